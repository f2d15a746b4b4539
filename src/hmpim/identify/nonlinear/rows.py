"""Rows for nonlinearities: the effect of each kind on the output, given the model.

It is proportional to its size. x is the output of the linear part G, z that of the whole model, u
the input, 1/A the dynamics:

=====================  ====================================================================
backlash               play(x) - x: half the gap down and up while the output moves; while it waits
                       at a reversal, its samples do not count
dead_zone              -G clip(u): nothing happens within half its width
friction               a constant force against the motion, in a unit of second or third order
                       (`hmpim.model.friction`); while it sticks, its samples do not count
hardening, softening   -(1/A) z³: a spring force beyond proportion, or below
asymmetry              -(1/A) z², or x²: more one way than the other
curvature              x³: a scale that changes with the deflection
=====================  ====================================================================
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import scipy

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.fitting.derivatives import jacobian
from hmpim.identify.fitting.fit import Fit, Problem, fit_structure
from hmpim.identify.fitting.least_squares import without
from hmpim.identify.fitting.sampled_rows import part_of
from hmpim.identify.nonlinear.mechanisms import GAPS
from hmpim.identify.worth import FEW, MATERIAL, PART
from hmpim.model.dynamics import StructureName, coefficients_of
from hmpim.model.fine import FINE, finely, joined, sampled
from hmpim.model.friction import Rubbing, rubbed
from hmpim.model.nonlinear import Kind, Place
from hmpim.model.operators import gap_crossed, play, power_of, pushed
from hmpim.model.response import per_step
from hmpim.model.sampled import MARGIN, prepare_input
from hmpim.record import Intersample

__all__ = [
    "TURNS",
    "Command",
    "NonlinearRow",
    "dead_zone",
    "first_rows",
    "linear_part",
    "with_row",
]

_Lag = Callable[[Fit], float]
"""Lag of the force behind the command, in samples, by a fit."""

_SHRINKING = 2
"""Steps of Newton's method for a dead zone after which each must be smaller than the one before."""

_GUESSES = 2
"""Rows from which the size of friction is guessed, each from that of the former."""

