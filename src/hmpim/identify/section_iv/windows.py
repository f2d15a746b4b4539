"""Windows that taper a record's ends before its transform (paper, equations 15-16, Fig. 14)."""

from typing import Literal, get_args

import numpy as np
import scipy

from hmpim.errors import ArgumentError
from hmpim.identify.arrays import Real

__all__ = ["WindowName", "gaussian_window", "window_samples"]

WindowName = Literal[
    "gaussian",
    "rectangular",
    "bartlett",
    "hann",
    "hamming",
    "blackman",
    "blackmanharris",
    "nuttall",
    "bohman",
    "parzen",
    "cosine",
    "flattop",
    "tukey",
]
"""The Gaussian of equation (15), and the others of the kind that Fig. 14 compares."""

_NARROWEST = 1e100  # of a window: its square is still a number


def gaussian_window(samples: int, alpha: float = 1.5) -> Real:
    """Return the Gaussian window of equations (15) and (16).

    w(n) = exp(-½ [α n / (N/2)]²) for -N/2 <= n <= N/2. That range holds N + 1 points, so a
    record of `samples` samples has N = samples - 1 and both its ends are at exp(-α²/2).

    Parameters
    ----------
    samples : int
        Number of samples, at least 2.
    alpha : float
        Reciprocal of the width, positive; larger tapers the ends more (0.32 at α = 1.5).

    Returns
    -------
    ndarray, shape (samples,)
        The window, without unit, at most 1.

    Raises
    ------
    ArgumentError
        For fewer than two samples, or an `alpha` that is not positive.

    Examples
    --------
    >>> gaussian_window(5, 1.5).round(3)
    array([0.325, 0.755, 1.   , 0.755, 0.325])
    """
    _check_samples(samples)
    if not 0 < alpha <= _NARROWEST:
        raise ArgumentError(f"alpha is {alpha}; give a positive number, 1.5 in the paper")
    half = (samples - 1) / 2
    n = np.arange(samples) - half
    return np.asarray(np.exp(-0.5 * (alpha * n / half) ** 2), dtype=np.float64)


def window_samples(name: WindowName, samples: int, *, alpha: float = 1.5) -> Real:
    """Return a window by its name, symmetric.

    Parameters
    ----------
    name : str
        One of `WindowName`.
    samples : int
        Number of samples, at least 2.
    alpha : float
        Shape of the Gaussian window; the other windows take none (Tukey tapers half).

    Returns
    -------
    ndarray, shape (samples,)
        The window, without unit.

    Raises
    ------
    ArgumentError
        For an unknown name, fewer than two samples, or an `alpha` that is not positive.

    Examples
    --------
    >>> window_samples("hann", 5)
    array([0. , 0.5, 1. , 0.5, 0. ])
    """
    if name not in get_args(WindowName):
        raise ArgumentError(f"window is {name!r}; give one of {', '.join(get_args(WindowName))}")
    if name == "gaussian":
        return gaussian_window(samples, alpha)
    _check_samples(samples)
    if name == "rectangular":
        return np.ones(samples)
    # A window that must be zero at its ends comes out at -1e-17 there in some of them.
    return np.asarray(
        scipy.signal.windows.get_window(name, samples, fftbins=False), dtype=np.float64
    )


def _check_samples(samples: int) -> None:
    if samples < 2:
        raise ArgumentError(f"samples is {samples}; a window needs at least 2")
