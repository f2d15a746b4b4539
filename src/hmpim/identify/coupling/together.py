"""Several couplings moved at once: what one of them took of another it gives back.

Fitted one after the other, the first of two inputs that are alike at some frequencies takes a
share of the other's coupling, and the other then looks like none. So all are moved together
(`hmpim.identify.fitting.fit.fit_together`), and only then is each one tested, the others allowed
to take over.
"""

from collections.abc import Sequence

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.fitting.derivatives import jacobian
from hmpim.identify.fitting.fit import Fit, Problem

__all__ = ["gained_by", "joint_covariance"]

_UNSEEN = 1e-13
"""Share of the greatest eigenvalue below which the record does not see a direction."""


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
    residual = problems[i].masked(fits[i].residual)
    full = joint_covariance(rows, residual, freedom=problems[i].counted)
    start = sum(block.shape[0] for block in blocks[:i])
    span = slice(start, start + blocks[i].shape[0])
    b = fits[i].linear[:-1]
    return float(0.5 * b @ np.linalg.pinv(full[span, span], hermitian=True) @ b)


def joint_covariance(rows: Real, residual: Real, *, freedom: int) -> Real:
    """Covariance under white noise; a direction that the record does not see spoils no other one.

    Of the derivatives of the prediction, (p, n), and of what is left over, (n,).

    Examples
    --------
    >>> rows = np.array([[1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]])
    >>> found = joint_covariance(rows, np.ones(4), freedom=4)
    >>> bool(np.isclose(found[0, 0], 0.5)), bool(found[1, 1] > 1e6)
    (True, True)
    """
    scale = np.sqrt(np.maximum(np.sum(rows**2, axis=1), np.finfo(float).tiny ** 0.5))
    scaled = rows / scale[:, None]
    values, vectors = np.linalg.eigh(scaled @ scaled.T)
    spread = vectors / np.sqrt(np.maximum(values, _UNSEEN * values[-1]))
    variance = float(residual @ residual) / freedom
    return np.asarray(variance * (spread @ spread.T) / np.outer(scale, scale))
