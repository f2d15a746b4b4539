"""Unwrap angles and counters that start again after a whole turn."""

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
"""Counts per turn of counters of 8 to 32 bits."""

_SLOW = 0.25
"""Largest motion between samples, in turns, at which its direction is certain: it remains below
half a turn with noise, or across a gap of one sample."""

_FASTER = 2.0
"""Ratio of the motion across a jump, less the whole turn, to the fastest motion elsewhere, up to
which the jump counts as a wrap: an angle that oscillates about the wrap is fastest there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Continued:
    """A record without jumps by whole turns, and a finding for each channel that had any."""

    record: Record
    findings: tuple[Finding, ...]


def continue_turns(record: Record) -> Continued:
    """Add whole turns to inputs and outputs that start again after a turn, so that they continue.

    The first sample of such a channel is then within half a turn of zero. A record without such
    channels is returned unchanged.

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

    Every jump must be a whole turn, plus a motion of at most twice the fastest one elsewhere. That
    one must be less than a quarter of a turn between samples. The values must not span more than a
    turn.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Samples.
    unit : str
        Their unit. For degrees and radians the turn is known. A channel without a unit, or in
        counts, may be in either, or be a counter of 8 to 32 bits if its values are whole numbers.
    command : bool
        Whether the channel is a command, which may be a sawtooth. Unless its unit is that of an
        angle, it must then jump in both directions.

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
        elsewhere = np.abs(steps[jumps == 0.0])
        usual = float(elsewhere.max(initial=0.0))
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
            f"{channel.name!r} jumps by about {turn:.6g}{unit} at {places}, where it starts again "
            f"after a whole turn; whole turns were added to remove the jumps{real}"
        ),
        severity="info",
        parameters=(),
    )
