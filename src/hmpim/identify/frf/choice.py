"""Which local fit to take at each frequency, and how much of its error is bias, not noise."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmpim.identify.arrays import Complex, Mask, Real, averaged
from hmpim.identify.frf.neighbours import LocalFit
from hmpim.identify.worth import PART, TOLERATED, TWICE

__all__ = ["choose", "needs_narrow_windows", "picked"]

# Criteria are averaged over this many frequencies on either side.
_NEIGHBOURS = 30


def choose(
    polynomials: Sequence[LocalFit], rationals: Sequence[LocalFit]
) -> tuple[NDArray[np.int64], Complex, Real]:
    """Return which fit to take at each frequency, its response, and its mean square error.

    The prediction error does not show that G and T cannot be separated in a narrow window, and the
    variance does not show the bias of a wide one. So the criterion is the variance of G plus the
    square of its bias. The bias is the larger of two: the excess of the prediction error over that
    of the best fit, referred to G by the power of U, and the distance to the same fit over the next
    narrower windows, or to that with T, beyond the variance of these (A. Goldenshluger and O.
    Lepski, Ann. Statist. 39, 2011). Then a polynomial gives way to that over the next narrower
    window if this costs little, so that curvature is small against the stated error
    (undersmoothing).

    Fits come in pairs, with T and without, in increasing widths; there may be no rational ones.
    Returned are the index in polynomials and then rationals, (..., c), the response, (..., c) or
    (..., c, m), and its variance plus squared bias.

    Examples
    --------
    >>> fit = LocalFit(
    ...     response=np.ones(3) + 0j, spread=np.ones(3), noise=np.ones(3), power=np.ones(3),
    ...     prediction_error=np.ones(3),
    ... )
    >>> chosen, response, variance = choose([fit, fit], [])
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
    # A window without a result must not spoil the averages of others.
    mean = _averaged(np.minimum(missed, 1e6 * missed.min(axis=0)))
    least = mean.min(axis=0)
    bias = np.maximum(mean - (1 + TOLERATED) * least, 0.0)[..., None] / power
    credible = (mean <= (1 + PART) * least)[..., None]
    variance = spread * least[..., None]
    # Fits come in pairs, with and without T: the same kind is two places before, one width down.
    kinds = (range(len(polynomials)), range(len(polynomials), len(tried)))
    fuller = [(k, k - 1) for kind in kinds for k in kind[1::2]]
    narrower = [(k, k - 2) for kind in kinds for k in kind[2:]]
    for pairs in (fuller, narrower):
        if pairs:
            fit, reference = np.array(pairs).T
            apart = response[fit] - response[reference]
            excess = _excess(apart, variance[reference], credible[reference])
            bias[fit] = np.maximum(bias[fit], excess)
    with np.errstate(over="ignore"):  # the cost of a hopeless fit is infinite
        cost = np.sum((variance + bias) * power[0], axis=-1)
    best = np.argmin(cost, axis=0)
    polynomial = (best >= 2) & (best < len(polynomials))
    below = np.where(polynomial, best - 2, best)
    cheap = picked(cost, below) <= TWICE * picked(cost, best)
    chosen = np.asarray(np.where(cheap, below, best), dtype=np.int64)
    error = picked(spread * np.stack([fit.noise for fit in tried])[..., None] + bias, chosen)
    return chosen, picked(response, chosen).reshape(shape), error.reshape(shape)


def needs_narrow_windows(chosen: NDArray[np.int64], widths: int) -> Mask:
    """Whether polynomials over the two widest windows do not suffice, as for noise, (...,).

    `chosen`, (..., c), are indices of two fits of each of so many widths, with T and without.

    Examples
    --------
    >>> needs_narrow_windows(np.array([[0, 1, 4, 5], [6, 7, 8, 9]]), 5).tolist()
    [True, False]
    """
    return np.asarray((chosen < 2 * (widths - 2)).mean(axis=-1) > PART)


def picked(values: NDArray[Any], chosen: NDArray[np.int64]) -> NDArray[Any]:
    """Return the chosen of the values, (k, ..., *), at each place of the choice, (...)."""
    flat = values.reshape(values.shape[0], chosen.size, *values.shape[1 + chosen.ndim :])
    return np.asarray(flat[chosen.ravel(), np.arange(chosen.size)].reshape(values.shape[1:]))


def _excess(apart: Real, variance: Real, credible: Mask) -> Real:
    """Return |difference|² beyond the variance of a credible reference, over neighbours."""
    against = np.maximum(variance, 1e-150)  # a record without noise must not overflow
    square = apart.real**2 + apart.imag**2
    places = np.where(credible, square / against - 1.0, 0.0)
    excess = _averaged(places.swapaxes(-2, -1)).swapaxes(-2, -1)
    return np.asarray(np.where(credible, np.maximum(excess, 0.0) * variance, 0.0))


def _averaged(values: Real) -> Real:
    """Average along the last axis over neighbouring frequencies."""
    return averaged(values, min(_NEIGHBOURS, values.shape[-1] // 2))
