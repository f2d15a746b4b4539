"""Samples without information: spikes, repeated frames, and stretches of standstill.

A spike is a sample or two that stand out of the residual around them, farther than the motion of
the model explains. An output that repeats one value exactly, while the model moves on, was not
updated, was cut off, or is a fixed word.
"""

from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from hmpim.identify.arrays import Mask, Real, every_of
from hmpim.identify.chance import BULK, DEVIATIONS
from hmpim.identify.worth import FEW, MOST, MUCH, PART, TWICE, WORTH
from hmpim.record.runs import runs_of

__all__ = [
    "find_frozen",
    "find_repeated",
    "find_spikes",
    "find_stuck",
    "stand_out",
]

_LONGEST_SPIKE = 3
_WINDOW = 51

_FEWEST_EQUAL = 8
"""Equal samples in a row from which an output may stand still."""

_LONGEST_COPY = 3
"""Most samples in a row that copy the frame before a lost one."""


def stand_out(residuals: Real) -> Mask:
    """Which residuals, (..., n), have a sample far beyond their bulk, (...); quick, needs no model.

    Examples
    --------
    >>> noise = np.random.default_rng(0).standard_normal((2, 1000))
    >>> noise[1, 500] = 20.0
    >>> stand_out(noise).tolist()
    [False, True]
    """
    some = slice(None, None, every_of(residuals.shape[-1]))
    away = np.abs(residuals - np.median(residuals[..., some], axis=-1, keepdims=True))
    bulk = np.median(away[..., some], axis=-1)
    # Twice what chance allows: noise need not be Gaussian.
    return np.asarray((away.max(axis=-1) > TWICE * DEVIATIONS / BULK * bulk) & (bulk > 0.0))


def find_spikes(y: Real, prediction: Real, *, clipped: Mask | None = None) -> Mask | None:
    """Return the samples that are spikes compared with a first model's prediction, or None.

    `clipped` samples are ignored.
    """
    residual = y - prediction
    counted = residual if clipped is None else residual[~clipped]
    if counted.size < 2 * _WINDOW or not stand_out(counted):
        return None
    bulk = float(np.median(np.abs(counted - np.median(counted)))) / BULK
    if clipped is not None:
        residual = np.where(clipped, np.median(counted), residual)
    around = sliding_window_view(np.pad(residual, _WINDOW // 2, mode="reflect"), _WINDOW)
    level = np.median(around, axis=1)
    distance = np.abs(residual - level)
    motion = np.ptp(sliding_window_view(np.pad(prediction, 1, mode="edge"), 3), axis=1)
    # A late sample differs by its motion at most, and is no spike.
    away = distance > np.maximum(TWICE * DEVIATIONS * 0.5 * bulk, motion)
    spread = np.median(np.abs(around[away] - level[away, None]), axis=1) / BULK
    away[away] = distance[away] > TWICE * DEVIATIONS * spread
    for a, b in zip(*runs_of(away), strict=True):
        if b - a > _LONGEST_SPIKE:
            away[a:b] = False
    return away if away.any() and np.mean(away) < MUCH else None


def find_frozen(y: Real, prediction: Real, *, step: float = 0.0) -> Mask | None:
    """Return the samples at which the output stands still while the model moves, or None.

    `step` is the rounding step of the output, in its unit; 0 for none.
    """
    repeats = np.concatenate([[False], np.diff(y) == 0.0])
    frozen = np.zeros(y.size, dtype=bool)
    least = max(5.0 * step, FEW * float(np.ptp(prediction)))
    for a, b in zip(*runs_of(repeats), strict=True):
        if b - a + 1 < _FEWEST_EQUAL or y[a] in (y.min(), y.max()):
            continue
        if float(np.ptp(prediction[a - 1 : b])) > least:
            frozen[a:b] = True
    others = repeats[~frozen]
    if not frozen.any() or others.size == 0 or np.mean(others) > MUCH:
        return None
    return frozen


def find_stuck(y: Real, inputs: Sequence[Real]) -> Mask | None:
    """Return the samples at which the output stands still to its end while an input moves, or None.

    It needs no model, and runs before the first fit, which a sensor stuck for much of the record
    would spoil. A standstill at the lowest or highest value is clipping.
    """
    if y.size < _FEWEST_EQUAL or y[-1] != y[-2] or y[-1] in (y.min(), y.max()):
        return None
    first = int(np.flatnonzero(y != y[-1])[-1]) + 2
    others = np.diff(y[:first]) == 0.0
    if y.size - first < PART * y.size or np.mean(others) > MUCH:
        return None
    if not any(np.ptp(u[first:]) > MOST * np.ptp(u) for u in inputs):
        return None
    return np.arange(y.size) >= first


def find_repeated(y: Real) -> Mask | None:
    """Return the samples that repeat the one before to the last digit, while all around moves.

    A lost frame is often replaced by the one before. An output that is rounded, held or at rest
    repeats itself too, but not for just a sample or two now and then. Equal samples at the highest
    or lowest value may be clipped: they count only in addition to others.
    """
    copies = np.concatenate([[False], np.diff(y) == 0.0])
    if not copies.any() or np.mean(copies) > PART:
        return None
    extreme, inside = (y.min(), y.max()), 0
    for a, b in zip(*runs_of(copies), strict=True):
        if b - a > _LONGEST_COPY or (y[a] in extreme and np.count_nonzero(y == y[a]) > b - a + 1):
            copies[a:b] = False
        elif y[a] not in extreme:
            inside += b - a
    return copies if inside >= max(3, WORTH * y.size) else None
