"""What is left over: whether it is white, whether it follows the input, and its spectrum."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.identify.chance import FALSE_ALARM
from hmpim.identify.kept import kept

__all__ = [
    "Misfit",
    "are_white",
    "autocovariance",
    "autoregressive_spectrum",
    "effective_share",
    "innovation_gain",
    "is_white",
    "misfit",
    "misfits",
]

_LAGS = 25
_LONGEST_AUTOREGRESSION = 30
_FLICKER_BINS = 32
_INNOVATION_ORDER = 12
_MOST_INNOVATIONS = 100_000


def autocovariance(residual: NDArray[np.float64], lags: int) -> NDArray[np.float64]:
    """Biased autocovariance at lags 0..lags, shape (lags + 1,), the unit of residual squared.

    Examples
    --------
    >>> autocovariance(np.array([1.0, -1.0, 1.0, -1.0]), 1).round(6).tolist()
    [1.0, -0.75]
    """
    n = residual.size
    if lags <= 60 and n < 1_000_000:
        full = [float(residual[: n - k] @ residual[k:]) for k in range(lags + 1)]
        return np.array(full) / n
    length = scipy.fft.next_fast_len(n + lags + 1, real=True)
    return np.asarray(
        scipy.fft.irfft(np.abs(scipy.fft.rfft(residual, length)) ** 2, length)[: lags + 1] / n
    )


def is_white(residual: NDArray[np.float64], *, level: float = FALSE_ALARM) -> bool:
    """Ljung-Box test (Biometrika 65, 1978) over 25 lags.

    Parameters
    ----------
    residual : ndarray, shape (n,)
        With samples that do not count left out or 0.
    level : float
        Chance of calling white noise coloured.
    """
    lags = min(_LAGS, residual.size // 4)
    r = autocovariance(residual, lags)
    if r[0] == 0 or lags == 0:
        return True
    rho = r[1:] / r[0]
    n = residual.size
    statistic = n * (n + 2) * np.sum(rho**2 / (n - np.arange(1, lags + 1)))
    return bool(scipy.special.chdtrc(lags, statistic) > level)


def effective_share(residual: NDArray[np.float64]) -> float:
    """Independent samples per sample: 1 for white noise, less for coloured.

    1 / (1 + 2 Σ ρ²), the share that holds for estimates of power (Bartlett, 1946), over
    the lags at which the correlation stands out of its own scatter.
    """
    lags = min(200, residual.size // 4)
    if is_white(residual) or lags < 1:
        return 1.0
    r = autocovariance(residual, lags)
    rho = r[1:] / r[0]
    rho = rho[np.abs(rho) > 3.0 / np.sqrt(residual.size)]
    return float(1.0 / (1.0 + 2.0 * np.sum(rho**2)))


def innovation_gain(y: NDArray[np.float64], residual: NDArray[np.float64]) -> float:
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


def _innovation(x: NDArray[np.float64]) -> float:
    """Mean square of what an autoregression with a constant does not foresee."""
    order = min(_INNOVATION_ORDER, x.size // 10)
    past = [x[order - k : x.size - k] for k in range(1, order + 1)]
    rows = np.stack([np.ones(x.size - order), *past])
    weights = np.linalg.lstsq(rows.T, x[order:], rcond=None)[0]
    return float(np.mean((x[order:] - weights @ rows) ** 2))


def autoregressive_spectrum(
    residual: NDArray[np.float64], omega: NDArray[np.float64]
) -> NDArray[np.float64]:
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


def _flicker(residual: NDArray[np.float64], omega: NDArray[np.float64]) -> NDArray[np.float64]:
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Misfit:
    """How much of the residual still follows the input.

    Parameters
    ----------
    share : float
        Share of the residual's in-band power that a smooth response to the input explains,
        beyond what noise would; 0 when none.
    probability : float
        Chance of seeing so much, or more, were the model right.
    """

    share: float
    probability: float


def misfit(
    u: NDArray[np.float64],
    residual: NDArray[np.float64],
    *,
    delay: float,
    band: tuple[float, float],
    groups: int = 24,
) -> Misfit:
    """Test whether the residual is still coherent with the input.

    The residual's spectrum is divided into groups of neighbouring bins; in each, one
    complex gain from the input is fitted. Under a right model the power that it takes up
    is that of two degrees of freedom of the noise of the same group, so colour does no harm.

    Parameters
    ----------
    u, residual : ndarray, shape (n,)
        Input and residual.
    delay : float
        Delay in samples; the input is moved by it so that the gain is smooth over a group.
    band : tuple of float
        Excited band, in cycles per sample.
    groups : int
        How many groups to cut the band into, at most.
    """
    share, probability = misfits(
        _transform(u),
        scipy.fft.rfft(residual)[None],
        samples=u.size,
        delays=np.array([delay]),
        band=band,
        groups=groups,
    )
    return Misfit(share=float(share[0]), probability=float(probability[0]))


@kept
def _transform(u: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Of an input less its mean."""
    return np.asarray(scipy.fft.rfft(u - u.mean()), dtype=np.complex128)


