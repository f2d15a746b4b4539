"""The noise as an autoregression: its order from the data, gaps omitted.

Least squares on the samples whose whole past is known (the covariance method: Kay, Modern
Spectral Estimation, 1988, ch. 7) estimates wander and lines without bias. One Cholesky
decomposition gives the residual power of every order; H. Akaike's criterion chooses the order
(IEEE Trans. Autom. Control 19, 1974). The products of samples and their past come from the
samples, from statistics, or, if the filter must be stable, from the autocovariance (Yule and
Walker).
"""

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.chance import COVERAGE, HALF
from hmpim.identify.kept import kept
from hmpim.identify.noise.whiteness import autocovariance
from hmpim.identify.worth import PART

__all__ = [
    "LONGEST",
    "autoregression",
    "autoregressive_spectrum",
    "deviation_of_mean",
    "innovation_gain",
    "spectrum_of_filter",
    "whitening_filter",
    "yule_walker",
]

LONGEST = 30
"""Greatest order tried."""

_BLOCK = 65_536
_FLICKER_BINS = 32
_FEWEST_BINS = 8

_SLOPES = (0.5, 1.0, 1.5)
"""Powers of 1/f between white noise and a random walk, which are autoregressions themselves."""

_INNOVATION_ORDER = 12


def autoregression(residual: Real, valid: Mask | None) -> Real:
    """Filter that whitens a residual, (n,), of zero mean; 1 first, shape (order + 1,).

    Samples that are not `valid` do not count.
    """
    longest = min(LONGEST, residual.size // 20)
    if valid is not None:  # enough samples must remain between the gaps
        ends = int(np.count_nonzero(valid[:-1] & ~valid[1:])) + 1
        longest = min(longest, int(PART * np.count_nonzero(valid) / ends))
    if longest < 1:
        return np.ones(1)
    return whitening_filter(*_moments(residual, valid, longest))


def whitening_filter(gram: Real, count: int) -> Real:
    """Whitening filter, 1 first, from the products of a sample and its past.

    `gram`, (k + 1, k + 1), holds sums over `count` samples of products of a sample, first, and the
    k before it. Akaike's criterion chooses the order, at most k.

    Examples
    --------
    >>> whitening_filter(100 * np.array([[1.0, 0.5], [0.5, 1.0]]), 100).tolist()
    [1.0, -0.49...]
    """
    if not gram[0, 0] > 0.0:
        return np.ones(1)
    shares, ordered = _innovation_shares(gram)
    order = int(np.argmin(count * np.log(shares) + 2.0 * np.arange(shares.size)))
    if order == 0:
        return np.ones(1)
    weights = np.linalg.solve(ordered[:order, :order], ordered[:order, -1])
    return np.concatenate([[1.0], -weights])


def _innovation_shares(gram: Real) -> tuple[Real, Real]:
    """Share of the power that each order cannot predict; the scaled products, the sample last."""
    scale = max(float(gram[0, 0]), np.finfo(float).tiny)
    # With the latest sample last, the factor's last row holds the power that each order explains.
    ordered = np.roll(gram, -1, axis=(0, 1)) / scale
    ordered += 1e-13 * np.trace(ordered) * np.eye(gram.shape[0])
    try:
        factor = np.linalg.cholesky(ordered)
    except np.linalg.LinAlgError:  # rounding exceeds the innovation: assume it nearer to white
        ordered -= 2.0 * np.linalg.eigvalsh(ordered)[0] * np.eye(gram.shape[0])
        factor = np.linalg.cholesky(ordered)
    explained = np.concatenate([[0.0], np.cumsum(factor[-1, :-1] ** 2)])
    return np.maximum(ordered[-1, -1] - explained, np.finfo(float).tiny), ordered


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

    Each is modelled as an autoregression of its own (order 12, by least squares, which is exact
    for wander and lines). A model gains only by explaining the unpredictable part of the output.

    Examples
    --------
    The past of a wandering output predicts all of it but noise:

    >>> rng = np.random.default_rng(0)
    >>> wander, pulses = np.cumsum(rng.standard_normal(2000)), rng.standard_normal(2000)
    >>> innovation_gain(wander, wander - wander.mean()) < 1
    True
    >>> innovation_gain(wander + 2 * pulses, wander) > 500
    True
    """
    tiny = float(np.finfo(float).tiny)
    before, after = (max(_innovation_power(x), tiny) for x in (y, residual))
    return float(0.5 * (y.size - _INNOVATION_ORDER) * np.log(before / after))


def _innovation_power(x: Real) -> float:
    """Mean square of the innovation of samples, their mean removed, at that order."""
    gram, count = _moments(x - x.mean(), None, min(_INNOVATION_ORDER, x.size // 10))
    return float(gram[0, 0] * _innovation_shares(gram)[0][-1] / count) if gram[0, 0] > 0.0 else 0.0


@kept
def yule_walker(residual: Real, longest: int = LONGEST) -> tuple[Real, float]:
    """The whitening filter from the autocovariance, always stable, and the innovation power.

    The residual, (n,), is 0 where a sample does not count. The order is at most `longest`, and a
    tenth of the number of samples.
    """
    gram = scipy.linalg.toeplitz(autocovariance(residual, min(longest, residual.size // 10)))
    noise = whitening_filter(gram, residual.size)
    return noise, float(noise @ gram[: noise.size, : noise.size] @ noise)


def spectrum_of_filter(noise: Real, omega: Real) -> Real:
    """Power spectrum of noise that a filter whitens to a power of 1, at radians per sample."""
    turns = np.exp(-1j * omega)
    return np.asarray(np.abs(np.polynomial.polynomial.polyval(turns, noise)) ** -2)


def autoregressive_spectrum(residual: Real, omega: Real) -> Real:
    """Power spectrum of a residual from an autoregression of it, at radians per sample, (m,).

    Equal to the variance at every frequency if the noise is white.
    """
    noise, innovation = yule_walker(residual)
    power = innovation * spectrum_of_filter(noise, omega)
    at = omega * residual.size / (2 * np.pi)
    low = at <= _low_bins(residual).size
    weights, kinds = _kinds(residual, noise, innovation, at[low])
    power[low] = kinds[np.argmax(weights)]
    return np.asarray(power)


def deviation_of_mean(residual: Real, counted: int) -> float:
    """Deviation of the mean of a noise over `counted` samples; 1.96 of these hold with 95 %.

    The variance of a mean is the power at half a bin over the number of samples. Only the lowest
    bins determine that power: given the kind of noise, the mean follows Student's t, and the kinds
    are averaged by their likelihood. The noise has zero mean.
    """
    weights, kinds = _kinds(residual, *yule_walker(residual), np.array([0.5]))
    spread = np.sqrt(kinds[:, 0] / counted)
    freedom = 2 * max(_low_bins(residual).size, 1)
    if not spread.any():
        return 0.0

    def outside(limit: float) -> float:
        beyond = scipy.special.stdtr(freedom, -limit / np.maximum(spread, np.finfo(float).tiny))
        return float(2.0 * weights @ beyond - (1.0 - COVERAGE))

    most = float(spread.max()) * float(scipy.special.stdtrit(freedom, 0.5 + COVERAGE / 2))
    return float(scipy.optimize.brentq(outside, 0.0, most)) / HALF


def _low_bins(residual: Real) -> Real:
    """The lowest bins, which an autoregression does not resolve; none for a short record."""
    count = min(_FLICKER_BINS, residual.size // 8)
    return np.arange(1.0, count + 1.0) if count >= _FEWEST_BINS else np.empty(0)


def _kinds(residual: Real, noise: Real, innovation: float, at: Real) -> tuple[Real, Real]:
    """Likelihood of each kind of noise by the lowest bins, (k,), and its power `at` bins, (k, m).

    The kinds are an autoregression, and power that rises towards DC as f^-α, which a short
    autoregression would level off. With unknown level, bins I around a shape s have the likelihood
    Π s⁻¹ (Σ I/s)^-N (P. Whittle, 1953); the kinds are equally likely beforehand. `noise` and
    `innovation` are from `yule_walker`.
    """
    n, bins, at = residual.size, _low_bins(residual), np.maximum(at, 0.5)
    behind = innovation * spectrum_of_filter(noise, 2 * np.pi * np.concatenate([bins, at]) / n)
    power = np.abs(scipy.fft.rfft(residual)[1 : bins.size + 1]) ** 2 / n
    if not power.any() or not behind.all():
        return np.ones(1), behind[None, bins.size :]
    rising = np.concatenate([bins, at]) ** -np.array(_SLOPES)[:, None]
    shapes = np.vstack([behind, rising])
    inside, outside = shapes[:, : bins.size], shapes[:, bins.size :]
    levels = np.mean(power / inside, axis=1)
    likelihood = -np.sum(np.log(inside), axis=1) - bins.size * np.log(levels)
    return scipy.special.softmax(likelihood), levels[:, None] * outside
