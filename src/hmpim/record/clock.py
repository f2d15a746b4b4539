"""The uniform clock behind a channel's time stamps: its rate, its jitter, its gaps."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

__all__ = ["JITTER_THRESHOLD", "Clock", "fit_clock", "places_of_late", "rate_of", "usual_interval"]

JITTER_THRESHOLD = 0.01
"""Largest distance from the uniform clock that is let pass, as a share of the interval.

At a tenth of the sampling rate, one hundredth of an interval displaces one sample by
2π · 0.1 · 0.01 = 0.6 % of the amplitude at most; the r.m.s. is a third of that or less,
below the noise of the records that the method is made for.
"""

_MANY = 100
"""Samples over which the jitter of each hardly counts: in the distance between two stamps, and in
the mean delay of as many stamps about an interval, half of them on either side."""

_ALIKE = 0.05
"""Relative difference up to which the stated rate is that of the stamps."""

_FAR = 6.0
"""Deviations of lateness beyond which samples are missing: by chance in one of 10⁹ intervals."""

_BULK = 0.6745
"""Median of the size of a normal variable, in standard deviations."""

_LASTS = 0.5
"""Intervals by which stamps after a gap are later at least than those before it."""

_NEAR = 0.25
"""Relative difference from the median within which most intervals lie, unless jitter is strong."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Clock:
    """A uniform clock laid through time stamps.

    Parameters
    ----------
    start : float
        Time of index 0 in s.
    fs : float
        Rate in Hz; gaps do not lower it.
    index : integer ndarray, shape (n,)
        Place of each stamp on the uniform clock; it skips what is missing.
    deviation : ndarray, shape (n,)
        Stamp minus its place on the uniform clock, in s.
    resolution : float
        Decimal step in s of which all stamps are multiples; 0 where there is none.
    jittered : bool
        True if the stamps stray by more than `JITTER_THRESHOLD` of an interval, and by more
        than the rounding of printed stamps explains.
    """

    start: float
    fs: float
    index: NDArray[np.int64]
    deviation: NDArray[np.float64]
    resolution: float
    jittered: bool

    @property
    def gaps(self) -> NDArray[np.int64]:
        """Positions (in the stamps) of the last sample before each gap."""
        return np.flatnonzero(np.diff(self.index) > 1)

    @property
    def uniform(self) -> bool:
        """True if nothing is missing and nothing strays."""
        return not self.jittered and int(self.index[-1]) == self.index.size - 1

    @property
    def length(self) -> int:
        """Number of places from the first stamp to the last."""
        return int(self.index[-1]) + 1

    @property
    def mostly_empty(self) -> bool:
        """Whether more places miss a sample than hold one, as with samples stamped in packets."""
        return self.length > 2 * self.index.size

    @property
    def without_jitter(self) -> "Clock":
        """The same for samples that were taken evenly, whatever their stamps say."""
        return replace(self, deviation=np.zeros(self.deviation.size), jittered=False)

    @property
    def rounding(self) -> float:
        """Distance in s below which two instants of this clock cannot be told apart."""
        noise = 8 * float(np.spacing(abs(self.start) + self.length / self.fs))
        return noise if self.jittered else noise + float(np.abs(self.deviation).max())


