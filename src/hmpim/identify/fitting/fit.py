"""Maximum likelihood at given structures: delay, dynamics, scale factor and bias together.

With white Gaussian noise the likelihood is greatest where the residual's sum of squares is
least. Delay and denominator enter nonlinearly, all else linearly. The linear parameters are solved
exactly at each step (variable projection: G. H. Golub and V. Pereyra, SIAM J. Numer. Anal. 10,
1973), the others by Levenberg-Marquardt with derivatives in closed form. One optimiser serves one
input or several, with or without a drift, from rest or in mid-motion.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, singledispatch
from typing import Protocol

import numpy as np

from hmpim.identify.arrays import Real, dots, parts_of
from hmpim.identify.fitting.climb import Evaluated, climb
from hmpim.identify.fitting.held_steps import kept_in_sample
from hmpim.identify.fitting.least_squares import solved, solved_exactly
from hmpim.identify.fitting.rows import Part, Problem, spans
from hmpim.identify.fitting.sampled_rows import SampledPart, part_of
from hmpim.identify.kept import recent
from hmpim.identify.noise.whiteness import effective_share, is_steady, is_white
from hmpim.model.dynamics import Structure, coefficients_of, denominator_of, numerator_of
from hmpim.model.response import slowest_time_constant
from hmpim.model.sampled import SAMPLES_ALONE

__all__ = [
    "CONVERGED",
    "FORGETS",
    "Evaluation",
    "Fit",
    "Problem",
    "bounded_for",
    "delayed",
    "evaluating",
    "fit_structure",
    "fit_together",
    "within_reach",
]

_LONGEST_TIME_CONSTANT = 2.0
"""In record lengths; a slower pole cannot be distinguished from an integrator."""

_SHORTEST_TIME_CONSTANT = 0.02
"""In samples; a faster pole cannot be distinguished from none."""

_SHAPES = (1e-4, 1e6)
"""Bounds of 1 / (4ζ²): from a second pole 10 000 times as fast as the first, to ζ = 0.0005."""

_CRITICAL = 0.25
"""1 / (4ζ²) at critical damping, above which poles oscillate."""

CONVERGED = 1e-2
"""Decrease of the sum of squares, in units of σ², below which a step ends a fit that is compared
with others. If only a share of the samples is independent, it is divided by that share.
"""

FORGETS = 5.0
"""Time constants after which a state is forgotten (0.7 % remains)."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """The result of a fit, for one input."""

    structure: Structure
    # (1 + order,): delay in samples, then the parameters of the denominator's sections
    # (`coefficients_of`), time in samples
    theta: Real
    # (m + 1,): numerator coefficients by rising power of s (the first is the scale factor), or the
    # gains that `numerator_of` takes instead; bias
    linear: Real
    # (n,): output of the fitted model, drift and free response included; with several inputs, the
    # part due to this one, bias and drift
    prediction: Real
    # (n,): output less the prediction from all inputs, not whitened; 0 if a sample does not count
    residual: Real
    cost: float  # sum of squares of the residual
    objective: float  # minimised sum of squares: of the residual, whitened if the problem whitens
    converged: bool  # whether the last step was negligible
    nuisance: Real  # (k,): weights of the problem's nuisance rows
    initial: Real  # (order,) or (0,): weights of the free responses

    @property
    def delay(self) -> float:
        """Pure delay in samples."""
        return float(self.theta[0])

    @property
    def denominator(self) -> Real:
        """A(s) by rising powers of s per sample, shape (order + 1,)."""
        return denominator_of(self.structure, coefficients_of(self.structure, self.theta[1:]))

    @property
    def numerator(self) -> Real:
        """B(s) by rising powers of s per sample, shape (zeros + 1,)."""
        coefficients = coefficients_of(self.structure, self.theta[1:])
        return numerator_of(self.structure, coefficients, self.linear[:-1])

    @property
    def memory(self) -> float:
        """Samples after which a state is forgotten: five times the slowest time constant."""
        return FORGETS * slowest_time_constant(self.denominator)

    @property
    def is_white(self) -> bool:
        """Whether the residual passes a test for white noise."""
        return is_white(self.residual)

    @property
    def is_steady(self) -> bool:
        """Whether the residual keeps its level, by a test of its squares."""
        return is_steady(self.residual)

    @property
    def share(self) -> float:
        """Independent samples per sample of the residual."""
        return effective_share(self.residual)


class Evaluation(Evaluated, Protocol):
    """A model of every input at given parameters."""

    def fits(self, *, converged: bool) -> "list[Fit]":
        """The fit of each input."""


class _Known:
    """Quantities that no parameter moves: output and fixed rows, masked, and their products."""

    def __init__(self, problem: Problem) -> None:
        self.target = problem.masked(problem.y)
        self.plain = problem.fixed()
        self.fixed = problem.masked(self.plain)
        self.gram = dots(self.fixed, self.fixed)
        self.cross = self.fixed @ self.target


def _known(problem: Problem) -> _Known:
    """These quantities; if they take long, they are kept for the next fits to the same data."""
    costly = problem.filtered or problem.nuisance is not None
    made = recent(_known, problem.y.nbytes) if costly else None
    if made is None:
        return _Known(problem)
    if problem not in made:
        made[problem] = _Known(problem)
    known: _Known = made[problem]
    return known


class _Evaluation:
    """All inputs at given parameters: linear parameters, residual, and derivatives on demand."""

    def __init__(
        self, problems: Sequence[Problem], parts: Sequence[Part | SampledPart], known: _Known
    ) -> None:
        self.problems, self.parts, self._known = problems, parts, known
        first = problems[0]
        self._blocks = [rows for part in parts for rows in (part.rows, part.free)]
        filled = [rows for rows in self._blocks if rows.shape[0]]
        self.rows = filled[0] if len(filled) == 1 else np.vstack(filled)
        self.counted = first.masked(self.rows)
        own = self.counted.shape[0]
        self._gram = np.empty((own + len(known.cross),) * 2)
        self._gram[:own, :own] = dots(self.counted, self.counted)
        self._gram[own:, :own] = dots(known.fixed, self.counted)
        self._gram[:own, own:] = self._gram[own:, :own].T
        self._gram[own:, own:] = known.gram
        if first.source.degree == SAMPLES_ALONE:  # rounding may be the only noise
            every = np.vstack([self.counted, known.fixed])
            self.linear, _ = solved_exactly(every, known.target)
            self.residual = known.target - self.linear @ every
        else:
            cross = np.concatenate([self.counted @ known.target, known.cross])
            self.linear = solved(self._gram, cross)
            self.residual = np.empty_like(known.target)
            for here in spans(0, known.target.size):
                residual = known.target[here] - self.linear[:own] @ self.counted[:, here]
                residual -= self.linear[own:] @ known.fixed[:, here]
                self.residual[here] = residual
        self.cost = float(self.residual @ self.residual)

    def weights(self) -> list[Real]:
        """Linear parameters: numerator and initial state of each input, then the fixed rows'."""
        sizes = [block.shape[0] for block in self._blocks]
        return parts_of(self.linear, [*sizes, self.linear.size - sum(sizes)])

    def slopes(self, here: slice) -> Real:
        """Derivatives of the prediction by all delays and denominators, as samples count."""
        weights = self.weights()
        rows = [
            part.slopes(weights[2 * i], weights[2 * i + 1], here)
            for i, part in enumerate(self.parts)
        ]
        for problem, own in zip(self.problems, rows, strict=True):
            if problem.shortest_delay == problem.longest_delay:
                own[0] = 0.0  # a fixed delay
        return self.problems[0].masked(rows[0] if len(rows) == 1 else np.vstack(rows), here)

    @property
    def thetas(self) -> list[Real]:
        """Delay and denominator of each input."""
        return [part.theta for part in self.parts]

    def normal(self) -> tuple[Real, Real]:
        """Normal equations of delays and denominators: matrix, and derivative of the cost."""
        size = sum(part.theta.size for part in self.parts)
        inner, moment = np.zeros((size, size)), np.zeros(size)
        mixed, own = np.zeros((size, self.linear.size)), self.counted.shape[0]
        for here in self.problems[0].stretches(0, self.residual.size):
            rows = self.slopes(here)
            inner += dots(rows, rows)
            mixed[:, :own] += dots(rows, self.counted[:, here])
            mixed[:, own:] += dots(rows, self._known.fixed[:, here])
            moment += rows @ self.residual[here]
        return inner - mixed @ solved(self._gram, mixed.T), moment

    def fits(self, *, converged: bool) -> list[Fit]:
        """The fit of each input."""
        weights = self.weights()
        fixed, problem, residual = weights[-1], self.problems[0], self.residual
        levels = [weights[2 * i][0] * part.level for i, part in enumerate(self.parts)]
        bias = fixed[0] - sum(levels)  # for inputs that rest at zero
        if problem.filtered:
            moved = self.linear[: -fixed.size] @ self.rows
            residual = problem.y - moved - fixed @ self._known.plain
            if problem.valid is not None:
                residual = residual * problem.valid
        out = []
        for i, part in enumerate(self.parts):
            own = weights[2 * i] @ part.rows
            own += bias + levels[i]
            if part.free.shape[0]:
                own = own + weights[2 * i + 1] @ part.free
            if problem.nuisance is not None:
                own = own + fixed[1:] @ problem.nuisance
            out.append(
                Fit(
                    structure=part.structure,
                    theta=part.theta,
                    linear=np.append(weights[2 * i], bias),
                    prediction=own,
                    residual=residual,
                    cost=float(residual @ residual),
                    objective=self.cost,
                    converged=converged,
                    nuisance=fixed[1:],
                    initial=weights[2 * i + 1],
                )
            )
        return out


