"""The step to which a signal was rounded: an encoder's count, a converter's least bit.

There are two tests. If nothing was added after rounding, all values lie on one grid, and the
distances between neighbouring distinct values are whole multiples of the step. If a little noise,
or interpolation to another clock, came after, the values still cluster on the grid, and the mean of
exp(2πi y/Δ) stands out at Δ = step (the characteristic function of a rounded signal repeats:
B. Widrow and I. Kollár, Quantization Noise, 2008, ch. 4).
"""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.identify.arrays import Real, median
from hmpim.identify.chance import SEARCHED
from hmpim.identify.worth import FEW, MOST, NEARLY, PART, TWICE

__all__ = ["Quantization", "detect_quantization", "is_predicted"]

_FEWEST_LEVELS = 5
"""Fewest levels: a square wave has two, or three with its rest, and is not rounded."""

_FINEST = 2.0**-22
"""Smallest step relative to the greatest magnitude; single-precision floats round below it."""

_FINEST_DOUBLE = 2.0**-44
"""The same for values that are not single-precision numbers."""

_CELLS = 1 << 15
"""Cells of the histogram that is transformed; the finest step is 4 / _CELLS of the range."""

_SOME = 256
"""Distances, evenly spread over the range, that are tested for a common step before all are."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantization:
    """Rounding of a signal to a grid."""

    # distance between neighbouring levels, and its standard deviation, in the signal's unit
    step: float
    std: float
    exact: bool  # every value but the extremes lies on the grid; False if something was added later

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
    largest, span = float(np.max(np.abs(y))), float(np.ptp(y))
    if span == 0.0:
        return None
    values = np.sort(y)  # values that differ by arithmetic alone count once
    distinct = np.diff(values) > 64 * np.finfo(float).eps * largest
    levels = values[np.concatenate([[True], distinct])]
    if levels.size < _FEWEST_LEVELS:
        return None
    inner = levels[1:-1]  # a clipping level is on no grid
    tested = inner if inner.size >= _FEWEST_LEVELS else levels
    return _by_distances(tested, largest) or _by_clusters(y, span)


def is_predicted(found: Quantization, y: Real, prediction: Real) -> bool:
    """Whether a prediction and normal noise bring values as near to the grid, without rounding.

    They do if an input of few levels drives a unit without dynamics. The characteristic function
    of a sum is the product of those of its parts. Values exactly on the grid are always rounded.
    """
    if found.exact:
        return False
    omega = 2.0 * np.pi / found.step
    smeared = float(np.exp(-0.5 * omega**2 * np.mean((y - prediction) ** 2)))
    actual, expected = (abs(np.mean(np.exp(1j * omega * x))) for x in (y, prediction))
    beyond = max(float(actual - expected * smeared), 0.0)
    return y.size * beyond**2 <= SEARCHED * (1.0 - smeared**2)


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
        exact=True,
    )


def _significant_digits(levels: Real, step: float) -> bool:
    """Whether nearly all levels lie on a ten times coarser grid, so that few need this step."""
    if levels.size < 100:
        return False
    phase = np.exp(2j * np.pi * levels / (10.0 * step))
    near = np.abs(np.angle(phase * np.conj(phase[np.argmax(np.abs(levels))]))) < np.pi / 10
    return bool(np.mean(near) > NEARLY)


def _by_clusters(samples: Real, span: float) -> Quantization | None:
    """Find the step at which the values' characteristic function stands out."""
    low = float(samples.min())
    width = span * (1.0 + 1e-9) / _CELLS
    counts = np.bincount(((samples - low) / width).astype(np.intp), minlength=_CELLS)
    # Clip the count of a plateau, or it would dominate at all frequencies.
    counts = np.minimum(counts, max(3, int(3 * samples.size / _CELLS)))
    total = float(counts.sum())
    cells = counts.astype(np.float32)
    first, last = 4 * (_FEWEST_LEVELS + 1), _CELLS
    # With two points per peak, the nearest is at half its height at least.
    least = PART**2 * total**2
    if float(_power(cells, 2)[first // 2 : last // 2].max()) < (1 - PART) * MOST * least:
        return None
    power = _power(cells, 4)[:last]
    best = first + int(np.argmax(power[first:]))
    near = slice(max(first, best // 2), min(2 * best, last))
    if power[best] < max(SEARCHED / np.log(2) * median(power[near]), least):
        return None
    return _sharpened(samples, 4 * _CELLS * width / best, span)


def _power(cells: NDArray[np.float32], points: int) -> Real:
    """Power of the cells' transform, with so many points per peak."""
    spectrum = scipy.fft.rfft(cells, points * cells.size)
    return np.asarray(spectrum.real**2 + spectrum.imag**2, dtype=np.float64)


def _sharpened(samples: Real, step: float, span: float) -> Quantization | None:
    """Fit the grid to all values by least squares of their distances from it."""
    middle = float(np.median(samples))
    for _ in range(8):
        phase = np.angle(np.mean(np.exp(2j * np.pi * (samples - middle) / step)))
        origin = middle + step * phase / (2 * np.pi)
        k = np.rint((samples - origin) / step)
        centred = k - k.mean()
        spread = float(centred @ centred)
        if spread == 0.0:
            return None
        moved = float(centred @ samples / spread)
        if abs(moved - step) * span / step < 1e-9 * step:
            break
        step = moved
    error = float(np.std(samples - origin - step * k))
    if error > NEARLY * step / np.sqrt(12):  # no nearer to the grid than arbitrary values
        return None
    return Quantization(step=step, std=float(error / np.sqrt(spread)), exact=False)
