"""The uniform clock behind a channel's time stamps: its rate, its jitter, its gaps."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["JITTER_THRESHOLD", "Clock", "fit_clock"]

JITTER_THRESHOLD = 0.01
"""Largest distance from the uniform clock that is let pass, as a share of the interval.

At a tenth of the sampling rate, one hundredth of an interval displaces one sample by
2π · 0.1 · 0.01 = 0.6 % of the amplitude at most; the r.m.s. is a third of that or less,
below the noise of the records that the method is made for.
"""


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
    def rounding(self) -> float:
        """Distance in s below which two instants of this clock cannot be told apart."""
        span = abs(self.start) + self.length / self.fs
        return max(self.resolution, 8 * float(np.spacing(span)))


def fit_clock(time: NDArray[np.float64], *, nominal: float | None = None) -> Clock:
    """Lay a uniform clock through increasing time stamps.

    Stamps that are a uniform clock rounded to a decimal step (0.0016384 k printed with six
    digits, or 400 Hz printed in whole milliseconds) are uniform. Otherwise an interval of more
    than 1.5 medians is a gap, unless a neighbouring interval is short by as much.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Strictly increasing time stamps in s, n >= 2.
    nominal : float, optional
        Stated rate in Hz; it is kept, digit for digit, where the stamps agree with it.

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
    steps = np.diff(since)
    median = float(np.median(steps))
    long = _long_steps(steps, median)
    # A dropped sample bends the stamps by a whole interval; rounding bends them by one
    # decimal step at most. Where the decimal step is nearly an interval, the two look alike,
    # and only many "gaps" speak for rounding.
    every = np.arange(n)
    mean_step = _step(since, every)
    bend = float(np.ptp(since - every * mean_step))
    slack = resolution + 8 * float(np.spacing(np.abs(time).max()))
    by_rounding = bend <= 1.05 * slack and (
        resolution <= 0.6 * mean_step or np.count_nonzero(long) > 0.05 * n
    )
    index = every if by_rounding else _places(steps, long, median)
    step = _step(since, index)
    deviation = since - index * step
    # Three and a half standard deviations of a slope fitted through strayed stamps.
    unsure = slack + 12 * float(np.std(deviation)) / np.sqrt(n)
    fs = 1 / step
    if nominal is not None and abs(1 / nominal - step) * index[-1] <= unsure:
        fs, step = float(nominal), 1 / nominal
        deviation = since - index * step
    # The first stamp may stray as any other: the clock starts where they agree on the whole.
    jittered = not by_rounding and float(np.abs(deviation).max()) > max(
        JITTER_THRESHOLD * step, slack
    )
    shift = float(np.median(deviation)) if jittered else 0.0
    return Clock(
        start=float(time[0]) + shift,
        fs=fs,
        index=index.astype(np.int64),
        deviation=deviation - shift,
        resolution=resolution,
        jittered=jittered,
    )


def _long_steps(steps: NDArray[np.float64], median: float) -> NDArray[np.bool_]:
    """Intervals in which a sample is missing, not merely late."""
    before = np.concatenate(([np.inf], steps[:-1])) + steps
    after = steps + np.concatenate((steps[1:], [np.inf]))
    return (steps > 1.5 * median) & (before > 2.5 * median) & (after > 2.5 * median)


def _places(
    steps: NDArray[np.float64], long: NDArray[np.bool_], median: float
) -> NDArray[np.int64]:
    # The mean of the whole intervals is a finer ruler for the long ones than the median is.
    short = steps[~long]
    ruler = float(short.mean()) if short.size else median
    jumps = np.where(long, np.maximum(np.rint(steps / ruler), 2), 1).astype(np.int64)
    return np.concatenate((np.zeros(1, dtype=np.int64), np.cumsum(jumps)))


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
