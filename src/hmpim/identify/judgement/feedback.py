"""Whether the input responds to the noise: a feedback loop around the unit."""

from collections.abc import Iterator

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.chance import FALSE_ALARM
from hmpim.identify.fitting.least_squares import solved
from hmpim.identify.judgement.evidence import Evidence
from hmpim.identify.judgement.residual import moved_by
from hmpim.identify.kept import kept
from hmpim.identify.noise.covariance import covariance
from hmpim.identify.noise.whiteness import is_white
from hmpim.identify.nonlinear.period import find_period
from hmpim.identify.worth import MOST
from hmpim.record import Finding

__all__ = ["chances_without_feedback", "feedback"]

_AHEAD = 12
"""Samples of the input's future, and of its past, that are tested."""

_PAST, _FUTURE = slice(0, _AHEAD + 2), slice(_AHEAD + 2, None)
"""Rows of a constant with the past of the input, and of its future."""

_AT_ONCE = 20_000
"""Missing samples whose lags are in memory at once."""


def feedback(evidence: Evidence) -> Iterator[Finding]:
    """Say that the residual moves the input; a doubt if the residual is not white.

    A score test (Rao 1948): without a loop the input's future, in addition to its past, explains
    nothing of the residual. In a loop with white noise the fit is right all the same (L. Ljung,
    System Identification, 2nd ed., ch. 13.4).
    """
    residual, u = evidence.readings.innovations, evidence.u
    if evidence.through or residual.size != u.size or u.size < 20 * _AHEAD:
        return
    if evidence.nonlinear > 0.0 and evidence.unexplained < MOST:
        return  # a sweep's harmonics resemble its future
    counts = evidence.joint.weighed.counts
    if counts is not None and np.count_nonzero(counts[_AHEAD:-_AHEAD]) < 10 * _AHEAD:
        return
    if float(chances_without_feedback(u, residual[None], counts)[0]) > FALSE_ALARM:
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


def chances_without_feedback(u: Real, residuals: Real, counts: Mask | None = None) -> Real:
    """Chances, without a loop, of so strong a relation of residuals to the input's future.

    The residuals, (k, n), are of outputs to the input, (n,); all samples count, or those of
    `counts`. The chance is 1 if the input's past determines its future.

    Products of lags decide that there is none. They lose half of the digits, where the future of a
    smooth input differs little from what its past predicts, and take the residual for white: what
    they find is computed again from the samples.
    """
    chances = _by_products(u, residuals, counts)
    for k in np.flatnonzero(chances < FALSE_ALARM):
        chances[k] = _by_samples(u, residuals[k], counts)
    return chances


def _by_samples(u: Real, residual: Real, counts: Mask | None) -> float:
    """The chance by orthogonal projections of the samples, for a residual of any colour."""
    moves = u - u.mean()
    lags = np.lib.stride_tricks.sliding_window_view(moves, moves.size - 2 * _AHEAD)
    rows, inner = np.concatenate([np.ones((1, lags.shape[1])), lags]), residual[_AHEAD:-_AHEAD]
    counted = np.ones(inner.size, dtype=bool) if counts is None else counts[_AHEAD:-_AHEAD]
    rows, inner = rows * counted, np.where(counted, inner - inner[counted].mean(), 0.0)
    past = np.linalg.qr(rows[_PAST].T)[0].T
    future = rows[_FUTURE] - (rows[_FUTURE] @ past.T) @ past
    size, direction = _distinct(future @ future.T, float(np.sum(rows[1:] ** 2)))
    if not size.size:
        return 1.0
    own = direction.T @ future
    freedom = max(int(np.count_nonzero(counted)) - len(past) - size.size, 1)
    errors = covariance(own, inner, freedom=freedom, white=is_white(inner[counted]))
    found = (own @ inner) / size
    return float(scipy.special.chdtrc(size.size, found @ np.linalg.solve(errors, found)))


def _by_products(u: Real, residuals: Real, counts: Mask | None) -> Real:
    """The chances by the products of lags, of which the input's are computed once."""
    lost = np.flatnonzero([] if counts is None else ~counts[_AHEAD:-_AHEAD])
    size, direction, predicted = _future_of(u, lost)
    if not size.size or not residuals.shape[0]:
        return np.ones(residuals.shape[0])
    inner = residuals[:, _AHEAD:-_AHEAD]
    if lost.size:
        inner = inner.copy()
        inner[:, lost] = 0.0
    count = inner.shape[1] - lost.size
    mean = inner.sum(axis=1) / count
    variance = np.vecdot(inner, inner) / count - mean**2
    moves = u - u.mean()
    cross = np.stack([np.correlate(moves, row, "valid") for row in inner], axis=1)
    cross = np.concatenate([inner.sum(axis=1)[None], cross])
    along = direction.T @ (cross[_FUTURE] - predicted.T @ cross[_PAST])
    noisy = variance > 0.0  # not where nothing is left
    explained = np.sum(along**2 / size[:, None], axis=0) / np.where(noisy, variance, 1.0)
    return np.where(noisy, scipy.special.chdtrc(size.size, explained), 1.0)


def _distinct(products: Real, power: float) -> tuple[Real, Real]:
    """Eigenvalues and vectors of a future's unpredicted part that the arithmetic resolves."""
    size, direction = np.linalg.eigh(products)
    distinct = size > 1e-9 * power
    return size[distinct], direction[:, distinct]


@kept
def _future_of(u: Real, lost: NDArray[np.intp]) -> tuple[Real, Real, Real]:
    """Eigenvalues and vectors of the unpredicted part of the future, and the predictor."""
    gram = _gram(u - u.mean())
    for begin in range(0, lost.size, _AT_ONCE):
        places = lost[begin : begin + _AT_ONCE]
        lags = (u - u.mean())[places + np.arange(2 * _AHEAD + 1)[:, None]]
        rows = np.concatenate([np.ones((1, places.size)), lags])
        gram -= rows @ rows.T
    # The Schur complement is the part of the future that the past does not predict.
    predicted = solved(gram[_PAST, _PAST], gram[_PAST, _FUTURE])
    unpredicted = gram[_FUTURE, _FUTURE] - gram[_FUTURE, _PAST] @ predicted
    return *_distinct(unpredicted, float(np.trace(gram) - gram[0, 0])), predicted


def _gram(u: Real) -> Real:
    """Products of a constant and an input's lags, past first, over all samples that have them."""
    samples = u.size - 2 * _AHEAD
    head, tail = u[: 2 * _AHEAD], u[samples:]
    gram = np.empty((2 * _AHEAD + 2, 2 * _AHEAD + 2))
    gram[0, 0], gram[0, 1] = samples, u[:samples].sum()
    gram[0, 2:] = gram[0, 1] + np.cumsum(tail - head)
    gram[1, 1:] = np.correlate(u, u[:samples], "valid")
    gram[1:, :2] = gram[:2, 1:].T
    # From lag to lag a product gains a term at its end, and loses its first.
    change = np.outer(tail, tail) - np.outer(head, head)
    for k in range(2, gram.shape[0]):
        gram[k, 2:] = gram[k - 1, 1:-1] + change[k - 2]
    return gram
