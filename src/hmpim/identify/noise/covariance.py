"""The covariance of a fit under noise of any colour.

With white noise the covariance of a maximum-likelihood fit is the Cramér-Rao bound, σ² (JᵀJ)⁻¹.
With coloured noise it is the sandwich (JᵀJ)⁻¹ JᵀRJ (JᵀJ)⁻¹ (Söderström and Stoica, System
Identification, 1989, ch. 7), R from an autoregression fitted to the residual. If the noise level
changes along the record, each sample counts with its own level (H. White, Econometrica 48, 1980;
MacKinnon and White, J. Econometrics 29, 1985).
"""

from collections.abc import Callable

import numpy as np
import scipy

from hmpim.identify.arrays import Real
from hmpim.identify.noise.autoregression import autoregressive_spectrum, yule_walker
from hmpim.identify.noise.whiteness import is_steady
from hmpim.identify.worth import PART

__all__ = ["WELL", "covariance", "white_covariance"]

WELL = 1e-4
"""Least diagonal element of a triangular factor that normal equations give accurately."""


def covariance(rows: Real, residual: Real, *, freedom: int, white: bool) -> Real:
    """Covariance of the parameters of a least-squares fit, (p, p).

    `rows`, (p, n), are derivatives of the prediction, and `freedom` is the number of samples that
    count less that of the parameters. Finite but very large along an undetermined direction.
    """
    gram = rows @ rows.T
    norm = np.sqrt(gram.diagonal())
    scale = np.where(norm > 1e-100 * norm.max(), norm, 1.0)  # a row of zeros stays zero
    inverse, basis = _orthonormal(gram / np.outer(scale, scale), rows, scale)
    if white:
        inner = np.eye(scale.size) * float(residual @ residual) / freedom
    else:
        length = scipy.fft.next_fast_len(2 * residual.size, real=True)
        spectra = scipy.fft.rfft(basis(), length)
        omega = 2 * np.pi * np.arange(spectra.shape[1]) / length
        power = autoregressive_spectrum(residual, omega) * residual.size / freedom
        power[1 : (length + 1) // 2] *= 2.0  # both signs of frequency
        inner = ((spectra * power) @ spectra.conj().T).real / length
    inner = _with_level(inner, basis, residual, white=white)
    return np.asarray(inverse @ inner @ inverse.T / np.outer(scale, scale))


def _with_level(inner: Real, basis: Callable[[], Real], residual: Real, *, white: bool) -> Real:
    """Return the covariance of the whitened slopes for noise with its own level at each sample.

    It is scaled by the ratio of two sums, with these levels and with their mean.
    """
    noise = np.ones(1) if white else yule_walker(residual)[0]
    innovations = residual if white else scipy.signal.lfilter(noise, np.ones(1), residual)
    if is_steady(innovations):
        return inner
    rows = basis()
    # A fit absorbs part of the noise in each sample.
    whole = innovations / np.maximum(1.0 - np.sum(rows**2, axis=0), PART)
    if not white:
        rows = scipy.signal.lfilter(np.ones(1), noise, rows[:, ::-1])[:, ::-1]
    counted = max(int(np.count_nonzero(innovations)), 1)
    mean = rows @ rows.T * float(innovations @ innovations) / counted
    own = (rows * whole) @ (rows * whole).T
    if not (inner.diagonal().all() and mean.diagonal().all()):  # a row of zeros
        return inner
    turn = np.linalg.cholesky(inner) @ np.linalg.inv(np.linalg.cholesky(mean))
    return np.asarray(turn @ own @ turn.T)


def white_covariance(gram: Real, power: float, *, freedom: int) -> Real | None:
    """Return `covariance` for white noise, from products instead of rows.

    `gram`, (p, p), holds the products of the rows, and `power` is the residual's sum of squares.
    None where the products determine a direction too inaccurately.
    """
    diagonal = gram.diagonal()
    if not (diagonal > 0.0).all():  # below 0 by rounding
        return None
    scale = np.sqrt(diagonal)
    inverse = _inverse_factor(gram / np.outer(scale, scale))
    if inverse is None:
        return None
    return np.asarray(inverse @ inverse.T * (power / freedom) / np.outer(scale, scale))


def _inverse_factor(gram: Real) -> Real | None:
    """Inverse of a Gram matrix's triangular factor; None where it is too inaccurate."""
    factor, info = scipy.linalg.lapack.dpotrf(gram)
    return None if info or factor.diagonal().min() <= WELL else np.linalg.inv(factor)


def _orthonormal(gram: Real, rows: Real, scale: Real) -> tuple[Real, Callable[[], Real]]:
    """Return the inverse of R and a function that returns Q', (p, n): the scaled rows are (Q R)'.

    By normal equations, unless they determine a direction too inaccurately.
    """
    inverse = _inverse_factor(gram)
    if inverse is not None:
        return inverse, lambda: (inverse.T / scale) @ rows
    q, r = np.linalg.qr((rows / scale[:, None]).T)
    diagonal = np.abs(np.diag(r))
    if diagonal.min() > 1e-10 * diagonal.max():
        return np.linalg.inv(r), lambda: q.T
    left, values, right = np.linalg.svd(r)
    return (right.T / np.maximum(values, 1e-10 * max(values[0], 1.0))) @ left.T, lambda: q.T
