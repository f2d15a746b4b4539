"""One channel onto a grid: its own samples where they fit, interpolated or reduced where not."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.record.bridge import bridged
from hmpim.record.channel import Channel, Intersample
from hmpim.record.clock import Clock
from hmpim.record.resample import CROSSINGS, PASSED, band_limited, share_above
from hmpim.record.slower import restored

__all__ = ["FASTER", "is_reduced", "on_grid"]

_NOTHING = 1e-6
"""Share of power above what is passed that is let fold: 10⁻³ of the amplitude."""

FASTER = 1.02
"""Ratio from which one rate is higher than another; two clocks of one kind differ by less."""

_AT_ONCE = 0.25
"""Share of an interval within which stamps are of one instant."""


def on_grid(
    channel: Channel,
    clock: Clock,
    grid: NDArray[np.float64],
    *,
    fs: float,
    intersample: Intersample | None,
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return values of one channel at the instants of a grid, and which of them are known.

    Parameters
    ----------
    channel : Channel
        The channel.
    clock : Clock
        The clock laid through its stamps.
    grid : ndarray, shape (m,)
        Instants in s, `fs` apart.
    fs : float
        Rate of the grid in Hz.
    intersample : {'zoh', 'foh', 'bandlimited', 'feedforward'} or None
        What the channel does between its samples.

    Returns
    -------
    values : ndarray, shape (m,)
        Filled in inside gaps.
    known : bool ndarray, shape (m,)
        False inside gaps.
    """
    smooth = intersample not in ("zoh", "foh", "feedforward")
    if smooth and is_reduced(channel, clock, fs):
        return _reduced(channel, clock, grid, fs)
    place = (grid - clock.start) * clock.fs
    nearest = np.rint(place).astype(np.int64)
    on_clock = not clock.jittered and bool(
        np.all(np.abs(place - nearest) <= clock.rounding * clock.fs)
    )
    if on_clock:
        # Every instant is one of this channel's own: take its samples as they are.
        position = np.minimum(np.searchsorted(clock.index, nearest), clock.index.size - 1)
        valid = clock.index[position] == nearest
        values = channel.values[position]
    else:
        valid = ~_inside_gaps(channel.time, clock, grid)
        values = np.empty(grid.size)
        values[valid] = _interpolated(channel, clock, grid[valid], intersample, fs)
    if not valid.all():
        own = channel.time if not on_clock else clock.start + clock.index / clock.fs
        values[~valid] = _filled(own, channel.values, grid[~valid], intersample)
        whole, told = restored(values, valid)
        if smooth and not (valid | told).all():
            values = _bridged(grid, values, valid)
        values[told] = whole[told]
    return values, valid


