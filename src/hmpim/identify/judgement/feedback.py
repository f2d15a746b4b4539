"""Whether the input answers the noise: a loop around the unit."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.identify.arrays import Mask, Real
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
"""Samples left out whose lags are held at once."""


def feedback(evidence: Evidence) -> Iterator[Finding]:
    """Say that the residual moves the input; a doubt on what it may move where it has a colour.

    A score test (Rao 1948): the input's future, beside its past, explains nothing of a residual
    that it does not answer. A fit under the noise model of a loop whose noise is white is right
    all the same (L. Ljung, System Identification, 2nd ed., ch. 13.4).
    """
    left, u = evidence.readings.innovations, evidence.u
    if evidence.through or left.size != u.size or u.size < 20 * _AHEAD:
        return
    if evidence.nonlinear > 0.0 and evidence.unexplained < MOST:
        return  # a sweep's harmonics are its future
    counts = evidence.joint.weighed.counts
    if counts is not None and np.count_nonzero(counts[_AHEAD:-_AHEAD]) < 10 * _AHEAD:
        return
    if float(chances_of_an_answer(u, left[None], counts)[0]) > FALSE_ALARM:
        return
    if find_period(u) is not None:
        return  # the future of a periodic input is its past
    moved = moved_by(evidence, 1.0)
    if moved == ("noise_std",):
        return
    coloured = not evidence.readings.white
    treated = ", and the fit treats some of the noise as response" if coloured else ""
    yield Finding(
        code="feedback",
        message="The residual later appears in the input: the unit was in a feedback loop"
        f"{treated}. Identify it through what drives the loop (reference=, --reference).",
        severity="doubt" if coloured else "info",
        parameters=moved,
    )


def chances_of_an_answer(u: Real, left: Real, counts: Mask | None = None) -> Real:
    """Chance, for each of many residuals, that no answer of the input makes what is seen.

    `left`, (k, n), is what models leave over of outputs to the input `u`, (n,), of which all
    samples count or those of `counts`. 1 where the input's past tells all of its future.
    """
    lost = np.flatnonzero([] if counts is None else ~counts[_AHEAD:-_AHEAD])
    own = _future_of(u, lost)
    if not own.size.size or not left.shape[0]:
        return np.ones(left.shape[0])
    inner = left[:, _AHEAD:-_AHEAD]
    if lost.size:
        inner = inner.copy()
        inner[:, lost] = 0.0
    count = inner.shape[1] - lost.size
    mean = inner.sum(axis=1) / count
    variance = np.vecdot(inner, inner) / count - mean**2
    moves = u - u.mean()
    cross = np.stack([np.correlate(moves, one, "valid") for one in inner], axis=1)
    cross = np.concatenate([inner.sum(axis=1)[None], cross])
    along = own.direction.T @ (cross[_FUTURE] - own.told.T @ cross[_PAST])
    gained = np.sum(along**2 / own.size[:, None], axis=0) / variance
    return np.asarray(scipy.special.chdtrc(own.size.size, gained))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Future:
    """What an input's future has beside its past: sizes and directions, and what the past tells."""

    size: Real
    direction: Real
    told: Real


@kept
def _future_of(u: Real, lost: NDArray[np.intp]) -> _Future:
    gram = _gram(u - u.mean())
    for begin in range(0, lost.size, _AT_ONCE):
        rows = _lags_at(u - u.mean(), lost[begin : begin + _AT_ONCE])
        gram -= rows @ rows.T
    # Of the future what the past does not tell (a Schur complement).
    told = solved(gram[_PAST, _PAST], gram[_PAST, _FUTURE])
    size, direction = np.linalg.eigh(gram[_FUTURE, _FUTURE] - gram[_FUTURE, _PAST] @ told)
    seen = size > 1e-9 * float(np.trace(gram) - gram[0, 0])
    return _Future(size=size[seen], direction=direction[:, seen], told=told)


def _gram(u: Real) -> Real:
    """Products of a constant and an input's lags, past first, over all samples that have them.

    From lag to lag a product of two loses what stands first, and gains what comes behind.
    """
    samples = u.size - 2 * _AHEAD
    head, tail = u[: 2 * _AHEAD], u[samples:]
    gram = np.empty((2 * _AHEAD + 2, 2 * _AHEAD + 2))
    gram[0, 0], gram[0, 1] = samples, u[:samples].sum()
    gram[0, 2:] = gram[0, 1] + np.cumsum(tail - head)
    gram[1, 1:] = np.correlate(u, u[:samples], "valid")
    gram[1:, :2] = gram[:2, 1:].T
    change = np.outer(tail, tail) - np.outer(head, head)
    for k in range(2, gram.shape[0]):
        gram[k, 2:] = gram[k - 1, 1:-1] + change[k - 2]
    return gram


def _lags_at(u: Real, places: NDArray[np.intp]) -> Real:
    """A constant and an input's lags at samples counted from the first that has them."""
    lags = u[places + np.arange(2 * _AHEAD + 1)[:, None]]
    return np.concatenate([np.ones((1, places.size)), lags])
