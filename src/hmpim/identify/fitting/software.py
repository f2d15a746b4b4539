"""The joint fit of software under test: filters in z, with a whole number of samples of delay.

Output sample k depends on input samples up to k. Poles start from a difference equation,
y[k] = Σ b u[k-d-j] - Σ a y[k-i], which is linear in all coefficients, and exact if rounding is the
only noise (Söderström and Stoica, System Identification, 1989, ch. 7). Filtering input and output
by the estimated poles removes most of its bias under noise (K. Steiglitz and L. E. McBride, IEEE
TAC 10, 1965). The fits themselves are those of all structures. One triangular factor of all lagged
samples is enough for every structure and every delay.
"""

from bisect import bisect_left
from dataclasses import dataclass, replace

import numpy as np
import scipy

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.fitting.beginning import begins_of
from hmpim.identify.fitting.data import polished, refit
from hmpim.identify.fitting.fit import Fit, Problem, delayed, fit_structure
from hmpim.identify.fitting.least_squares import solved_exactly
from hmpim.identify.fitting.trial import JointFit, as_likely, trial_of
from hmpim.identify.fitting.unrelated import LEAST_ANSWER, is_unexplainable
from hmpim.identify.kept import kept
from hmpim.identify.noise.whiteness import effective_share
from hmpim.identify.section_iv.correlation import likeness
from hmpim.identify.worth import MOST, ROUNDING, TOLERATED, TWICE
from hmpim.model.dynamics import FILTERS, Structure
from hmpim.model.filters import nyquist_taps, section_parameters
from hmpim.model.sampled import prepare_input

__all__ = ["is_exact", "software_fit"]

_ORDER = 4
"""Past output samples in an equation."""

_TAPS = 16
"""Input samples in it beyond the lag of the greatest cross-correlation."""

_ROWS, _GLANCES = 20_000, (160, 1000)
"""Equations, spread over the record, for starts, and to check whether they hold: few first."""

_EARLIER = 40
"""Samples by which the delay may be below that lag."""

_LONGEST = 24
"""Most taps of an exact filter without poles, their differences known to better than 1e-9."""

_NEAR = 3
"""Delays of each structure that are fitted to convergence."""

_ROUNDING = 1e-11
"""Share of the output (r.m.s.) below which a residual cannot be distinguished from rounding."""

_REFINED = 4
"""Times that input and output are filtered by the estimated poles."""

