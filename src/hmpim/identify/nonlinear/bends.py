"""By how much a nonlinearity may have moved the figures of a linear fit.

A linear fit takes up what of a nonlinearity looks linear: a row left out of a regression moves its
other weights by their regression on that row (H. Theil, Rev. Int. Statist. Inst. 25, 1957). So each
kind's trace (`hmpim.identify.nonlinear.mechanisms`, and at the input a dead zone and a limit of
speed, seen through the model) stands as one more row beside the fit's derivatives, with noise that
is an autoregression. Whether it belongs there is a score test (C. R. Rao, Proc. Cambridge Phil.
Soc. 44, 1948), of any input, by what it leaves at the input's own frequency and beside it; how far
the fit moves with it follows from the same regression.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy

from hmpim.identify.arrays import Real
from hmpim.identify.chance import CLEARLY, HALF, searched
from hmpim.identify.fitting.data import polished
from hmpim.identify.fitting.derivatives import jacobian
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.fitting.least_squares import solved
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.noise.autoregression import yule_walker
from hmpim.identify.noise.whiteness import is_white
from hmpim.identify.nonlinear.mechanisms import (
    LONGEST_AUTOREGRESSION,
    RATES,
    Hypothesis,
    Kind,
    hypotheses,
    rate_limited,
    stretch_of,
)
from hmpim.identify.worth import MATERIAL, PART, WORTH
from hmpim.model.poles import rational_response
from hmpim.model.sampled import prepare_input
from hmpim.record import Intersample

__all__ = ["Bend", "bends", "bent_shapes", "is_bent_instead", "plainer_bends"]

_EVERY = 3
"""Of a kind's values every so many is tried: its neighbours leave traces that are much alike."""

_DEAD = (0.02, 0.1, 0.4)
"""Half widths of a dead zone tried, over the largest input."""

