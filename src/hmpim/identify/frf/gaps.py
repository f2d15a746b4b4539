"""Gaps in the outputs of several inputs, filled before anything is transformed."""

import numpy as np
import scipy
from numpy.typing import ArrayLike

from hmpim.errors import ArgumentError, RecordError
from hmpim.identify.arrays import Real

__all__ = ["filled"]

_FEWEST = 16


def filled(
    y: Real, valid: ArrayLike | None, fill: ArrayLike | None, labels: tuple[str, ...]
) -> tuple[Real, Real]:
    """Fill gaps in outputs, by a model where there is one, or by a curve through the neighbours.

    Parameters
    ----------
    y : ndarray, shape (p, n)
        Outputs; finite inside gaps too.
    valid : array_like of bool, shape (p, n) or (n,), or None
        False where an output is missing.
    fill : array_like, shape (p, n), or None
        What a model predicts.
    labels : tuple of str
        Names of the outputs.

    Returns
    -------
    ndarray, shape (p, n), and ndarray, shape (p,)
        Outputs without gaps, and the share of each that was measured.

    Raises
    ------
    ArgumentError, RecordError
        For a mask or a model of another shape, or fewer than 16 valid samples.

    Examples
    --------
    >>> y = np.arange(20.0)[None, :]
    >>> whole, share = filled(np.where(y == 7, 99.0, y), y[0] != 7, None, ("y",))
    >>> round(float(whole[0, 7]), 6), float(share[0])
    (7.0, 0.95)
    """
    if valid is None:
        return y, np.ones(y.shape[0])
    mask = np.asarray(valid)
    if mask.dtype != np.bool_ or mask.shape not in (y.shape, y.shape[1:]):
        raise ArgumentError(
            f"valid has shape {mask.shape} and type {mask.dtype}; give booleans of shape {y.shape} "
            f"or ({y.shape[1]},)"
        )
    mask = np.broadcast_to(mask, y.shape)
    given = None if fill is None else np.asarray(fill, dtype=np.float64)
    if given is not None and given.shape != y.shape:
        raise RecordError(f"fill has shape {given.shape} and outputs {y.shape}; give as many")
    out = y.copy()
    for i, (row, told, label) in enumerate(zip(out, mask, labels, strict=True)):
        if np.count_nonzero(told) < _FEWEST:
            raise RecordError(
                f"{label} has {np.count_nonzero(told)} valid samples; at least {_FEWEST} are needed"
            )
        gaps = np.flatnonzero(~told)
        if gaps.size and given is None:
            row[gaps] = scipy.interpolate.PchipInterpolator(np.flatnonzero(told), row[told])(gaps)
        elif given is not None:
            row[gaps] = given[i, gaps]
    return out, np.asarray(mask.mean(axis=1))
