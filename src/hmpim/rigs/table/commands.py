"""Stimuli by axis, and the commands of all axes together."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import ArgumentError
from hmpim.rigs.table.axes import AXES, AxisName
from hmpim.stimulus import Stimulus
from hmpim.units import conversion_factor

__all__ = ["by_axis", "command_rate", "commands", "place"]

FloatArray = NDArray[np.float64]


def place(axis: str) -> int:
    """Place of an axis in `AXES`.

    Raises
    ------
    ArgumentError
        If there is no such axis.

    Examples
    --------
    >>> place("yaw")
    1
    """
    if axis not in AXES:
        raise ArgumentError(f"axis {axis!r} is not known; use one of {AXES}")
    return AXES.index(axis)


def by_axis(stimuli: Stimulus | Mapping[AxisName, Stimulus]) -> dict[AxisName, Stimulus]:
    """Stimulus by axis, in the order of `AXES`; a single one goes to the axis that it names.

    Raises
    ------
    ArgumentError
        If there is none, an axis is not known, or the rates differ.

    Examples
    --------
    >>> from hmpim.stimulus import Ramp
    >>> by_axis(Stimulus(waveform=Ramp(duration=1.0), fs=10.0, axis="yaw"))["yaw"].fs
    10.0
    """
    if isinstance(stimuli, Stimulus):
        stimuli = {AXES[place(stimuli.axis)]: stimuli}
    if not stimuli:
        raise ArgumentError("no stimulus is given; give at least one axis something to do")
    for axis in stimuli:
        place(axis)
    named = {axis: stimuli[axis] for axis in AXES if axis in stimuli}
    rates = {axis: stimulus.fs for axis, stimulus in named.items()}
    if len(set(rates.values())) > 1:
        raise ArgumentError(f"stimuli have different rates, {rates} Hz; design all at one rate")
    return named


def command_rate(named: Mapping[AxisName, Stimulus]) -> float:
    """Rate in Hz that all stimuli share.

    Examples
    --------
    >>> from hmpim.stimulus import Ramp
    >>> command_rate({"yaw": Stimulus(waveform=Ramp(duration=1.0), fs=500.0)})
    500.0
    """
    return next(iter(named.values())).fs


def commands(
    named: Mapping[AxisName, Stimulus], *, start: FloatArray
) -> tuple[FloatArray, tuple[FloatArray, FloatArray, FloatArray]]:
    """Sample all stimuli on one clock; a shorter one waits at rest for the longest.

    Parameters
    ----------
    named : mapping of axis to Stimulus
        In units of angle, all at one rate.
    start : ndarray, shape (5,)
        Where the axes stand, rad.

    Returns
    -------
    time : ndarray, shape (n,)
        Of the commands, s.
    command : tuple of ndarray, each shape (n + 1, 5)
        Position, velocity, acceleration, rad; in front the place of rest before time 0.

    Examples
    --------
    >>> from hmpim.stimulus import Ramp
    >>> ramp = Stimulus(waveform=Ramp(rate=2.0, duration=1.0), fs=2.0, unit="rad")
    >>> time, command = commands({"yaw": ramp}, start=np.ones(5))
    >>> time.tolist(), command[0][:, 1].tolist()
    ([0.0, 0.5], [1.0, 1.0, 2.0])
    """
    count = max(stimulus.samples for stimulus in named.values())
    time = np.arange(-1, count) / command_rate(named)
    position = np.tile(start, (count + 1, 1))
    velocity, acceleration = np.zeros((count + 1, 5)), np.zeros((count + 1, 5))
    for axis, stimulus in named.items():
        i, factor = place(axis), conversion_factor(stimulus.unit, to="rad")
        motion = stimulus.motion(time)
        position[:, i] += factor * motion.position
        velocity[:, i] = factor * motion.velocity
        acceleration[:, i] = factor * motion.acceleration
    return time[1:], (position, velocity, acceleration)
