"""Least squares, where columns may differ by powers of ten and some have no content."""

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.identify.arrays import Real
from hmpim.identify.noise.covariance import WELL

__all__ = [
    "UNSEEN",
    "added",
    "explained",
    "inverted",
    "projected",
    "scores",
    "solved",
    "solved_exactly",
    "without",
]

UNSEEN = 1e-13
"""Share of the greatest eigenvalue below which the record does not determine a direction."""

_EXACTLY = 1e-14
"""The same share without normal equations."""


def solved_exactly(rows: Real, target: Real) -> tuple[Real, float]:
    """Least squares without normal equations, which would lose half of the digits.

    Returned are the weights, (k,), of `rows`, (k, n), and the sum of squares of the residual of
    `target`, (n,).
    """
    scale = np.sqrt(np.maximum(np.sum(rows**2, axis=1), np.finfo(float).tiny))
    found = np.linalg.lstsq((rows / scale[:, None]).T, target, rcond=_EXACTLY)[0] / scale
    residual = target - found @ rows
    return np.asarray(found), float(residual @ residual)


def solved(gram: Real, moment: Real, damping: float = 0.0) -> Real:
    """Solve normal equations, scaled to unit diagonal; undetermined directions stay 0.

    `moment` has shape (k,), or (k, m) for m right-hand sides.
    """
    diagonal = gram.diagonal()
    scale = np.sqrt(np.where(diagonal > 1e-200 * diagonal.max(), diagonal, 1.0))
    scaled = gram / (scale[:, None] * scale)
    factor, info = scipy.linalg.lapack.dpotrf(scaled)
    if not info and factor.diagonal().min() > WELL:
        if damping:
            scaled.flat[:: scale.size + 1] += damping
            factor, _ = scipy.linalg.lapack.dpotrf(scaled)
        found, _ = scipy.linalg.lapack.dpotrs(factor, (moment.T / scale).T)
        return np.asarray((found.T / scale).T)
    # eigh calls the same routine, but takes as long again to check its arguments.
    values, vectors, info = scipy.linalg.lapack.dsyevd(scaled, lower=1)
    if info:
        raise np.linalg.LinAlgError("eigenvalues of the normal equations did not converge")
    keep = values > UNSEEN * values[-1]
    directions = vectors[:, keep] / scale[:, None]
    projected = (moment.T @ directions) / (values[keep] + damping)
    return np.asarray(directions @ projected.T)


def inverted(gram: Real) -> Real:
    """Inverse of normal equations, very large along an undetermined direction.

    Where they are not definite, each curvature counts by its absolute value.
    """
    diagonal = np.abs(np.diag(gram))
    scale = np.sqrt(np.where(diagonal > 1e-200 * diagonal.max(), diagonal, 1.0))
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    values = np.abs(values)
    values = np.maximum(values, max(_EXACTLY * values.max(), np.finfo(float).tiny))
    return np.asarray((vectors / values) @ vectors.T / np.outer(scale, scale))


def added(gram: Real, mixed: Real, own: Real, cross: Real, along: Real) -> tuple[Real, Real, Real]:
    """More rows in addition to those of a model, as a score test needs them.

    `gram`, (k, k), and `cross`, (k,), are products of the model's rows among them and with the
    residual; `own`, (q, q), and `along`, (q,), those of the added rows; `mixed`, (q, k), of both.
    For a single row these are numbers and `mixed` is (k,).

    Returned are how the model's parameters change with the weights of the added rows, (k, q); and
    the products of the added rows, the model's own projected out, among them and with the residual.
    """
    shift = -solved(gram, mixed.T)
    return shift, own + mixed @ shift, along + shift.T @ cross


def projected(gram: Real, count: int) -> Real:
    """Products of the last `count` rows and the residual, the model's rows projected out.

    `gram`, (q, q), holds the products of the model's rows, of these and of the residual.
    """
    size = gram.shape[0] - count - 1
    mixed = gram[:size, size:]
    return np.asarray(gram[size:, size:] - mixed.T @ solved(gram[:size, :size], mixed))


def scores(gram: Real, count: int, *, least: float) -> tuple[Real, Real, Real, float]:
    """Score test of each of the last `count` rows alone, for `gram` as for `projected`.

    Returned are, (count,) each: the weight, the power with the model's rows projected out, and the
    share of the residual's power that the row explains. A row of which less than the share `least`
    is left has no power and explains nothing. The last value is the power of the residual.
    """
    rest, whole = projected(gram, count), gram.diagonal()[-count - 1 : -1]
    along, power, total = rest[:-1, -1], rest.diagonal()[:-1], float(rest[-1, -1])
    known = (power > least * whole) & (total > 0.0)
    power = np.where(known, power, 0.0)
    weights = np.where(known, along, 0.0) / np.where(known, power, 1.0)
    taken = weights * along / (total or 1.0)
    return weights, power, np.minimum(taken, 1.0 - np.finfo(float).eps), total


def explained(
    gram: Real, moment: Real, *, least: float, size: Real | None = None
) -> tuple[Real, NDArray[np.intp]]:
    """Power of residuals that rows explain, (...,), and the directions that they determine.

    `gram`, (..., k, k), and `moment`, (..., k), are products of the rows among them and with the
    residuals. With rows scaled to unit power, a direction is not determined below the share `least`
    of the greatest eigenvalue. `size`, (..., k), is the power of each row before the scaling, if it
    is not on the diagonal of `gram`.
    """
    power = np.diagonal(gram, axis1=-2, axis2=-1) if size is None else size
    # Rounding may leave a row less power than none: it determines nothing.
    scale = np.where(power > 0.0, np.sqrt(np.maximum(power, np.finfo(float).tiny)), np.inf)
    values, vectors = np.linalg.eigh(gram / (scale[..., :, None] * scale[..., None, :]))
    determined = values > least * (values[..., -1:] if size is None else 1.0)
    along = (vectors.swapaxes(-1, -2) @ (moment / scale)[..., None])[..., 0]
    each = np.where(determined, along, 0.0) ** 2 / np.where(determined, values, 1.0)
    return np.sum(each, axis=-1), np.count_nonzero(determined, axis=-1)


def without(rows: Real, others: Real) -> Real:
    """Project `others`, (k, n), out of `rows`, (p, n)."""
    scale = np.sqrt(np.maximum(np.sum(others**2, axis=1), np.finfo(float).tiny))
    q, r = np.linalg.qr((others / scale[:, None]).T)
    q = q[:, np.abs(np.diag(r)) > np.sqrt(UNSEEN)]
    return np.asarray(rows - (rows @ q) @ q.T)
