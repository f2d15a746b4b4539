"""The sweeps in a log: where the input moves, between rests, and what it does there."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.record.channel import Channel
from hmpim.record.clock import fit_clock
from hmpim.record.mend import check_span
from hmpim.record.runs import runs_of

__all__ = ["Motion", "cut_alike", "find_motions"]

_BLOCKS = 2000
"""Blocks into which a channel is cut: a rest shows to 1/2000 of its length."""

_SHORTEST_REST = 10
"""Blocks in a rest, 1/200 of the log: shorter ones are pauses within a motion."""

_STEADY = 0.9
"""Spearman's correlation of frequency with time from which a motion is a sweep.

By chance six cycles in no order reach it once in 70 times, ten once in 1 500.
"""


_FIRST = 8
"""Crossings from which the slow end of a sweep is told: its rate may change after them."""


_EVEN = 0.03
"""Deviation from an even growth, as a share of the whole: a logarithmic sweep has
0.037 over a factor of 3, and 0.07 over a decade and more."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """A part of a log in which the input moves, with half of the rest on either side.

    Parameters
    ----------
    start, stop : float
        Span in s, to be cut out with `Record.between`.
    begin, end : float
        When the input starts to move, and when it rests again, in s.
    kind : {'sweep', 'other'}
        A sweep has a frequency that rises or falls throughout.
    low, high : float or None
        Lowest and highest frequency of a sweep in Hz.
    rising : bool or None
        Whether its frequency rises.
    """

    start: float
    stop: float
    begin: float
    end: float
    kind: Literal["sweep", "other"]
    low: float | None
    high: float | None
    rising: bool | None

    def __str__(self) -> str:
        """Say in a few words what it is and when."""
        when = f"{self.begin:.6g} s to {self.end:.6g} s"
        if self.kind == "other":
            return f"other motion, {when}"
        first, last = (self.low, self.high) if self.rising else (self.high, self.low)
        return f"sweep from {first:.3g} Hz to {last:.3g} Hz, {when}"


def find_motions(channel: Channel) -> tuple[Motion, ...]:
    """Find where a channel moves, between rests at the level at which it mostly is.

    A turning point of a slow sweep is no rest, as it is not at that level; crossing the level
    is none, as it is quick.

    Parameters
    ----------
    channel : Channel
        An input.

    Returns
    -------
    tuple of Motion
        In order of time; one over all of the log if it never rests, none if it never moves.

    Examples
    --------
    >>> t = np.arange(0, 12, 0.001)
    >>> sweep = np.sin(2 * np.pi * (0.5 * t + 1.0 * t**2)) * (t < 4.0)
    >>> u = Channel(name="u", time=t, values=sweep + np.roll(sweep, 6000))
    >>> [str(m) for m in find_motions(u)]
    ['sweep from 0.5 Hz to 8.26 Hz, 0 s to 3.999 s', \
'sweep from 0.5 Hz to 8.26 Hz, 6 s to 9.999 s']
    """
    check_span(channel)
    clock = fit_clock(channel.time)
    time = clock.start + np.arange(clock.length) / clock.fs
    values = np.interp(time, channel.time, channel.values)
    with np.errstate(over="ignore"):
        span = float(np.ptp(values))
    if not 0.0 < span < 1e100:  # beyond, samples are damaged
        return ()
    width = max(8, values.size // _BLOCKS)
    resting, level, noise = _rests(values, width, span)
    edges = _moving(resting)
    found = []
    for k, (first, stop) in enumerate(edges):
        before = edges[k - 1][1] if k else 0
        after = edges[k + 1][0] if k + 1 < len(edges) else resting.size
        a, b = first * width, min(stop * width, values.size)
        part = values[a:b]
        length = stop - first
        # A single block beyond the noise is chance; a step is as short, and much larger.
        if float(np.ptp(part)) < max(0.02 * span, 5 * noise):
            continue
        # Half of the rest, and no more than half of the motion: an hour of waiting tells nothing.
        lead = min((first - before) // 2 if k else first, length // 2 + 1)
        tail = min(
            (after - stop + 1) // 2 if k + 1 < len(edges) else resting.size - stop, length // 2 + 1
        )
        u, v = max(0, a - lead * width), min(values.size, b + tail * width)
        rising, low, high = _swept(part, level, noise, clock.fs)
        found.append(
            Motion(
                start=float(time[u]),
                stop=float(time[v - 1] + 0.5 / clock.fs),
                begin=float(time[a]),
                end=float(time[b - 1]),
                kind="other" if rising is None else "sweep",
                low=low,
                high=high,
                rising=rising,
            )
        )
    return tuple(found)


def _rests(
    values: NDArray[np.float64], width: int, span: float
) -> tuple[NDArray[np.bool_], float, float]:
    """Blocks in which the channel rests, the level at which it does, and its noise there."""
    count = -(-values.size // width)
    padded = np.concatenate((values, np.full(count * width - values.size, values[-1])))
    blocks = padded.reshape(count, width)
    ranges, means = np.ptp(blocks, axis=1), blocks.mean(axis=1)
    counts, bounds = np.histogram(values, bins=100)
    most = int(np.argmax(counts))
    inside = (values >= bounds[most]) & (values <= bounds[most + 1])
    level = float(np.median(values[inside]))
    near = np.abs(means - level) <= 0.02 * span
    if not near.any():
        return np.zeros(count, dtype=np.bool_), level, 0.0
    noise = float(np.quantile(ranges[near], 0.25))
    tolerance = max(3.0 * noise, 1e-9 * span)
    resting = near & (ranges <= tolerance) & (np.abs(means - level) <= max(tolerance, 1e-3 * span))
    # A turning point may lie at the level too, if the channel never rests; it is short.
    for first, stop in zip(*runs_of(resting), strict=True):
        resting[first:stop] &= stop - first >= _SHORTEST_REST
    if noise > 0.1 * span or not resting.any():  # what never rests shows no level and no noise
        return np.zeros(count, dtype=np.bool_), float(np.median(values)), 0.0
    return resting, level, noise


def _moving(resting: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Runs of blocks that do not rest, those merged between which there is only a pause."""
    moving = [ends.tolist() for ends in runs_of(~resting)]
    merged: list[tuple[int, int]] = []
    for first, stop in zip(*moving, strict=True):
        if merged and first - merged[-1][1] < _SHORTEST_REST:
            merged[-1] = (merged[-1][0], stop)
        else:
            merged.append((first, stop))
    return merged


