"""The noise as an autoregression: its order from the data, gaps left out.

Least squares on the samples whose whole past is known (the covariance method: Kay, Modern
Spectral Estimation, 1988, ch. 7), which tells wander and lines without bias. One Cholesky
decomposition gives what every order leaves over; the order is that of H. Akaike's criterion (IEEE
Trans. Autom. Control 19, 1974).
"""

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.noise.whiteness import autocovariance
from hmpim.identify.worth import PART

__all__ = [
    "LONGEST",
    "autoregression",
    "autoregressive_spectrum",
    "innovation_gain",
    "whitening_filter",
]

LONGEST = 30
"""Greatest order that is tried."""

_BLOCK = 65_536
_LONGEST_AUTOREGRESSION = 30
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
    longest = gram.shape[0] - 1
    # Latest sample last: the factor's last row holds what each order explains of it.
    scale = np.sqrt(max(float(gram[0, 0]), np.finfo(float).tiny))
    ordered = np.roll(gram, -1, axis=(0, 1)) / scale**2
    ordered += 1e-13 * np.trace(ordered) * np.eye(longest + 1)
    factor = np.linalg.cholesky(ordered)
    explained = np.concatenate([[0.0], np.cumsum(factor[-1, :-1] ** 2)])
    left = np.maximum(ordered[-1, -1] - explained, np.finfo(float).tiny)
    order = int(np.argmin(count * np.log(left) + 2.0 * np.arange(longest + 1)))
    if order == 0:
        return np.ones(1)
    weights = np.linalg.solve(ordered[:order, :order], ordered[:order, -1])
    return np.concatenate([[1.0], -weights])


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
    """Mean square of what an autoregression with a constant does not foresee."""
    order = min(_INNOVATION_ORDER, x.size // 10)
    past = [x[order - k : x.size - k] for k in range(1, order + 1)]
    rows = np.stack([np.ones(x.size - order), *past])
    weights = np.linalg.lstsq(rows.T, x[order:], rcond=None)[0]
    return float(np.mean((x[order:] - weights @ rows) ** 2))


def autoregressive_spectrum(residual: Real, omega: Real) -> Real:
    """Power spectrum of the residual from an autoregression fitted to it (Yule-Walker).

    Parameters
    ----------
    residual : ndarray, shape (n,)
        White or coloured noise.
    omega : ndarray, shape (m,)
        Radians per sample.

    Returns
    -------
    ndarray, shape (m,)
        Equal to the variance at every frequency if the noise is white. The order is chosen
        by Akaike's criterion, at most 30 (Kay, Modern Spectral Estimation, ch. 7).
    """
    n = residual.size
    longest = min(_LONGEST_AUTOREGRESSION, n // 10)
    r = autocovariance(residual, longest)
    best = (n * np.log(r[0]), r[0], np.zeros(0))
    for order in range(1, longest + 1):
        coefficients = scipy.linalg.solve_toeplitz(r[:order], r[1 : order + 1])
        variance = float(r[0] - coefficients @ r[1 : order + 1])
        if variance <= 0:
            break
        criterion = n * np.log(variance) + 2 * order
        if criterion < best[0]:
            best = (criterion, variance, coefficients)
    _, variance, coefficients = best
    steps = np.arange(1, coefficients.size + 1)
    transfer = 1.0 - np.exp(-1j * np.outer(omega, steps)) @ coefficients
    power = variance / np.abs(transfer) ** 2
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
    if slope > -2.0 * error:
        return np.zeros_like(omega)
    at = np.maximum(omega * n / (2 * np.pi), 0.5)
    power = np.exp(np.mean(level) + slope * (np.log(at) - np.mean(np.log(bins))))
    return np.asarray(np.where(at <= bins[-1], power, 0.0))
