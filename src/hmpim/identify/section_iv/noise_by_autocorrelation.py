"""Measurement noise from the autocorrelation of the error, the paper's way (equation 14)."""

import math
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from hmpim.errors import ArgumentError
from hmpim.identify.section_iv.correlation import autocorrelation
from hmpim.identify.signals import as_signal

__all__ = ["Infinity", "noise_by_autocorrelation"]

Infinity = Literal["mean", "lags"]
"""How R(∞) is read: as the square of the mean, or off the autocorrelation at far lags."""


def noise_by_autocorrelation(error: ArrayLike, *, infinity: Infinity = "mean") -> float:
    """Return the standard deviation of the noise by equation (14): σ² = R(0) - R(∞).

    R is the autocorrelation (10) of the time-corrected error. R(0) is its mean square. A
    record ends, so R(∞) must be read otherwise:

    - 'mean': the square of the mean, as the paper's words have it ("the difference of the
      mean-square value and the square of the mean").
    - 'lags': the mean of R over the lags from a tenth to a half of the record, each divided
      by the number of products in it rather than by N, as one would read it off Fig. 11.

    Whatever the dynamics leave in the error counts as noise too: 0.32 where 0.1 is true in
    the paper's Fig. 17.

    Parameters
    ----------
    error : array_like, shape (n,)
        Time-corrected error of equation (9).
    infinity : {'mean', 'lags'}
        How R(∞) is read.

    Returns
    -------
    float
        Standard deviation σ, in the unit of the error; 0 where R(∞) exceeds R(0).

    Raises
    ------
    RecordError
        For fewer than four samples, NaN or infinity.
    ArgumentError
        For an unknown `infinity`.

    Examples
    --------
    >>> round(noise_by_autocorrelation([0.7, 0.5, 0.7, 0.5]), 6)
    0.1
    """
    array = as_signal("error", error)
    match infinity:
        case "mean":
            # R(0) - mean² is the variance; taken directly it does not cancel badly.
            return float(np.std(array))
        case "lags":
            n = array.size
            lag = np.arange(max(n // 10, 1), n // 2 + 1)
            far = autocorrelation(array).value[n - 1 + lag] * n / (n - lag)
            return math.sqrt(max(float(array @ array) / n - float(far.mean()), 0.0))
        case _:
            raise ArgumentError(f"infinity is {infinity!r}; give 'mean' or 'lags'")
