"""Whether the input responds to the noise: a feedback loop around the unit."""

from collections.abc import Iterator

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.chance import FALSE_ALARM
from hmpim.identify.fitting.least_squares import solved
from hmpim.identify.judgement.evidence import Evidence
from hmpim.identify.judgement.residual import moved_by
from hmpim.identify.kept import kept
from hmpim.identify.nonlinear.lines import find_period
from hmpim.identify.worth import MOST
from hmpim.record import Finding

__all__ = ["chances_without_feedback", "feedback"]

_AHEAD = 12
"""Samples of the input's future, and of its past, that are tested."""

_PAST, _FUTURE = slice(0, _AHEAD + 2), slice(_AHEAD + 2, None)
"""Rows of a constant with the past of the input, and of its future."""

_AT_ONCE = 4096
"""Samples whose lags are in memory at once."""


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
    """
    size, direction, predicted = _future_of(u, counts)
    if not size.size or not residuals.shape[0]:
        return np.ones(residuals.shape[0])
    inner, count = residuals[:, _AHEAD:-_AHEAD], u.size - 2 * _AHEAD
    if counts is not None:
        inner, count = inner * counts[_AHEAD:-_AHEAD], int(np.sum(counts[_AHEAD:-_AHEAD]))
    mean = inner.sum(axis=1) / count
    variance = np.vecdot(inner, inner) / count - mean**2
    moves = u - u.mean()
    cross = np.stack([np.correlate(moves, row, "valid") for row in inner], axis=1)
    cross = np.concatenate([inner.sum(axis=1)[None], cross])
    along = direction.T @ (cross[_FUTURE] - predicted.T @ cross[_PAST])
    explained = np.sum(along**2 / size[:, None], axis=0) / variance
    return np.asarray(scipy.special.chdtrc(size.size, explained))


@kept
def _future_of(u: Real, counts: Mask | None) -> tuple[Real, Real, Real]:
    """Eigenvalues and vectors of the unpredicted part of the future, and the predictor."""
    windows = sliding_window_view(u - u.mean(), 2 * _AHEAD + 1)
    gram = np.zeros((2 * _AHEAD + 2, 2 * _AHEAD + 2))
    for here in (slice(k, k + _AT_ONCE) for k in range(0, len(windows), _AT_ONCE)):
        lags = windows[here]
        if counts is not None:
            lags = lags[counts[_AHEAD:-_AHEAD][here]]
        rows = np.insert(lags, 0, 1.0, axis=1)
        gram += rows.T @ rows
    # The Schur complement is the part of the future that the past does not predict.
    predicted = solved(gram[_PAST, _PAST], gram[_PAST, _FUTURE])
    size, direction = np.linalg.eigh(gram[_FUTURE, _FUTURE] - gram[_FUTURE, _PAST] @ predicted)
    distinct = size > 1e-9 * float(np.trace(gram) - gram[0, 0])
    return size[distinct], direction[:, distinct], predicted