def _swept(
    part: NDArray[np.float64], level: float, noise: float, fs: float
) -> tuple[bool | None, float | None, float | None]:
    """Whether the frequency of a motion rises (None: it is no sweep), its lowest and highest."""
    away = part - level
    margin = max(noise, 1e-6 * float(np.abs(away).max()))
    sign = np.where(away > margin, 1, np.where(away < -margin, -1, 0))
    sure = np.flatnonzero(sign)
    cross = sure[1:][sign[sure[1:]] != sign[sure[:-1]]]
    if cross.size < 8:
        return None, None, None
    # The crossing itself, between the two samples; a period is that from one to the next but one.
    y0, y1 = away[cross - 1], away[cross]
    crossing = cross - 1 + np.clip(y0 / np.where(y0 == y1, 1.0, y0 - y1), 0.0, 1.0)
    frequency = fs / (crossing[2:] - crossing[:-2])
    order = float(scipy.stats.spearmanr(np.arange(frequency.size), frequency).statistic)
    low, high = float(frequency.min()), float(frequency.max())
    if not abs(order) >= _STEADY or high < 1.5 * low:
        return None, None, None
    if _is_linear(frequency if order > 0 else frequency[::-1]):
        slow_first = crossing if order > 0 else crossing[-1] - crossing[::-1]
        low = min(low, fs * _slowest(slow_first, low / fs))  # in samples: stamps may be any size
    return order > 0, low, high


def _is_linear(frequency: NDArray[np.float64]) -> bool:
    """Whether the square of the frequency grows evenly from half cycle to half cycle."""
    kept = frequency[: max(8, round(0.9 * frequency.size))]  # the fast end may fade away
    square = (kept / kept.max()) ** 2
    count = np.arange(square.size)
    off = square - np.polyval(np.polyfit(count, square, 1), count)
    return float(np.std(off)) < _EVEN * float(np.ptp(square))