_ALIKE = 1e-8
"""Share of a trace's power that must be left beside what a linear change explains."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bend:
    """One kind of nonlinearity that the record leaves in question.

    Parameters
    ----------
    kind : str
        Name as in `hmpim.identify.nonlinear.mechanisms`.
    gain : float
        Log-likelihood that it brings.
    certain : bool
        Whether the likeliest kind brings more than a linear unit's record would by chance.
    effect : float
        R.m.s. of all it does, over that of the output about its mean.
    share : float
        Share of the residual's power that it explains.
    white : bool
        Whether the likeliest kind leaves white noise.
    fit : Fit
        The linear fit beside which it stands.
    moved : ndarray, shape (p,)
        What it adds to the parameters of that fit: `theta`, then `linear`.
    """

    kind: Kind
    gain: float
    certain: bool
    effect: float
    share: float
    white: bool
    fit: Fit
    moved: Real

    @property
    def matters(self) -> bool:
        """Whether it is there, and worth a word."""
        return self.certain and self.effect > WORTH

    @property
    def counts(self) -> bool:
        """Whether it is there, and too large, or too little of it known, for an interval.

        All is known where it leaves noise beside a plain structure; a rich one may have been taken
        for its sake.
        """
        known = self.white and self.fit.structure.name in PLAIN
        return self.certain and self.effect > (MATERIAL if known else WORTH)

    @property
    def farthest(self) -> Real:
        """What it adds at most: its weight is known as well as its likelihood says."""
        return np.asarray(self.moved * (1.0 + HALF / np.sqrt(2.0 * self.gain)))


def bends(
    u: Real, problem: Problem, fit: Fit, *, intersample: Intersample, fs: float, floor: float = 0.0
) -> tuple[Bend, ...]:
    """Find the kinds of nonlinearity that the record leaves in question, the likeliest first.

    Parameters
    ----------
    u : ndarray, shape (n,)
        Input samples.
    problem, fit
        The data with the noise as they were weighed, and the linear fit.
    intersample : str
        What the input does between its samples.
    fs : float
        Rate in Hz.
    floor : float
        R.m.s. up to which nothing is said, in the output's unit: the error of rounding.

    Returns
    -------
    tuple of Bend
        Empty where the odds for the likeliest are below 400 to 1; else every one that explains
        nearly as much, for no trace is exact.

    Examples
    --------
    >>> from hmpim.identify.fitting.fit import fit_structure
    >>> from hmpim.model import STRUCTURES
    >>> u = np.sin(np.arange(3000) / 30 * (1 + np.arange(3000) / 3000))
    >>> y = u - np.clip(u, -0.1, 0.1) + 0.01 * np.random.default_rng(0).standard_normal(3000)
    >>> data = Problem(source=prepare_input(u, "foh"), y=y, valid=None, longest_delay=9.0)
    >>> fit = fit_structure(data, STRUCTURES["static"], np.zeros(1))
    >>> best = bends(u, data, fit, intersample="foh", fs=100.0)[0]
    >>> best.kind, best.certain, abs(fit.linear + best.moved[1:]).round(2).tolist()
    ('dead_zone', True, [1.0, 0.0])
    """
    given = fit
    u, problem, fit = _shortened(u, problem, fit, intersample)
    if not np.any(fit.residual) or np.ptp(fit.prediction) == 0.0:
        return ()
    tried = _tried(u, fit, intersample, fs)
    traces = np.stack([one.trace for one in tried])
    if problem.valid is not None:  # a trace that lies elsewhere is but rounding where they count
        there = traces[:, problem.valid]
        traces[np.vecdot(there, there) <= _ALIKE * np.vecdot(traces, traces)] = 0.0
    rows = jacobian(problem, fit, *traces)
    residual = problem.innovations(fit.prediction, fit.residual)
    if problem.counts is not None:
        rows, residual = rows[:, problem.counts], residual[problem.counts]
    slopes, seen = np.split(rows, [rows.shape[0] - len(tried)])
    weights, gains, rest = _scored(slopes, seen, residual)
    if not np.any(gains[weights > 0.0] > CLEARLY):
        return ()
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
            moved=-solved(gram, slopes @ seen[i] * weights[i]),
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
    fs: float,
    floor: float = 0.0,
) -> bool:
    """Whether a plain fit and one nonlinearity explain more than a rich fit, with its own or none.

    A spring that hardens is described better by a second mode than by none. All else is as for
    `bends`.
    """
    if fit.cost < PART * plain.cost:  # no kind makes that up
        return False
    bent = bends(u, problem, plain, intersample=intersample, fs=fs, floor=floor)
    if not bent or not bent[0].certain or fit.cost <= 0.0:
        return False
    gained = 0.5 * problem.counted * float(np.log(plain.cost / fit.cost))
    if bent[0].gain <= gained:
        return False
    own = bends(u, problem, fit, intersample=intersample, fs=fs, floor=floor)
    return bent[0].gain > gained + (own[0].gain if own else 0.0)


def plainer_bends(
    u: Real, joint: JointFit, plain: Fit | None, *, fs: float, floor: float = 0.0
) -> tuple[Bend, ...]:
    """Find the kinds beside which a plain fit is about as likely as the rich one chosen.

    Both are to the same data; without a plain one there is nothing to find.
    """
    best, problem = joint.best, joint.weighed
    if plain is None or plain.structure.parameters >= best.fit.structure.parameters:
        return ()
    plain = polished(problem, plain)
    if best.fit.objective < PART * plain.objective:  # no kind makes that up
        return ()
    count = problem.counted * joint.weighed_share
    fewer = best.fit.structure.parameters - plain.structure.parameters - 1
    behind = count * np.log(plain.objective / best.fit.objective) - fewer * np.log(count)
    found = bends(u, problem, plain, intersample=best.intersample, fs=fs, floor=floor)
    return tuple(
        replace(one, white=False) for one in found if behind - 2.0 * one.gain < 2.0 * CLEARLY
    )


def bent_shapes(
    u: Real, problem: Problem, fit: Fit, *, intersample: Intersample, fs: float
) -> Real:
    """Traces of all kinds beside a fit in white noise, less what a linear change explains, (k, n).

    Each has a sum of squares of 1, so that half the square of its product with a residual of unit
    variance is the log-likelihood that it brings, where the product is above 0.
    """
    traces = np.stack([one.trace for one in _tried(u, fit, intersample, fs)])
    slopes = jacobian(problem, fit)
    beside = traces - traces @ np.linalg.pinv(slopes) @ slopes
    power = np.vecdot(beside, beside)
    told = power > _ALIKE * np.vecdot(traces, traces)
    return np.asarray(beside[told] / np.sqrt(power[told, None]))


def _tried(u: Real, fit: Fit, intersample: Intersample, fs: float) -> list[Hypothesis]:
    """Every kind with the values that are tried."""
    return [
        *hypotheses(fit.prediction - fit.linear[-1], fit.denominator, fs, every=_EVERY),
        *_at_the_input(u, fit, intersample, fs),
    ]


def _shortened(
    u: Real, problem: Problem, fit: Fit, intersample: Intersample
) -> tuple[Real, Problem, Fit]:
    """The stretch of a long record with most to explain; it begins in mid-motion."""
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


def _at_the_input(u: Real, fit: Fit, intersample: Intersample, fs: float) -> Iterator[Hypothesis]:
    """What a dead zone or a limited speed of the command leaves behind the model."""
    largest, fastest = float(np.max(np.abs(u))), float(np.max(np.abs(np.diff(u))))
    inside = [-np.clip(u, -half * largest, half * largest) for half in _DEAD]
    rates = RATES[_EVERY::2]
    bent = np.stack([*inside, *(rate_limited(u, rate * fastest) - u for rate in rates)])
    first = bent[:, :1]
    # A trace is told from noise, not measured: its spline need be no finer than the samples.
    source = prepare_input(bent - first, intersample, precision=np.inf)
    traces = rational_response(
        source, delay=fit.delay, numerator=fit.numerator, denominator=fit.denominator
    )
    if fit.structure.integrators:
        traces += fit.linear[0] * first * np.maximum(np.arange(u.size) - fit.delay, 0.0)
    for trace in traces[: len(inside)]:
        yield Hypothesis(kind="dead_zone", trace=trace)
    for rate, trace in zip(rates, traces[len(inside) :], strict=True):
        yield Hypothesis(kind="rate_limit", trace=trace, size=rate * fastest * fs)


def _scored(slopes: Real, seen: Real, residual: Real) -> tuple[Real, Real, Real]:
    """Weight of each trace beside the slopes, what it gains, and what the best leaves."""
    weights, gains, basis = _regressed(slopes, seen, residual, np.ones(1))
    best = int(np.argmax(gains))
    rest = residual - weights[best] * seen[best]
    rest -= basis @ (rest @ basis)
    colour, _ = yule_walker(rest, LONGEST_AUTOREGRESSION)
    if colour.size > 1:
        weights, gains, _ = _regressed(slopes, seen, residual, colour)
    return weights, gains, rest


def _regressed(slopes: Real, seen: Real, residual: Real, colour: Real) -> tuple[Real, Real, Real]:
    """The same in noise of one colour; and a basis of what the slopes explain, shape (n, k)."""
    if colour.size > 1:
        rows = scipy.signal.lfilter(colour, [1.0], np.vstack([slopes, seen, residual]), axis=1)
        slopes, seen, residual = rows[: slopes.shape[0]], rows[slopes.shape[0] : -1], rows[-1]
    size = np.sqrt(np.vecdot(slopes, slopes))
    q, r = np.linalg.qr((slopes / np.where(size > 0.0, size, 1.0)[:, None]).T)
    q = q[:, np.abs(np.diag(r)) > _ALIKE]
    # Of trace and residual what the slopes leave of them, which need not be made itself.
    along, own = seen @ q, residual @ q
    whole = np.vecdot(seen, seen)
    power = whole - np.vecdot(along, along)
    told = power > _ALIKE * whole
    product = seen @ residual - along @ own
    weights = np.where(told, product, 0.0) / np.where(told, power, 1.0)
    total = float(residual @ residual - own @ own)
    freedom = max(residual.size - q.shape[1], 1)
    if total <= 0.0:
        return weights, np.zeros(weights.size), q
    taken = np.minimum(weights**2 * power / total, 1.0 - np.finfo(float).eps)
    return weights, -0.5 * freedom * np.log1p(-np.where(told, taken, 0.0)), q
