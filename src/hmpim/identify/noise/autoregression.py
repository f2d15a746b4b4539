"""The noise as an autoregression: its order from the data, gaps left out.

Least squares on the samples whose whole past is known (the covariance method: Kay, Modern
Spectral Estimation, 1988, ch. 7), which tells wander and lines without bias. One Cholesky
decomposition gives what every order leaves over; the order is that of H. Akaike's criterion (IEEE
Trans. Autom. Control 19, 1974). All that asks for the colour of a noise asks here; the products
of samples and their past come from the samples, from statistics, or, where the filter must be
stable, from the autocovariance (Yule and Walker).
"""

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.chance import HALF
from hmpim.identify.noise.whiteness import autocovariance
from hmpim.identify.worth import PART

__all__ = [
    "LONGEST",
    "autoregression",
    "autoregressive_spectrum",
    "innovation_gain",
    "spectrum_behind",
    "whitening_filter",
    "yule_walker",
]

LONGEST = 30
"""Greatest order that is tried."""

_BLOCK = 65_536
_FLICKER_BINS = 32
_INNOVATION_ORDER = 12
_MOST_INNOVATIONS = 100_000


def autoregression(residual: Real, valid: Mask | None) -> Real:
    """Filter that leaves white noise of a residual, 1 first, shape (order + 1,).

    Parameters
    ----------
    residual : ndarray, shape (n,)
        0 on average.
    valid : ndarray of bool, shape (n,), optional
        Samples that count; all if None.

    Examples
    --------
    >>> from scipy.signal import lfilter
    >>> noise = lfilter([1.0], [1.0, -0.9], np.random.default_rng(0).standard_normal(5000))
    >>> autoregression(noise, None)[:2].round(2).tolist()
    [1.0, -0.9]
    """
    longest = min(LONGEST, residual.size // 20, _reach(valid))
    if longest < 1:
        return np.ones(1)
    return whitening_filter(*_moments(residual, valid, longest))


def whitening_filter(gram: Real, count: int) -> Real:
    """Filter that leaves white noise, from the products of a sample and its past.

    Parameters
    ----------
    gram : ndarray, shape (k + 1, k + 1)
        Sums of products of a sample and the k before it, the sample itself first.
    count : int
        Of samples that were summed.

    Returns
    -------
    ndarray, shape (order + 1,)
        1 first; the order, at most k, is Akaike's.

    Examples
    --------
    >>> whitening_filter(100 * np.array([[1.0, 0.5], [0.5, 1.0]]), 100).tolist()
    [1.0, -0.49...]
    """
    if not gram[0, 0] > 0.0:
        return np.ones(1)
    left, ordered = _left(gram)
    order = int(np.argmin(count * np.log(left) + 2.0 * np.arange(left.size)))
    if order == 0:
        return np.ones(1)
    weights = np.linalg.solve(ordered[:order, :order], ordered[:order, -1])
    return np.concatenate([[1.0], -weights])


def _left(gram: Real) -> tuple[Real, Real]:
    """Share of its power that each order leaves of a sample; the products, it standing last."""
    scale = max(float(gram[0, 0]), np.finfo(float).tiny)
    # Latest sample last: the factor's last row holds what each order explains of it.
    ordered = np.roll(gram, -1, axis=(0, 1)) / scale
    ordered += 1e-13 * np.trace(ordered) * np.eye(gram.shape[0])
    factor = np.linalg.cholesky(ordered)
    explained = np.concatenate([[0.0], np.cumsum(factor[-1, :-1] ** 2)])
    return np.maximum(ordered[-1, -1] - explained, np.finfo(float).tiny), ordered


def _reach(valid: Mask | None) -> int:
    """Greatest order that leaves enough samples between the gaps."""
    if valid is None:
        return LONGEST
    ends = int(np.count_nonzero(valid[:-1] & ~valid[1:])) + 1
    return int(PART * np.count_nonzero(valid) / ends)


def _moments(residual: Real, valid: Mask | None, longest: int) -> tuple[Real, int]:
    """Sums of products of a sample and its past, (longest + 1)², the sample itself first."""
    gram, count = np.zeros((longest + 1, longest + 1)), 0
    for start in range(0, residual.size - longest, _BLOCK):
        span = slice(start, start + _BLOCK + longest)
        windows = sliding_window_view(residual[span], longest + 1)[:, ::-1]
        if valid is not None:
            windows = windows[sliding_window_view(valid[span], longest + 1).all(axis=1)]
        gram += windows.T @ windows
        count += windows.shape[0]
    return gram, count


def innovation_gain(y: Real, residual: Real) -> float:
    """Log-likelihood by which a residual is more likely than the output, both as coloured noise.

    Each is taken as an autoregression of its own (order 12, least squares, so that wander and
    lines are told exactly); what that cannot foresee of the output, the model must explain.

    Parameters
    ----------
    y, residual : ndarray, shape (n,)
        Output, and what a model leaves of it.

    Examples
    --------
    A wandering output has nothing that its own past does not tell:

    >>> rng = np.random.default_rng(0)
    >>> wander, pulses = np.cumsum(rng.standard_normal(2000)), rng.standard_normal(2000)
    >>> innovation_gain(wander, wander - wander.mean()) < 1
    True
    >>> innovation_gain(wander + 2 * pulses, wander) > 500
    True
    """
    if y.size > _MOST_INNOVATIONS:
        middle = slice((y.size - _MOST_INNOVATIONS) // 2, (y.size + _MOST_INNOVATIONS) // 2)
        y, residual = y[middle], residual[middle]
    unforeseen = _innovation(residual)
    if unforeseen <= 0.0:
        return float("inf") if _innovation(y) > 0.0 else 0.0
    size = y.size - _INNOVATION_ORDER
    return float(0.5 * size * np.log(max(_innovation(y) / unforeseen, np.finfo(float).tiny)))


def _innovation(x: Real) -> float:
    """Mean square of what an autoregression of that order does not foresee, the mean taken off."""
    gram, count = _moments(x - x.mean(), None, min(_INNOVATION_ORDER, x.size // 10))
    return float(gram[0, 0] * _left(gram)[0][-1] / count) if gram[0, 0] > 0.0 else 0.0


def yule_walker(residual: Real, longest: int = LONGEST) -> tuple[Real, float]:
    """The same filter from the autocovariance, stable always, and the power that it leaves.

    Parameters
    ----------
    residual : ndarray, shape (n,)
        0 where a sample does not count.
    longest : int
        Greatest order that is tried; less for fewer than ten times as many samples.

    Examples
    --------
    >>> from scipy.signal import lfilter
    >>> noise = lfilter([1.0], [1.0, -0.9], np.random.default_rng(0).standard_normal(5000))
    >>> filtering, left = yule_walker(noise)
    >>> filtering[:2].round(2).tolist(), round(left, 1)
    ([1.0, -0.9], 1.0)
    """
    gram = scipy.linalg.toeplitz(autocovariance(residual, min(longest, residual.size // 10)))
    noise = whitening_filter(gram, residual.size)
    return noise, float(noise @ gram[: noise.size, : noise.size] @ noise)


def spectrum_behind(noise: Real, omega: Real) -> Real:
    """Power spectrum of what a filter turns into white noise of power 1, at rad per sample."""
    return np.asarray(np.abs(np.exp(-1j * np.outer(omega, np.arange(noise.size))) @ noise) ** -2)


def autoregressive_spectrum(residual: Real, omega: Real) -> Real:
    """Power spectrum of the residual from an autoregression fitted to it.

    Parameters
    ----------
    residual : ndarray, shape (n,)
        White or coloured noise.
    omega : ndarray, shape (m,)
        Radians per sample.

    Returns
    -------
    ndarray, shape (m,)
        Equal to the variance at every frequency if the noise is white.
    """
    noise, left = yule_walker(residual)
    power = left * spectrum_behind(noise, omega)
    flicker = _flicker(residual, omega)
    return np.asarray(np.where(flicker > 0, flicker, power))


def _flicker(residual: Real, omega: Real) -> Real:
    """Power that rises towards DC as f^-α, which a short autoregression levels off; 0 if none.

    A straight line through the logarithm of the first bins of the periodogram, whose scatter
    about it is known: standard deviation π/√6, mean -0.577 (Kay, Modern Spectral Estimation).
    """
    n = residual.size
    bins = np.arange(1, min(_FLICKER_BINS, n // 8) + 1)
    if bins.size < 8:
        return np.zeros_like(omega)
    wave = scipy.fft.rfft(residual)[bins]
    level = np.log(np.maximum(np.abs(wave) ** 2 / n, np.finfo(float).tiny)) + 0.5772
    steps = np.log(bins) - np.mean(np.log(bins))
    slope = float(steps @ level / (steps @ steps))
    error = np.pi / np.sqrt(6.0 * float(steps @ steps))
    if slope > -HALF * error:
        return np.zeros_like(omega)
    at = np.maximum(omega * n / (2 * np.pi), 0.5)
    power = np.exp(np.mean(level) + slope * (np.log(at) - np.mean(np.log(bins))))
    return np.asarray(np.where(at <= bins[-1], power, 0.0))
