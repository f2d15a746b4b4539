"""Angles and counters that start again after a whole turn, continued as one motion."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hmpim.record.channel import Channel
from hmpim.record.finding import Finding
from hmpim.record.record import Record

__all__ = ["Continued", "continue_turns", "turn_of"]

_TURNS = {"deg": 360.0, "rad": 2.0 * np.pi}
"""One turn in the units of angles."""

_UNSTATED = ("", "count")
"""Units of a channel that may be an angle or a counter."""

_COUNTERS = tuple(2.0**bits for bits in range(8, 33))
"""Steps of counters of 8 to 32 bits."""

_SLOW = 0.25
"""Largest part of a turn that an angle moves between samples if its direction is known: with noise
or a gap of one sample it is then still less than half a turn."""

_FASTER = 2.0
"""Ratio of the motion in a jump to the fastest elsewhere, up to which the jump is a whole turn: an
angle that oscillates about its jump is fastest there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Continued:
    """A record without jumps by whole turns, and a finding for each channel that had some."""

    record: Record
    findings: tuple[Finding, ...]


def continue_turns(record: Record) -> Continued:
    """Add whole turns to the inputs and outputs that start again after one.

    The first sample of such a channel is then within half a turn of zero. A record without one
    comes back as it is.

    Examples
    --------
    >>> angle = np.mod(10.0 * np.sin(np.arange(100) / 9), 360.0)
    >>> record = Record.from_arrays({"u": np.arange(100.0)}, {"y": angle}, fs=100.0)
    >>> continued = continue_turns(record)
    >>> [f.code for f in continued.findings]
    ['wrapped']
    >>> float(continued.record.outputs[0].values.min().round(1))
    -10.0
    """
    findings: list[Finding] = []

    def continued(channel: Channel, *, command: bool) -> Channel:
        turn = turn_of(channel.values, channel.unit, command=command)
        if turn is None:
            return channel
        findings.append(_finding(channel, turn))
        values = channel.values + turn * np.cumsum(np.append(0.0, -_jumps(channel.values, turn)))
        return replace(channel, values=values - turn * np.rint(values[0] / turn))

    inputs = tuple(continued(c, command=True) for c in record.inputs)
    outputs = tuple(continued(c, command=False) for c in record.outputs)
    if findings:
        record = replace(record, inputs=inputs, outputs=outputs)
    return Continued(record=record, findings=tuple(findings))


def turn_of(values: NDArray[np.float64], unit: str = "", *, command: bool = False) -> float | None:
    """Return the turn after which a channel starts again, in its unit; None if it does not.

    Every jump must be a whole turn, but for a motion hardly faster than elsewhere, where it is less
    than a quarter of a turn between samples; and the values must not span more than a turn.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Samples.
    unit : str
        Their unit. Degrees and radians have one turn; a channel without a unit may be in either,
        or a counter of 8 to 32 bits if its values are whole numbers.
    command : bool
        Whether the channel may be a sawtooth, whose jumps all have one direction. Without a unit
        of angles, it must then jump in both.

    Examples
    --------
    >>> counter = np.mod(np.rint(40_000 * np.sin(np.arange(500) / 40)), 65_536.0)
    >>> turn_of(counter), turn_of(counter, "V")
    (65536.0, None)
    """
    span, steps = float(np.ptp(values)), np.diff(values)
    if not 2.0 * float(np.abs(steps).max(initial=0.0)) > span:
        return None
    for turn in _candidates(values, unit):
        jumps = _jumps(values, turn)
        beside = np.abs(steps[jumps == 0.0])
        usual = float(beside.max(initial=0.0))
        if span > turn or not jumps.any() or not 0.0 < usual < _SLOW * turn:
            continue
        if np.abs(steps - turn * jumps).max() > _FASTER * usual:
            continue
        if not command or unit in _TURNS or ((jumps > 0.0).any() and (jumps < 0.0).any()):
            return turn
    return None


def _candidates(values: NDArray[np.float64], unit: str) -> tuple[float, ...]:
    if unit in _TURNS:
        return (_TURNS[unit],)
    if unit not in _UNSTATED:
        return ()
    whole = np.array_equal(values, np.rint(values))
    return (*_TURNS.values(), *(_COUNTERS if whole else ()))


def _jumps(values: NDArray[np.float64], turn: float) -> NDArray[np.float64]:
    """Whole turns in each step between samples, shape (n - 1,)."""
    return np.asarray(np.rint(np.diff(values) / turn))


def _finding(channel: Channel, turn: float) -> Finding:
    count = int(np.count_nonzero(_jumps(channel.values, turn)))
    unit = f" {channel.unit}" if channel.unit else ""
    places = "1 sample" if count == 1 else f"{count} samples"
    real = "" if channel.unit in _TURNS else "; if the jumps are real, state the channel's unit"
    return Finding(
        code="wrapped",
        message=(
            f"{channel.name!r} jumps by nearly {turn:.6g}{unit} at {places}, since it starts again "
            f"after a whole turn; whole turns were added, so that it continues{real}"
        ),
        severity="info",
        parameters=(),
    )