def bounded_for(problem: Problem, structure: Structure, theta: Real) -> Real:
    """Limit delay and time constants to what the record can determine."""
    delays = (problem.shortest_delay, problem.longest_delay)
    bounded = within_reach(structure, theta, delays=delays, samples=problem.source.samples)
    return _below_nyquist(structure.sections, bounded) if problem.source.degree == 0 else bounded


@singledispatch
def evaluating(
    first: Problem, problems: Sequence[Problem], structures: Sequence[Structure]
) -> Callable[[Sequence[Real]], Evaluation]:
    """Return a function that evaluates all inputs at given parameters, here by samples.

    The kind of the first input's problem decides; other kinds register their own function.
    """
    known = _known(first)

    def evaluated(thetas: Sequence[Real]) -> Evaluation:
        parts = [part_of(p, s, t) for p, s, t in zip(problems, structures, thetas, strict=True)]
        return _Evaluation(problems, parts, known)

    return evaluated


def within_reach(
    structure: Structure, theta: Real, *, delays: tuple[float, float], samples: int
) -> Real:
    """Limit a delay to a range, and time constants to what so many samples can determine.

    Examples
    --------
    >>> from hmpim.model.dynamics import STRUCTURES
    >>> theta = np.array([-9.0, 0.0])
    >>> within_reach(STRUCTURES["first_order"], theta, delays=(-4.0, 50.0), samples=100).tolist()
    [-4.0, 0.0]
    """
    least, most = _reach(structure.sections, samples)
    bounded = np.minimum(np.maximum(theta, least), most)
    bounded[0] = min(max(theta[0], delays[0]), delays[1])
    return bounded