def fit_clock(
    time: NDArray[np.float64],
    *,
    nominal: float | None = None,
    index: NDArray[np.int64] | None = None,
) -> Clock:
    """Lay a uniform clock through increasing time stamps.

    Stamps that are a uniform clock rounded to a decimal step (0.0016384 k printed with six
    digits, or 400 Hz printed in whole milliseconds) are uniform. Else samples are missing
    where an interval is long and the stamps stay late after it; where they catch up, the one
    stamp was late.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Strictly increasing time stamps in s, n >= 2.
    nominal : float, optional
        Stated rate in Hz; it is kept, digit for digit, where the stamps agree with it.
    index : integer ndarray, shape (n,), optional
        Place of each stamp, where it is known; found from the intervals if None.

    Returns
    -------
    Clock

    Examples
    --------
    >>> import numpy as np
    >>> clock = fit_clock(np.array([0.0, 0.1, 0.2, 0.5, 0.6]))
    >>> round(clock.fs, 9), clock.index.tolist(), clock.uniform
    (10.0, [0, 1, 2, 5, 6], False)
    """
    n = time.size
    since = time - time[0]
    resolution = _decimal_step(since, float(np.abs(time).max()))
    missing = _missing(since, nominal) if index is None else np.diff(index) - 1
    # A dropped sample bends the stamps by a whole interval; rounding bends them by one
    # decimal step at most. Where the decimal step is nearly an interval, the two look alike,
    # and only many "gaps" speak for rounding.
    every = np.arange(n)
    mean_step = _step(since, every)
    noise = 8 * float(np.spacing(np.abs(time).max()))
    bend = 1.05 * (resolution + noise)
    by_rounding = float(np.ptp(since - every * mean_step)) <= bend and (
        resolution <= 0.6 * mean_step or np.count_nonzero(missing) > max(3, 0.05 * n)
    )
    steady = by_rounding or not missing.any()
    index = every if steady else every + np.concatenate(([0], np.cumsum(missing)))
    step = mean_step if steady else _step(since, index)
    deviation = since - index * step
    rounded = by_rounding or float(np.ptp(deviation)) <= bend
    # Rounding may tilt the fit by what it shows; strayed stamps by 3.5 standard deviations.
    tilt = float(np.ptp(deviation)) if rounded else 12 * _std(deviation) / np.sqrt(n)
    fs = 1 / step
    if nominal is not None and abs(1 / nominal - step) * index[-1] <= noise + tilt:
        fs, step = float(nominal), 1 / nominal
        deviation = since - index * step
    # The first stamp may stray as any other: the clock starts where they agree on the whole.
    jittered = not rounded and float(np.abs(deviation).max()) > JITTER_THRESHOLD * step
    shift = float(np.median(deviation)) if jittered else 0.0
    return Clock(
        start=float(time[0]) + shift,
        fs=fs,
        index=index.astype(np.int64),
        deviation=deviation - shift,
        resolution=resolution,
        jittered=jittered,
    )


def rate_of(time: NDArray[np.float64]) -> float:
    """Rate (Hz) of increasing stamps (shape (n,), s) of which none is stated.

    Of samples that arrive in packets it is the rate of all, not that within a packet.

    Examples
    --------
    >>> import numpy as np
    >>> packets = np.repeat(np.arange(1, 31), 10) / 10 + 1e-5 * np.tile(np.arange(10), 30)
    >>> round(rate_of(np.arange(50) / 100), 9), round(rate_of(packets))
    (100.0, 100)
    """
    clock = fit_clock(time)
    strays = _std(clock.deviation) * clock.fs > _LASTS
    return 1.0 / usual_interval(time) if strays or clock.mostly_empty else clock.fs


