"""Levels at which a signal was clipped, and the samples at them.

A clipped signal spends far more time at its extreme than just below it. So does a settled step or
a square wave; but only if it was clipped does a model's prediction exceed the level.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import scipy

from hmpim.identify.arrays import Mask, Real, every_of, median
from hmpim.identify.chance import BULK, FALSE_ALARM, ONE_SIDED
from hmpim.identify.effects.smeared import Side, corrections, smeared_plateaus
from hmpim.identify.worth import FEW, MATERIAL, MOST, MUCH, ROUNDING

__all__ = ["Saturation", "detect_saturation", "goes_beyond"]

_CROWDED = 3.5
"""Samples at a flattened crest, as of sin x + (1/9) sin 3x, over those expected from just below;
a sinusoid's gives 2.4 to 3."""

_FEWEST = 8
"""Fewest samples at the level."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Saturation:
    """Clipping of a signal at its lower and upper level; None where it is not clipped."""

    low: Side | None
    high: Side | None
    tolerance: float  # half the rounding step: a value so far inside the level may read as it

    @property
    def sides(self) -> tuple[Side, ...]:
        """The levels at which it is clipped."""
        return tuple(side for side in (self.low, self.high) if side is not None)

    @property
    def noise(self) -> Literal["before", "after"]:
        """Whether noise was added before the clipping, or after it."""
        return "before" if all(side.exact for side in self.sides) else "after"

    @property
    def clipped(self) -> Mask:
        """Samples at either level, shape (n,); there must be one."""
        return np.asarray(np.logical_or.reduce([side.at for side in self.sides]))

    @property
    def share(self) -> float:
        """Share of all samples that is clipped."""
        return float(np.mean(self.clipped))


def detect_saturation(y: Real, prediction: Real, *, step: float = 0.0) -> Saturation:
    """Find the levels at which `y`, (n,), was clipped; None where there is no clipping.

    The prediction is that of a linear model, (n,). It need not be good: its gain and timing are
    corrected on the samples that are not at the level. `step` is that to which `y` is rounded, in
    its unit; 0 for none (see `detect_quantization`).
    """
    scatter = _scatter(y)
    high = _upper(y, prediction, step, scatter)
    low = _upper(-y, -prediction, step, scatter)
    if low is not None:
        low = replace(low, level=-low.level)
    if high is None and low is None:  # noise may hide the plateau
        low, high = smeared_plateaus(y, prediction, step=step)
    return Saturation(low=low, high=high, tolerance=0.5 * step)


def _upper(y: Real, prediction: Real, step: float, scatter: float) -> Side | None:
    """The upper level of equal values; None where there is none."""
    span = float(np.ptp(y))
    side = _exact(y, span, step)
    clipped = side is not None and _is_clipped(y, side, prediction, step, span, scatter)
    return side if clipped else None


def _spread(x: Real) -> float:
    """Standard deviation of the bulk, from the median magnitude."""
    return median(np.abs(x - median(x))) / BULK


def _scatter(y: Real) -> float:
    """Standard deviation of the noise, from third differences of (at most some) samples."""
    every = every_of(y.size)
    first, second, third, last = (y[k : y.size - 3 + k : every] for k in range(4))
    return _spread(last - first + 3.0 * (second - third)) / float(np.sqrt(20.0))


def _exact(y: Real, span: float, step: float) -> Side | None:
    """The greatest value, if enough samples share it."""
    rounding = max(1e-11 * span, 8 * np.finfo(float).eps * float(np.max(np.abs(y))))
    tolerance = max(rounding, 0.5 * step)
    top = float(y.max())
    at = y >= top - tolerance
    if np.count_nonzero(at) < _FEWEST:
        return None
    error = step / np.sqrt(12.0) if step else rounding
    return Side(level=top, std=float(error), at=at, exact=True)


def _is_clipped(
    y: Real, side: Side, prediction: Real, step: float, span: float, scatter: float
) -> bool:
    """Whether a level is one of clipping, by the values near it and by the prediction."""
    # The level covers half a step on either side.
    resolution = 2.0 * max(float(side.level - y[side.at].min()), 0.5 * step, 1e-9 * span)
    distance = side.level - y[~side.at]
    reach = resolution + MUCH * span
    below = distance[(distance >= 0) & (distance < reach)]
    count = int(np.count_nonzero(side.at))
    crowded = _is_crowded(count, below, resolution)
    return crowded and _is_confirmed(y, side, prediction, resolution, scatter)


def _is_crowded(count: int, below: Real, resolution: float) -> bool:
    """Whether the level has more samples than a crest would, given those just below it."""
    if below.size == 0:
        return True
    nearest = min(max(40, count // 4), count, below.size)
    room = max(float(np.partition(below, nearest - 1)[nearest - 1]), 2.0 * resolution) - resolution
    found = np.count_nonzero(below < room + resolution) + 1
    expected = found * resolution / room
    return bool(scipy.special.pdtrc(count - 1, _CROWDED * expected) < FALSE_ALARM)


def goes_beyond(found: Saturation, y: Real, prediction: Real) -> bool:
    """Whether a prediction, (n,), exceeds a clipping level of `y` that was found with another.

    Examples
    --------
    >>> wave = np.sin(np.arange(1000) / 50)
    >>> y = np.clip(wave, -2.0, 0.8)
    >>> found = detect_saturation(y, wave)
    >>> goes_beyond(found, y, wave), goes_beyond(found, y, y)
    (True, False)
    """
    for side in found.sides:
        sign = -1.0 if side is found.low else 1.0
        ahead = _beyond(sign * y, sign * side.level, side.at, sign * prediction, 0.0)
        if ahead is not None and _is_passed(*ahead, side.at, ROUNDING * float(np.ptp(y))):
            return True
    return False


def _beyond(
    y: Real, level: float, at: Mask, prediction: Real, resolution: float
) -> tuple[Real, float] | None:
    """Distance of the corrected prediction beyond the level, and its error.

    Its gain, bias and timing are corrected on the samples that are not at the level.
    """
    rows, free = corrections(prediction), ~at
    between = free & (y > y.min() + resolution)  # the other end may be clipped too
    if np.count_nonzero(between) > FEW * y.size:
        free = between
    if np.count_nonzero(free) < 4 * rows.shape[0]:
        return None
    weights = np.linalg.lstsq(rows[:, free].T, y[free], rcond=None)[0]
    corrected = weights @ rows
    return (corrected - level)[at], _spread((y - corrected)[free])


def _is_passed(beyond: Real, error: float, at: Mask, resolution: float) -> bool:
    """Whether most of a prediction lies beyond the level, by more than its error."""
    runs = int(np.count_nonzero(at[1:] & ~at[:-1])) + 1
    least = max(ONE_SIDED * error / np.sqrt(runs), 0.5 * error, 0.5 * resolution)
    return bool(np.mean(beyond) > least and np.mean(beyond > 0) > MOST)


def _is_confirmed(y: Real, side: Side, prediction: Real, resolution: float, scatter: float) -> bool:
    """Whether the prediction exceeds the level, or moves while the values stand still."""
    ahead = _beyond(y, side.level, side.at, prediction, resolution)
    if ahead is None:
        return False
    beyond, error = ahead
    if _is_passed(beyond, error, side.at, resolution):
        return True
    # Values that scatter elsewhere are all alike here, while the prediction moves.
    noise = min(error, scatter)
    least = max(MUCH * noise, MATERIAL * float(np.ptp(y)))
    return bool(noise > resolution and np.std(beyond) > least)
