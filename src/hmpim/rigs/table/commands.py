"""Stimuli by axis, and the commands of all five axes together."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import ArgumentError
from hmpim.rigs.protocol import Stimuli
from hmpim.rigs.stimuli import commands_of, stimuli_by_axis
from hmpim.rigs.table.axes import AXES, AxisName
from hmpim.stimulus import Stimulus
from hmpim.units import conversion_factor

__all__ = ["by_axis", "command_rate", "commands", "place", "spread"]

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


def by_axis(stimuli: Stimuli) -> dict[AxisName, Stimulus]:
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
    named = stimuli_by_axis(stimuli, AXES, name="the table")
    return {axis: named[axis] for axis in AXES if axis in named}


def command_rate(named: Mapping[AxisName, Stimulus]) -> float:
    """Rate in Hz that all stimuli share.

    Examples
    --------
    >>> from hmpim.stimulus import Ramp
    >>> command_rate({"yaw": Stimulus(waveform=Ramp(duration=1.0), fs=500.0)})
    500.0
    """
    return next(iter(named.values())).fs


def spread(
    values: FloatArray, axes: tuple[str, ...], units: tuple[str, ...], *, around: FloatArray
) -> FloatArray:
    """Commands of the axes that move as those of all five, rad; the others stay where they are.

    Parameters
    ----------
    values : ndarray, shape (n, m)
        Of the axes that move, in their units.
    axes, units : tuple of str
        Those axes, and the units of their positions.
    around : ndarray, shape (5,)
        What is added to every row, rad.

    Returns
    -------
    ndarray, shape (n, 5)

    Examples
    --------
    >>> spread(np.ones((1, 1)), ("yaw",), ("rad",), around=np.zeros(5)).tolist()
    [[0.0, 1.0, 0.0, 0.0, 0.0]]
    """
    all_five = np.tile(around, (values.shape[0], 1))
    for column, (axis, unit) in enumerate(zip(axes, units, strict=True)):
        all_five[:, place(axis)] += conversion_factor(unit, to="rad") * values[:, column]
    return all_five


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
    command : tuple of ndarray, each shape (n, 5)
        Position, velocity, acceleration, rad.

    Examples
    --------
    >>> from hmpim.stimulus import Ramp
    >>> ramp = Stimulus(waveform=Ramp(rate=2.0, duration=1.0), fs=2.0, unit="rad")
    >>> time, command = commands({"yaw": ramp}, start=np.ones(5))
    >>> time.tolist(), command[0][:, 1].tolist()
    ([0.0, 0.5], [1.0, 2.0])
    """
    sent = commands_of({str(axis): stimulus for axis, stimulus in named.items()})
    still = np.zeros(5)
    return sent.time, (
        spread(sent.position, sent.axes, sent.units, around=start),
        spread(sent.velocity, sent.axes, sent.units, around=still),
        spread(sent.acceleration, sent.axes, sent.units, around=still),
    )
