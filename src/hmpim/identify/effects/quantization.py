"""The step to which a signal was rounded: an encoder's count, a converter's least bit.

If nothing was added after rounding, all values lie on one grid, and the distances between
neighbouring distinct values are whole multiples of the step.
"""

from dataclasses import dataclass

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.worth import FEW, NEARLY, TWICE

__all__ = ["Quantization", "detect_quantization"]

_FEWEST_LEVELS = 5
"""Fewest levels: a square wave has two, or three with its rest, and is not rounded."""

_FINEST = 2.0**-22
"""Smallest step relative to the greatest magnitude; single-precision floats round below it."""

_FINEST_DOUBLE = 2.0**-44
"""The same for values that are not single-precision numbers."""

_SOME = 256
"""Distances, evenly spread over the range, that are tested for a common step before all are."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantization:
    """Rounding of a signal to a grid."""

    # distance between neighbouring levels, and its standard deviation, in the signal's unit
    step: float
    std: float

    @property
    def noise_std(self) -> float:
        """Standard deviation of the rounding error, step / √12, in the signal's unit."""
        return float(self.step / np.sqrt(12.0))


def detect_quantization(y: Real) -> Quantization | None:
    """Return the step to which samples, (n,), were rounded, or None.

    Give the values as recorded: resampling blurs the grid. None for continuous data, for data
    rounded to significant digits rather than to a step, for fewer than five levels, and for a step
    below 2^-22 of the greatest value if all values are single-precision numbers, or else 2^-44.
    """
    largest = float(np.max(np.abs(y)))
    values = np.sort(y)  # values that differ by arithmetic alone count once
    distinct = np.diff(values) > 64 * np.finfo(float).eps * largest
    levels = values[np.concatenate([[True], distinct])]
    if levels.size < _FEWEST_LEVELS:
        return None
    inner = levels[1:-1]  # a clipping level is on no grid
    tested = inner if inner.size >= _FEWEST_LEVELS else levels
    return _by_distances(tested, largest)


def _by_distances(levels: Real, largest: float) -> Quantization | None:
    """Find the step of which all distances between neighbours are multiples."""
    gaps = np.diff(levels)
    smallest = float(gaps.min())
    # If all distances of a grid are multiples of a step, so are some of them.
    some = np.sort(gaps[:: max(1, gaps.size // _SOME)])
    finest = (_FINEST if _single(levels) else _FINEST_DOUBLE) * largest
    for divisor in (1, 2, 3):  # the smallest distance may be a few steps
        rough = smallest / divisor
        if rough < finest:
            return None
        if _common_step(some, rough, TWICE * FEW) is None:
            continue
        step = _common_step(np.sort(gaps), rough, FEW)
        fitted = None if step is None else _multiples(levels, gaps, step)
        if fitted is not None:
            return fitted
    return None


def _single(levels: Real) -> bool:
    """Whether all values are single-precision numbers."""
    with np.errstate(over="ignore"):
        return all(bool(np.all(x == x.astype(np.float32))) for x in (levels[:_SOME], levels))


def _common_step(ordered: Real, step: float, most: float) -> float | None:
    """Refine a step of which distances are multiples; None if their r.m.s. error is > `most`."""
    # Small distances first: their multiple is sure even while the step is rough.
    count = 1
    while True:
        chosen = ordered[:count]
        multiple = np.maximum(np.rint(chosen / step), 1.0)
        step = float(chosen @ multiple / (multiple @ multiple))
        if count == ordered.size:
            break
        count = min(2 * count, ordered.size)
    parts = ordered / step
    off = parts - np.maximum(np.rint(parts), 1.0)
    return step if float(np.sqrt(off @ off / off.size)) <= most else None


def _multiples(levels: Real, gaps: Real, step: float) -> Quantization | None:
    """Fit a grid of that step through all levels; None if they do not lie on one."""
    k = np.concatenate([[0.0], np.cumsum(np.maximum(np.rint(gaps / step), 1.0))])
    centred = k - k.mean()
    spread = float(centred @ centred)
    step = float(centred @ levels / spread)
    offset = float(np.mean(levels - step * k))
    error = float(np.sqrt(np.mean((levels - offset - step * k) ** 2)))
    if error > FEW * step or _significant_digits(levels, step):
        return None
    rounding = np.finfo(float).eps * float(np.max(np.abs(levels)))
    return Quantization(
        step=step,
        # The precision of a float limits that of the step.
        std=float(max(max(error, rounding) / np.sqrt(spread), np.finfo(float).eps * step)),
    )


def _significant_digits(levels: Real, step: float) -> bool:
    """Whether nearly all levels lie on a ten times coarser grid, so that few need this step."""
    if levels.size < 100:
        return False
    phase = np.exp(2j * np.pi * levels / (10.0 * step))
    near = np.abs(np.angle(phase * np.conj(phase[np.argmax(np.abs(levels))]))) < np.pi / 10
    return bool(np.mean(near) > NEARLY)
