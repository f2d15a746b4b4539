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

__all__ = ["Halves", "compare_halves", "halves_of"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Halves:
    """How far the halves of a record part.

    Parameters
    ----------
    probability : float
        Chance of so much or more, were one model right for both and the noise white.
    share : float
        Of the residual's power, what models of their own would explain.
    owed : float
        The same, r.m.s. over that of the whole output. Not over a half's own: of a sweep one half
        hardly moves, and friction is much of that and nothing of the record.
    """

    probability: float
    share: float
    owed: float


def compare_halves(rows: Real, residual: Real, y: Real, *, share: float) -> Halves:
    """Compare the halves of a fit.

    Parameters
    ----------
    rows : ndarray, shape (p, n)
        Derivatives of the prediction.
    residual, y : ndarray, shape (n,)
        What is left over, 0 where a sample does not count; the output about its mean, weighed
        alike.
    share : float
        Independent samples per sample.

    Examples
    --------
    >>> rows = np.ones((1, 200))
    >>> drifting = np.concatenate([-np.ones(100), np.ones(100)])
    >>> compare_halves(rows, drifting + 0.1 * rows[0], drifting, share=1.0).probability < 1e-6
    True
    """
    chance, gained = halves_of(rows[None], residual[None], share=share)
    power, size = (float(np.vecdot(x, x)) for x in (residual, y))
    return Halves(
        probability=float(chance[0]),
        share=float(gained[0]) / power if power > 0 else 0.0,
        owed=float(np.sqrt(gained[0] / size)) if size > 0 else 0.0,
    )


def halves_of(rows: Real, residual: Real, *, share: float) -> tuple[Real, Real]:
    """Compare the halves of many fits; probabilities and sums of squares gained, shape (k,).

    Parameters
    ----------
    rows : ndarray, shape (k, p, n)
        Derivatives of the predictions.
    residual : ndarray, shape (k, n)
        What is left over.
    share : float
        Independent samples per sample.
    """
    count, p, n = rows.shape
    tiny = np.finfo(float).tiny
    variance = np.vecdot(residual, residual) / max(n - p, 1)
    statistic, degrees = np.zeros(count), np.zeros(count)
    for half in (slice(0, n // 2), slice(n // 2, n)):
        part, left = rows[:, :, half], residual[:, half]
        slope = (part @ left[:, :, None])[:, :, 0]
        gram = part @ part.transpose(0, 2, 1)
        scale = np.sqrt(np.maximum(np.einsum("iaa->ia", gram), tiny))
        values, vectors = np.linalg.eigh(gram / (scale[:, :, None] * scale[:, None, :]))
        seen = values > 1e-8 * values[:, -1:]
        along = (vectors.transpose(0, 2, 1) @ (slope / scale)[:, :, None])[:, :, 0]
        gained = np.sum(np.where(seen, along**2 / np.where(seen, values, 1.0), 0.0), axis=1)
        statistic += np.minimum(gained, np.vecdot(left, left))
        degrees += np.count_nonzero(seen, axis=1)
    told = variance > 0
    free = np.maximum(degrees - p, 1)
    chance = scipy.special.chdtrc(free, share * statistic / np.where(told, variance, 1.0))
    return np.where(told, chance, 1.0), np.where(told, statistic, 0.0)