def _below_nyquist(sections: tuple[int, ...], theta: Real) -> Real:
    """Keep oscillating modes slower than half the sampling rate.

    In samples of a response to a held input a faster mode appears as its alias, and one at the
    sampling rate as a real pole. `theta` is changed in place.
    """
    at = 1
    for order in sections:
        if order == 2 and theta[at + 1] > _CRITICAL:  # poles (-1 ± sqrt(1 - 4 q)) / (2 q T)
            shape = float(theta[at + 1])
            fastest = math.sqrt(4.0 * shape - 1.0) / (2.0 * shape * math.pi)
            theta[at] = max(theta[at], math.log(max(fastest, _SHORTEST_TIME_CONSTANT)))
        at += order
    return theta


@lru_cache(maxsize=256)
def _reach(sections: tuple[int, ...], samples: int) -> tuple[Real, Real]:
    """Least and greatest parameters, (1 + order,); the delay has no bounds here."""
    span = (np.log(_SHORTEST_TIME_CONSTANT), np.log(_LONGEST_TIME_CONSTANT * samples))
    each = [(-np.inf, np.inf)]
    for order in sections:
        each += [span, _SHAPES][:order]
    least, most = np.array(each).T
    return least, most


def delayed(theta: Real, later: float) -> Real:
    """The same parameters, with a delay that is longer by so many samples.

    Examples
    --------
    >>> delayed(np.array([3.0, 0.5]), 1.5).tolist()
    [4.5, 0.5]
    """
    return np.append(theta[0] + later, theta[1:])


def fit_structure(
    problem: Problem,
    structure: Structure,
    theta: Real,
    *,
    iterations: int = 40,
    precision: float = CONVERGED,
    hopeless: float = np.inf,
) -> Fit:
    """Fit one structure from one start.

    `theta`, (1 + order,), is the start: delay in samples, parameters of the denominator's sections.
    The fit has converged if a step lowers the sum of squares by less than `precision`, in units of
    σ²; a parameter then is within about the root of it, in standard deviations. It is given up
    after so many iterations, or where a step promises to leave more than `hopeless`, and more than
    a quarter of what it begins with. It is also given up if its latest steps hardly gain, or if at
    its pace so far it would still end above `hopeless`.
    """
    limits = {"precision": precision, "hopeless": hopeless}
    return fit_together([problem], [structure], [theta], iterations=iterations, **limits)[0]


def fit_together(
    problems: Sequence[Problem],
    structures: Sequence[Structure],
    thetas: Sequence[Real],
    *,
    iterations: int = 40,
    precision: float = CONVERGED,
    hopeless: float = np.inf,
) -> list[Fit]:
    """Fit one output to several inputs at once, each with a structure and a start of its own.

    There is a problem for each input; output, mask, whitening, nuisance and beginning are those of
    the first. All else is as for `fit_structure`. All fits share residual and cost.
    """
    problems = list(map(kept_in_sample, problems, structures, thetas))

    def bounded(moved: Sequence[Real]) -> list[Real]:
        return [bounded_for(p, s, t) for p, s, t in zip(problems, structures, moved, strict=True)]

    best, converged = climb(
        evaluating(problems[0], problems, structures),
        bounded(thetas),
        structures=structures,
        bounded=bounded,
        counted=problems[0].counted,
        iterations=iterations,
        precision=precision,
        hopeless=hopeless,
    )
    return best.fits(converged=converged)
