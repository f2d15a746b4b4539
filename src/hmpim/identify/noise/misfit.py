"""Whether what is left over still follows the input."""

from dataclasses import dataclass

import numpy as np
import scipy

from hmpim.identify.arrays import Complex, Real
from hmpim.identify.kept import kept

__all__ = ["Misfit", "misfit", "misfits"]


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
    u: Real, residual: Real, *, delay: float, band: tuple[float, float], groups: int = 24
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
def _transform(u: Real) -> Complex:
    """Of an input less its mean."""
    return np.asarray(scipy.fft.rfft(u - u.mean()), dtype=np.complex128)


def misfits(
    stimulus: Complex,
    residuals: Complex,
    *,
    samples: int,
    delays: Real,
    band: tuple[float, float],
    groups: int = 24,
) -> tuple[Real, Real]:
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
