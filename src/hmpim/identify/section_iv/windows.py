"""Windows that taper the ends of a record before its transform (equations 15-16, Fig. 14)."""

from typing import Literal, get_args

import numpy as np
import scipy

from hmpim.errors import ArgumentError
from hmpim.identify.arrays import Real
from hmpim.identify.kept import kept

__all__ = ["WindowName", "window_samples"]

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
"""The Gaussian of equation (15), and other windows such as Fig. 14 compares."""

_NARROWEST = 1e100  # its square is still finite


@kept
def window_samples(name: WindowName, samples: int, *, alpha: float = 1.5) -> Real:
    """Return a window by its name, symmetric.

    The Gaussian is that of equations (15) and (16): w(n) = exp(-½ [α n / (N/2)]²) for
    -N/2 <= n <= N/2. That range has N + 1 points, so that N = samples - 1 and both ends are at
    exp(-α²/2).

    Parameters
    ----------
    name : str
        One of `WindowName`.
    samples : int
        Number of samples, at least 2.
    alpha : float
        Reciprocal of the width of the Gaussian window, positive; a larger one tapers the ends more
        (0.32 at α = 1.5). The other windows ignore it (Tukey tapers half).

    Raises
    ------
    ArgumentError
        For an unknown name, fewer than two samples, or an `alpha` that is not positive.

    Examples
    --------
    >>> window_samples("gaussian", 5).round(3)
    array([0.325, 0.755, 1.   , 0.755, 0.325])
    """
    if name not in get_args(WindowName):
        raise ArgumentError(f"window is {name!r}; give one of {', '.join(get_args(WindowName))}")
    if samples < 2:
        raise ArgumentError(f"samples is {samples}; a window needs at least 2")
    if name == "gaussian" and not 0 < alpha <= _NARROWEST:
        raise ArgumentError(f"alpha is {alpha}; give a positive number, 1.5 in the paper")
    if name == "rectangular":
        return np.ones(samples)
    kind = (name, (samples - 1) / (2 * alpha)) if name == "gaussian" else name
    window = scipy.signal.windows.get_window(kind, samples, fftbins=False)
    return np.asarray(window, dtype=np.float64)
