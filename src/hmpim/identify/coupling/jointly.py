"""Several couplings moved at once: what one of them took of another it gives back.

Fitted one after the other, the first of two inputs that are alike at some frequencies takes a
share of the other's coupling, and the other then looks like none. So all are moved together by
Gauss-Newton steps (Levenberg-Marquardt, as in `hmpim.identify.fitting.fit`), and only then is each
one tested, the others allowed to take over.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hmpim.identify.fitting.fit import Fit, Problem, basis_rows, jacobian, moved_by
from hmpim.identify.uncertainty import covariance

__all__ = ["gained_by", "joint_covariance", "refined_together"]

_STEPS = 8
_STUCK = 1e3
"""Damping at which there is no way down."""

_PRECISION = 1e-3
"""Stop when a step lowers the sum of squares by less than this, in units of σ²."""

_UNSEEN = 1e-13
"""Share of the greatest eigenvalue below which the record does not see a direction."""

Real = NDArray[np.float64]


def refined_together(problems: Sequence[Problem], fits: Sequence[Fit], y: Real) -> list[Fit]:
    """Move the parameters of all pairs until their common sum of squares falls no more.

    Parameters
    ----------
    problems : sequence of Problem
        Source of each, and the mask and the whitening common to all.
    fits : sequence of Fit
        Starts.
    y : ndarray, shape (n,)
        What all of them and one bias are to explain together.

    Returns
    -------
    list of Fit
        One for each, against what the others leave over.
    """
    best, cost = _levelled(problems, fits, [fit.theta for fit in fits], y)
    damping = 1e-4
    for _ in range(_STEPS):
        blocks = [jacobian(p, f)[:-1] for p, f in zip(problems, best, strict=True)]
        rows = np.vstack([*blocks, problems[0].masked(np.ones(y.size))])
        residual = _whitened(problems[0], best[0])
        fell = 0.0
        while damping < _STUCK:
            step = _solved(rows, residual, damping)
            theta, start = [], 0
            for p, f, block in zip(problems, best, blocks, strict=True):
                theta.append(moved_by(p, f, step[start : start + f.theta.size]))
                start += block.shape[0]
            trial, spent = _levelled(problems, best, theta, y)
            fell = cost - spent
            if fell > 0:
                best, cost, damping = trial, spent, max(damping / 10, 1e-9)
                break
            damping *= 10
        if fell < _PRECISION * cost / problems[0].counted:
            break
    return best


def gained_by(problems: Sequence[Problem], fits: Sequence[Fit], i: int) -> float:
    """Log-likelihood that one pair's gain adds, all other parameters free to take over.

    Half of b' C⁻¹ b, b the pair's numerator, C its covariance, the pair's own poles and delay
    held: without a gain they mean nothing.
    """
    blocks = []
    for j, (p, f) in enumerate(zip(problems, fits, strict=True)):
        rows = jacobian(p, f)[:-1]
        blocks.append(rows[f.theta.size :] if j == i else rows)
    rows = np.vstack([*blocks, problems[0].masked(np.ones(problems[0].y.size))])
    residual = _whitened(problems[i], fits[i])
    full = joint_covariance(rows, residual, freedom=problems[i].counted, white=True)
    start = sum(block.shape[0] for block in blocks[:i])
    span = slice(start, start + blocks[i].shape[0])
    b = fits[i].linear[:-1]
    return float(0.5 * b @ np.linalg.pinv(full[span, span], hermitian=True) @ b)


def joint_covariance(rows: Real, residual: Real, *, freedom: int, white: bool) -> Real:
    """As `covariance`, but a direction that the record does not see spoils no other one.

    Examples
    --------
    >>> rows = np.array([[1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]])
    >>> found = joint_covariance(rows, np.ones(4), freedom=4, white=True)
    >>> bool(np.isclose(found[0, 0], 0.5)), bool(found[1, 1] > 1e6)
    (True, True)
    """
    scale = np.sqrt(np.maximum(np.sum(rows**2, axis=1), np.finfo(float).tiny ** 0.5))
    scaled = rows / scale[:, None]
    values, vectors = np.linalg.eigh(scaled @ scaled.T)
    spread = vectors / np.sqrt(np.maximum(values, _UNSEEN * values[-1]))
    if white:
        inner = np.eye(scale.size) * float(residual @ residual) / freedom
    else:
        inner = covariance(_orthogonal(spread.T @ scaled), residual, freedom=freedom, white=False)
    return np.asarray(spread @ inner @ spread.T / np.outer(scale, scale))


def _orthogonal(rows: Real) -> Real:
    """Rows of which none vanishes: one without content is given a sample of its own."""
    out = rows.copy()
    for k in np.flatnonzero(np.sum(rows**2, axis=1) < 0.5):
        out[k] = 0.0
        out[k, k % rows.shape[1]] = 1.0
    return out


def _levelled(
    problems: Sequence[Problem], fits: Sequence[Fit], theta: Sequence[Real], y: Real
) -> tuple[list[Fit], float]:
    """Solve all numerators and the bias at given delays and poles; return the cost too."""
    basis = [basis_rows(p, f.structure, t) for p, f, t in zip(problems, fits, theta, strict=True)]
    rows = np.vstack([*basis, np.ones(y.size)])
    linear = _solved(problems[0].masked(rows), problems[0].masked(y), 0.0)
    parts, start = [], 0
    for own in basis:
        parts.append(linear[start : start + own.shape[0]] @ own)
        start += own.shape[0]
    total = sum(parts, np.full(y.size, linear[-1]))
    out, start = [], 0
    for p, f, t, own, part in zip(problems, fits, theta, basis, parts, strict=True):
        residual = y - total if p.valid is None else (y - total) * p.valid
        out.append(
            replace(
                f,
                theta=t,
                linear=np.append(linear[start : start + own.shape[0]], linear[-1]),
                prediction=part + linear[-1],
                residual=residual,
                cost=float(residual @ residual),
                converged=True,
            )
        )
        start += own.shape[0]
    left = _whitened(problems[0], out[0])
    return out, float(left @ left)


def _whitened(problem: Problem, fit: Fit) -> Real:
    return problem.masked(fit.residual)


def _solved(rows: Real, y: Real, damping: float) -> Real:
    """Least squares by normal equations, scaled to unit diagonal; unseen directions stay 0."""
    gram = rows @ rows.T
    scale = np.sqrt(np.maximum(np.diag(gram), np.finfo(float).tiny ** 0.5))
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    seen = values > _UNSEEN * values[-1]
    projected = (vectors.T @ (rows @ y / scale))[seen] / (values[seen] + damping)
    return np.asarray(vectors[:, seen] @ projected / scale)