def _bridged(
    grid: NDArray[np.float64], values: NDArray[np.float64], valid: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Short gaps from the samples around them."""

    def rule(known: NDArray[np.bool_]) -> NDArray[np.float64]:
        out = values.copy()
        lost = valid & ~known
        out[lost] = _filled(grid[known], values[known], grid[lost], None)
        return out

    return bridged(values, valid, rule)


def is_reduced(channel: Channel, clock: Clock, fs: float) -> bool:
    """Whether a channel must lose what lies above half a lower rate before it is taken there.

    Parameters
    ----------
    channel : Channel
        The channel.
    clock : Clock
        The clock laid through its stamps.
    fs : float
        The new rate in Hz.
    """
    if clock.fs < FASTER * fs:
        return False
    return share_above(channel.values, fs=clock.fs, limit=PASSED * fs) > _NOTHING


def _reduced(
    channel: Channel, clock: Clock, grid: NDArray[np.float64], fs: float
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Values at a lower rate, what lies above its half taken out."""
    ratio = fs / clock.fs
    # A gap shorter than the new interval hides no instant of the grid: it is bridged first.
    own = clock.start + np.arange(clock.length) / clock.fs
    wide = clock.gaps[np.diff(clock.index)[clock.gaps] - 1 > 1.0 / ratio]
    edges = np.concatenate(([0], wide + 1, [clock.index.size]))
    values = np.zeros(grid.size)
    known = np.zeros(grid.size, dtype=np.bool_)
    half = 0.5 / clock.fs
    for first, stop in pairwise(edges):
        low, high = int(clock.index[first]), int(clock.index[stop - 1])
        mine = (grid >= own[low] - half) & (grid <= own[high] + half)
        if not mine.any():
            continue
        part = slice(first, stop)
        if stop - first < 4:
            values[mine] = np.interp(grid[mine], channel.time[part], channel.values[part])
        else:
            stamps = channel.time[part] if clock.jittered else own[clock.index[part]]
            whole = _curve(stamps, channel.values[part], clock)(own[low : high + 1])
            place = np.clip((grid[mine] - own[low]) * clock.fs, 0.0, high - low)
            values[mine] = band_limited(whole, place, ratio=ratio)
        known |= mine
    if not known.all():
        values[~known] = _filled(channel.time, channel.values, grid[~known], None)
    return values, known


def _inside_gaps(
    time: NDArray[np.float64], clock: Clock, grid: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Instants more than half an interval from both edges of a gap, inside it."""
    long = np.zeros(time.size + 1, dtype=np.bool_)
    long[clock.gaps + 1] = True  # the interval that ends at each stamp; open at both ends
    after = np.searchsorted(time, grid)
    left = time[np.maximum(after - 1, 0)]
    right = time[np.minimum(after, time.size - 1)]
    half = 0.5 / clock.fs
    return np.asarray(long[after] & (grid > left + half) & (grid < right - half))


def _interpolated(
    channel: Channel,
    clock: Clock,
    at: NDArray[np.float64],
    intersample: Intersample | None,
    fs: float,
) -> NDArray[np.float64]:
    time, values = channel.time, channel.values
    if intersample in ("zoh", "feedforward"):
        return _held(time, values, at + clock.rounding, 1.0 / fs)
    if intersample == "foh":
        return np.interp(at, time, values)
    # The spline errs by 2e-4 at a tenth of the rate, the band-limited values by 4e-5 everywhere.
    lively = share_above(values, fs=clock.fs, limit=0.1 * clock.fs) > 1e-6
    out = np.empty(at.size)
    edges = np.concatenate(([0], clock.gaps + 1, [time.size]))
    # A segment answers for its own span and half a gap beyond, where instants lie within half
    # an interval of its end; the spline is carried on that far.
    middles = 0.5 * (time[edges[1:-1] - 1] + time[edges[1:-1]])
    bounds = np.concatenate(([0], np.searchsorted(at, middles), [at.size]))
    for k in np.flatnonzero(np.diff(bounds)):
        part, mine = slice(edges[k], edges[k + 1]), slice(bounds[k], bounds[k + 1])
        if edges[k + 1] - edges[k] == 1:
            out[mine] = values[part]
            continue
        out[mine] = _curve(time[part], values[part], clock)(at[mine])
        if lively and clock.jittered:
            out[mine] = _agreeing(out[mine], at[mine], channel, part, clock, fs)
        elif lively:
            _sharpen(out, mine, clock, part, values, at)
    return out


def _held(
    time: NDArray[np.float64],
    values: NDArray[np.float64],
    at: NDArray[np.float64],
    interval: float,
) -> NDArray[np.float64]:
    """Mean of a held channel over the interval that follows each instant.

    The value at the instant itself would be switched up to an interval late: a delay. The mean
    has the same area, so that what answers slowly answers at the same time.
    """
    area = np.concatenate([[0.0], np.cumsum(values[:-1] * np.diff(time))])

    def until(t: NDArray[np.float64]) -> NDArray[np.float64]:
        before = np.clip(np.searchsorted(time, t, side="right") - 1, 0, time.size - 1)
        return np.asarray(area[before] + values[before] * (t - time[before]))

    before = np.clip(np.searchsorted(time, at, side="right") - 1, 0, time.size - 1)
    after = np.searchsorted(time, at + interval, side="left") - 1
    mean = (until(at + interval) - until(at)) / interval
    # Where nothing is switched in between the value stays as it is, to the last digit.
    return np.asarray(np.where(after <= before, values[before], mean))


def _curve(
    time: NDArray[np.float64], values: NDArray[np.float64], clock: Clock
) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    """The curve through the samples; those stamped at nearly one instant count as their mean.

    A stalled machine catches up in a burst. The noise of two samples a hundredth of an interval
    apart is a slope, on which a spline leaves the signal by far.
    """
    bunch = np.concatenate([[0], np.cumsum(np.diff(time) >= _AT_ONCE / clock.fs)])
    if bunch[-1] + 1 < time.size:
        count = np.bincount(bunch)
        time = time[0] + np.bincount(bunch, time - time[0]) / count
        values = np.bincount(bunch, values) / count
    if time.size < 2:
        return lambda at: np.full(at.size, values[0])
    return scipy.interpolate.CubicSpline(time, values)


def _agreeing(
    values: NDArray[np.float64],
    at: NDArray[np.float64],
    channel: Channel,
    part: slice,
    clock: Clock,
    fs: float,
) -> NDArray[np.float64]:
    """Values at even instants that agree, band-limited, with the samples at their own stamps.

    What they miss of the samples is interpolated as the samples were, and added, so that the
    error of the spline is of second order (H. G. Feichtinger, K. Gröchenig, Theory and Practice
    of Irregular Sampling, in Wavelets: Mathematics and Applications, 1994). More such steps
    gain little, and each raises the noise.
    """
    time = channel.time[part]
    place = (time - at[0]) * fs
    inner = (place >= CROSSINGS) & (place <= at.size - 1 - CROSSINGS)
    if clock.fs >= FASTER * fs or not inner.any():
        return values
    missed = np.zeros(time.size)
    missed[inner] = channel.values[part][inner] - band_limited(values, place[inner], ratio=1.0)
    return np.asarray(values + _curve(time, missed, clock)(at))


def _sharpen(
    out: NDArray[np.float64],
    mine: slice,
    clock: Clock,
    part: slice,
    values: NDArray[np.float64],
    at: NDArray[np.float64],
) -> None:
    """Replace a spline by the band-limited values where they have samples enough on both sides."""
    place = (at[mine] - clock.start) * clock.fs - clock.index[part][0]
    inner = (place >= CROSSINGS) & (place <= values[part].size - 1 - CROSSINGS)
    if inner.any():
        where = np.arange(mine.start, mine.stop)[inner]
        out[where] = band_limited(values[part], place[inner], ratio=1.0)


def _filled(
    time: NDArray[np.float64],
    values: NDArray[np.float64],
    at: NDArray[np.float64],
    intersample: Intersample | None,
) -> NDArray[np.float64]:
    """Values inside gaps: held, or a monotone cubic Hermite between the two edges."""
    after = np.clip(np.searchsorted(time, at), 1, time.size - 1)
    before = after - 1
    t0, t1, v0, v1 = time[before], time[after], values[before], values[after]
    if intersample == "zoh":  # not where derivatives are taken
        return np.asarray(v0)
    chord = (v1 - v0) / (t1 - t0)
    slope = np.diff(values) / np.diff(time)
    # The slope at an edge is that of the interval outside the gap, if that is a sample long.
    outside0 = np.where(before > 0, slope[np.maximum(before - 1, 0)], chord)
    outside1 = np.where(after < time.size - 1, slope[np.minimum(after, slope.size - 1)], chord)
    if intersample == "foh":
        outside0 = outside1 = chord

    def limited(s: NDArray[np.float64]) -> NDArray[np.float64]:
        # Fritsch and Carlson (1980): same sign as the chord, at most three times as steep.
        return np.where(s * chord > 0, np.sign(chord) * np.minimum(np.abs(s), 3 * np.abs(chord)), 0)

    h = t1 - t0
    x = (at - t0) / h
    d0, d1 = limited(outside0) * h, limited(outside1) * h
    cubic = v0 + x * (d0 + x * (3 * (v1 - v0) - 2 * d0 - d1 + x * (d0 + d1 - 2 * (v1 - v0))))
    return np.asarray(cubic)
