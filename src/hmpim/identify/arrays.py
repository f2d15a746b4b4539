"""The arrays of identification: samples, spectra, and which samples count."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["Complex", "Mask", "Real", "median"]

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
Mask = NDArray[np.bool_]


def median(values: Real) -> float:
    """Return the median of a few numbers, shape (m,), m > 0: `np.median`, in a sixth of its time.

    NaN if one of them is.

    Examples
    --------
    >>> median(np.array([3.0, 1.0, 2.0])), median(np.array([4.0, 1.0, 2.0, 3.0]))
    (2.0, 2.5)
    """
    half = values.size // 2
    ordered = np.partition(values, (half - 1, half, values.size - 1))  # NaN comes last
    if np.isnan(ordered[-1]):
        return float("nan")
    if values.size % 2:
        return float(ordered[half])
    return float((ordered[half - 1] + ordered[half]) / 2)
