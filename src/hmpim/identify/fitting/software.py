"""The joint fit of software under test: sample over sample, in z, the delay a whole number.

Output sample k follows from input samples up to k. Poles start from an equation in the samples
themselves, y[k] = Σ b u[k-d-j] - Σ a y[k-i], which is linear in all coefficients and exact where
rounding is all the noise (Söderström and Stoica, System Identification, 1989, ch. 7); filtering
input and output by the poles found removes most of its bias under noise (K. Steiglitz and L. E.
McBride, IEEE TAC 10, 1965); the climb is the one of all fits. One triangular factor of all lagged
samples serves every structure and every delay.
"""

from bisect import bisect_left
from dataclasses import dataclass, replace

import numpy as np
import scipy

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.fitting.beginning import begins_of
from hmpim.identify.fitting.fit import Fit, Problem, fit_structure
from hmpim.identify.fitting.least_squares import solved_exactly
from hmpim.identify.fitting.trial import JointFit, trial_of
from hmpim.identify.fitting.unrelated import UNDENIED, says_nothing
from hmpim.identify.kept import kept
from hmpim.identify.noise.whiteness import effective_share
from hmpim.identify.section_iv.correlation import likeness
from hmpim.identify.worth import MOST, ROUNDING, TOLERATED, TWICE
from hmpim.model.dynamics import FILTERS, Structure
from hmpim.model.filters import nyquist_taps, section_parameters
from hmpim.model.sampled import prepare_input

__all__ = ["is_exact", "software_fit"]


_ORDER = 4
"""Output samples that an equation reaches back to."""

_TAPS = 16
"""Input samples that it may take beyond the lag of the greatest cross-correlation."""

_ROWS, _GLANCES = 20_000, (160, 1000)
"""Equations, evenly over the record, for starts, and to see whether they hold at all: few first."""

_EARLIER = 40
"""Samples by which the delay may be below that lag."""

_LONGEST = 24
"""Taps of a filter without poles whose differences, up to the last, are known better than 1e-9."""

_NEAR = 3
"""Delays of a structure that are followed to their end."""

_ROUNDING = 1e-11
"""Share of the output (r.m.s.) down to which nothing is told from rounding."""

_REFINED = 4
"""Times that input and output are filtered by the poles found."""

_TASTE = 6
"""Steps from each start, and sum of squares over the least up to which it is followed on."""

