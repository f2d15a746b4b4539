"""The true peaks of a waveform: every cycle is resolved, then each peak is closed in upon."""

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np

from hmpim.arguments import MOST_SAMPLES
from hmpim.errors import ArgumentError
from hmpim.stimulus.motion import Brief, FloatArray, Motion, Peaks, Piecewise, Waveform

__all__ = ["ROUGHLY", "true_peaks"]

Moved = Callable[[FloatArray], Motion]

_POINTS_PER_CYCLE = 24
ROUGHLY = 1.0 - math.cos(math.pi / _POINTS_PER_CYCLE)
"""What a peak may lose between two dense samples, as a share of itself."""

_NEAR = 0.97  # a dense sample below this share of the largest cannot hide the true peak
_BLOCK = 1 << 17
_ROUNDS = 8  # each makes the bracket 4 times narrower
# points to each side of a grid maximum: at a break three stand so close together that rounding
# alone decides which of them seems the highest
_WIDE = 3
_JUMP = 1e-6  # of the peak; less than this between two sides of an instant is rounding


def true_peaks(
    waveform: Waveform,
    *,
    start: float = 0.0,
    stop: float | None = None,
    jerk: bool = True,
    exact: bool = True,
) -> Peaks:
    """Largest |position|, |velocity|, |acceleration| and |jerk| on [start, stop].

    The waveform is evaluated densely (24 points for each cycle of its highest frequency,
    and geometrically towards the start, where a sweep with extinction turns sharply);
    each grid maximum near the largest is then enclosed ever more tightly. Where one piece
    hands over to the next both sides count, and what jumps makes its derivatives infinite.

    Parameters
    ----------
    waveform : Waveform
        Any motion in closed form.
    start, stop : float
        Span in seconds; the whole waveform by default.
    jerk : bool
        Whether the jerk is wanted; without it is infinite, that is, not known.
    exact : bool
        False takes the dense evaluation as it is, which costs a third.

    Returns
    -------
    Peaks
        Good to about 1e-10 of themselves; without `exact` too small by `ROUGHLY` at most.

    Examples
    --------
    >>> from hmpim.stimulus.sweep import Sweep
    >>> peaks = true_peaks(Sweep(band=(0.1, 10.0), duration=10.0, gain=37.385, extinction=0.0))
    >>> round(peaks.position, 2), round(peaks.velocity)
    (10.0, 628)
    """
    end = waveform.duration if stop is None else stop
    grid = _grid(waveform, start, end)
    known = jerk and waveform.motion(grid[:1]).jerk is not None
    moved: Moved = waveform.motion
    if not jerk and isinstance(waveform, Brief):
        moved = waveform.without_jerk
    orders = 4 if known else 3
    brackets: list[list[FloatArray]] = [[] for _ in range(orders)]
    coarse = np.zeros(orders)
    # blocks overlap on each side, so that every interior point has its neighbours
    for first in range(0, grid.size, _BLOCK):
        block = grid[max(first - _WIDE, 0) : first + _BLOCK + _WIDE]
        for k, size in enumerate(_magnitudes(moved(block))[:orders]):
            coarse[k] = max(coarse[k], float(size.max()))
            near = size >= _NEAR * coarse[k]
            left = np.concatenate(([True], size[1:] >= size[:-1]))
            right = np.concatenate((size[:-1] >= size[1:], [True]))
            at = np.flatnonzero(near & left & right)
            low, high = np.maximum(at - _WIDE, 0), np.minimum(at + _WIDE, block.size - 1)
            brackets[k].append(np.stack((size[at], block[low], block[at], block[high])))
    found = [float(top) for top in coarse]
    if exact:
        found = _closed_in(moved, [np.concatenate(b, axis=1) for b in brackets], coarse)
    jumping = _first_jump(waveform, found, start, end)
    found += [math.inf] * (4 - orders)
    found[jumping + 1 :] = [math.inf] * (3 - jumping)
    x, v, a, j = found
    return Peaks(position=x, velocity=v, acceleration=a, jerk=j)