def misfits(
    stimulus: NDArray[np.complex128],
    residuals: NDArray[np.complex128],
    *,
    samples: int,
    delays: NDArray[np.float64],
    band: tuple[float, float],
    groups: int = 24,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Test many residuals of one input as `misfit` does one; shares and probabilities.

    Parameters
    ----------
    stimulus : complex ndarray, shape (m,)
        Transform of the input less its mean.
    residuals : complex ndarray, shape (k, m)
        Transforms of the residuals.
    samples : int
        Length of each record.
    delays : ndarray, shape (k,)
        In samples.
    band, groups
        As for `misfit`.
    """
    count, n = residuals.shape[0], samples
    first = max(int(np.ceil(band[0] * n)), 1)
    last = min(int(band[1] * n), stimulus.size - 1)
    width = max((last + 1 - first) // groups, 4)
    groups = max(last + 1 - first, 0) // width
    if groups == 0:
        return np.zeros(count), np.ones(count)
    bins = np.arange(first, first + groups * width)
    U = stimulus[bins].reshape(groups, width)
    E = (residuals[:, bins] * np.exp((2j * np.pi / n) * np.outer(delays, bins))).reshape(
        count, groups, width
    )
    power = np.sum(np.abs(U) ** 2, axis=1)
    power = np.where(power > 0, power, 1.0)
    along = np.sum(U.conj() * E, axis=2) / np.sqrt(power)
    taken = along.real**2 + along.imag**2  # of any unit
    total = np.sum(E.real**2 + E.imag**2, axis=2)
    noise = (total - taken) / (width - 1)
    told = np.all(noise > 0, axis=1)
    noise, total = np.where(told[:, None], noise, 1.0), np.where(told[:, None], total, 1.0)
    # Fisher's sum over groups: each ratio is F(2, 2 width - 2), whose tail is closed.
    tail = (1.0 + taken / noise / (width - 1)) ** (-(width - 1.0))
    statistic = -2.0 * np.sum(np.log(np.maximum(tail, 1e-300)), axis=1)
    beyond = np.sum(taken - noise, axis=1) / np.sum(total, axis=1)
    return (
        np.where(told, np.maximum(beyond, 0.0), 0.0),
        np.where(told, scipy.special.chdtrc(2 * groups, statistic), 1.0),
    )


def are_white(
    residuals: NDArray[np.float64],
    spectra: NDArray[np.complex128],
    *,
    level: float = FALSE_ALARM,
) -> NDArray[np.bool_]:
    """Test many residuals of one length as `is_white` does one.

    Parameters
    ----------
    residuals : ndarray, shape (k, n)
        The residuals.
    spectra : complex ndarray, shape (k, m)
        Their transforms, which give the correlation of each with itself shifted in a circle.
    level : float
        As for `is_white`.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> noise = rng.standard_normal((2, 1000))
    >>> noise[1] = np.cumsum(noise[1])
    >>> are_white(noise, scipy.fft.rfft(noise)).tolist(), is_white(noise[1])
    ([True, False], False)
    """
    n = residuals.shape[1]
    lags = min(_LAGS, n // 4)
    if lags == 0:
        return np.ones(residuals.shape[0], dtype=bool)
    r = scipy.fft.irfft(spectra.real**2 + spectra.imag**2, n)[:, : lags + 1]
    for k in range(1, lags + 1):  # less what the end meets at the beginning
        r[:, k] -= np.einsum("ij,ij->i", residuals[:, :k], residuals[:, n - k :])
    power = np.where(r[:, :1] > 0, r[:, :1], 1.0)
    statistic = n * (n + 2) * np.sum((r[:, 1:] / power) ** 2 / (n - np.arange(1, lags + 1)), axis=1)
    white = scipy.special.chdtrc(lags, statistic) > level
    return np.asarray(white | (r[:, 0] <= 0))
