"""By how much a nonlinearity may have moved the figures of a linear fit.

A linear fit absorbs the part of a nonlinearity that looks linear: a row missing from a regression
moves the other weights by their regression on that row (H. Theil, Rev. Int. Statist. Inst. 25,
1957). So each kind's trace in the output is added as one more row to the fit's derivatives, in
autoregressive noise. The kinds are those of `hmpim.identify.nonlinear.mechanisms`, and a dead zone
and a rate limit at the input. A score test decides whether the row belongs there (C. R. Rao, Proc.
Cambridge Phil. Soc. 44, 1948), for any input; the same regression gives how far the fit moves.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import scipy

from hmpim.identify.arrays import Real
from hmpim.identify.chance import CLEARLY, HALF, searched
from hmpim.identify.fitting.derivatives import jacobian
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.fitting.least_squares import solved
from hmpim.identify.kept import kept
from hmpim.identify.noise.autoregression import yule_walker
from hmpim.identify.noise.whiteness import is_white
from hmpim.identify.nonlinear.mechanisms import (
    LONGEST_AUTOREGRESSION,
    RATES,
    Hypothesis,
    hypotheses,
    stretch_of,
)
from hmpim.identify.worth import MATERIAL, PART, WORTH
from hmpim.model.nonlinear import Kind
from hmpim.model.operators import rate_limited
from hmpim.model.poles import rational_response
from hmpim.model.sampled import SampledInput, prepare_input
from hmpim.record import Intersample

__all__ = ["Bend", "bends", "bent_shapes", "is_bent_instead"]

_EVERY = 3
"""Every third of a kind's values is tried: neighbouring values leave very similar traces."""

_DEAD = (0.02, 0.1, 0.4)
"""Half widths tried for a dead zone, over the largest input."""