def _closed_in(moved: Moved, brackets: list[FloatArray], coarse: FloatArray) -> list[float]:
    """Largest value of each derivative within its brackets; one call of the waveform a round."""
    around = [b[1:, b[0] >= _NEAR * top] for b, top in zip(brackets, coarse, strict=True)]
    best = [float(top) for top in coarse]
    orders = [k for k, top in enumerate(best) if top > 0.0]
    share = np.linspace(0.0, 1.0, 5)
    for round_ in range(_ROUNDS if orders else 0):
        times = []
        for k in orders:
            low, middle, high = around[k]
            # the middle, the highest so far, is among them
            left = low[:, None] + (middle - low)[:, None] * share[:-1]
            right = middle[:, None] + (high - middle)[:, None] * share
            times.append(np.concatenate((left, right), axis=1))
        motion = moved(np.concatenate([at.ravel() for at in times]))
        sizes = _magnitudes(motion)
        first = 0
        for k, at in zip(orders, times, strict=True):
            values = sizes[k][first : first + at.size].reshape(at.shape)
            first += at.size
            top = np.argmax(values, axis=1)
            rows = np.arange(top.size)
            best[k] = max(best[k], float(values.max()))
            # what a bracket can still hide shrinks 16-fold a round; 4-fold is the cautious bound
            keep = values[rows, top] >= (1.0 - (1.0 - _NEAR) / 4.0**round_) * best[k]
            last = at.shape[1] - 1
            columns = (np.maximum(top - 1, 0), top, np.minimum(top + 1, last))
            around[k] = np.stack([at[rows, column][keep] for column in columns])
    return best


def _magnitudes(motion: Motion) -> list[FloatArray]:
    known = [motion.position, motion.velocity, motion.acceleration]
    if motion.jerk is not None:
        known.append(motion.jerk)
    return [np.abs(values) for values in known]


def _first_jump(waveform: Waveform, peaks: list[float], start: float, stop: float) -> int:
    """Lowest derivative that jumps at a break, 3 if none below the jerk does.

    At the ends only a jump of the position counts: that a printed waveform starts with its
    velocity is known, and a stimulus with a lead does not.
    """
    if not isinstance(waveform, Piecewise):
        return 3
    at = np.array([t for t in waveform.breaks if start <= t <= stop])
    if at.size == 0:
        return 3
    inside = (at > 0.0) & (at < waveform.duration)
    before = waveform.motion(np.nextafter(at, -np.inf))
    after = waveform.motion(np.nextafter(at, np.inf))
    for order, name in enumerate(("position", "velocity", "acceleration")):
        size = np.abs(getattr(after, name) - getattr(before, name))
        if np.any(size[inside | (order == 0)] > _JUMP * peaks[order]):
            return order
    return 3


def _grid(waveform: Waveform, start: float, stop: float) -> FloatArray:
    span = stop - start
    highest = waveform.band[1] if waveform.band is not None else 0.0
    points = _POINTS_PER_CYCLE * highest * span
    if not points <= MOST_SAMPLES:
        raise ArgumentError(
            f"{span:g} s at up to {highest:g} Hz are {highest * span:.3g} cycles, and peaks are "
            f"sought in {MOST_SAMPLES / _POINTS_PER_CYCLE:.1e} at most; take a shorter time, or "
            "end the band lower"
        )
    count = math.ceil(points) + 256
    parts = [np.linspace(start, stop, count), start + span * np.geomspace(1e-9, 1.0, 256)]
    if isinstance(waveform, Piecewise):
        knots = np.array([t for t in waveform.breaks if start < t < stop])
        knots = knots[np.diff(knots, prepend=-np.inf) > 1e-12 * span]
        parts += [knots, np.nextafter(knots, -np.inf), np.nextafter(knots, np.inf)]
        parts += [np.linspace(a, b, 64) for a, b in pairwise(knots) if b - a < 0.2 * span]
    return np.unique(np.clip(np.concatenate(parts), start, stop))
