"""Whether the input answers the noise: a loop around the unit."""

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.identify.chance import FALSE_ALARM
from hmpim.identify.fitting.least_squares import solved
from hmpim.identify.judgement.evidence import Evidence
from hmpim.identify.result.groups import MODELLED
from hmpim.record import Finding

__all__ = ["feedback"]

Real = NDArray[np.float64]

_AHEAD = 12
"""Samples of the input's future, and of its past, that are looked at."""

_AT_ONCE = 20_000
"""Samples whose lags are held at once."""


def feedback(evidence: Evidence) -> tuple[Finding, ...]:
    """Say that what the model leaves over moves the input; a doubt where the noise has a colour.

    A score test (Rao 1948): the input's future, beside its past, explains nothing of a residual
    that it does not answer. A fit under the noise model of a loop whose noise is white is right
    all the same (L. Ljung, System Identification, 2nd ed., ch. 13.4).
    """
    left, u = evidence.readings.innovations, evidence.u
    if evidence.through or evidence.nonlinear or left.size != u.size or u.size < 20 * _AHEAD:
        return ()  # a sweep's harmonics are its future
    inside = np.arange(_AHEAD, u.size - _AHEAD)
    counts = evidence.joint.weighed.counts
    inside = inside if counts is None else inside[counts[inside]]
    if inside.size < 10 * _AHEAD:
        return ()
    gram, cross = _products(u - u.mean(), left, inside)
    past, future = slice(0, _AHEAD + 2), slice(_AHEAD + 2, None)  # the past, and a constant
    # Of the future what the past does not tell (a Schur complement).
    told = np.column_stack([solved(gram[past, past], column) for column in gram[past, future].T])
    size, direction = np.linalg.eigh(gram[future, future] - gram[future, past] @ told)
    seen = size > 1e-9 * float(np.trace(gram) - gram[0, 0])
    if not seen.any():
        return ()
    along = direction[:, seen].T @ (cross[future] - told.T @ cross[past])
    gained = float(np.sum(along**2 / size[seen])) / float(left[inside].var())
    if scipy.special.chdtrc(int(seen.sum()), gained) > FALSE_ALARM:
        return ()
    coloured = not evidence.readings.white
    return (
        Finding(
            code="feedback",
            message="What the model leaves over moves the input afterwards: the unit was in a "
            "loop"
            + (", and the figures take noise for answer. " if coloured else ". ")
            + "Identify it through what drives the loop (reference=, --reference).",
            severity="doubt" if coloured else "info",
            parameters=MODELLED,
        ),
    )


def _products(u: Real, left: Real, inside: NDArray[np.intp]) -> tuple[Real, Real]:
    """Products of a constant and an input's lags, past first, with each other and what is left."""
    lags = np.arange(-_AHEAD, _AHEAD + 1)
    gram, cross = np.zeros((lags.size + 1, lags.size + 1)), np.zeros(lags.size + 1)
    for begin in range(0, inside.size, _AT_ONCE):
        some = inside[begin : begin + _AT_ONCE]
        rows = np.vstack([np.ones(some.size), u[some + lags[:, None]]])
        gram += rows @ rows.T
        cross += rows @ left[some]
    return gram, cross
