"""Curves and bands as the text of SVG paths, thinned to what a width can show."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from hmpim.plots.envelope import envelope

__all__ = ["path_of", "thin_band"]

FloatArray = NDArray[np.float64]
_TENTHS = 12_000  # of a px: how far right and down the places that are looked up go


def path_of(x: FloatArray, y: FloatArray) -> str:
    """Return a path through points to a tenth of a pixel, interrupted where one is missing.

    Parameters
    ----------
    x, y : ndarray, shape (n,)
        Places in px, right and down; nan where one is missing.

    Examples
    --------
    >>> path_of(np.array([0.0, 1.25, 2.0]), np.array([3.0, np.nan, 4.0]))
    'M0 3M2 4'
    """
    there = np.isfinite(x) & np.isfinite(y)
    if not there.any():
        return ""
    if there.all():
        tenths = np.rint(10.0 * np.stack((x, y), axis=1)).astype(np.intp)
        if tenths.min() >= 0 and tenths.max() < _TENTHS:
            across, down_to = _words_of_tenths()
            words = np.stack((across[tenths[:, 0]], down_to[tenths[:, 1]]), axis=1)
            return "M" + "".join(words.ravel().tolist())[1:]
    numbers = np.round(np.stack((x, y), axis=1), 1).tolist()
    if there.all():
        return "M" + "L".join([f"{a:g} {b:g}" for a, b in numbers])
    out, down = [], False
    for (a, b), seen in zip(numbers, there.tolist(), strict=True):
        if seen:
            out.append(f"{'L' if down else 'M'}{a:g} {b:g}")
        down = seen
    return "".join(out)


@cache
def _words_of_tenths() -> tuple[NDArray[np.object_], NDArray[np.object_]]:
    """Every place in a picture as the text of a path: it is faster to look up than to write."""
    numbers = [f"{k / 10.0:g}" for k in range(_TENTHS)]
    across = np.array([f"L{number} " for number in numbers], dtype=np.object_)
    return across, np.array(numbers, dtype=np.object_)


def thin_band(x: FloatArray, y: FloatArray, width: float) -> tuple[FloatArray, FloatArray]:
    """Keep the highest upper and the lowest lower edge of each pixel.

    Parameters
    ----------
    x, y : ndarray, shape (2 n,)
        The outline in px: the upper edge from left to right, then the lower one back.
    width : float
        Of the panel, in px.
    """
    half = x.size // 2
    most = int(2 * width)
    if half <= most:
        return x, y
    upper = envelope(x[:half], y[:half], most_points=most)
    lower = envelope(x[half:][::-1], y[half:][::-1], most_points=most)
    return np.concatenate((upper[0], lower[0][::-1])), np.concatenate((upper[1], lower[1][::-1]))