def usual_interval(time: NDArray[np.float64]) -> float:
    """Interval of stamps (shape (n,), s), whatever a few gaps and the jitter of each are.

    Examples
    --------
    >>> import numpy as np
    >>> time = np.delete(np.arange(1000), np.s_[500:600]) / 100
    >>> round(usual_interval(time), 9)
    0.01
    """
    apart = min(_MANY, (time.size + 1) // 2)
    return float(np.median(time[apart:] - time[:-apart])) / apart


def places_of_late(time: NDArray[np.float64], *, nominal: float | None = None) -> NDArray[np.int64]:
    """Sample numbers of stamps; a gap counts only if all later stamps are delayed by it.

    Stamps of a computer that was busy catch up, and so do those of samples that arrive in packets.
    """
    n, half = time.size, _MANY // 2
    since = time - time[0]
    steps = np.diff(since)
    every = np.arange(n)
    ruler = usual_interval(time)
    if nominal is not None and abs(ruler * nominal - 1.0) < _ALIKE:
        ruler = 1.0 / nominal
    total = np.concatenate(([0.0], np.cumsum(since - every * ruler)))
    # Mean lateness of the stamps after each interval, less that of as many before it.
    after = total[2 * half :] - total[half:-half]
    before = total[half:-half] - total[: -2 * half]
    late = (after - before) / (half * ruler)
    if not late.size:
        return every
    late -= np.median(late)
    usual = _FAR * float(np.median(np.abs(late))) / _BULK
    found: list[int] = []
    while float(late.max()) > max(usual, _LASTS):
        k = int(np.argmax(late))
        near = slice(max(k - half, 0), k + half + 1)
        first = near.start + half  # the sample after the interval that is longest there
        found.append(first + int(np.argmax(steps[first - 1 : near.stop + half - 1])))
        late[near] = 0.0
    # How late all stamps after each gap are tells the samples in it better than those beside it.
    at = np.unique(np.array(found, dtype=np.int64))
    run = np.searchsorted(at, every, side="right")
    size = np.bincount(run, minlength=at.size + 1)
    place, stamp = (np.bincount(run, x, minlength=size.size) / size for x in (every, since))
    along, after_mean = every - place[run], since - stamp[run]
    step = float(along @ after_mean) / float(along @ along)
    missing = np.zeros(n, dtype=np.int64)
    missing[at] = np.clip(np.rint(np.diff(stamp - step * place) / step), 0, _MOST_MISSING)
    return every + np.cumsum(missing)


def _std(deviation: NDArray[np.float64]) -> float:
    """Standard deviation, of stamps of any size."""
    with np.errstate(over="ignore"):
        return float(np.std(deviation))


_MOST_MISSING = 2.0**40
"""Samples in one gap, beyond which stamps are damaged and the count only says so."""


def _missing(since: NDArray[np.float64], nominal: float | None) -> NDArray[np.int64]:
    """Number of samples missing in each interval; shape (n - 1,)."""
    steps = np.diff(since)
    ruler = float(np.median(steps))
    if since.size > 2 * _MANY and np.median(np.abs(steps - ruler)) > _NEAR * ruler:
        return np.diff(places_of_late(since, nominal=nominal)) - 1
    sure = steps >= 1.9 * ruler
    # The mean of the whole intervals is a finer ruler for the long ones than the median is.
    if not sure.all():
        ruler = float(np.mean(steps[~sure]))
    missing = np.zeros(steps.size, dtype=np.int64)
    with np.errstate(over="ignore"):
        missing[sure] = np.clip(np.rint(steps[sure] / ruler) - 1, 1, _MOST_MISSING)
    doubtful = np.flatnonzero((steps > 1.3 * ruler) & ~sure)
    while doubtful.size:
        late = _late_now(since, missing, ruler, doubtful)
        # Neighbours see the same gap; the one that sees most of it holds it.
        found = doubtful[(late > 0.5) & (late >= _largest_near(doubtful, late))]
        if not found.size:
            break
        missing[found] += 1
        doubtful = np.setdiff1d(doubtful, found)
    gaps = np.flatnonzero(missing)
    while gaps.size:  # one stamp was late by more than an interval, and those after it are not
        early = -_late_now(since, missing, ruler, gaps)
        found = gaps[(early > 0.5) & (early >= _largest_near(gaps, early))]
        if not found.size:
            break
        counted = np.maximum(np.rint(early[np.isin(gaps, found)]), 1).astype(np.int64)
        missing[found] -= np.minimum(counted, missing[found])
        gaps = np.flatnonzero(missing)
    return missing


def _late_now(
    since: NDArray[np.float64],
    missing: NDArray[np.int64],
    ruler: float,
    at: NDArray[np.int64],
) -> NDArray[np.float64]:
    """Intervals by which the stamps after some are later than those before, gaps closed."""
    closed = since - ruler * np.concatenate(([0], np.cumsum(missing)))
    return _lateness(closed, at) / ruler


_WINDOW = 5  # stamps on either side that say whether a delay stays


def _lateness(since: NDArray[np.float64], at: NDArray[np.int64]) -> NDArray[np.float64]:
    """How much later (s) the stamps after each interval are than those before it foretell."""
    n = since.size
    ruler = float(np.median(np.diff(since)))
    total = np.concatenate(([0.0], np.cumsum(since)))
    low, high = np.maximum(at + 1 - _WINDOW, 0), np.minimum(at + 1 + _WINDOW, n)
    before = (total[at + 1] - total[low]) / (at + 1 - low)
    after = (total[high] - total[at + 1]) / (high - at - 1)
    return np.asarray(after - before - 0.5 * (high - low) * ruler)


def _largest_near(at: NDArray[np.int64], late: NDArray[np.float64]) -> NDArray[np.float64]:
    """Largest lateness among the intervals within a window of each."""
    first = np.searchsorted(at, at - _WINDOW)
    last = np.searchsorted(at, at + _WINDOW, side="right")
    return np.array([late[a:b].max() for a, b in zip(first, last, strict=True)])


def _step(since: NDArray[np.float64], index: NDArray[np.int64]) -> float:
    """Interval of the clock: the whole span for exact stamps, least squares for others."""
    whole = float(since[-1]) / float(index[-1])
    if float(np.abs(since - index * whole).max()) <= 1e-6 * whole:
        return whole
    centred = index - index.mean()
    return float(centred @ since / (centred @ centred))


def _decimal_step(since: NDArray[np.float64], largest: float) -> float:
    """Largest power of ten of which all stamps are multiples, or 0."""
    noise = 4 * float(np.spacing(largest))
    probe = since[:64]  # most steps are ruled out by a few stamps
    for digits in range(10):
        scale = 10.0**digits
        for part in (probe, since):
            ticks = part * scale
            if np.any(np.abs(ticks - np.rint(ticks)) > noise * scale + 1e-6):
                break
        else:
            return 1 / scale
    return 0.0