_ALIKE = 1e-8
"""Least share of a trace's power that linear changes must leave unexplained."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bend:
    """One kind of nonlinearity that the record does not exclude."""

    kind: Kind
    gain: float  # log-likelihood that it gains
    certain: bool  # whether the likeliest kind gains more than a linear unit would by chance
    effect: float  # r.m.s. of its whole effect, over that of the output about its mean
    share: float  # share of the residual's power that it explains
    white: bool  # whether the residual is white without the likeliest kind
    fit: Fit  # the linear fit to which it is added
    moved: Real  # (p,): its effect on the parameters of that fit, `theta`, then `linear`

    @property
    def matters(self) -> bool:
        """Whether it exists, and is worth a word."""
        return self.certain and self.effect > WORTH

    @property
    def counts(self) -> bool:
        """Whether it exists, and is too large or too poorly known for an interval.

        It is well known if a plain structure with it leaves white noise; a rich structure may have
        been chosen only to imitate it.
        """
        known = self.white and self.fit.structure.name in PLAIN
        return self.certain and self.effect > (MATERIAL if known else WORTH)

    @property
    def farthest(self) -> Real:
        """The most that it adds: its likelihood determines the error of its weight."""
        return np.asarray(self.moved * (1.0 + HALF / np.sqrt(2.0 * self.gain)))


@kept
def bends(
    u: Real, problem: Problem, fit: Fit, *, intersample: Intersample, floor: float = 0.0
) -> tuple[Bend, ...]:
    """Find the kinds of nonlinearity that the record does not exclude, the likeliest first.

    None is found if the odds for the likeliest are below 400 to 1; else every kind that explains
    nearly as much, because no trace is exact. The input has shape (n,), the problem is weighted by
    its noise. Effects up to `floor`, the r.m.s. rounding error, are ignored.
    """
    given = fit
    u, problem, fit = _shortened(u, problem, fit, intersample)
    if not np.any(fit.residual) or np.ptp(fit.prediction) == 0.0:
        return ()
    tried = _tried(u, fit, intersample)
    traces = np.stack([hypothesis.trace for hypothesis in tried])
    if problem.valid is not None:  # a trace outside the valid samples is only rounding inside
        inside = traces[:, problem.valid]
        traces[np.vecdot(inside, inside) <= _ALIKE * np.vecdot(traces, traces)] = 0.0
    rows = jacobian(problem, fit, *traces)
    residual = problem.innovations(fit.prediction, fit.residual)
    if problem.counts is not None:
        rows, residual = rows[:, problem.counts], residual[problem.counts]
    slopes, filtered = np.split(rows, [-len(tried)])
    weights, gains, rest = _scored(slopes, filtered, residual)
    sizes = np.std(traces, axis=1)
    gains = np.where(weights * sizes > floor, gains, 0.0)
    most = float(gains.max())
    if most <= CLEARLY:
        return ()
    white = is_white(rest)
    spread = float(np.std(problem.y if problem.valid is None else problem.y[problem.valid]))
    gram = slopes @ slopes.T
    return tuple(
        Bend(
            kind=tried[i].kind,
            gain=float(gains[i]),
            certain=most > searched(len(tried)),
            effect=float(weights[i] * sizes[i]) / spread,
            share=-float(np.expm1(-2.0 * gains[i] / residual.size)),
            white=white,
            fit=given,
            moved=-solved(gram, slopes @ filtered[i] * weights[i]),
        )
        for i in np.argsort(-gains)
        if gains[i] > most - max(CLEARLY, PART * most)
    )


def is_bent_instead(
    u: Real,
    problem: Problem,
    fit: Fit,
    plain: Fit,
    *,
    intersample: Intersample,
    floor: float = 0.0,
) -> bool:
    """Whether a plain fit with one nonlinearity explains more than a rich fit, with or without one.

    A second mode may imitate a hardening spring. The other arguments are as for `bends`.
    """
    if fit.cost < PART * plain.cost:  # no kind explains as much
        return False
    bent = bends(u, problem, plain, intersample=intersample, floor=floor)
    if not bent or not bent[0].certain or fit.cost <= 0.0:
        return False
    gained = 0.5 * problem.counted * float(np.log(plain.cost / fit.cost))
    if bent[0].gain <= gained:
        return False
    own = bends(u, problem, fit, intersample=intersample, floor=floor)
    return bent[0].gain > gained + (own[0].gain if own else 0.0)


def bent_shapes(u: Real, problem: Problem, fit: Fit, *, intersample: Intersample) -> Real:
    """Traces of all kinds in white noise, less what a linear change of the fit explains, (k, n).

    Each has a sum of squares of 1. Half the square of its product with a residual of unit variance
    is the log-likelihood that it gains, if the product is positive.
    """
    traces = np.stack([hypothesis.trace for hypothesis in _tried(u, fit, intersample)])
    slopes = jacobian(problem, fit)
    rest = traces - traces @ np.linalg.pinv(slopes) @ slopes
    power = np.vecdot(rest, rest)
    distinct = power > _ALIKE * np.vecdot(traces, traces)
    return np.asarray(rest[distinct] / np.sqrt(power[distinct, None]))


def _tried(u: Real, fit: Fit, intersample: Intersample) -> list[Hypothesis]:
    """Every kind, with the values to try."""
    return [
        *hypotheses(fit.prediction - fit.linear[-1], fit.denominator, every=_EVERY),
        *_at_the_input(u, fit, intersample),
    ]


def _shortened(
    u: Real, problem: Problem, fit: Fit, intersample: Intersample
) -> tuple[Real, Problem, Fit]:
    """The stretch of a long record with the largest residual; it begins in mid-motion."""
    here = stretch_of(fit.residual)
    if here == slice(0, u.size):
        return u, problem, fit
    part = replace(
        problem.plain,
        source=prepare_input(u[here], intersample, rest=False),
        y=problem.y[here],
        valid=None if problem.valid is None else problem.valid[here],
        nuisance=None if problem.nuisance is None else problem.nuisance[:, here],
        begins=0,
    )
    own = replace(
        fit,
        prediction=fit.prediction[here],
        residual=fit.residual[here],
        initial=np.zeros(fit.structure.order),
    )
    if problem.noise is not None:
        part = part.coloured(problem.noise, None if problem.level is None else problem.level[here])
    return u[here], part, own


def _at_the_input(u: Real, fit: Fit, intersample: Intersample) -> Iterator[Hypothesis]:
    """Traces in the output of a dead zone or a rate limit of the command."""
    source, first = _bent(u, intersample)
    traces = rational_response(
        source, delay=fit.delay, numerator=fit.numerator, denominator=fit.denominator
    )
    if fit.structure.integrators:
        traces += fit.linear[0] * first * np.maximum(np.arange(u.size) - fit.delay, 0.0)
    for i, trace in enumerate(traces):
        yield Hypothesis(kind="dead_zone" if i < len(_DEAD) else "rate_limit", trace=trace)


@partial(kept, long=True)
def _bent(u: Real, intersample: Intersample) -> tuple[SampledInput, Real]:
    """What a dead zone or a rate limit adds to a command, and the first sample of that."""
    largest, fastest = float(np.max(np.abs(u))), float(np.max(np.abs(np.diff(u))))
    inside = [-np.clip(u, -half * largest, half * largest) for half in _DEAD]
    rates = RATES[_EVERY::2]
    bent = np.stack([*inside, *(rate_limited(u, rate * fastest) - u for rate in rates)])
    first = bent[:, :1]
    # A trace is only detected, not measured: its spline need be no finer than the samples.
    return prepare_input(bent - first, intersample, precision=np.inf), first


def _scored(slopes: Real, traces: Real, residual: Real) -> tuple[Real, Real, Real]:
    """Weight and gain of each trace in addition to the slopes, and the residual of the best."""
    weights, gains, basis = _regressed(slopes, traces, residual)
    best = int(np.argmax(gains))
    rest = residual - weights[best] * traces[best]
    rest -= basis @ (rest @ basis)
    colour, _ = yule_walker(rest, LONGEST_AUTOREGRESSION)
    if colour.size > 1:
        rows = scipy.signal.lfilter(colour, [1.0], np.vstack([slopes, traces, residual]), axis=1)
        slopes, traces, residual = np.split(rows, [len(slopes), -1])
        weights, gains, _ = _regressed(slopes, traces, residual[0])
    return weights, gains, rest


def _regressed(slopes: Real, traces: Real, residual: Real) -> tuple[Real, Real, Real]:
    """Weights and gains in white noise, and a basis of what the slopes explain, shape (n, k)."""
    size = np.sqrt(np.vecdot(slopes, slopes))
    q, r = np.linalg.qr((slopes / np.where(size > 0.0, size, 1.0)[:, None]).T)
    q = q[:, np.abs(np.diag(r)) > _ALIKE]
    # Products of the parts that the slopes do not explain, without forming these parts.
    along, own = traces @ q, residual @ q
    whole = np.vecdot(traces, traces)
    power = whole - np.vecdot(along, along)
    total = float(residual @ residual - own @ own)
    distinct = power > np.maximum(_ALIKE * whole, np.finfo(float).tiny * total)
    product = traces @ residual - along @ own
    weights = np.where(distinct, product, 0.0) / np.where(distinct, power, 1.0)
    freedom = max(residual.size - q.shape[1], 1)
    if total <= 0.0:
        return weights, np.zeros(weights.size), q
    explained = np.minimum(weights**2 * power / total, 1.0 - np.finfo(float).eps)
    return weights, -0.5 * freedom * np.log1p(-np.where(distinct, explained, 0.0)), q
