"""Samples that a channel lost here and there, from those around them."""

from collections.abc import Callable

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from hmpim.record.runs import runs_of

__all__ = ["SHORT", "bridged"]

SHORT = 8
"""Longest gap in samples that is bridged; over a longer one the past is soon forgotten."""

_ORDER = 32
"""Order of the autoregression."""

_ROWS = 5000
"""Equations at most from which it is estimated, spread over the record."""

_FEWEST = 4
"""Equations for each coefficient at least."""

_ROUNDS = 5
"""Rounds of estimating and bridging where no stretch is without a gap."""


def bridged(
    values: NDArray[np.float64],
    known: NDArray[np.bool_],
    rule: Callable[[NDArray[np.bool_]], NDArray[np.float64]],
) -> NDArray[np.float64]:
    """Return a channel whose short gaps are bridged by an autoregression, if that is better.

    The samples lost are those that make the prediction errors least, of an autoregression
    estimated from unbroken stretches (A. J. E. M. Janssen, R. N. J. Veldhuis and L. B. Vries, IEEE
    Trans. ASSP 34, 1986): the likeliest ones under a Gaussian process. What moves slower than half
    the rate is found to within its noise. Whether that is mostly nearer than what was filled in
    is tried on samples that are known.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Samples; what stands where they are not known does not matter.
    known : ndarray of bool, shape (n,)
        Which samples are known.
    rule : callable
        Fills in all samples but those of a mask, (n,), in any other way; returns all, (n,).

    Returns
    -------
    ndarray, shape (n,)
        All samples; what the rule fills in stays where it does better, and in longer gaps.

    Examples
    --------
    >>> x = np.sin(np.arange(2000) ** 2 / 5000)
    >>> known = np.arange(2000) % 23 > 0
    >>> lost = bridged(x, known, lambda known: np.where(known, x, 0.0))[~known]
    >>> bool(np.abs(lost - x[~known])[1:].max() < 1e-3)
    True
    """
    filled = rule(known)
    lost = ~known & (_run_lengths(~known) <= SHORT)
    order = min(_ORDER, values.size // (2 * _FEWEST))
    tried = _trial(lost, known)
    if not tried.any() or order < 2:
        return filled
    level = float(np.mean(filled[known]))
    whole = np.flatnonzero(sliding_window_view(known, order + 1).all(axis=1))
    rounds = 1
    if whole.size < _FEWEST * order:  # gaps in every stretch: estimate and bridge in turns
        whole, rounds = np.arange(values.size - order), _ROUNDS
    x = filled - level
    for _ in range(rounds):
        autoregression = _autoregression(x, whole, order)
        x = _likeliest(filled - level, ~known, autoregression)
    both = _likeliest(filled - level, ~known | tried, autoregression) + level
    nearer = np.abs(both - values) < np.abs(rule(known & ~tried) - values)
    if 2 * np.count_nonzero(nearer[tried]) <= np.count_nonzero(tried):
        return filled
    return np.where(lost, x + level, filled)


def _run_lengths(flags: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Length of the run of true samples that each is in; 0 elsewhere."""
    first, stop = runs_of(flags)
    out = np.zeros(flags.size, dtype=np.intp)
    out[flags] = np.repeat(stop - first, stop - first)
    return out


def _autoregression(
    x: NDArray[np.float64], places: NDArray[np.intp], order: int
) -> NDArray[np.float64]:
    """Coefficients, 1 first, by least squares over the stretches that begin at `places`."""
    places = places[:: -(-places.size // _ROWS)]
    after = sliding_window_view(x, order + 1)[places]
    rows = np.concatenate([after[:, ::-1], after])  # time reversed, a process is the same
    found = np.linalg.lstsq(rows[:, 1:], -rows[:, 0], rcond=1e-12)[0]
    return np.concatenate([[1.0], found])


def _trial(lost: NDArray[np.bool_], known: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Known samples away from gaps, lost in the same pattern."""
    moved = np.roll(lost, known.size // 2)
    return moved & sliding_window_view(np.pad(known, 1), 3).all(axis=1)


def _likeliest(
    x: NDArray[np.float64], lost: NDArray[np.bool_], autoregression: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Samples lost so that the prediction errors are least, of the past and of what comes after."""
    order, index = autoregression.size - 1, np.flatnonzero(lost)
    base = np.where(lost, 0.0, x)
    rows = index[:, None] + np.arange(-order, 1)
    inside = (rows >= 0) & (rows < x.size - order)
    columns = np.broadcast_to(np.arange(index.size)[:, None], rows.shape)[inside]
    both = (autoregression, autoregression[::-1])
    spread = [np.broadcast_to(weights, rows.shape)[inside] for weights in both]
    places = np.concatenate([rows[inside], rows[inside] + x.size - order])
    matrix = scipy.sparse.csc_array(
        (np.concatenate(spread), (places, np.tile(columns, 2))),
        shape=(2 * (x.size - order), index.size),
    )
    errors = np.concatenate([np.convolve(base, weights, "valid") for weights in both])
    found = scipy.sparse.linalg.spsolve((matrix.T @ matrix).tocsc(), -(matrix.T @ errors))
    base[index] = np.atleast_1d(found)
    return base
