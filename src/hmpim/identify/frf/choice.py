"""Which local fit to take at each frequency, and how much of its error is bend, not noise."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmpim.identify.arrays import Complex, Mask, Real, averaged
from hmpim.identify.frf.neighbours import LocalFit
from hmpim.identify.worth import PART, TOLERATED, TWICE

__all__ = ["choose", "picked"]

# What is judged is averaged over this many frequencies on either side.
_NEIGHBOURS = 30


def choose(
    polynomials: Sequence[LocalFit], rationals: Sequence[LocalFit]
) -> tuple[NDArray[np.int64], Complex, Real]:
    """Return which fit to take at each frequency, and what it says, with the error it leaves in.

    Prediction alone does not see that G and T cannot be told apart in a narrow window, nor
    variance that a wide one is bent. So the error of G is weighed: its variance, plus what a
    fit predicts worse than the best of them, referred to G through the power of U, or, if that
    is more, plus what parts it from the same fit over the next narrower windows, or from that
    with T, beyond the variance of these (A. Goldenshluger and O. Lepski, Ann. Statist. 39,
    2011). Then, of polynomials, the next narrower window is taken if it costs little, so that
    what curvature leaves over is small beside the stated error (undersmoothing).

    Fits come in pairs, with T and without, widths increasing; the rational ones may be none.
    Returned are the place in polynomials and rationals, one after the other, (..., c), the response
    there, (..., c) or (..., c, m), and its variance with the square of what is bent.

    Examples
    --------
    >>> one = LocalFit(
    ...     response=np.ones(3) + 0j, spread=np.ones(3), noise=np.ones(3), power=np.ones(3),
    ...     prediction_error=np.ones(3),
    ... )
    >>> chosen, response, variance = choose([one, one], [])
    >>> chosen.tolist(), variance.tolist()
    ([0, 0, 0], [1.0, 1.0, 1.0])
    """
    tried = (*polynomials, *rationals)
    shape = tried[0].response.shape
    missed = np.stack([fit.prediction_error for fit in tried])

    def stacked(name: str, kind: type = float) -> NDArray[Any]:
        out = np.empty((len(tried), *shape), dtype=kind)
        for own, fit in zip(out, tried, strict=True):
            own[...] = getattr(fit, name)
        return out.reshape(*missed.shape, -1)

    response, spread, power = stacked("response", complex), stacked("spread"), stacked("power")
    # A window that came to nothing must not make nothing of those beyond its reach.
    mean = _averaged(np.minimum(missed, 1e6 * missed.min(axis=0)))
    least = mean.min(axis=0)
    bent = np.maximum(mean - (1 + TOLERATED) * least, 0.0)[..., None] / power
    credible = (mean <= (1 + PART) * least)[..., None]
    variance = spread * least[..., None]
    # Fits come in pairs, with and without T: the same kind one width down stands two before.
    kinds = (range(len(polynomials)), range(len(polynomials), len(tried)))
    fuller = [(k, k - 1) for kind in kinds for k in kind[1::2]]
    narrower = [(k, k - 2) for kind in kinds for k in kind[2:]]
    for pairs in (fuller, narrower):
        if pairs:
            fit, reference = np.array(pairs).T
            apart = response[fit] - response[reference]
            parted = _beyond(apart, variance[reference], credible[reference])
            bent[fit] = np.maximum(bent[fit], parted)
    with np.errstate(over="ignore"):  # a hopeless fit costs infinitely much
        cost = np.sum((variance + bent) * power[0], axis=-1)
    best = np.argmin(cost, axis=0)
    polynomial = (best >= 2) & (best < len(polynomials))
    below = np.where(polynomial, best - 2, best)
    cheap = picked(cost, below) <= TWICE * picked(cost, best)
    chosen = np.asarray(np.where(cheap, below, best), dtype=np.int64)
    told = picked(spread * np.stack([fit.noise for fit in tried])[..., None] + bent, chosen)
    return chosen, picked(response, chosen).reshape(shape), told.reshape(shape)


def picked(values: NDArray[Any], chosen: NDArray[np.int64]) -> NDArray[Any]:
    """Return at each place the one of the values, (k, ..., *), that is chosen, (...)."""
    flat = values.reshape(values.shape[0], chosen.size, *values.shape[1 + chosen.ndim :])
    told = flat[chosen.ravel(), np.arange(chosen.size)]
    return np.asarray(told.reshape(values.shape[1:]))


def _beyond(apart: Real, variance: Real, credible: Mask) -> Real:
    """Return |difference|² beyond the variance of a credible reference, over neighbours."""
    against = np.maximum(variance, 1e-150)  # a record without noise must not overflow
    square = apart.real**2 + apart.imag**2
    places = np.where(credible, square / against - 1.0, 0.0)
    excess = _averaged(places.swapaxes(-2, -1)).swapaxes(-2, -1)
    return np.asarray(np.where(credible, np.maximum(excess, 0.0) * variance, 0.0))


def _averaged(values: Real) -> Real:
    """Average along the last axis over what is judged together."""
    return averaged(values, min(_NEIGHBOURS, values.shape[-1] // 2))
