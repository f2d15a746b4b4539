"""The true peaks of a waveform: every cycle is resolved, then each peak is closed in upon."""

from itertools import pairwise

import numpy as np

from hmpim.stimulus.motion import FloatArray, Motion, Peaks, Piecewise, Waveform

__all__ = ["true_peaks"]

_POINTS_PER_CYCLE = 24
_NEAR = 0.97  # a dense sample below this share of the largest cannot hide the true peak
_BLOCK = 1 << 17
_ROUNDS = 8  # each makes the bracket 4 times narrower


def true_peaks(waveform: Waveform, *, start: float = 0.0, stop: float | None = None) -> Peaks:
    """Largest |position|, |velocity| and |acceleration| on [start, stop].

    The waveform is evaluated densely (24 points for each cycle of its highest frequency,
    and geometrically towards the start, where a sweep with extinction turns sharply);
    each grid maximum near the largest is then enclosed ever more tightly.

    Parameters
    ----------
    waveform : Waveform
        Any motion in closed form.
    start, stop : float
        Span in seconds; the whole waveform by default.

    Returns
    -------
    Peaks
        Good to about 1e-10 of themselves.

    Examples
    --------
    >>> from hmpim.stimulus.sweep import Sweep
    >>> peaks = true_peaks(Sweep(band=(0.1, 10.0), duration=10.0, gain=37.385, extinction=0.0))
    >>> round(peaks.position, 2), round(peaks.velocity)
    (10.0, 628)
    """
    end = waveform.duration if stop is None else stop
    grid = _grid(waveform, start, end)
    brackets: list[list[FloatArray]] = [[], [], []]
    coarse = np.zeros(3)
    # blocks overlap by one point on each side, so that every interior point has neighbours
    for first in range(0, grid.size, _BLOCK):
        block = grid[max(first - 1, 0) : first + _BLOCK + 1]
        for k, size in enumerate(_magnitudes(waveform.motion(block))):
            coarse[k] = max(coarse[k], float(size.max()))
            near = size >= _NEAR * coarse[k]
            left = np.concatenate(([True], size[1:] >= size[:-1]))
            right = np.concatenate((size[:-1] >= size[1:], [True]))
            at = np.flatnonzero(near & left & right)
            low, high = np.maximum(at - 1, 0), np.minimum(at + 1, block.size - 1)
            brackets[k].append(np.stack((size[at], block[low], block[high])))
    found = [
        _closed_in(waveform, k, np.concatenate(brackets[k], axis=1), coarse[k]) for k in range(3)
    ]
    return Peaks(position=found[0], velocity=found[1], acceleration=found[2])


def _closed_in(waveform: Waveform, order: int, brackets: FloatArray, coarse: float) -> float:
    _, low, high = brackets[:, brackets[0] >= _NEAR * coarse]
    best = coarse
    share = np.linspace(0.0, 1.0, 9)
    for k in range(_ROUNDS if coarse > 0.0 else 0):
        times = low[:, None] + (high - low)[:, None] * share
        values = _magnitudes(waveform.motion(times.ravel()))[order].reshape(times.shape)
        at = np.argmax(values, axis=1)
        rows = np.arange(at.size)
        best = max(best, float(values.max()))
        # what a bracket can still hide shrinks 16-fold a round; 4-fold is the cautious bound
        keep = values[rows, at] >= (1.0 - (1.0 - _NEAR) / 4.0**k) * best
        low = times[rows, np.maximum(at - 1, 0)][keep]
        high = times[rows, np.minimum(at + 1, share.size - 1)][keep]
    return float(best)


def _magnitudes(motion: Motion) -> tuple[FloatArray, FloatArray, FloatArray]:
    return np.abs(motion.position), np.abs(motion.velocity), np.abs(motion.acceleration)


def _grid(waveform: Waveform, start: float, stop: float) -> FloatArray:
    span = stop - start
    highest = waveform.band[1] if waveform.band is not None else 0.0
    count = int(np.ceil(_POINTS_PER_CYCLE * highest * span)) + 256
    parts = [np.linspace(start, stop, count), start + span * np.geomspace(1e-9, 1.0, 256)]
    if isinstance(waveform, Piecewise):
        knots = np.array([t for t in waveform.breaks if start < t < stop])
        parts.append(knots)
        parts += [np.linspace(a, b, 64) for a, b in pairwise(knots) if b - a < 0.2 * span]
    return np.unique(np.clip(np.concatenate(parts), start, stop))