_TASTE = 6
"""Steps from each start before the best ones are fitted to convergence."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Equations:
    """Triangular factor of so many `rows` of lagged samples.

    Columns: y[k-1] … y[k-_ORDER], u[k-first] … u[k-first-count+1], 1, y[k]. `ar` says whether past
    outputs count.
    """

    factor: Real
    rows: int
    first: int
    count: int
    ar: bool

    def cost(self, structure: Structure, delay: int) -> tuple[float, Real]:
        """Least sum of squares of the equation error, and the coefficients of A after the 1."""
        columns = [self.factor[:, k] for k in range(structure.order)]
        start = _ORDER + delay - self.first
        if structure.nyquist_zeros:
            weights = nyquist_taps(structure)
            columns.append(self.factor[:, start : start + weights.size] @ weights)
        else:
            columns += [self.factor[:, start + k] for k in range(structure.zeros + 1)]
        columns.append(self.factor[:, -2])
        found, cost = solved_exactly(np.stack(columns), self.factor[:, -1])
        return cost, -found[: structure.order]

    def costs(self, structure: Structure) -> dict[int, tuple[float, Real]]:
        """The same at every delay with all input samples; none if the past outputs do not count."""
        if structure.order and not self.ar:
            return {}
        last = self.first + self.count - max(structure.zeros, structure.nyquist_zeros)
        return {delay: self.cost(structure, delay) for delay in range(self.first, last)}

    def holds(self, structure: Structure, allowed: float) -> bool:
        """Whether the equation error of a structure is no more than allowed at some delay."""
        return any(cost <= allowed for cost, _ in self.costs(structure).values())

    def transversal_cost(self, first: int, last: int) -> float:
        """Least sum of squares of the equation error with input samples first to last alone."""
        return self.cost(_transversal(last - first + 1), first)[0]

    @property
    def last(self) -> int:
        """The greatest lag of the input."""
        return self.first + self.count - 1

    @property
    def cost_of_all(self) -> float:
        """Sum of squares of the equation error with all lagged samples."""
        return solved_exactly(self.factor[:, :-1].T, self.factor[:, -1])[1]

    def predictability(self, taps: slice = slice(None)) -> float:
        """Least over greatest singular value of the lagged inputs, each scaled to unit size.

        `taps` selects some of them, counted from `first`.
        """
        lagged = self.factor[:, _ORDER : _ORDER + self.count][:, taps]
        sizes = np.linalg.norm(lagged, axis=0)
        if not sizes.all():  # an impulse may not reach some lags
            return 0.0
        found = np.linalg.svd(lagged / sizes, compute_uv=False)
        return float(found[-1] / found[0])


def _equations(u: Real, y: Real, valid: Mask | None, *, most: int = _ROWS) -> _Equations:
    """Factor the equations; if samples are masked, only those that count."""
    # The output of a slower task resembles its input later, or another part of it.
    filled = y if valid is None else np.where(valid, y, y[valid].mean())
    lag = likeness(u, filled, u.size // 2).lag
    first = max(lag - _EARLIER, 0)
    last = min(lag + 2 + _TAPS, u.size // 2)
    last = max(min(last, (u.size + 2 * first) // 3 - _ORDER), first)  # two equations per unknown
    used, ar = np.arange(u.size) >= max(_ORDER, _unknown(u, last)), True
    if valid is not None:
        unbroken = used & valid
        for k in range(1, _ORDER + 1):
            unbroken[k:] &= valid[:-k]
        ar = bool(np.count_nonzero(unbroken) > u.size // 2)
        used = unbroken if ar else valid
    index = np.flatnonzero(used)
    index = index[:: -(-index.size // most)]
    rows = [y[np.maximum(index - k, 0)] for k in range(1, _ORDER + 1)]
    rows += [u[np.maximum(index - k, 0)] for k in range(first, last + 1)]
    every = np.stack([*rows, np.ones(index.size), y[index]], axis=1)
    factor = np.asarray(np.linalg.qr(every, mode="r"), dtype=np.float64)
    return _Equations(factor=factor, rows=index.size, first=first, count=last + 1 - first, ar=ar)


def _unknown(u: Real, reach: int) -> int:
    """Samples at the start that may depend on input before the record.

    0 if most of the input's motion is in them: it is then assumed to have been at rest before.
    """
    steps = np.diff(u) ** 2
    return reach if float(steps[reach:].sum()) > MOST * float(steps.sum()) else 0


def is_exact(u: Real, y: Real) -> bool:
    """Whether a difference equation holds to rounding: only software has no noise at all.

    All lagged samples together are tested first, on a few equations, then each filter.
    """
    for most in _GLANCES:
        equations = _equations(u, y, None, most=most)
        allowed = ROUNDING**2 * float(y.var()) * equations.rows
        least = equations.factor[-1, -1] ** 2  # the cost, if no direction is left out
        if not least < allowed:
            return False
    if any(equations.holds(structure, allowed) for structure in FILTERS.values()):
        return True
    every = _equations(u, y, None)
    cost = every.transversal_cost(every.first, every.last)
    return every.predictability() >= ROUNDING and cost <= allowed * every.rows / equations.rows


@kept
def software_fit(
    u: Real,
    y: Real,
    valid: Mask | None = None,
    structures: tuple[str, ...] = tuple(FILTERS),
    nuisance: Real | None = None,
) -> JointFit:
    """Fit every filter at every possible delay, and keep the one that the record supports.

    The `structures` are names of `FILTERS`; the rest is as for
    `hmpim.identify.fitting.joint.joint_fit`. There is a trial for each structure and delay that was
    fitted.
    """
    equations = _equations(u, y, valid)
    source, latest = prepare_input(u, "sampled"), u.size // 2
    problem = Problem(source=source, y=y, valid=valid, longest_delay=latest, nuisance=nuisance)
    floor = _ROUNDING**2 * problem.spread
    fits = _followed(problem, equations, u, structures, exact=floor)
    first = min(fits, key=lambda fit: fit.cost)
    if first.cost > floor and equations.cost_of_all <= floor:
        # The filters are exact but for input before the record.
        problem = _begun_at(problem, _unknown(u, equations.first + equations.count))
        fits = _followed(problem, equations, u, structures, exact=floor)
    elif first.cost > floor and (begins := begins_of(problem, first, lag=0)) is not None:
        problem = _begun_at(problem, begins)
        fits = [refit(problem, fit) for fit in fits]
    if "fir_16" in structures and min(fit.cost for fit in fits) > floor:
        problem, fits = _long_filter(problem, equations, u, exact=floor) or (problem, fits)
    share = effective_share(min(fits, key=lambda fit: fit.cost).residual)
    count = problem.counted * share
    trials = [trial_of("sampled", fit, count, floor=floor) for fit in fits]
    best = min(trials, key=lambda trial: trial.criterion)
    return JointFit(
        problem=problem,
        weighed=problem,
        best=best,
        trials=tuple(trials),
        forgotten=problem.begins or 0,
        effective_share=share,
        related=not is_unexplainable(u, problem, best.fit, (0.0, 0.5), least=LEAST_ANSWER),
    )


def _followed(
    problem: Problem, equations: _Equations, u: Real, structures: tuple[str, ...], *, exact: float
) -> list[Fit]:
    """Fit each structure at its likeliest delays, none richer than an exact one.

    If the equation of one structure holds to rounding, plainer ones are only evaluated.
    """
    tried: dict[Structure, dict[int, tuple[float, Real]]] = {}
    allowed = (ROUNDING / _ROUNDING) ** 2 * exact * equations.rows / problem.counted
    holding: set[Structure] = set()
    for structure in sorted((FILTERS[name] for name in structures), key=lambda s: s.parameters):
        if holding and structure.parameters > min(s.parameters for s in holding):
            break  # the residual is only rounding
        tried[structure] = costs = equations.costs(structure)
        if any(cost <= allowed for cost, _ in costs.values()):
            holding.add(structure)
    fits: list[Fit] = []
    for structure, costs in tried.items():
        fitted = not holding or structure in holding
        for delay in sorted(costs, key=lambda delay: costs[delay][0])[: _NEAR if fitted else 1]:
            theta = np.array([float(delay)])
            if structure.order:
                below = np.concatenate([[1.0], costs[delay][1]])
                below = _refined(problem, u, structure, delay, below) if fitted else below
                poles = np.asarray(np.roots(below), dtype=np.complex128)
                theta = np.append(theta, section_parameters(structure, poles))
            hopeless = TWICE * min((fit.cost for fit in fits), default=np.inf)
            most = _TASTE if fitted else 0
            fit = fit_structure(problem, structure, theta, iterations=most, hopeless=hopeless)
            fits.append(fit)
    if not holding:
        fits += [fit for structure in tried for fit in _walked(problem, structure, fits)]
    least = min(fits, key=lambda fit: fit.cost)
    count = problem.counted * least.share
    for i in sorted(range(len(fits)), key=lambda i: fits[i].cost):
        fit = fits[i]
        if fit.structure.order and fit.cost <= TWICE * least.cost:
            own = fit.structure.parameters
            hopeless = min(as_likely(one, own, count) for one in fits)
            fits[i] = polished(problem, fit, hopeless=hopeless)
    return fits


def _walked(problem: Problem, structure: Structure, fits: list[Fit]) -> list[Fit]:
    """Move a structure's best delay earlier and later while the fit improves; the better fits.

    With noise in past outputs, the equation error ranks delays differently from the output error.
    """
    own = [fit for fit in fits if fit.structure == structure]
    known, found = {fit.delay for fit in own}, list[Fit]()
    if not structure.order or not own:
        return found
    for step in (-1.0, 1.0):
        best = min([*own, *found], key=lambda fit: fit.cost)
        while 0.0 <= best.delay + step <= problem.longest_delay and best.delay + step not in known:
            start = delayed(best.theta, step)
            other = fit_structure(problem, structure, start)
            if not other.cost < best.cost:
                break
            best = other
            found.append(other)
    return found


def _long_filter(
    problem: Problem, equations: _Equations, u: Real, *, exact: float
) -> tuple[Problem, list[Fit]] | None:
    """The shortest filter without poles that is exact to rounding, and the data that it explains.

    Samples that depend on input before the record do not count. None if there is no such filter,
    or if the input is so smooth that its samples predict each other: many taps then explain any
    output, with coefficients that rounding alone would change.
    """
    allowed = exact * equations.rows / problem.counted

    def holds(first: int, last: int) -> bool:
        return equations.transversal_cost(first, last) <= allowed

    first, last = equations.first, equations.last
    if not holds(first, last):
        return None
    last = first + bisect_left(range(first, last), True, key=lambda k: holds(first, k))
    first += bisect_left(range(first, last), True, key=lambda k: not holds(k + 1, last))
    if last - first >= _LONGEST:
        return None
    taken = slice(first - equations.first, last + 1 - equations.first)
    spread = equations.transversal_cost(equations.first, equations.first - 1)  # of the output
    share = equations.transversal_cost(first, last) / spread
    if np.sqrt(share) > TOLERATED * equations.predictability(taken):
        return None
    began = _begun_at(problem, _unknown(u, last))
    return began, [fit_structure(began, _transversal(last - first + 1), np.array([float(first)]))]


def _begun_at(problem: Problem, first: int) -> Problem:
    """The data from a sample on, with a free response from there; all data if it is 0."""
    if not first:
        return problem
    late = np.arange(problem.y.size) >= first
    counted = late if problem.valid is None else problem.valid & late
    return replace(problem, valid=counted, begins=first)


def _transversal(taps: int) -> Structure:
    """A filter without poles."""
    return Structure(name="fir", sections=(), zeros=taps - 1, sampled=True)


def _refined(problem: Problem, u: Real, structure: Structure, delay: int, below: Real) -> Real:
    """A, re-estimated after filtering input and output by 1/A, while the error decreases."""
    y, n = problem.y, u.size
    moved = np.concatenate([np.full(delay, u[0]), u])[:n] - u[0]
    weights = nyquist_taps(structure)
    best, least = below, np.inf
    for _ in range(_REFINED):
        if np.max(np.abs(np.roots(below))) >= 1.0:
            break
        x = scipy.signal.lfilter(weights, below, moved)
        z = scipy.signal.lfilter([1.0], below, y - y[0])
        level = scipy.signal.lfilter([1.0], below, np.ones(n))
        rows = [np.concatenate([np.zeros(k), z[: n - k]]) for k in range(1, structure.order + 1)]
        rows += [np.concatenate([np.zeros(k), x[: n - k]]) for k in range(structure.zeros + 1)]
        counts = slice(None) if problem.valid is None else problem.valid
        found, cost = solved_exactly(np.stack([*rows, level])[:, counts], z[counts])
        if cost >= least:
            break
        best, least = below, cost
        below = np.concatenate([[1.0], -found[: structure.order]])
    return below if np.max(np.abs(np.roots(below))) < 1.0 else best
