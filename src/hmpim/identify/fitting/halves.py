"""Whether the two halves of a record tell the same model.

At the optimum of the whole record the slope of its sum of squares is zero, but that of either half
need not be. One step of Gauss-Newton on a half says by how much a model of its own would lower
its sum of squares: the score test (C. R. Rao, Proc. Cambridge Phil. Soc. 44, 1948), at the cost
of a small matrix. A plant that warms up, a sweep whose second half is nonlinear, and a slipping
coupling show here.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from hmpim.identify.arrays import Real

__all__ = ["Halves", "compare_halves"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Halves:
    """How far the halves of a record part.

    Parameters
    ----------
    probability : float
        Chance of so much or more, were one model right for both and the noise white.
    owed : float
        What a half would gain from a model of its own, r.m.s. over that of its own output
        about the mean; the greater of the two.
    """

    probability: float
    owed: float


def compare_halves(rows: Real, residual: Real, y: Real, *, share: float) -> Halves:
    """Compare the halves of a fit.

    Parameters
    ----------
    rows : ndarray, shape (p, n)
        Derivatives of the prediction.
    residual, y : ndarray, shape (n,)
        What is left over, 0 where a sample does not count; the output.
    share : float
        Independent samples per sample.

    Examples
    --------
    >>> rows = np.ones((1, 200))
    >>> drifting = np.concatenate([-np.ones(100), np.ones(100)])
    >>> compare_halves(rows, drifting + 0.1 * rows[0], drifting, share=1.0).probability < 1e-6
    True
    """
    n = residual.size
    variance = float(residual @ residual) / max(n - rows.shape[0], 1)
    statistic, degrees, owed = 0.0, 0, 0.0
    for half in (slice(0, n // 2), slice(n // 2, n)):
        part, left, out = rows[:, half], residual[half], y[half]
        slope = part @ left
        gram = part @ part.T
        scale = np.sqrt(np.maximum(np.diag(gram), np.finfo(float).tiny))
        values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
        seen = values > 1e-8 * values[-1]
        gained = float(np.sum((vectors.T @ (slope / scale))[seen] ** 2 / values[seen]))
        gained = min(gained, float(left @ left))
        statistic += gained
        degrees += int(np.count_nonzero(seen))
        spread = float(np.sum((out - out.mean()) ** 2))
        owed = max(owed, float(np.sqrt(gained / spread)) if spread else 0.0)
    if variance == 0.0:
        return Halves(probability=1.0, owed=0.0)
    free = max(degrees - rows.shape[0], 1)
    return Halves(
        probability=float(scipy.special.chdtrc(free, share * statistic / variance)), owed=owed
    )
