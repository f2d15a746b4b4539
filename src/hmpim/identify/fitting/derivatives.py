"""Derivatives of a fit's prediction, drift and initial state projected out, and their products."""

from itertools import pairwise

import numpy as np

from hmpim.identify.arrays import Real, dots
from hmpim.identify.fitting.fit import Fit
from hmpim.identify.fitting.least_squares import solved, without
from hmpim.identify.fitting.rows import Part, Problem
from hmpim.identify.fitting.sampled_rows import SampledPart, part_of

__all__ = ["combined", "jacobian", "products"]


def jacobian(
    problem: Problem, fit: Fit, *more: Real, part: Part | SampledPart | None = None
) -> Real:
    """Derivatives of the prediction with respect to theta, then to `fit.linear`; then more rows.

    Drift and initial state, where they are fitted, are projected out, so that the inverse of the
    rows' Gram matrix is the covariance with them unknown. The shape is
    (1 + order + m + 1 + len(more), n), with 0 where a sample does not count. `part` holds the
    input's rows at the fit, if already computed; its free response is ignored where the problem has
    none.
    """
    part = part_of(problem, fit.structure, fit.theta) if part is None else part
    bias = np.ones((1, problem.y.size))
    rows = np.vstack([part.slopes(fit.linear[:-1], fit.initial), part.rows, bias, *more])
    rows[fit.theta.size] += part.level
    return _projected(problem, part, rows)


def combined(problem: Problem, fit: Fit, weights: Real, row: Real) -> Real:
    """Return a row, (n,), plus weights, (p,), times the rows of `jacobian`, treated alike."""
    part, size = part_of(problem, fit.structure, fit.theta), fit.theta.size
    out = row + part.driven(weights[size:-1]) + weights[-1]
    for here in problem.stretches(0, row.size):
        out[here] += weights[:size] @ part.slopes(fit.linear[:-1], fit.initial, here)
    return np.asarray(_projected(problem, part, out[None])[0])


def _projected(problem: Problem, part: Part | SampledPart, rows: Real) -> Real:
    """Rows as samples count, drift and initial state projected out."""
    others = _others(problem, part)
    counted = problem.masked(rows)
    return without(counted, problem.masked(np.vstack(others))) if others else counted


def _others(problem: Problem, part: Part | SampledPart) -> list[Real]:
    """Rows of the initial state and of the drift, where they are fitted."""
    free = [] if problem.begins is None else [*part.free]
    return free if problem.nuisance is None else [*free, *problem.nuisance]


def products(
    problem: Problem,
    fit: Fit,
    residual: Real,
    *more: Real,
    part: Part | SampledPart | None = None,
    edges: tuple[int, ...] = (),
) -> Real:
    """Inner products of the rows of `jacobian` and of a residual, (n,), which comes last.

    They are summed in stretches, so that no row is as long as the record unless samples are
    whitened. A new span begins at each sample in `edges`, and each span has its own products: the
    shape is (1 + len(edges), q, q). The residual is 0 where a sample does not count.
    """
    part = part_of(problem, fit.structure, fit.theta) if part is None else part
    others, size, n = _others(problem, part), fit.theta.size, residual.size
    count = size + part.rows.shape[0] + 1 + len(more)

    def rows_at(here: slice) -> Real:
        slopes = part.slopes(fit.linear[:-1], fit.initial, here)
        rows = np.empty((count + len(others) + 1, slopes.shape[1]))
        rows[:size], rows[size : count - 1 - len(more)] = slopes, part.rows[:, here]
        rows[size] += part.level
        rows[count - 1 - len(more)] = 1.0
        for own, row in zip(rows[count - len(more) :], (*more, *others), strict=False):
            own[:] = row[here]
        rows[:-1] = problem.masked(rows[:-1], here)
        rows[-1] = residual[here]
        return rows

    whole = rows_at(slice(0, n)) if problem.filtered else None
    sums = np.zeros((1 + len(edges), count + len(others) + 1, count + len(others) + 1))
    for own, (first, last) in zip(sums, pairwise((0, *edges, n)), strict=True):
        for here in problem.stretches(first, last):
            rows = rows_at(here) if whole is None else whole[:, here]
            own += dots(rows, rows)
    if not others:
        return sums
    gram, last = sums.sum(axis=0), count + len(others)
    turn = np.zeros((count + 1, last + 1))
    turn[:count, :count], turn[count, last] = np.eye(count), 1.0
    turn[:count, count:last] = -solved(gram[count:last, count:last], gram[count:last, :count]).T
    return np.asarray(turn @ sums @ turn.T)
