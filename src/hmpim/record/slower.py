"""Samples lost of a channel that a slower clock updates: its other samples of that interval."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["restored", "updates"]

_FEWEST = 20
"""Changes from which on all but one are an even number of samples apart by chance in fewer than one
record of ten thousand (40 of 2^20)."""

_ODD = 0.05
"""Share of the changes that may come apart from the clock, as where a sequence begins."""


def restored(
    values: NDArray[np.float64], known: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return a channel with the samples that its updates tell, and which of those lost they are.

    A converter or a sequence that is slower than the record keeps each value for a whole number of
    samples. A sample lost among them has the value of the others, whether the channel changes
    before it or after.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Samples; what stands where they are not known does not matter.
    known : ndarray of bool, shape (n,)
        Which samples are known.

    Examples
    --------
    >>> x = np.repeat(np.random.default_rng(0).standard_normal(30), 4)
    >>> known = np.arange(120) % 7 > 0
    >>> found, told = restored(np.where(known, x, 0.0), known)
    >>> bool(told[~known].all() and np.array_equal(found, x))
    True
    """
    nothing = np.zeros(known.size, dtype=np.bool_)
    moved = np.flatnonzero(known[1:] & known[:-1] & (values[1:] != values[:-1])) + 1
    period, first = _clock(moved)
    if period == 1:
        return values, nothing
    kept = (np.arange(values.size) - first) // period + 1
    lowest, highest = np.full(kept[-1] + 1, np.inf), np.full(kept[-1] + 1, -np.inf)
    np.minimum.at(lowest, kept[known], values[known])
    np.maximum.at(highest, kept[known], values[known])
    told = ~known & (lowest == highest)[kept]
    return np.where(told, lowest[kept], values), told


def updates(values: NDArray[np.float64]) -> NDArray[np.intp] | None:
    """Return the samples at which a slower clock updates a channel, (m,); None without one.

    Examples
    --------
    >>> x = np.repeat(np.random.default_rng(0).standard_normal(30), 4)
    >>> updates(x)[:3].tolist()
    [0, 4, 8]
    """
    period, first = _clock(np.flatnonzero(np.diff(values) != 0.0) + 1)
    return None if period == 1 else np.arange(first, values.size, period)


def _clock(moved: NDArray[np.intp]) -> tuple[int, int]:
    """Longest period by which nearly all changes come, in samples, and its phase; 1 for none."""
    if moved.size < _FEWEST:
        return 1, 0
    longest = int(np.quantile(np.diff(moved), _ODD, method="higher"))
    for period in range(longest, 1, -1):
        counts = np.bincount(moved % period)
        if counts.max() >= (1.0 - _ODD) * moved.size:
            return period, int(np.argmax(counts))
    return 1, 0
