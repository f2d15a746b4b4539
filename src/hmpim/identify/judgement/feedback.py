"""Whether the input answers the noise: a loop around the unit."""

import numpy as np
from scipy.special import chdtrc

from hmpim.identify.fitting.fit import without
from hmpim.identify.groups import MODELLED
from hmpim.identify.judgement.evidence import Evidence
from hmpim.record import Finding

__all__ = ["feedback"]

_AHEAD = 12
"""Samples of the input's future, and of its past, that are looked at."""

_CHANCE = 1e-6
"""Chance below which what is left over is said to move the input."""


def feedback(evidence: Evidence) -> tuple[Finding, ...]:
    """Say that what the model leaves over moves the input; a doubt where the noise has a colour.

    A score test (Rao 1948): the input's future, beside its past, explains nothing of a residual
    that it does not answer. A fit under the noise model of a loop whose noise is white is right
    all the same (L. Ljung, System Identification, 2nd ed., ch. 13.4).
    """
    left, u = evidence.readings.innovations, evidence.u
    if evidence.through or left.size != u.size or u.size < 20 * _AHEAD:
        return ()
    inside = np.arange(_AHEAD, u.size - _AHEAD)
    counts = evidence.joint.weighed.counts
    inside = inside if counts is None else inside[counts[inside]]
    if inside.size < 10 * _AHEAD:
        return ()
    level = u - u.mean()
    lags = level[inside + np.arange(-_AHEAD, _AHEAD + 1)[:, None]]
    past, future = lags[: _AHEAD + 1], lags[_AHEAD + 1 :]
    rows = without(future, np.vstack([past, np.ones(inside.size)]))
    size, direction = np.linalg.eigh(rows @ rows.T)
    seen = size > 1e-9 * float(np.trace(lags @ lags.T))
    if not seen.any():
        return ()
    residual = left[inside]
    along = direction[:, seen].T @ (rows @ residual)
    gained = float(np.sum(along**2 / size[seen])) / float(residual.var())
    if chdtrc(int(seen.sum()), gained) > _CHANCE:
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