TURNS = 24
"""Turns after which a row that still changes is given up."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Command:
    """Input samples, (n,), and what the input does between them."""

    u: Real
    intersample: Intersample
    others: Real | None = None  # (n,): what other inputs move the output by


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NonlinearRow:
    """A row for a nonlinearity of size 1."""

    kind: Kind
    row: Real  # (n,): its effect on the output
    # makes the row from data, a fit to them and a size
    remake: Callable[[Problem, Fit, float], "NonlinearRow"]
    counts: Mask | None = None  # (n,): samples that depend on the linear part; None if all do
    size: float = 0.0  # for which the row was made
    begins: int = 0  # first sample at which its effect is known: a gap may begin anywhere in it
    at: Place = "output"  # where it acts
    reach: float = 0.0  # largest deflection that it was made for; of a dead zone, largest command
    between: Intersample = "bandlimited"  # what it took the command to do between its samples
    within: Fit | None = None  # of friction: the dynamics in which it acts
    lag: float = 0.0  # of friction: between the command and the force, in samples

    def again(self, problem: Problem, fit: Fit) -> "NonlinearRow":
        """Compute the row again from a fit to data of which it is the last row."""
        return self.remake(problem, fit, float(fit.nuisance[-1]))


def linear_part(problem: Problem, fit: Fit, others: Real | None = None) -> Real:
    """Effect of the input, of `others` and of the initial state on the output, (n,)."""
    x = fit.prediction - fit.linear[-1]
    if others is not None:
        x = x + others
    if problem.nuisance is not None:
        x = x - fit.nuisance @ problem.nuisance
    return np.asarray(x)


def linear_part_finely(problem: Problem, fit: Fit, others: Real | None = None) -> Real:
    """The same on the finer clock."""
    steps = np.arange(FINE)[:, None] * np.eye(1, fit.theta.size) / FINE
    driving = replace(problem, begins=None)
    parts = [part_of(driving, fit.structure, fit.theta - step) for step in steps]
    driven = np.stack([part.driven(fit.linear[:-1]) for part in parts], axis=1)
    rest = np.zeros(driven.shape[0]) if others is None else others
    if fit.initial.size:
        rest = rest + fit.initial @ part_of(problem, fit.structure, fit.theta).free
    moves = np.flatnonzero(rest)
    if moves.size:
        here = slice(max(moves[0] - MARGIN, 0), moves[-1] + 1 + MARGIN)
        at = np.arange(rest.size)[here]
        spline = scipy.interpolate.CubicSpline(at, rest[here])
        driven[here] += spline(at[:, None] + np.arange(FINE) / FINE)
    return joined(driven)


def with_row(problem: Problem, one: NonlinearRow) -> Problem:
    """The data with the row, without samples that do not count."""
    valid = problem.valid
    if one.counts is not None:
        valid = one.counts if valid is None else valid & one.counts
    return replace(problem.plain, valid=valid).with_row(one.row)


def first_rows(
    kind: Kind, command: Command, problem: Problem, start: Fit
) -> Iterator[NonlinearRow]:
    """Rows of a kind as the linear fit suggests them."""
    if kind == "backlash":
        largest = _most(linear_part(problem, start, command.others))
        tried = [_waiting(command, problem, start, gap * largest) for gap in GAPS]
        yield _likeliest(tried, problem, start)
    elif kind == "friction":
        for lag in _LAGS.get(start.structure.name, ()):
            first = _first_friction(command, lag, problem, start)
            if first is not None:
                yield first
    elif kind in ("hardening", "softening"):
        yield _forced(command, kind, 3, problem, start)
    elif kind == "curvature":
        yield _scaled(command, kind, 3, problem, start)
    elif kind == "asymmetry":
        yield _scaled(command, kind, 2, problem, start)
        if start.structure.order:
            yield _forced(command, kind, 2, problem, start)


def _likeliest(tried: list[NonlinearRow], problem: Problem, fit: Fit) -> NonlinearRow:
    """The row that explains most of the residual together with a linear change of the model."""
    along, power = _regressed(tried, problem, fit)
    return tried[int(np.argmax(np.maximum(along, 0.0) ** 2 / power))]


def _regressed(tried: list[NonlinearRow], problem: Problem, fit: Fit) -> tuple[Real, Real]:
    """Products with the residual, and powers, of what no linear change of the model explains."""
    rows = problem.plain.masked(np.stack([one.row for one in tried]))
    own = without(rows, jacobian(problem.plain, fit))
    return own @ fit.residual, np.maximum(np.vecdot(own, own), np.finfo(float).tiny)


def dead_zone(command: Command, problem: Problem, start: Fit) -> NonlinearRow | None:
    """A dead zone of the input, which is known once its width is: Newton's method for the width.

    It is given up once its steps no longer become smaller: the residual has another cause.
    """
    fine = finely(command.u, command.intersample)
    largest, structure = float(np.max(np.abs(fine))), start.structure
    tried = [_dead(fine, problem, start, gap * largest) for gap in GAPS]
    fit, half = start, _likeliest(tried, problem, start).size
    last = np.inf
    for turn in range(TURNS):
        lived = sampled(np.sign(fine) * np.maximum(np.abs(fine) - half, 0.0))
        source = prepare_input(lived, "bandlimited", rest=problem.begins is None)
        edges = sampled(np.sign(fine) * (np.abs(fine) > half))
        slope = -_through_model(edges, problem, fit)
        data = replace(problem.plain, source=source).with_row(slope)
        fit = fit_structure(data, structure, fit.theta)
        change = float(fit.nuisance[-1])
        half = float(np.clip(half + change, PART * half, half / PART))
        if half > largest:
            return None
        if abs(change) < MATERIAL**2 * half:
            return _dead(fine, problem, fit, half)
        if turn >= _SHRINKING and abs(change) >= last:
            break
        last = abs(change)
    return None


def _dead(fine: Real, problem: Problem, fit: Fit, half: float) -> NonlinearRow:
    """A dead zone of half a width, of an input on the finer clock."""
    half = abs(half)
    row = -_through_model(sampled(np.clip(fine, -half, half)) / half, problem, fit)
    remake = partial(_dead, fine)
    return NonlinearRow(
        kind="dead_zone", row=row, remake=remake, size=half, at="command", reach=_most(fine)
    )


def _through_model(u: Real, problem: Problem, fit: Fit) -> Real:
    """The response of a model to another input, (n,)."""
    source = prepare_input(u, "bandlimited", rest=problem.begins is None)
    part = part_of(replace(problem, source=source, begins=None), fit.structure, fit.theta)
    return part.driven(fit.linear[:-1])


def _waiting(command: Command, problem: Problem, fit: Fit, half: float) -> NonlinearRow:
    """Backlash of half a gap; while it waits the output does not depend on the input."""
    half = abs(half)
    fine = linear_part_finely(problem, fit, command.others)  # it turns between samples
    moved = ((play(fine, half) - fine) / half)[::FINE]
    counts = np.abs(np.abs(moved) - 1.0) < MATERIAL**2
    begins = int(np.count_nonzero(~gap_crossed(fine, half)[::FINE]))
    counts[:begins] = False
    return NonlinearRow(
        kind="backlash",
        remake=partial(_waiting, command),
        row=moved,
        counts=counts,
        size=half,
        begins=begins,
        reach=_most(fine),
    )


def _rubbing(command: Command, lag: _Lag, problem: Problem, fit: Fit, force: float) -> NonlinearRow:
    """Coulomb friction, in the output's unit: at rest it holds the output.

    Samples count that would move with a little more friction as well: others may come and go.
    """
    force = abs(force)
    fine = linear_part_finely(problem, fit, command.others)
    unit = Rubbing(denominator=fit.denominator, lag=lag(fit))
    effect, moves = rubbed(fine, unit, force, margin=FEW)
    return NonlinearRow(
        kind="friction",
        row=effect[::FINE] / force,
        remake=partial(_rubbing, command, lag),
        counts=moves[::FINE],
        size=force,
        at="force",
        reach=_most(fine),
        within=fit,
        lag=unit.lag,
    )


def _first_friction(command: Command, lag: _Lag, problem: Problem, fit: Fit) -> NonlinearRow | None:
    """Friction of the size by which its row explains the residual; None if against the motion."""
    size = GAPS[0] * _most(linear_part(problem, fit, command.others))
    for _ in range(_GUESSES):
        one = _rubbing(command, lag, problem, fit, size)
        along, power = _regressed([one], problem, fit)
        size = float(along[0] / power[0])
        if size <= 0.0:
            return None
    return _rubbing(command, lag, problem, fit, size)


def _no_lag(_: Fit) -> float:
    """In a unit of second order the command is the force."""
    return 0.0


def _lag_of_servo(fit: Fit) -> float:
    """Lag of the force within a loop without other damping: it delays damping and stiffness."""
    return float(fit.denominator[3] / fit.denominator[2])


def _lag_of_command(fit: Fit) -> float:
    """Lag of the command in front of a second-order unit: the real pole."""
    return float(coefficients_of(fit.structure, fit.theta[1:])[-1])


_LAGS: dict[StructureName, tuple[_Lag, ...]] = {
    "second_order": (_no_lag,),
    "third_order": (_lag_of_servo, _lag_of_command),
    "third_order_zero": (_lag_of_servo,),
    "third_order_zeros": (_lag_of_servo,),
}
"""Lags between command and force that a structure may have."""


def _forced(
    command: Command,
    kind: Kind,
    power: int,
    data: Problem,
    fit: Fit,
    size: float = 0.0,
    *,
    shape: Real | None = None,
) -> NonlinearRow:
    """A force by a power of the output, over the linear one at the largest.

    It is followed on the finer clock, since its harmonics go beyond half the rate; `size` times
    `shape` is the effect so far.
    """
    z = linear_part_finely(data, fit, command.others)
    z = z if shape is None else z + size * shape
    largest = _most(z)
    fine = -pushed(power_of(z, power, largest), per_step(fit.denominator, FINE))
    remake = partial(_forced, command, kind, power, shape=fine)
    return NonlinearRow(
        kind=kind, row=np.asarray(fine[::FINE]), remake=remake, at="force", reach=largest
    )


def _scaled(
    command: Command, kind: Kind, power: int, data: Problem, fit: Fit, _: float = 0.0
) -> NonlinearRow:
    """A scale that changes with the deflection."""
    x = linear_part(data, fit, command.others)
    largest, remake = _most(x), partial(_scaled, command, kind, power)
    return NonlinearRow(kind=kind, row=power_of(x, power, largest), remake=remake, reach=largest)


def _most(x: Real) -> float:
    return float(np.max(np.abs(x)))
