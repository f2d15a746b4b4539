"""What a record can tell: the Cramér-Rao bound of the true structure, by numerical derivatives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from families.noise import Noise

__all__ = ["Information", "derivatives", "information", "propagated", "spread"]

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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Information:
    """What n samples say of p parameters, q nuisances fitted with them.

    Parameters
    ----------
    covariance : ndarray, shape (p, p)
        The bound; infinite for a direction that the record does not see.
    rows : ndarray, shape (n, p + q)
        Derivatives of the output.
    gain : ndarray, shape (p + q, n)
        The best linear estimator: from what is left over to how far the parameters move.
    """

    covariance: np.ndarray
    rows: np.ndarray
    gain: np.ndarray


def information(
    rows: np.ndarray,
    noise: Noise,
    *,
    valid: np.ndarray | None = None,
    nuisances: Sequence[np.ndarray] = (),
) -> Information:
    """The Cramér-Rao bound in Gaussian noise of a known covariance, of the valid samples."""
    count = rows.shape[1]
    full = np.column_stack([rows, *nuisances])
    size = np.linalg.norm(full, axis=0)
    size[size == 0] = 1.0
    scaled = full / size
    if noise.is_white:
        kept = scaled if valid is None else np.where(valid[:, None], scaled, 0.0)
        left, s, v = np.linalg.svd(kept, full_matrices=False)
        seen = s > 1e-11 * s.max()
        gain = (v[seen].T / s[seen]) @ left[:, seen].T
        inverse = noise.variance * (v[seen].T / s[seen] ** 2) @ v[seen]
        hidden = v[~seen]
    else:
        weighed = noise.solve(scaled, valid)
        fisher = scaled.T @ weighed
        values, vectors = np.linalg.eigh((fisher + fisher.T) / 2)
        seen = values > 1e-13 * values.max()
        inverse = (vectors[:, seen] / values[seen]) @ vectors[:, seen].T
        gain = inverse @ weighed.T
        hidden = vectors[:, ~seen].T
    if hidden.size:
        unseen = np.sum(hidden**2, axis=0) > 1e-9
        inverse[unseen, unseen] = np.inf
    covariance = (inverse / size / size[:, None])[:count, :count]
    return Information(covariance=covariance, rows=full, gain=gain / size[:, None])


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
