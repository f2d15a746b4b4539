"""The arrays of identification: samples, spectra, and which samples count."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["Complex", "Mask", "Real"]

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
Mask = NDArray[np.bool_]
