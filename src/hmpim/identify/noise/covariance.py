"""The covariance of a fit under noise of any colour.

With white noise the covariance of a maximum-likelihood fit is the Cramér-Rao bound,
σ² (JᵀJ)⁻¹. With coloured noise the same fit scatters as the sandwich
(JᵀJ)⁻¹ JᵀRJ (JᵀJ)⁻¹ (Söderström and Stoica, System Identification, 1989, ch. 7), R from an
autoregression fitted to the residual.
"""

import numpy as np
import scipy

from hmpim.identify.arrays import Real
from hmpim.identify.noise.autoregression import autoregressive_spectrum

__all__ = ["covariance"]


def covariance(rows: Real, residual: Real, *, freedom: int, white: bool) -> Real:
    """Covariance of the parameters of a least-squares fit.

    Parameters
    ----------
    rows : ndarray, shape (p, n)
        Derivatives of the prediction.
    residual : ndarray, shape (n,)
        What is left over.
    freedom : int
        Samples that counted less parameters.
    white : bool
        Whether the residual is white.

    Returns
    -------
    ndarray, shape (p, p)
        Finite but very large along a direction that the record does not see.
    """
    norm = np.linalg.norm(rows, axis=1)
    scale = np.where(norm > 1e-100 * norm.max(), norm, 1.0)  # a row of zeros stays one
    scaled = rows / scale[:, None]
    q, r = np.linalg.qr(scaled.T)
    diagonal = np.abs(np.diag(r))
    if diagonal.min() <= 1e-10 * diagonal.max():
        left, values, right = np.linalg.svd(r)
        inverse = (right.T / np.maximum(values, 1e-10 * max(values[0], 1.0))) @ left.T
    else:
        inverse = np.linalg.inv(r)
    if white:
        inner = np.eye(scale.size) * float(residual @ residual) / freedom
    else:
        length = scipy.fft.next_fast_len(2 * residual.size, real=True)
        spectra = scipy.fft.rfft(q.T, length)
        omega = 2 * np.pi * np.arange(spectra.shape[1]) / length
        power = autoregressive_spectrum(residual, omega) * residual.size / freedom
        power[1 : (length + 1) // 2] *= 2.0  # both signs of frequency
        inner = ((spectra * power) @ spectra.conj().T).real / length
    return np.asarray(inverse @ inner @ inverse.T / np.outer(scale, scale))
