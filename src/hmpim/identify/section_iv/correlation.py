"""Cross- and autocorrelation, and the delay at the peak (paper, equations 8 and 10)."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from hmpim.identify.arrays import Complex, Real
from hmpim.identify.kept import kept
from hmpim.identify.signals import as_pair
from hmpim.identify.worth import MOST, NEARLY, PART

__all__ = [
    "Correlation",
    "CorrelationPeak",
    "Likeness",
    "autocorrelation",
    "cross_correlation",
    "likeness",
]


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
    """How far two signals resemble each other when the output is late, and when it is early."""

    # the paper's, of the signals as they are, over the lags at which at least half of the record
    # overlaps; of the signals less their means where those, at the paper's, resemble each other by
    # less than half of what they do elsewhere: a bias of many times the motion has its own peak
    peak: CorrelationPeak
    # of the signals less their means, the correlation of largest magnitude where the output comes
    # first
    ahead: float
    behind: tuple[float, float]  # the greatest and the least where it comes last, or at once
    # lag in samples, from 0 to the longest asked for, at which that correlation has its largest
    # magnitude
    lag: int
    there: float  # that correlation, times the number of samples
    # negative lag, as far at most, at which it is larger still; None if there is none
    lead: int | None

    @property
    def is_ahead(self) -> bool:
        """Whether the output is ahead where the two resemble each other most.

        A sine, an integral or a derivative resembles as much on the other side, with the other
        sign: then it is not told which is ahead.
        """
        sign = -1.0 if self.ahead > 0.0 else 1.0
        opposite = max(sign * one for one in self.behind)
        most = max(abs(one) for one in self.behind)
        return abs(self.ahead) > most and opposite < NEARLY * abs(self.ahead)


def cross_correlation(x: ArrayLike, y: ArrayLike) -> Correlation:
    """Return the cross-correlation of equation (8), at every lag.

    R_xy(k) = (1/N) Σ x(n) y(n-k), the sum over the n at which both samples exist. Means are
    not removed and every lag is divided by the same N, both as printed. The sum is done by
    FFT, with zeros enough that nothing wraps around.

    With y(n-k) as printed, a `y` that is `x` delayed peaks at a negative lag: to read a
    delay as positive, pass the later signal first. Its peak then is the paper's delay, a whole
    number of samples: the pure delay plus what the dynamics add, 170 ms for the system of
    Fig. 17, whose pure delay is 150 ms.

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
    """Return how an input and an output resemble each other, late and early, in one transform.

    Both have shape (n,) and are checked; `lag` and `lead` are sought up to the longest.

    Examples
    --------
    >>> u, y = np.array([0.0, 1.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 2.0, 0.0])
    >>> seen = likeness(u, y, 4)
    >>> seen.peak, seen.is_ahead, seen.lag
    (CorrelationPeak(lag=2, value=0.4...), False, 2)
    """
    n, half = u.size, u.size // 2 + 1
    length = int(scipy.fft.next_fast_len(2 * n - 1, real=True))
    means, moves = (float(u.mean()), float(y.mean())), y - y.mean()
    around = scipy.fft.rfft(moves, length)
    around *= _conjugate(u, length)
    around = scipy.fft.irfft(around, length, overwrite_x=True)
    behind, ahead = around[:n], around[length - n + 1 :]
    # Of the signals as they are, their means on the samples that meet come in addition.
    value = behind[:half] + (n - np.arange(half)) * (means[0] * means[1])
    value[1:] -= means[0] * np.cumsum(moves[: half - 1])
    value[1:] -= means[1] * np.cumsum(u[: n - half : -1] - means[0])
    lag, lead = _farthest(behind[: longest + 1]), -1 - _farthest(ahead[: -longest - 1 : -1])
    peak, late, early = _peak(value / n), _farthest(behind[:half]), float(ahead[_farthest(ahead)])
    if abs(early) < abs(behind[late]) > abs(behind[peak.lag]) / MOST:
        peak = CorrelationPeak(lag=late, value=float(behind[late]) / n)
    return Likeness(
        peak=peak,
        ahead=early,
        behind=(float(behind.max()), float(behind.min())),
        lag=lag,
        there=float(behind[lag]),
        lead=lead if abs(ahead[lead]) > abs(behind[lag]) else None,
    )


@kept
def _conjugate(u: Real, length: int) -> Complex:
    """Conjugate transform of an input less its mean, zeros behind it."""
    spectrum = np.asarray(scipy.fft.rfft(u - u.mean(), length), dtype=np.complex128)
    return np.conj(spectrum, out=spectrum)


def _farthest(values: Real) -> int:
    """Where values, (m,), are farthest from zero, and there first."""
    ends = sorted((int(np.argmax(values)), int(np.argmin(values))))
    return max(ends, key=lambda k: abs(float(values[k])))


def autocorrelation(x: ArrayLike) -> Correlation:
    """Return the autocorrelation of equation (10), at every lag.

    R_xx(k) = (1/N) Σ x(n) x(n-k): equation (8) of a signal with itself, (n,), its mean not
    removed; in the paper of the time-corrected measurement error. It is the same at k and -k, and
    R(0) is the mean square.

    Examples
    --------
    >>> autocorrelation([1, -1, 1, -1]).value.round(2)
    array([-0.25,  0.5 , -0.75,  1.  , -0.75,  0.5 , -0.25])
    """
    return cross_correlation(x, x)


def _peak(value: Real) -> CorrelationPeak:
    """Peak of a correlation at lags from 0 on, since an output cannot come before its cause.

    The highest value, as in the paper, unless the lowest is 1.2 times as far from zero: then the
    device turns the sign.
    """
    high, low = int(np.argmax(value)), int(np.argmin(value))
    lag = low if -value[low] > (1 + PART) * max(value[high], 0.0) else high
    return CorrelationPeak(lag=lag, value=float(value[lag]))
