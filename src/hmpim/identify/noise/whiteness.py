"""Whether noise is white, and how many of its samples are independent."""

import numpy as np
import scipy

from hmpim.identify.arrays import Complex, Mask, Real
from hmpim.identify.chance import DEVIATIONS, FALSE_ALARM
from hmpim.identify.kept import kept

__all__ = [
    "are_white",
    "autocovariance",
    "effective_share",
    "is_steady",
    "is_white",
    "ljung_box",
    "share_of",
    "squares_of",
]

_LAGS = 25

_FEW_LAGS = 60
"""Lags up to which sums of products are faster than a transform."""

_BLOCK = 16_384


def autocovariance(residual: Real, lags: int, spectra: Complex | None = None) -> Real:
    """Biased autocovariance of residuals, (..., n), at lags 0..lags, shape (..., lags + 1).

    `spectra`, (..., n // 2 + 1), are their transforms, if known.
    """
    n = residual.shape[-1]
    if spectra is not None:
        r = scipy.fft.irfft(spectra.real**2 + spectra.imag**2, n)[..., : lags + 1]
        for k in range(1, lags + 1):  # less the products of the end and the beginning
            r[..., k] -= np.vecdot(residual[..., :k], residual[..., n - k :])
        return np.asarray(r / n)
    if lags <= _FEW_LAGS:  # block by block, to stay in the cache for all lags
        r = np.zeros((*residual.shape[:-1], lags + 1))
        for row in np.ndindex(residual.shape[:-1]):
            padded = np.append(residual[row], np.zeros(lags))
            for start in range(0, n, _BLOCK):
                block = residual[row][start : start + _BLOCK]
                r[row] += np.correlate(padded[start : start + block.size + lags], block)
        return np.asarray(r / n)
    length = scipy.fft.next_fast_len(n + lags + 1, real=True)
    power = np.abs(scipy.fft.rfft(residual, length)) ** 2
    return np.asarray(scipy.fft.irfft(power, length)[..., : lags + 1] / n)


@kept
def is_white(residual: Real) -> bool:
    """Whether one residual, shape (n,), is white by the test of `are_white`."""
    return bool(are_white(residual))


@kept
def is_steady(residual: Real) -> bool:
    """Whether white noise keeps its level, by a test of its squares (McLeod and Li, 1983).

    The squares of noise that is louder for a while, or where the output moves fast, are
    correlated (J. Time Series Anal. 4). Samples of 0 do not count.
    """
    return not _correlated(np.where(residual != 0.0, squares_of(residual) - 1.0, 0.0))


def squares_of(residual: Real) -> Real:
    """Squares over their mean; samples of 0 do not count."""
    size = float(np.max(np.abs(residual), initial=0.0)) or 1.0
    squares = (residual / size) ** 2
    counted = max(int(np.count_nonzero(residual)), 1)
    return np.asarray(squares * (counted / max(float(squares.sum()), 1.0)))


def are_white(residuals: Real, spectra: Complex | None = None) -> Mask:
    """Ljung-Box test (Biometrika 65, 1978) over 25 lags.

    A changing level increases the scatter of each lag's covariance; such noise is white if it
    passes with its own scatter (F. X. Diebold, 1986: Testing for serial correlation in the
    presence of ARCH). White noise is called coloured at the rate `FALSE_ALARM`.

    Samples of the residuals, (..., n), that do not count are omitted or 0. `spectra`,
    (..., n // 2 + 1), are their transforms, if known.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> noise = rng.standard_normal((2, 1000))
    >>> noise[1] = np.cumsum(noise[1])
    >>> are_white(noise).tolist(), are_white(noise, scipy.fft.rfft(noise)).tolist()
    ([True, False], [True, False])
    """
    white = np.array(~_correlated(residuals, spectra))
    for row in np.argwhere(~white):
        own = residuals[tuple(row)]
        white[tuple(row)] = not is_steady(own) and not _correlated(own, steady=False)
    return white


def _correlated(residuals: Real, spectra: Complex | None = None, *, steady: bool = True) -> Mask:
    return np.asarray(ljung_box(residuals, spectra, steady=steady) <= FALSE_ALARM)


def ljung_box(residuals: Real, spectra: Complex | None = None, *, steady: bool = True) -> Real:
    """Probability of so great a Ljung-Box statistic over 25 lags, if the residuals were white.

    Samples of the residuals, (..., n), that do not count are 0; for zeros alone it is 1. If the
    level is not assumed `steady`, each lag has its own scatter.

    Examples
    --------
    >>> noise = np.random.default_rng(0).standard_normal((2, 1000))
    >>> noise[1] = np.cumsum(noise[1])
    >>> (ljung_box(noise) > 0.05).tolist()
    [True, False]
    """
    n = residuals.shape[-1]
    lags = min(_LAGS, n // 4)
    if lags == 0:
        return np.ones(residuals.shape[:-1])
    r = autocovariance(residuals, lags, spectra)
    power = np.where(r[..., :1] > 0, r[..., :1], 1.0)
    rho = (r[..., 1:] / power) ** 2
    count = np.asarray(np.count_nonzero(residuals, axis=-1))[..., None]
    if not steady:
        scatter = autocovariance(residuals**2 / power, lags)[..., 1:]  # smaller if few count
        rho, count = rho / np.where(scatter > 0, scatter, 1.0), np.full_like(count, n)
    pairs = np.maximum(count - np.arange(1, lags + 1), 1)
    statistic = np.sum(count * (count + 2) * rho / pairs, axis=-1)
    return np.where(r[..., 0] > 0, scipy.special.chdtrc(lags, statistic), 1.0)


@kept
def effective_share(residual: Real) -> float:
    """Independent samples per sample: 1 for white noise, less for coloured.

    1 / (1 + 2 Σ ρ²), the share for estimates of power (Bartlett, 1946), over the lags with a
    significant correlation.
    """
    lags = min(200, residual.size // 4)
    if is_white(residual):
        return 1.0
    r = autocovariance(residual, lags)
    return share_of(r[1:] / r[0], int(np.count_nonzero(residual)))


def share_of(rho: Real, count: int) -> float:
    """The same from the correlations, (m,), at lags from 1 on, of so many samples."""
    clear = rho[np.abs(rho) > DEVIATIONS / np.sqrt(count)]
    return float(1.0 / (1.0 + 2.0 * np.sum(clear**2)))
