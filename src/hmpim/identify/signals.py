"""Checks of signals: finite real samples of equal length, a positive rate, a longest lag."""

import math

import numpy as np
from numpy.typing import ArrayLike

from hmpim.errors import ArgumentError, RecordError
from hmpim.identify.arrays import Real

__all__ = [
    "as_pair",
    "as_signal",
    "bins_in",
    "check_band",
    "check_rate",
    "longest_lag",
    "whole_lag",
]

_FEWEST_SAMPLES = 4

_FARTHEST = 0.85
"""Longest lag over the record's length; the remaining samples must still show a response."""


def as_signal(name: str, values: ArrayLike) -> Real:
    """Return `values` as finite samples of shape (n,), n >= 4, or refuse them.

    They are not copied where that is not needed.
    """
    if np.iscomplexobj(values):
        raise RecordError(f"{name} is complex; give real numbers, the real part for instance")
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise RecordError(f"{name} is not numeric ({error}); give real numbers") from None
    if array.ndim != 1:
        raise RecordError(f"{name} has shape {array.shape}; give one dimension, shape (n,)")
    if array.size < _FEWEST_SAMPLES:
        raise RecordError(
            f"{name} has {array.size} samples; give at least {_FEWEST_SAMPLES}, "
            "better thousands over 5 to 10 s"
        )
    # One pass: a sum is finite only if no sample is NaN or infinite (or if it overflows).
    if not math.isfinite(float(array.sum())):
        bad = np.flatnonzero(~np.isfinite(array))
        if bad.size:
            raise RecordError(
                f"{name} holds {array[bad[0]]} at sample {bad[0]}; cut it out or fill it first"
            )
    return array


def as_pair(u: ArrayLike, y: ArrayLike) -> tuple[Real, Real]:
    """Return two signals as `as_signal` does, of the same shape (n,), or refuse them."""
    first, second = as_signal("u", u), as_signal("y", y)
    if first.size != second.size:
        raise RecordError(
            f"u has {first.size} samples and y has {second.size}; cut them to the same span"
        )
    return first, second


def check_rate(fs: float) -> None:
    """Refuse a sampling rate that is not a positive number of Hz."""
    if not (math.isfinite(fs) and fs > 0):
        raise ArgumentError(f"fs is {fs}; give the sampling rate as a positive number of Hz")


def check_band(band: tuple[float, float], fs: float) -> None:
    """Refuse a band that is not 0 <= low < high <= fs/2, in Hz."""
    low, high = band
    if not (0 <= low < high <= fs / 2):
        raise ArgumentError(
            f"band is ({low}, {high}) Hz; give 0 <= low < high <= fs/2 = {fs / 2:g} Hz"
        )


def bins_in(band: tuple[float, float], step: float, bins: int) -> tuple[int, int]:
    """First and last bin of a band in Hz, without bin 0, among `bins` bins `step` Hz apart.

    If there is none, the first is greater than the last.

    Examples
    --------
    >>> bins_in((0.0, 20.0), 0.1, 1000)
    (1, 200)
    """
    first = max(math.ceil(band[0] / step - 1e-9), 1)
    return first, min(math.floor(band[1] / step + 1e-9), bins - 1)


def longest_lag(samples: int) -> int:
    """Longest lag, in samples, that is considered in a record of so many samples.

    Examples
    --------
    >>> longest_lag(1000)
    850
    """
    return int(_FARTHEST * samples)


def whole_lag(delay: float, fs: float, samples: int) -> int:
    """Whole samples of a delay, by which an output is shifted; the phase accounts for the rest.

    It is limited, since a delay of most of the record leaves too few samples.

    Examples
    --------
    >>> whole_lag(0.026, 100.0, 1000), whole_lag(-0.026, 100.0, 1000), whole_lag(12.0, 100.0, 1000)
    (2, -3, 850)
    """
    most = longest_lag(samples)
    return int(np.clip(np.floor(delay * fs + 1e-9), -most, most))
