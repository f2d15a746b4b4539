"""Long curves, drawn with few points and no peak lost."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

__all__ = ["MOST_POINTS", "Spacing", "envelope"]

MOST_POINTS = 4000  # more than a page or a screen can show
Spacing = Literal["linear", "log"]


def envelope(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    *,
    most_points: int = MOST_POINTS,
    spacing: Spacing = "linear",
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Replace a long curve by the minimum and maximum of each of its slices.

    Parameters
    ----------
    x, y : ndarray, shape (n,)
        The curve, `x` increasing.
    most_points : int
        A curve of so many points or fewer is returned as it is; at least 4.
    spacing : {'linear', 'log'}
        Slices of equal width on this kind of axis.

    Returns
    -------
    x, y : ndarray, shape (m,)
        m <= most_points. A slice's lowest and highest point stand at its own `x`, in the
        order they came, so that neither peak nor time of peak is lost.

    Examples
    --------
    >>> x = np.arange(100_000.0)
    >>> y = np.zeros(100_000)
    >>> y[54_321] = 1.0
    >>> shown_x, shown_y = envelope(x, y)
    >>> len(shown_x) <= MOST_POINTS, float(shown_x[np.argmax(shown_y)])
    (True, 54321.0)
    """
    if x.size <= most_points:
        return x, y
    slices = max(most_points // 2, 2)
    if spacing == "log" and x[-1] > 0:
        first = x[np.argmax(x > 0)]
        inner = np.geomspace(first, x[-1], slices + 1)[1:-1]
    else:
        inner = np.linspace(x[0], x[-1], slices + 1)[1:-1]
    starts = np.concatenate(([0], np.searchsorted(x, inner)))
    starts = starts[np.diff(starts, prepend=-1) > 0]
    slice_of = np.repeat(np.arange(starts.size), np.diff(starts, append=x.size))
    shown = np.zeros(x.size, dtype=np.bool_)
    extreme = y[starts]
    for extreme in (np.fmin.reduceat(y, starts), np.fmax.reduceat(y, starts)):
        there = np.flatnonzero(y == extreme[slice_of])
        shown[there[np.diff(slice_of[there], prepend=-1) > 0]] = True  # the first of each slice
    shown[starts[np.isnan(extreme)]] = True  # a slice without any sample stays a gap
    return x[shown], y[shown]
