"""Two clocks held against each other by a signal that both have recorded."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.errors import RecordError
from hmpim.record.channel import Channel
from hmpim.record.clock import fit_clock
from hmpim.record.onto import on_grid

__all__ = ["ClockOffset", "clock_offset"]

_ALIKE = 0.5
"""Correlation below which two recordings are not of one signal: noise as large as the signal."""

_TWICE = 0.95
"""Another peak this high means a signal that repeats itself, whose period cannot be told."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockOffset:
    """How one clock stands to another.

    Parameters
    ----------
    offset : float
        What the other clock shows beyond the first, in s, at the instant `at` of the first.
    std : float
        Standard deviation of `offset` in s.
    drift : float
        How much faster the other clock runs, as a share (1e-6 is one part in a million).
    drift_std : float
        Standard deviation of `drift`.
    at : float
        The instant, in s of the first clock.
    correlation : float
        Between the two recordings, 1 for equal ones.
    """

    offset: float
    std: float
    drift: float
    drift_std: float
    at: float
    correlation: float

    def corrected(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Stamps of the other clock (shape (n,), s) as the first clock would show them."""
        return np.asarray((time - self.offset + self.drift * self.at) / (1.0 + self.drift))


def clock_offset(first: Channel, other: Channel) -> ClockOffset:
    """Find how far, and by how much per second, one clock is off another.

    The two channels are recordings of one signal; scale and bias may differ. The peak of their
    correlation gives the offset to a sample, a least-squares fit of offset, drift, scale and
    bias the rest.

    Parameters
    ----------
    first, other : Channel
        The same signal, recorded by two clocks.

    Raises
    ------
    RecordError
        If the two are not alike, or the signal repeats itself.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> t = np.arange(2000) / 200.0
    >>> signal = np.convolve(rng.standard_normal(2000), np.hanning(20), "same")
    >>> pc = Channel(name="sync", time=t, values=signal)
    >>> scope = Channel(name="sync", time=t + 3.5, values=2 * signal + 1)
    >>> found = clock_offset(pc, scope)
    >>> round(found.offset, 6), bool(abs(found.drift) < 1e-6)
    (3.5, True)
    """
    fs = min(fit_clock(first.time).fs, fit_clock(other.time).fs)
    t1, x1 = _even(first, fs)
    t2, x2 = _even(other, fs)
    lag = _lag(x1, x2, fs, first.name)
    return _refined(t1, x1, t2, x2, float(t2[0] - t1[0]) - lag / fs)


def _even(channel: Channel, fs: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    clock = fit_clock(channel.time)
    grid = np.arange(clock.start, float(channel.time[-1]), 1.0 / fs)
    values, _ = on_grid(channel, clock, grid, fs=fs, intersample=None)
    return grid, values


def _lag(x1: NDArray[np.float64], x2: NDArray[np.float64], fs: float, name: str) -> int:
    """Samples by which the second must be moved later to lie over the first."""
    a, b = x1 - x1.mean(), x2 - x2.mean()
    n = 1 << int(np.ceil(np.log2(a.size + b.size)))
    product = np.fft.rfft(a, n) * np.conj(np.fft.rfft(b, n))
    cross = np.fft.irfft(product, n)
    lags = np.arange(n)
    lags[lags > n // 2] -= n
    lowest, highest = -b.size + 1, a.size - 1
    inside = (lags >= lowest) & (lags <= highest)
    lags, cross = lags[inside], cross[inside]
    score = np.abs(cross) / float(np.sqrt((a @ a) * (b @ b)))
    best = int(np.argmax(score))
    begin, end = max(int(lags[best]), 0), min(int(lags[best]) + b.size, a.size)
    one, other = a[begin:end], b[begin - lags[best] : end - lags[best]]
    alike = abs(float(cross[best])) / float(np.sqrt((one @ one) * (other @ other)))
    if not alike >= _ALIKE:
        raise RecordError(
            f"the two recordings of {name!r} are not alike (correlation {alike:.2f}); name a "
            "channel that both files hold, or give the offset"
        )
    _check_single(lags, score, best, name)
    return int(lags[best])


def _check_single(
    lags: NDArray[np.int64], score: NDArray[np.float64], best: int, name: str
) -> None:
    """Refuse a signal that fits itself as well at another lag."""
    order = np.argsort(lags)
    ordered = score[order]
    peak = int(np.flatnonzero(order == best)[0])
    # Down both sides of the peak, to where the correlation has fallen by a tenth.
    low = ordered < 0.9 * ordered[peak]
    left = np.flatnonzero(low[:peak])
    right = np.flatnonzero(low[peak:])
    rest = np.concatenate(
        (
            ordered[: left[-1] if left.size else 0],
            ordered[peak + right[0] if right.size else ordered.size :],
        )
    )
    if rest.size and float(rest.max()) > _TWICE * ordered[peak]:
        raise RecordError(
            f"{name!r} repeats itself, so that it fits at several offsets; give the offset, or a "
            "common channel that does not"
        )


def _refined(
    t1: NDArray[np.float64],
    x1: NDArray[np.float64],
    t2: NDArray[np.float64],
    x2: NDArray[np.float64],
    offset: float,
) -> ClockOffset:
    """Offset and drift by Gauss and Newton, from an offset that is right to a sample.

    The slope of the first recording is the instrument: its noise has no part in that of the
    other, nor, at its own samples, in its own values. With the other's slope the noise would
    draw the offset towards whole samples.
    """
    curve = scipy.interpolate.CubicSpline(t2, x2)
    slope = curve.derivative()
    own = scipy.interpolate.CubicSpline(t1, x1)(t1, 1)
    drift, middle = 0.0, float(t1.mean())
    covariance, correlation = np.zeros((2, 2)), 0.0
    for _ in range(20):
        at = t1 + offset + drift * (t1 - middle)
        both = (at >= t2[0]) & (at <= t2[-1])
        if np.count_nonzero(both) < 8:
            raise RecordError("the two recordings overlap too little to be aligned")
        y, x, late = x1[both], curve(at[both]), t1[both] - middle
        # The scale as the ratio of sizes: noise on x would make a fitted one too small.
        correlation = float(np.corrcoef(x, y)[0, 1])
        scale = float(np.copysign(np.std(y) / np.std(x), correlation))
        rest = y - scale * x
        rest -= rest.mean()
        instruments = np.stack([own[both], own[both] * late], axis=1)
        # To the first order the rest is the other's slope times what is wrong with the offset.
        moved = scale * slope(at[both])
        size = np.linalg.norm(instruments, axis=0)
        normal = (instruments / size).T @ (np.stack([moved, moved * late], axis=1) / size)
        step = np.linalg.solve(normal, (instruments / size).T @ rest) / size
        offset, drift = offset + float(step[0]), drift + float(step[1])
        inverse = np.linalg.inv(normal)
        spread = inverse @ _scores(instruments / size, rest) @ inverse.T
        covariance = spread / np.outer(size, size)
        if abs(step[0]) < 1e-12 + 1e-3 * np.sqrt(covariance[0, 0]):
            break
    return ClockOffset(
        offset=offset,
        std=float(np.sqrt(covariance[0, 0])),
        drift=drift,
        drift_std=float(np.sqrt(covariance[1, 1])),
        at=middle,
        correlation=correlation,
    )


def _scores(rows: NDArray[np.float64], rest: NDArray[np.float64]) -> NDArray[np.float64]:
    """Covariance of the estimating equations, neighbours correlated (Newey and West 1987)."""
    scores = rows * rest[:, None]
    total = scores.T @ scores
    most = int(np.ceil(4 * (rest.size / 100) ** (2 / 9)))
    for lag in range(1, most + 1):
        one = scores[lag:].T @ scores[:-lag]
        total += (1.0 - lag / (most + 1)) * (one + one.T)
    return np.asarray(total)
