"""Least squares, where columns may differ by powers of ten and some have no content."""

import numpy as np
import scipy

from hmpim.identify.arrays import Real
from hmpim.identify.noise.covariance import WELL

__all__ = ["UNSEEN", "inverted", "solved", "solved_exactly", "without"]

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


def without(rows: Real, others: Real) -> Real:
    """Project `others`, (k, n), out of `rows`, (p, n)."""
    scale = np.sqrt(np.maximum(np.sum(others**2, axis=1), np.finfo(float).tiny))
    q, r = np.linalg.qr((others / scale[:, None]).T)
    q = q[:, np.abs(np.diag(r)) > np.sqrt(UNSEEN)]
    return np.asarray(rows - (rows @ q) @ q.T)
