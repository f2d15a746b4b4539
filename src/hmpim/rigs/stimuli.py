"""Stimuli by axis, the commands of all axes together on one clock, and what software is fed."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from hmpim.arguments import shown
from hmpim.errors import ArgumentError
from hmpim.record import Intersample
from hmpim.rigs.block import Block, ChannelSpec, Layout, Pace, Quantity
from hmpim.stimulus import Stimulus
from hmpim.stimulus.command import rounded
from hmpim.units import rate_unit

__all__ = [
    "Commands",
    "Feed",
    "commands_of",
    "feed_of",
    "shared_band",
    "stimuli_by_axis",
]

FloatArray = NDArray[np.float64]


def stimuli_by_axis(
    stimuli: Stimulus | Mapping[str, Stimulus], axes: Sequence[str] = (), *, name: str = "the rig"
) -> dict[str, Stimulus]:
    """Return the stimulus of each axis that moves, in the order of `axes`.

    Parameters
    ----------
    stimuli : Stimulus or mapping of axis to Stimulus
        A single one goes to the axis that it names, or to the only one there is.
    axes : sequence of str
        Axes there are; empty for a rig that takes any one stimulus.
    name : str
        Of the rig, for messages.

    Raises
    ------
    ArgumentError
        If there is none, an axis is not known, or the rates differ.

    Examples
    --------
    >>> from hmpim.stimulus import Ramp
    >>> ramp = Stimulus(waveform=Ramp(duration=1.0), fs=10.0, axis="yaw")
    >>> list(stimuli_by_axis(ramp, ("roll", "yaw")))
    ['yaw']
    >>> stimuli_by_axis(ramp, ("roll",))
    Traceback (most recent call last):
    hmpim.errors.ArgumentError: axis 'yaw' is not known; use one of ('roll',)
    """
    if isinstance(stimuli, Stimulus):
        only = axes[0] if len(axes) == 1 and not stimuli.axis else stimuli.axis
        stimuli = {only: stimuli}
    for axis, stimulus in stimuli.items():
        if not isinstance(stimulus, Stimulus):
            raise ArgumentError(
                f"{shown(stimulus)} for axis {axis!r} is not a Stimulus; make one with "
                "design(...) or "
                "Stimulus(waveform=...)"
            )
    if not stimuli:
        raise ArgumentError("no stimulus is given; give at least one axis something to do")
    for axis in stimuli:
        if axes and not axis:
            raise ArgumentError(
                f"the stimulus names no axis, and {name} has {', '.join(axes)}; name one "
                "(Stimulus.axis, or --axis)"
            )
        if axes and axis not in axes:
            raise ArgumentError(f"axis {axis!r} is not known; use one of {tuple(axes)}")
    if not axes and len(stimuli) > 1:
        raise ArgumentError(
            f"{name} takes one stimulus, and {len(stimuli)} are given, for {list(stimuli)}; "
            "run them one after the other"
        )
    order = axes or tuple(stimuli)
    named = {axis: stimuli[axis] for axis in order if axis in stimuli}
    rates = {axis: stimulus.fs for axis, stimulus in named.items()}
    if len(set(rates.values())) > 1:
        raise ArgumentError(f"stimuli have different rates, {rates} Hz; design all at one rate")
    return named


def shared_band(stimuli: Mapping[str, Stimulus]) -> tuple[float, float] | None:
    """Band in Hz from the lowest to the highest that is excited; None where none is known.

    Examples
    --------
    >>> from hmpim.stimulus import Chirp
    >>> slow = Stimulus(waveform=Chirp(band=(0.1, 5.0), duration=2.0), fs=100.0)
    >>> fast = Stimulus(waveform=Chirp(band=(1.0, 20.0), duration=2.0), fs=100.0)
    >>> shared_band({"yaw": slow, "roll": fast})
    (0.1, 20.0)
    """
    bands = [s.band for s in stimuli.values() if s.band is not None]
    return (min(b[0] for b in bands), max(b[1] for b in bands)) if bands else None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Commands:
    """All commands of a run.

    Parameters
    ----------
    axes, units : tuple of str
        Axes that move, and the units of their positions.
    fs : float
        Commands a second.
    time : ndarray, shape (n,)
        When each is due, s.
    position, velocity, acceleration : ndarray, shape (n, m)
        Of each axis, in its unit.
    """

    axes: tuple[str, ...]
    units: tuple[str, ...]
    fs: float
    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray

    def __len__(self) -> int:
        return self.time.size

    def blocks(self, size: int, *, pace: Pace | None = None) -> Iterator[Block]:
        """Cut into blocks of `size` commands; the last may be shorter."""
        for first in range(0, len(self), size):
            yield self.block(first, size, pace=pace)

    def block(self, first: int, size: int, *, pace: Pace | None = None) -> Block:
        """Return `size` commands from number `first` on, or as many as there are."""
        part = slice(first, min(first + size, len(self)))
        return Block(
            axes=self.axes,
            start=first,
            time=self.time[part],
            position=self.position[part],
            velocity=self.velocity[part],
            acceleration=self.acceleration[part],
            units=self.units,
            last=first + size >= len(self),
            pace=pace,
        )

    def cut(self, count: int) -> "Commands":
        """Return the first `count` commands."""
        return replace(
            self,
            time=self.time[:count],
            position=self.position[:count],
            velocity=self.velocity[:count],
            acceleration=self.acceleration[:count],
        )


def commands_of(named: Mapping[str, Stimulus]) -> Commands:
    """Sample all stimuli on one clock; a shorter one waits at rest for the longest.

    Parameters
    ----------
    named : mapping of axis to Stimulus
        All at one rate, see `stimuli_by_axis`.

    Examples
    --------
    >>> from hmpim.stimulus import Ramp
    >>> slow = Stimulus(waveform=Ramp(rate=2.0, duration=2.0), fs=2.0)
    >>> fast = Stimulus(waveform=Ramp(rate=4.0, duration=1.0), fs=2.0)
    >>> commands_of({"yaw": slow, "roll": fast}).position.tolist()
    [[0.0, 0.0], [1.0, 2.0], [2.0, 4.0], [3.0, 4.0]]
    """
    longest = max(named.values(), key=lambda stimulus: stimulus.samples)
    count = longest.samples
    columns: dict[str, list[FloatArray]] = {"position": [], "velocity": [], "acceleration": []}
    for stimulus in named.values():
        source = stimulus if stimulus.samples == count else stimulus.motion(longest.time)
        columns["position"].append(rounded(source.position, stimulus.resolution))
        columns["velocity"].append(source.velocity)
        columns["acceleration"].append(source.acceleration)
    return Commands(
        axes=tuple(named),
        units=tuple(stimulus.unit for stimulus in named.values()),
        fs=longest.fs,
        time=longest.time,
        position=np.column_stack(columns["position"]),
        velocity=np.column_stack(columns["velocity"]),
        acceleration=np.column_stack(columns["acceleration"]),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Feed:
    """One quantity of one stimulus, as software under test is fed it.

    Parameters
    ----------
    values : ndarray, shape (n,)
        The samples.
    fs : float
        Their rate in Hz.
    channel : ChannelSpec
        The record's input.
    """

    values: FloatArray
    fs: float
    channel: ChannelSpec

    @property
    def unit(self) -> str:
        """Of the samples."""
        return self.channel.unit

    def layout(
        self, *, output: str, unit: str, intersample: Intersample | None, source: str
    ) -> Layout:
        """What will be recorded: this, and what the software makes of it."""
        made = ChannelSpec(name=output, role="output", unit=unit)
        return Layout(channels=(self.channel, made), intersample=intersample, source=source)


def feed_of(
    stimulus: Stimulus | Mapping[str, Stimulus], *, measures: Quantity, rig: str, name: str
) -> Feed:
    """Return what software is fed: the commanded quantity of the only stimulus.

    Parameters
    ----------
    stimulus : Stimulus or mapping
        As `stimuli_by_axis` takes it.
    measures : {'position', 'velocity', 'acceleration'}
        Which quantity.
    rig, name : str
        Of the rig, for messages, and of the record's input.
    """
    named = stimuli_by_axis(stimulus, name=repr(rig))
    ((axis, only),) = named.items()
    unit = rate_unit(only.unit, get_args(Quantity).index(measures))
    return Feed(
        values=getattr(commands_of(named), measures)[:, 0],
        fs=only.fs,
        channel=ChannelSpec(
            name=name, role="input", unit=unit, axis=axis, quantity=measures, commanded=True
        ),
    )
