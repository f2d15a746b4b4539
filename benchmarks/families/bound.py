"""What a record can tell: the Cramér-Rao bound of the true structure, by numerical derivatives."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from families.noise import Noise

__all__ = ["derivatives", "information", "propagated", "spread"]

Output = Callable[[np.ndarray], np.ndarray]


def derivatives(output: Output, vector: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Central differences of an output of any shape (n,): shape (n, p)."""
    columns = []
    for k, step in enumerate(steps):
        up, down = vector.copy(), vector.copy()
        up[k] += step
        down[k] -= step
        columns.append((output(up) - output(down)) / (2 * step))
    return np.stack(columns, axis=-1)


def information(
    rows: np.ndarray, noise: Noise, *, valid: np.ndarray | None, nuisances: np.ndarray | None = None
) -> np.ndarray:
    """Covariance of the parameters, shape (p, p), nuisances fitted with them.

    A direction that the record does not see gets an infinite variance.
    """
    count = rows.shape[1]
    full = rows if nuisances is None else np.hstack([rows, nuisances])
    size = np.linalg.norm(full, axis=0)
    size[size == 0] = 1.0
    scaled = full / size
    if noise.is_white:
        kept = scaled if valid is None else scaled[valid]
        _, s, v = np.linalg.svd(kept, full_matrices=False)
        s = s / np.sqrt(noise.variance)
        values, vectors = s**2, v.T
    else:
        fisher = scaled.T @ noise.solve(scaled, valid)
        values, vectors = np.linalg.eigh((fisher + fisher.T) / 2)
    floor = 1e-22 if noise.is_white else 1e-13
    seen = values > floor * values.max()
    inverse = (vectors[:, seen] / values[seen]) @ vectors[:, seen].T
    if not seen.all():
        hidden = np.sum(vectors[:, ~seen] ** 2, axis=1) > 1e-9
        inverse[hidden, hidden] = np.inf
    return (inverse / size / size[:, None])[:count, :count]


def propagated(
    function: Callable[[np.ndarray], dict[str, float]],
    vector: np.ndarray,
    steps: np.ndarray,
    covariance: np.ndarray,
) -> dict[str, float]:
    """Standard deviation of named functions of the parameters, to first order."""
    here = function(vector)
    slopes = {name: np.zeros(vector.size) for name in here}
    for k, step in enumerate(steps):
        up, down = vector.copy(), vector.copy()
        up[k] += step
        down[k] -= step
        above, below = function(up), function(down)
        for name in slopes:
            if name in above and name in below:
                slopes[name][k] = (above[name] - below[name]) / (2 * step)
            else:
                slopes[name][k] = np.nan
    return {name: spread(slope, covariance) for name, slope in slopes.items()}


def spread(slope: np.ndarray, covariance: np.ndarray) -> float:
    """Standard deviation of slope · parameters; infinite where an unseen direction enters."""
    used = np.abs(slope) > 0
    if not np.isfinite(slope).all() or np.isinf(np.diag(covariance)[used]).any():
        return float("inf")
    return float(np.sqrt(max(slope[used] @ covariance[np.ix_(used, used)] @ slope[used], 0.0)))
