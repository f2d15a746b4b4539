"""Runs of samples of which one thing is true."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["runs_of"]


def runs_of(flags: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First sample of each run of true ones, and the one after its last.

    Parameters
    ----------
    flags : ndarray of bool, shape (n,)
        What is true of each sample.

    Examples
    --------
    >>> first, stop = runs_of(np.array([True, False, True, True]))
    >>> first.tolist(), stop.tolist()
    ([0, 2], [1, 4])
    """
    edges = np.diff(np.concatenate([[0], flags.astype(np.int8), [0]]))
    return np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
