"""Whether one model fits both halves of a record.

At the optimum of the whole record the gradient of its sum of squares is zero, but that of a half
need not be. One Gauss-Newton step on a half gives the reduction of its sum of squares by a model
of its own: the score test (C. R. Rao, Proc. Cambridge Phil. Soc. 44, 1948), at the cost of a small
matrix. It detects a plant that warms up, a sweep with a nonlinear second half, and a slipping
coupling.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from hmpim.identify.arrays import Real
from hmpim.identify.fitting.least_squares import explained

__all__ = ["Halves", "compare_halves", "halves_of", "products_of_halves"]

_DETERMINED = 1e-8
"""Share of the greatest direction, below which a half does not determine a direction."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Halves:
    """How much the halves of a record differ."""

    # chance of so large a difference if one model were right for both and the noise white
    probability: float
    share: float  # of the residual's power that a model for each half would explain
    # the same as an r.m.s., over that of the whole output. In one half of a sweep the output hardly
    # moves; friction is much of that half, but little of the record
    owed: float


def compare_halves(halves: Real, y: Real, *, share: float) -> Halves:
    """Compare the halves of a fit, from `products_of_halves`, (2, p + 1, p + 1).

    `y`, (n,), is the output about its mean, weighted like the residual, 0 where a sample does not
    count; `share` is that of independent samples.
    """
    chance, gained = halves_of(halves[:, None], y.size, share=share)
    power, size = float(halves[:, -1, -1].sum()), float(np.vecdot(y, y))
    return Halves(
        probability=float(chance[0]),
        share=float(gained[0]) / power if power > 0 else 0.0,
        owed=float(np.sqrt(gained[0] / size)) if size > 0 else 0.0,
    )


def products_of_halves(rows: Real, residual: Real) -> Real:
    """Products of rows, (..., p, n), and residuals, (..., n), over either half of a record.

    The shape is (2, ..., p + 1, p + 1), the residual last.
    """
    every, middle = np.concatenate([rows, residual[..., None, :]], axis=-2), rows.shape[-1] // 2
    parts = (every[..., :middle], every[..., middle:])
    return np.stack([part @ part.swapaxes(-1, -2) for part in parts])


def halves_of(halves: Real, samples: int, *, share: float) -> tuple[Real, Real]:
    """Compare the halves of many fits; probabilities and sums of squares gained, shape (k,).

    `halves`, (2, k, p + 1, p + 1), are from `products_of_halves`, of the derivatives of the
    predictions, over a record of so many samples; `share` is that of independent samples.
    """
    count, p = halves.shape[1], halves.shape[-1] - 1
    variance = halves[:, :, p, p].sum(axis=0) / max(samples - p, 1)
    statistic, degrees = np.zeros(count), np.zeros(count)
    for half in halves:
        gained, determined = explained(half[:, :p, :p], half[:, :p, p], least=_DETERMINED)
        statistic += np.minimum(gained, half[:, p, p])
        degrees += determined
    noisy = variance > 0
    free = np.maximum(degrees - p, 1)
    chance = scipy.special.chdtrc(free, share * statistic / np.where(noisy, variance, 1.0))
    return np.where(noisy, chance, 1.0), np.where(noisy, statistic, 0.0)
