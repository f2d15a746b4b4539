"""Clipping followed by noise, detected with the help of a prediction.

No value repeats then, and the plateau is as wide as the noise. The output is compared with a
corrected prediction q, clipped and not: min(H, max(L, q)) against q itself, and against a bent q,
as a soft spring gives. The clipped samples and q are found in turn.
"""

from dataclasses import dataclass

import numpy as np

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.chance import CLEARLY, SEARCHED, deviations
from hmpim.identify.fitting.least_squares import solved
from hmpim.identify.noise.whiteness import effective_share
from hmpim.identify.worth import FEW, MUCH, WORTH

__all__ = ["Side", "corrections", "smeared_plateaus"]

_FEWEST = 12
"""Fewest samples at a level."""

_MOST = 20_000
"""Most samples used."""

_STARTS = (0.6, 0.75, 0.85, 0.92, 0.97)
"""Initial levels: quantiles of the prediction."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Side:
    """A level at which a signal was clipped."""

    level: float  # in the signal's unit
    std: float  # its standard deviation
    # (n,): samples at the level; if noise was added after clipping, those within 3.9 of its
    # standard deviations, or whose prediction lies beyond the level
    at: Mask
    exact: bool  # whether they are equal: noise after the clipping scatters them


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Split:
    """A clipped fit: its sum of squares, levels, clipped samples and corrected prediction."""

    cost: float
    low: float
    high: float
    below: Mask
    above: Mask
    unclipped: Real
    weights: Real


def smeared_plateaus(
    y: Real, prediction: Real, *, step: float = 0.0
) -> tuple[Side | None, Side | None]:
    """Find levels at which an output was clipped before noise was added.

    The prediction is that of a linear model; samples where it is beyond a level are at that level.
    `step` is that to which the output is rounded, in its unit; 0 for none. The values are the low
    and the high side, None where it is not clipped.
    """
    everything = corrections(prediction)
    every = 1 + y.size // _MOST  # some samples of a long record are enough
    rows, prediction, y = everything[:, ::every], prediction[::every], y[::every]
    sides = _falls_short(y, rows)
    if not any(sides):
        return None, None
    best = _best_split(y, rows, sides)
    # Slow noise also bends the output: fewer of its samples are independent.
    model = np.clip(best.unclipped, best.low, best.high)
    variance = best.cost / y.size / effective_share(y - model)
    bent = np.vstack([rows, prediction**2, prediction**3])
    if _cost(y, bent) - best.cost < 2 * CLEARLY * variance:
        return None, None
    least = max(MUCH * float(np.sqrt(best.cost / y.size)), step, WORTH * float(np.ptp(y)))
    excess = np.abs(best.unclipped - model)
    kept = tuple(
        bool(np.any(clipped) and np.mean(excess[clipped]) > least)
        and _holds(y, rows, best, clipped, others, variance)
        for clipped, others in ((best.below, (False, sides[1])), (best.above, (sides[0], False)))
    )
    sigma, unclipped = float(np.sqrt(variance)), best.weights @ everything

    def side(level: float, clipped: Mask, at: Mask) -> Side:
        std = sigma / float(np.sqrt(max(int(np.count_nonzero(clipped)), 1)))
        return Side(level=level, std=std, at=at, exact=False)

    return (
        side(best.low, best.below, unclipped < best.low) if kept[0] else None,
        side(best.high, best.above, unclipped > best.high) if kept[1] else None,
    )


def corrections(prediction: Real) -> Real:
    """Rows, (4, n), that correct the bias, gain and timing of a prediction."""
    slope = np.gradient(prediction)
    return np.stack([np.ones(prediction.size), prediction, slope, np.gradient(slope)])


def _cost(y: Real, rows: Real) -> float:
    weights = solved(rows @ rows.T, rows @ y)
    return float(np.sum((y - weights @ rows) ** 2))


def _falls_short(y: Real, rows: Real) -> tuple[bool, bool]:
    """Whether the output falls short of the prediction at its low and at its high end."""
    p = rows[1]
    low, high = np.quantile(p, [0.1, 0.9])
    found = []
    for hinge in (np.minimum(p - low, 0.0), np.maximum(p - high, 0.0)):
        q, r = np.linalg.qr(np.vstack([rows, hinge]).T)
        if abs(r[-1, -1]) <= 1e-9 * float(np.linalg.norm(p)):
            found.append(False)
            continue
        weight = float(q[:, -1] @ y) / r[-1, -1]
        residual = y - q @ (q.T @ y)
        error = float(np.sqrt(residual @ residual / y.size)) / abs(r[-1, -1])
        found.append(weight < -max(deviations(2) * error, FEW))
    return found[0], found[1]


def _best_split(y: Real, rows: Real, sides: tuple[bool, bool]) -> _Split:
    """The best clipped fit from all starts."""
    found = []
    for quantile in _STARTS:
        low, high = np.quantile(rows[1], [1.0 - quantile, quantile])
        found.append(_settled(y, rows, low if sides[0] else -np.inf, high if sides[1] else np.inf))
    return min(found, key=lambda one: one.cost)


def _settled(y: Real, rows: Real, low: float, high: float) -> _Split:
    """Fit levels and correction in turn, until the clipped samples stay the same."""
    q, weights = rows[1], np.zeros(rows.shape[0])
    below, above = q < low, q > high
    for _ in range(30):
        free = ~(below | above)
        used = rows[:, free]
        weights = solved(used @ used.T, used @ y[free])
        q = weights @ rows
        if below.any():
            low = float(np.mean(y[below]))
        if above.any():
            high = float(np.mean(y[above]))
        before = below, above
        below, above = (q < low) & np.isfinite(low), (q > high) & np.isfinite(high)
        if np.array_equal(before, (below, above)):
            break
    cost = float(np.sum((y - np.clip(q, low, high)) ** 2))
    return _Split(
        cost=cost, low=low, high=high, below=below, above=above, unclipped=q, weights=weights
    )


def _holds(
    y: Real, rows: Real, best: _Split, clipped: Mask, others: tuple[bool, bool], variance: float
) -> bool:
    """Whether one side's plateau is necessary, and flat."""
    if np.count_nonzero(clipped) < _FEWEST:
        return False
    q = best.unclipped[clipped]
    centred = q - q.mean()
    slope = float(centred @ y[clipped]) / float(centred @ centred)
    error = float(np.sqrt(variance / (centred @ centred)))
    if slope > MUCH + 2 * error:
        return False
    cost = _best_split(y, rows, others).cost if any(others) else _cost(y, rows)
    return cost - best.cost > 2 * SEARCHED * variance