def _slowest(crossing: NDArray[np.float64], otherwise: float) -> float:
    """Frequency at the slow end of a linear sweep, whose first period ends long after it begins.

    Half cycles are counted from the first crossing by a parabola. The sweep begins half a cycle
    before that crossing or, where a lead swings to the other side, there.
    """
    since = crossing[:_FIRST] - crossing[0]
    bend, at, level = (float(c) for c in np.polyfit(since, np.arange(since.size), 2))
    square = at**2 - 4.0 * bend * (level + 1.0)  # of the slope where the count is -1
    # Noise makes the square of next to nothing negative; a lead makes it so by more than it is.
    found = float(np.sqrt(abs(square))) if square > -0.5 * at**2 else at
    return 0.5 * found if found > 0.0 else otherwise


_SAME = 0.98
"""Correlation from which two motions are one stimulus played twice, whatever its size."""


def cut_alike(channel: Channel, motions: Sequence[Motion]) -> tuple[tuple[float, float], ...]:
    """Spans that cut motions out so that repeats of one stimulus lie over each other.

    A motion that repeats the first one is cut where that begins to a sample, and as long; another
    where it is found.

    Parameters
    ----------
    channel : Channel
        The input that makes them.
    motions : sequence of Motion
        As `find_motions` gives them.

    Returns
    -------
    tuple of (float, float)
        Start and stop in s, for `Record.between`.

    Examples
    --------
    >>> t = np.arange(0, 12, 0.001)
    >>> sweep = np.sin(2 * np.pi * (0.5 * t + 1.0 * t**2)) * (t < 4.0)
    >>> u = Channel(name="u", time=t, values=sweep + np.roll(sweep, 6003))
    >>> (a, b), (c, d) = cut_alike(u, find_motions(u))
    >>> round(c - a, 6), round((d - c) - (b - a), 6)
    (6.003, 0.0)
    """
    if not motions:
        return ()
    clock = fit_clock(channel.time)
    time = clock.start + np.arange(clock.length) / clock.fs
    values = np.interp(time, channel.time, channel.values)

    def places(motion: Motion) -> tuple[int, int, int, int]:
        ends = (motion.start, motion.begin, motion.end, motion.stop)
        a, b, c, d = (round((t - clock.start) * clock.fs) for t in ends)
        return a, b, c, d

    _, begin, end, _ = places(motions[0])
    shifts: list[int | None] = [0]
    for motion in motions[1:]:
        other = places(motion)
        shift, alike = _shift(values[begin:end], values, other[1], end - begin)
        same = alike > _SAME
        shifts.append(shift - begin if same else None)
    # As much rest as all the repeats have.
    alike_ones = [(places(m), s) for m, s in zip(motions, shifts, strict=True) if s is not None]
    lead = max(0, min(begin + s - p[0] for p, s in alike_ones))
    tail = max(0, min(p[3] - end - s for p, s in alike_ones))
    half = 0.5 / clock.fs
    spans = []
    for motion, shift_of in zip(motions, shifts, strict=True):
        if shift_of is None:
            spans.append((motion.start, motion.stop))
            continue
        first, last = begin - lead + shift_of, min(end + tail + shift_of, time.size)
        spans.append((float(time[max(first, 0)] - half), float(time[last - 1] + half)))
    return tuple(spans)


def _shift(
    pattern: NDArray[np.float64], values: NDArray[np.float64], near: int, reach: int
) -> tuple[int, float]:
    """Place near `near` where a pattern is found, and how well it fits there."""
    low = max(0, near - reach)
    part = values[low : near + pattern.size + reach]
    if part.size < pattern.size:
        return near, 0.0
    centred = pattern - pattern.mean()
    cross = scipy.signal.fftconvolve(part, centred[::-1], mode="valid")
    total = np.concatenate(([0.0], np.cumsum(part)))
    square = np.concatenate(([0.0], np.cumsum(part**2)))
    n = pattern.size
    spread = (square[n:] - square[:-n]) - (total[n:] - total[:-n]) ** 2 / n
    size = np.sqrt(np.maximum(spread, 1e-12 * max(float(square[-1]), 1e-300)))
    fit = cross / (size * float(np.linalg.norm(centred)))
    best = int(np.argmax(fit))
    return low + best, float(fit[best])
