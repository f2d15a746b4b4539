"""Cross- and autocorrelation, and the delay at the peak (paper, equations 8 and 10)."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from hmpim.identify.arrays import Complex, Real
from hmpim.identify.kept import kept
from hmpim.identify.signals import as_pair
from hmpim.identify.worth import MOST, NEARLY, PART

__all__ = ["Correlation", "CorrelationPeak", "autocorrelation", "cross_correlation", "likeness"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Correlation:
    """A correlation over its lags."""

    lag: NDArray[np.int64]  # (m,): lags k in samples, increasing by one
    value: Real  # (m,): R(k), in the product of the two signals' units


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrelationPeak:
    """Where a correlation peaks: its lag in samples, and R there (negative for a trough)."""

    lag: int
    value: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Likeness:
    """How an input and an output correlate when the output is late, and when it is early."""

    # the paper's peak, of the signals as they are, at lags over which half of the record overlaps;
    # of the signals less their means, if these correlate less than half as well at the paper's peak
    # as elsewhere: a bias of many times the motion has a peak of its own
    peak: CorrelationPeak
    # whether the output leads at the strongest correlation, all without means; False for a sine, an
    # integral or a derivative, which correlate as much at a lag with the other sign
    is_ahead: bool
    lag: int  # samples, from 0 to the longest, at the strongest correlation without means
    there: float  # that correlation, times the number of samples
    lead: int | None  # negative lag, as far at most, with a stronger one; None if there is none


def cross_correlation(x: ArrayLike, y: ArrayLike) -> Correlation:
    """Return the cross-correlation of equation (8), at every lag.

    R_xy(k) = (1/N) Σ x(n) y(n-k), the sum over the n at which both samples exist. Means are not
    removed and every lag is divided by the same N, both as printed. The sum is computed by FFT,
    with enough zeros to prevent wrap-around.

    With y(n-k) as printed, a `y` that is `x` delayed peaks at a negative lag: pass the later signal
    first to get a positive delay. Its peak then is the paper's delay in whole samples: the pure
    delay plus that of the dynamics, 170 ms for the system of Fig. 17, whose pure delay is 150 ms.

    Parameters
    ----------
    x, y : array_like, shape (n,)
        Two signals on one clock, any units.

    Returns
    -------
    Correlation
        2n - 1 lags, from -(n-1) to n-1.

    Raises
    ------
    RecordError
        For unequal lengths, fewer than four samples, NaN or infinity.

    Examples
    --------
    >>> r = cross_correlation([0, 0, 1, 0, 0], [0, 1, 0, 0, 0])
    >>> int(r.lag[r.value.argmax()])
    1
    """
    first, second = as_pair(x, y)
    n = first.size
    length = int(scipy.fft.next_fast_len(2 * n - 1, real=True))
    spectrum = scipy.fft.rfft(first, length) * np.conj(scipy.fft.rfft(second, length))
    around = scipy.fft.irfft(spectrum, length)
    value = np.concatenate((around[length - n + 1 :], around[:n])) / n
    return Correlation(lag=np.arange(1 - n, n), value=value)


@kept
def likeness(u: Real, y: Real, longest: int) -> Likeness:
    """Return how an input and an output correlate, late and early, by one transform.

    Both have shape (n,) and are checked; `lag` and `lead` go up to the longest.

    Examples
    --------
    >>> u, y = np.array([0.0, 1.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 2.0, 0.0])
    >>> found = likeness(u, y, 4)
    >>> found.peak, found.is_ahead, found.lag
    (CorrelationPeak(lag=2, value=0.4...), False, 2)
    """
    n, half = u.size, u.size // 2 + 1
    means, moves = (float(u.mean()), float(y.mean())), y - y.mean()
    around = _around(u, y)
    behind, ahead = around[:n], around[1 - n :]
    # For the signals as they are, the products of the means are added over the overlap.
    value = behind[:half] + (n - np.arange(half)) * (means[0] * means[1])
    value[1:] -= means[0] * np.cumsum(moves[: half - 1])
    value[1:] -= means[1] * np.cumsum(u[: n - half : -1] - means[0])
    lag, lead = _farthest(behind[: longest + 1]), -1 - _farthest(ahead[: -longest - 1 : -1])
    peak, late, early = _peak(value / n), _farthest(behind[:half]), float(ahead[_farthest(ahead)])
    if abs(early) < abs(behind[late]) > abs(behind[peak.lag]) / MOST:
        peak = CorrelationPeak(lag=late, value=float(behind[late]) / n)
    greatest, least = float(behind.max()), float(behind.min())
    opposite = -least if early > 0.0 else greatest
    return Likeness(
        peak=peak,
        is_ahead=abs(early) > max(abs(greatest), abs(least)) and opposite < NEARLY * abs(early),
        lag=lag,
        there=float(behind[lag]),
        lead=lead if abs(ahead[lead]) > abs(behind[lag]) else None,
    )


@kept
def _around(u: Real, y: Real) -> Real:
    """Correlation sums of both signals less their means, at lags from 0 up, then below 0."""
    length = int(scipy.fft.next_fast_len(2 * u.size - 1, real=True))
    spectrum = scipy.fft.rfft(y - y.mean(), length)
    spectrum *= _conjugate(u, length)
    return np.asarray(scipy.fft.irfft(spectrum, length, overwrite_x=True))


@kept
def _conjugate(u: Real, length: int) -> Complex:
    """Conjugate transform of an input less its mean, with zeros appended."""
    spectrum = np.asarray(scipy.fft.rfft(u - u.mean(), length), dtype=np.complex128)
    return np.conj(spectrum, out=spectrum)


def _farthest(values: Real) -> int:
    """First index at which values, (m,), are farthest from zero."""
    ends = sorted((int(np.argmax(values)), int(np.argmin(values))))
    return max(ends, key=lambda k: abs(float(values[k])))


def autocorrelation(x: ArrayLike) -> Correlation:
    """Return the autocorrelation of equation (10), at every lag.

    R_xx(k) = (1/N) Σ x(n) x(n-k): equation (8) of a signal, (n,), with itself, its mean not
    removed. The paper applies it to the time-corrected measurement error. R(0) is the mean square.

    Examples
    --------
    >>> autocorrelation([1, -1, 1, -1]).value.round(2)
    array([-0.25,  0.5 , -0.75,  1.  , -0.75,  0.5 , -0.25])
    """
    return cross_correlation(x, x)


def _peak(value: Real) -> CorrelationPeak:
    """Peak of a correlation at lags from 0 on, since an output cannot come before its cause."""
    high, low = int(np.argmax(value)), int(np.argmin(value))
    # As in the paper the highest value, unless the lowest is so much lower: an inverted sign.
    lag = low if -value[low] > (1 + PART) * max(value[high], 0.0) else high
    return CorrelationPeak(lag=lag, value=float(value[lag]))
