"""The noise as an autoregression: its order from the data, gaps left out.

Least squares on the samples whose whole past is known (the covariance method: Kay, Modern
Spectral Estimation, 1988, ch. 7), which tells wander and lines without bias. One Cholesky
decomposition gives what every order leaves over; the order is that of H. Akaike's criterion (IEEE
Trans. Autom. Control 19, 1974).
"""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

__all__ = ["LONGEST", "autoregression", "whitening_filter"]

LONGEST = 30
"""Greatest order that is tried."""

_BLOCK = 65_536

_MOST_LOST = 0.2
"""Share of the samples that gaps may cost through the reach of an order."""

Real = NDArray[np.float64]


def autoregression(residual: Real, valid: NDArray[np.bool_] | None) -> Real:
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


def _reach(valid: NDArray[np.bool_] | None) -> int:
    """Greatest order that leaves enough samples between the gaps."""
    if valid is None:
        return LONGEST
    ends = int(np.count_nonzero(valid[:-1] & ~valid[1:])) + 1
    return int(_MOST_LOST * np.count_nonzero(valid) / ends)


def _moments(residual: Real, valid: NDArray[np.bool_] | None, longest: int) -> tuple[Real, int]:
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
