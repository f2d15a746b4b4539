"""Whether the input answers the noise: a loop around the unit."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.identify.arrays import Real
from hmpim.identify.chance import FALSE_ALARM
from hmpim.identify.fitting.least_squares import solved
from hmpim.identify.judgement.evidence import Evidence
from hmpim.identify.judgement.residual import moved_by
from hmpim.identify.kept import kept
from hmpim.identify.nonlinear.lines import find_period
from hmpim.identify.worth import MOST
from hmpim.record import Finding

__all__ = ["chances_of_an_answer", "feedback"]


_AHEAD = 12
"""Samples of the input's future, and of its past, that are looked at."""

_PAST, _FUTURE = slice(0, _AHEAD + 2), slice(_AHEAD + 2, None)
"""Of the lags behind a constant: it and the past, and the future."""

_AT_ONCE = 20_000
"""Samples whose lags are held at once."""


def feedback(evidence: Evidence) -> tuple[Finding, ...]:
    """Say that the residual moves the input; a doubt on what it may move where it has a colour.

    A score test (Rao 1948): the input's future, beside its past, explains nothing of a residual
    that it does not answer. A fit under the noise model of a loop whose noise is white is right
    all the same (L. Ljung, System Identification, 2nd ed., ch. 13.4).
    """
    left, u = evidence.readings.innovations, evidence.u
    if evidence.through or left.size != u.size or u.size < 20 * _AHEAD:
        return ()
    bent = evidence.nonlinear > 0.0 and evidence.unexplained < MOST
    if bent or find_period(u) is not None:
        return ()  # a sweep's harmonics are its future; that of a periodic input is its past
    inside = np.arange(_AHEAD, u.size - _AHEAD)
    counts = evidence.joint.weighed.counts
    inside = inside if counts is None else inside[counts[inside]]
    if inside.size < 10 * _AHEAD:
        return ()
    if float(chances_of_an_answer(u, left[None], inside)[0]) > FALSE_ALARM:
        return ()
    moved = moved_by(evidence, 1.0)
    if moved == ("noise_std",):
        return ()
    coloured = not evidence.readings.white
    return (
        Finding(
            code="feedback",
            message="The residual later appears in the input: the unit was in a feedback "
            "loop"
            + (", and the fit treats some of the noise as response. " if coloured else ". ")
            + "Identify it through what drives the loop (reference=, --reference).",
            severity="doubt" if coloured else "info",
            parameters=moved,
        ),
    )


def chances_of_an_answer(u: Real, left: Real, inside: NDArray[np.intp] | None = None) -> Real:
    """Chance, for each of many residuals, that no answer of the input makes what is seen.

    Parameters
    ----------
    u : ndarray, shape (n,)
        The input.
    left : ndarray, shape (k, n)
        What models leave over of outputs to it.
    inside : integer ndarray, optional
        Samples that count; all that have as many neighbours as are looked at by default.

    Returns
    -------
    ndarray, shape (k,)
        1 where the input's past tells all of its future.
    """
    inside = np.arange(_AHEAD, u.size - _AHEAD) if inside is None else inside
    own = _future_of(u, inside)
    if not own.size.size:
        return np.ones(left.shape[0])
    cross = _products_with(u, left, inside)
    along = own.direction.T @ (cross[_FUTURE] - own.told.T @ cross[_PAST])
    gained = np.sum(along**2 / own.size[:, None], axis=0) / left[:, inside].var(axis=1)
    return np.asarray(scipy.special.chdtrc(own.size.size, gained))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Future:
    """What an input's future has beside its past: sizes and directions, and what the past tells."""

    size: Real
    direction: Real
    told: Real


@kept
def _future_of(u: Real, inside: NDArray[np.intp]) -> _Future:
    gram = np.zeros((2 * _AHEAD + 2, 2 * _AHEAD + 2))
    for rows, _ in _lags_of(u, inside):
        gram += rows @ rows.T
    # Of the future what the past does not tell (a Schur complement).
    told = solved(gram[_PAST, _PAST], gram[_PAST, _FUTURE])
    size, direction = np.linalg.eigh(gram[_FUTURE, _FUTURE] - gram[_FUTURE, _PAST] @ told)
    seen = size > 1e-9 * float(np.trace(gram) - gram[0, 0])
    return _Future(size=size[seen], direction=direction[:, seen], told=told)


def _products_with(u: Real, left: Real, inside: NDArray[np.intp]) -> Real:
    """Products of a constant and an input's lags, past first, with what is left, (lags, k)."""
    cross = np.zeros((2 * _AHEAD + 2, left.shape[0]))
    for rows, some in _lags_of(u, inside):
        cross += rows @ left[:, some].T
    return cross


def _lags_of(u: Real, inside: NDArray[np.intp]) -> Iterator[tuple[Real, NDArray[np.intp]]]:
    """A constant and an input's lags, past first, as rows, so many samples at once; and those."""
    u, lags = u - u.mean(), np.arange(-_AHEAD, _AHEAD + 1)
    for begin in range(0, inside.size, _AT_ONCE):
        some = inside[begin : begin + _AT_ONCE]
        yield np.vstack([np.ones(some.size), u[some + lags[:, None]]]), some
