"""Colour of a noise that is known at some samples only, as between clipped ones."""

import numpy as np
import scipy

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.noise.whiteness import autocovariance

__all__ = ["masked_spectrum"]

_LONGEST = 12
"""Order of the autoregression at most: with gaps, far lags are hardly known."""


def masked_spectrum(e: Real, known: Mask, omega: Real) -> Real:
    """Power spectrum for unit variance, from an autoregression fitted to known samples.

    Products of samples k apart are averaged over the pairs in which both are known
    (R. H. Jones, Annals of Mathematical Statistics 33, 1962); the order is Akaike's.

    Parameters
    ----------
    e : ndarray, shape (n,)
        Noise.
    known : ndarray of bool, shape (n,)
        Which samples count.
    omega : ndarray, shape (m,)
        Radians per sample.

    Returns
    -------
    ndarray, shape (m,)

    Examples
    --------
    >>> e = np.random.default_rng(0).standard_normal(4000)
    >>> power = masked_spectrum(e, np.arange(4000) % 5 > 0, np.array([0.1, 1.0, 3.0]))
    >>> bool(np.all(np.abs(power - 1.0) < 0.3))
    True
    """
    count = int(np.count_nonzero(known))
    longest = min(_LONGEST, e.size // 20)
    pairs = autocovariance(known.astype(np.float64), longest)
    r = autocovariance(np.where(known, e, 0.0), longest)
    r = np.divide(r, pairs, out=np.zeros_like(r), where=pairs > 10.0 / e.size)
    if r[0] <= 0:
        return np.ones_like(omega)
    best = (count * float(np.log(r[0])), float(r[0]), np.zeros(0))
    for order in range(1, longest + 1):
        coefficients = scipy.linalg.solve_toeplitz(r[:order], r[1 : order + 1])
        variance = float(r[0] - coefficients @ r[1 : order + 1])
        roots = np.roots(np.concatenate([[1.0], -coefficients]))
        # Averaged over different pairs, the covariances need not belong to any noise.
        if variance <= 0 or np.max(np.abs(roots)) >= 1.0:
            break
        criterion = count * float(np.log(variance)) + 2 * order
        if criterion < best[0]:
            best = (criterion, variance, coefficients)
    _, variance, coefficients = best
    steps = np.arange(1, coefficients.size + 1)
    transfer = 1.0 - np.exp(-1j * np.outer(omega, steps)) @ coefficients
    return np.asarray(variance / r[0] / np.abs(transfer) ** 2)
