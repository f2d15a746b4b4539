"""Spectra of an input, shared by several steps."""

from functools import partial

import numpy as np
import scipy

from hmpim.identify.arrays import Complex, Real
from hmpim.identify.kept import kept

__all__ = ["transform_of", "windowed_power"]

_WEIGHTS = np.array([0.35875, -0.244145, 0.07064, -0.00584])
"""Weights by a Blackman-Harris window of a bin and each of three on either side."""


@partial(kept, long=True)
def transform_of(u: Real) -> Complex:
    """Return the transform of an input less its mean, shape (n // 2 + 1,)."""
    return np.asarray(scipy.fft.rfft(u - u.mean()), dtype=np.complex128)


@partial(kept, long=True)
def windowed_power(u: Real) -> Real:
    """Return the power in each bin after a Blackman-Harris window, without that of the mean.

    The window is a sum of four cosines, so a bin becomes a weighted sum of itself and three bins on
    either side.
    """
    n, plain = u.size, transform_of(u)
    after = plain[-4:-1] if n % 2 == 0 else plain[-3:]
    wide = np.concatenate([plain[3:0:-1].conj(), plain, after[::-1].conj()])
    energy = n * (_WEIGHTS[0] ** 2 + 2.0 * (_WEIGHTS[1:] @ _WEIGHTS[1:]))
    power = np.zeros(plain.size)
    for part in (wide.real, wide.imag):
        behind = np.convolve(part, np.concatenate([_WEIGHTS[:0:-1], _WEIGHTS]), mode="valid")
        behind[:4] -= behind[0] / _WEIGHTS[0] * _WEIGHTS
        power += behind**2
    power *= 2.0 / (energy * n)
    return power