_POLISHED = 1e-6
"""Precision of the chosen fits, see `fit_structure`."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Equations:
    """Lagged samples as columns of one triangular factor.

    Columns: y[k-1] … y[k-_ORDER], u[k-first] … u[k-first-count+1], 1, y[k]; `rows` were factored.
    """

    factor: Real
    rows: int
    first: int
    count: int
    ar: bool

    def cost(self, structure: Structure, delay: int) -> tuple[float, Real]:
        """Least sum of squares of the equation's error, and A's coefficients behind the 1."""
        columns = [self.factor[:, k] for k in range(structure.order)]
        start = _ORDER + delay - self.first
        if structure.nyquist_zeros:
            weights = nyquist_taps(structure)
            columns.append(self.factor[:, start : start + weights.size] @ weights)
        else:
            columns += [self.factor[:, start + k] for k in range(structure.zeros + 1)]
        columns.append(self.factor[:, -2])
        found, left = solved_exactly(np.stack(columns), self.factor[:, -1])
        return left, -found[: structure.order]

    def costs(self, structure: Structure) -> dict[int, tuple[float, Real]]:
        """The same at every delay; none of a filter whose past outputs do not count."""
        if structure.order and not self.ar:
            return {}
        return {delay: self.cost(structure, delay) for delay in self.delays(structure)}

    def holds(self, structure: Structure, allowed: float) -> bool:
        """Whether an equation of a structure leaves no more than so much."""
        return any(left <= allowed for left, _ in self.costs(structure).values())

    def spans(self, allowed: float) -> bool:
        """Whether all lagged inputs together leave no more than so much."""
        return self.cost(_transversal(self.count), self.first)[0] <= allowed

    @property
    def spread(self) -> float:
        """Sum of squares of the output about its mean."""
        return self.cost(_transversal(0), self.first)[0]

    @property
    def left(self) -> float:
        """Sum of squares that the equations leave, every sample and all structures taken."""
        return solved_exactly(self.factor[:, :-1].T, self.factor[:, -1])[1]

    def foreseen(self, taps: slice = slice(None)) -> float:
        """Least singular value of the lagged inputs, each of unit size, over the greatest.

        Of some of them, counted from `first`, or of all.
        """
        lagged = self.factor[:, _ORDER : _ORDER + self.count][:, taps]
        sizes = np.linalg.norm(lagged, axis=0)
        if not sizes.all():  # an impulse has left before some lags begin
            return 0.0
        found = np.linalg.svd(lagged / sizes, compute_uv=False)
        return float(found[-1] / found[0])

    def delays(self, structure: Structure) -> range:
        """Delays at which it has all samples that a structure takes."""
        taken = max(structure.zeros, structure.nyquist_zeros)
        return range(self.first, self.first + self.count - taken)


def _equations(u: Real, y: Real, valid: Mask | None, *, most: int = _ROWS) -> _Equations:
    """Factor what one output sample may follow from; of masked samples, those that count alone."""
    # What a slower task repeats looks like its input later, and like another part of it.
    heard = y if valid is None else np.where(valid, y, y[valid].mean())
    lag = likeness(u, heard, u.size // 2).lag
    first = max(lag - _EARLIER, 0)
    last = min(lag + 2 + _TAPS, u.size // 2)
    last = max(min(last, (u.size + 2 * first) // 3 - _ORDER), first)  # two equations an unknown
    told, ar = np.arange(u.size) >= max(_ORDER, _unknown(u, last)), True
    if valid is not None:
        unbroken = told & valid
        for k in range(1, _ORDER + 1):
            unbroken[k:] &= valid[:-k]
        ar = bool(np.count_nonzero(unbroken) > u.size // 2)
        told = unbroken if ar else valid
    index = np.flatnonzero(told)
    index = index[:: -(-index.size // most)]
    rows = [y[np.maximum(index - k, 0)] for k in range(1, _ORDER + 1)]
    rows += [u[np.maximum(index - k, 0)] for k in range(first, last + 1)]
    every = np.stack([*rows, np.ones(index.size), y[index]], axis=1)
    factor = np.asarray(np.linalg.qr(every, mode="r"), dtype=np.float64)
    return _Equations(factor=factor, rows=index.size, first=first, count=last + 1 - first, ar=ar)


def _unknown(u: Real, reach: int) -> int:
    """Samples at the start that may follow from input before the record.

    0 where most of the input's motion is in them: it is then taken to have been at rest.
    """
    steps = np.diff(u) ** 2
    return reach if float(steps[reach:].sum()) > MOST * float(steps.sum()) else 0


def is_exact(u: Real, y: Real) -> bool:
    """Whether an equation between samples holds to rounding: only software has no noise at all.

    That of all lagged samples is asked first, of a few samples, then those of the filters.

    Parameters
    ----------
    u, y : ndarray, shape (n,)
        Samples of input and output.

    Examples
    --------
    >>> u = np.sin(np.arange(400) ** 2 / 2000)
    >>> y = scipy.signal.lfilter([0.2], [1.0, -0.8], np.concatenate([np.zeros(6), u[:-6]]))
    >>> is_exact(u, y), is_exact(u, y + 1e-6 * np.cos(np.arange(400) ** 2))
    (True, False)
    """
    for most in _GLANCES:
        equations = _equations(u, y, None, most=most)
        allowed = ROUNDING**2 * float(y.var()) * equations.rows
        if not equations.left < allowed:
            return False
    if any(equations.holds(structure, allowed) for structure in FILTERS.values()):
        return True
    every = _equations(u, y, None)
    return every.foreseen() >= ROUNDING and every.spans(allowed * every.rows / equations.rows)


def software_fit(
    u: Real,
    y: Real,
    *,
    valid: Mask | None = None,
    structures: tuple[str, ...] = tuple(FILTERS),
    nuisance: Real | None = None,
) -> JointFit:
    """Fit every filter at every delay that may be, and keep the one that the record supports.

    Parameters
    ----------
    u, y, valid, nuisance
        As for `hmpim.identify.fitting.joint.joint_fit`.
    structures : tuple of str
        Of which those in `FILTERS` are tried; all of them where there is none.

    Returns
    -------
    JointFit
        A trial for each structure and delay followed to its end.
    """
    names = tuple(name for name in structures if name in FILTERS) or tuple(FILTERS)
    return _software_fit(u, y, None if valid is None or valid.all() else valid, names, nuisance)


@kept
def _software_fit(
    u: Real, y: Real, valid: Mask | None, names: tuple[str, ...], nuisance: Real | None
) -> JointFit:
    """The same, once for a record: it was asked whether one filter is exact."""
    equations = _equations(u, y, valid)
    problem = Problem(
        source=prepare_input(u, "sampled"),
        y=y,
        valid=valid,
        longest_delay=u.size // 2,
        nuisance=nuisance,
    )
    floor = _ROUNDING**2 * float(np.sum(problem.masked(y - y.mean()) ** 2))
    fits = _followed(problem, equations, u, names, exact=floor)
    first = min(fits, key=lambda fit: fit.cost)
    if first.cost > floor and equations.left <= floor:  # but for what came before the record
        problem = _begun_at(problem, _unknown(u, equations.first + equations.count))
        fits = _followed(problem, equations, u, names, exact=floor)
    elif first.cost > floor and (begins := begins_of(problem, first, lag=0)) is not None:
        problem = _begun_at(problem, begins)
        fits = [fit_structure(problem, fit.structure, fit.theta) for fit in fits]
    if "fir_16" in names and min(fit.cost for fit in fits) > floor:
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
        related=not says_nothing(u, problem, best.fit, (0.0, 0.5), least=UNDENIED),
    )


def _followed(
    problem: Problem, equations: _Equations, u: Real, structures: tuple[str, ...], *, exact: float
) -> list[Fit]:
    """Each structure at its likeliest delays, fitted to the end; none richer than an exact one.

    Where the equation of one holds but for rounding, the plainer ones are only evaluated.
    """
    tried: dict[Structure, dict[int, tuple[float, Real]]] = {}
    allowed = (ROUNDING / _ROUNDING) ** 2 * exact * equations.rows / problem.counted
    holding: set[Structure] = set()
    for structure in sorted((FILTERS[name] for name in structures), key=lambda s: s.parameters):
        if holding and structure.parameters > min(one.parameters for one in holding):
            break  # nothing but rounding is left to explain
        tried[structure] = costs = equations.costs(structure)
        if any(left <= allowed for left, _ in costs.values()):
            holding.add(structure)
    fits: list[Fit] = []
    for structure, costs in tried.items():
        told = not holding or structure in holding
        for delay in sorted(costs, key=lambda delay: costs[delay][0])[: _NEAR if told else 1]:
            theta = np.array([float(delay)])
            if structure.order:
                below = np.concatenate([[1.0], costs[delay][1]])
                below = _refined(problem, u, structure, delay, below) if told else below
                theta = np.append(
                    theta,
                    section_parameters(structure, np.asarray(np.roots(below), dtype=np.complex128)),
                )
            hopeless = TWICE * min((fit.cost for fit in fits), default=np.inf)
            steps = _TASTE if told else 0
            fits.append(
                fit_structure(problem, structure, theta, iterations=steps, hopeless=hopeless)
            )
    if not holding:
        fits += [walked for one in tried for walked in _walked(problem, one, fits)]
    least = min(fit.cost for fit in fits)
    return [
        fit
        if fit.cost > TWICE * least or not fit.structure.order
        else fit_structure(problem, fit.structure, fit.theta, precision=_POLISHED)
        for fit in fits
    ]


def _walked(problem: Problem, structure: Structure, fits: list[Fit]) -> list[Fit]:
    """Better fits at earlier and later delays, one after the other, than the best of a structure.

    Noise in the outputs that an equation reaches back to is no error of the output, and puts the
    delays in an order of its own.
    """
    own = [fit for fit in fits if fit.structure == structure]
    known, found = {fit.delay for fit in own}, list[Fit]()
    if not structure.order or not own:
        return found
    for step in (-1.0, 1.0):
        best = min([*own, *found], key=lambda fit: fit.cost)
        while 0.0 <= best.delay + step <= problem.longest_delay and best.delay + step not in known:
            start = np.append(best.theta[0] + step, best.theta[1:])
            other = fit_structure(problem, structure, start)
            if not other.cost < best.cost:
                break
            best = other
            found.append(other)
    return found


def _long_filter(
    problem: Problem, equations: _Equations, u: Real, *, exact: float
) -> tuple[Problem, list[Fit]] | None:
    """The shortest filter without poles that leaves nothing but rounding.

    None where there is none, and where the input is so smooth that those of its samples foresee
    each other: so many explain any output, by coefficients that rounding alone would move. Else
    with the data that it explains: what follows from input before the record is left out.
    """
    allowed = exact * equations.rows / problem.counted

    def holds(first: int, last: int) -> bool:
        return equations.cost(_transversal(last - first + 1), first)[0] <= allowed

    first, last = equations.first, equations.first + equations.count - 1
    if not equations.spans(allowed):
        return None
    last = first + bisect_left(range(first, last), True, key=lambda k: holds(first, k))
    first += bisect_left(range(first, last), True, key=lambda k: not holds(k + 1, last))
    if last - first >= _LONGEST:
        return None
    taken = slice(first - equations.first, last + 1 - equations.first)
    left = equations.cost(_transversal(last - first + 1), first)[0]
    if np.sqrt(left / equations.spread) > TOLERATED * equations.foreseen(taken):
        return None
    began = _begun_at(problem, _unknown(u, last))
    return began, [fit_structure(began, _transversal(last - first + 1), np.array([float(first)]))]


def _begun_at(problem: Problem, first: int) -> Problem:
    """The data from a sample on, and the free response of what came before; all from 0."""
    if not first:
        return problem
    late = np.arange(problem.y.size) >= first
    counted = late if problem.valid is None else problem.valid & late
    return replace(problem, valid=counted, begins=first)


def _transversal(taps: int) -> Structure:
    """A filter without poles."""
    return Structure(name="fir", sections=(), zeros=taps - 1, sampled=True)


def _refined(problem: Problem, u: Real, structure: Structure, delay: int, below: Real) -> Real:
    """A after filtering input and output by 1/A some times; the one that leaves least."""
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
        told = slice(None) if problem.valid is None else problem.valid
        found, left = solved_exactly(np.stack([*rows, level])[:, told], z[told])
        if left >= least:
            break
        best, least = below, left
        below = np.concatenate([[1.0], -found[: structure.order]])
    return below if np.max(np.abs(np.roots(below))) < 1.0 else best
