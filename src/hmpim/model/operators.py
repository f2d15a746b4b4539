"""What is not linear, as operators on a signal: each output follows from the past of its input.

A clock is not part of them: speeds and gaps are those of the signal's own samples. On the finer
clock of `hmpim.model.fine` they are near enough to what happens between the samples of a record.
"""

from functools import reduce

import numpy as np
from numpy.typing import NDArray

from hmpim.model.poles import rational_response
from hmpim.model.sampled import prepare_input

__all__ = [
    "gap_crossed",
    "play",
    "power_of",
    "pushed",
    "rate_limited",
    "reversals",
]

_Real = NDArray[np.float64]

_SMOOTH = 5
"""Steps that are too fast, per end of a stretch of them, above which ramps are computed whole."""

_AT_ONCE = 256
"""Samples that are compared first; the number doubles until one fits."""


def reversals(x: _Real) -> NDArray[np.intp]:
    """Reversals of a signal, and its end: only there must the output of backlash be computed."""
    way = np.sign(np.diff(x))
    return np.asarray(np.append(np.flatnonzero(way[1:] * way[:-1] <= 0.0) + 1, x.size - 1))


def play(x: _Real, half_gap: float, turns: NDArray[np.intp] | None = None) -> _Real:
    """Output of backlash: it follows `x`, (n,), half a gap behind, and waits at each reversal.

    Examples
    --------
    >>> play(np.array([0.0, 1.0, 2.0, 1.5, 0.0]), 0.5).tolist()
    [0.0, 0.5, 1.5, 1.5, 0.5]
    """
    turns = reversals(x) if turns is None else turns
    before, now = [], float(x[0])
    for turn in x[turns].tolist():
        before.append(now)
        now = min(max(now, turn - half_gap), turn + half_gap)
    held = np.repeat(before, np.diff(turns, prepend=-1))
    return np.asarray(np.clip(held, x - half_gap, x + half_gap))


def gap_crossed(x: _Real, half_gap: float) -> NDArray[np.bool_]:
    """Samples from which on `x`, (n,), has been so far to either side that its play is known.

    Examples
    --------
    >>> gap_crossed(np.array([0.0, 0.5, -0.5, 0.0]), 0.5).tolist()
    [False, False, True, True]
    """
    return np.asarray(np.maximum.accumulate(x) - np.minimum.accumulate(x) >= 2.0 * half_gap)


def rate_limited(x: _Real, step: float) -> _Real:
    """Follow `x`, moving by no more than `step` from sample to sample.

    Examples
    --------
    >>> rate_limited(np.array([0.0, 3.0, 3.0, 3.0]), 1.0).tolist()
    [0.0, 1.0, 2.0, 3.0]
    """
    moves = np.diff(x)
    fast = np.sign(moves) * (np.abs(moves) > step)
    starts = np.flatnonzero(fast)
    if starts.size > _SMOOTH * np.count_nonzero(fast[1:] != fast[:-1]):
        return _limited_smoothly(x, step, starts)
    target, reached = x.tolist(), 0
    out, late = x.copy(), target.copy()
    for lost in starts.tolist():
        if lost < reached:
            continue  # already behind
        now = target[lost]
        for reached in range(lost + 1, len(target)):  # until it has caught up
            ahead = target[reached] - now
            if ahead > step:
                now += step
            elif ahead < -step:
                now -= step
            else:
                break
            late[reached] = now
        else:
            break
    for begin in starts[:1].tolist():
        out[begin : reached + 1] = late[begin : reached + 1]
    return out


def _limited_smoothly(x: _Real, step: float, starts: NDArray[np.intp]) -> _Real:
    """The same, ramp by ramp, for a signal with few reversals; it is too fast after `starts`."""
    ramp, out, end = step * np.arange(x.size), x.copy(), 0
    ahead = {way: way * x - ramp for way in (1.0, -1.0)}  # constant along a ramp in direction way
    while (k := starts.searchsorted(end)) < starts.size:
        lost = starts.item(k)
        way = 1.0 if x[lost + 1] > x[lost] else -1.0
        level, begin = ahead[way].item(lost), lost + 1
        while begin < x.size:
            end = _first_up_to(ahead[way], level, begin)
            out[begin:end] = way * (level + ramp[begin:end])
            way, level, begin = -way, -level - 2.0 * ramp.item(end - 1), end
            if end < x.size and ahead[way].item(end) <= level:
                break  # the ramp has met the signal; otherwise the signal has turned past it
    return out


def _first_up_to(values: _Real, level: float, begin: int) -> int:
    """First index from `begin` on of a value up to a level; the number of values if none."""
    count = _AT_ONCE
    while begin < values.size:
        found = values[begin : begin + count] <= level
        first = found.argmax().item()
        if found.item(first):
            return begin + first
        begin, count = begin + found.size, 2 * count
    return values.size


def pushed(forces: _Real, denominator: _Real) -> _Real:
    """Deflections of dynamics 1/A, without delay, by forces, (..., n); at rest before them.

    The denominator is by rising powers of s per sample of the forces.
    """
    first = forces[..., :1]
    source = prepare_input(forces - first, "foh")
    answer = rational_response(source, delay=0.0, numerator=np.ones(1), denominator=denominator)
    return np.asarray(answer + first)


def power_of(x: _Real, power: int, largest: float) -> _Real:
    """A power of a signal, equal to the signal where that is `largest`.

    Examples
    --------
    >>> power_of(np.array([1.0, 2.0, -4.0]), 2, 2.0).tolist()
    [0.5, 2.0, 8.0]
    """
    return np.asarray(largest * reduce(np.multiply, [x / largest] * power))
