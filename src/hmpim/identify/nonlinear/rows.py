"""Rows for nonlinearities: the effect of each kind on the output, given the model.

It is proportional to its size. x is the output of the linear part G, z that of the whole model, u
the input, 1/A the dynamics:

=====================  ====================================================================
backlash               play(x) - x: half the gap down and up while the output moves; while it waits
                       at a reversal, its samples do not count
dead_zone              -G clip(u): nothing happens within half its width
friction               the unit stepped in time with a constant force against its motion, less that
                       without; while it sticks, its samples do not count
hardening, softening   -(1/A) z³: a spring force beyond proportion, or below
asymmetry              -(1/A) z², or x²: more one way than the other
curvature              x³: a scale that changes with the deflection
=====================  ====================================================================
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.fitting.derivatives import jacobian
from hmpim.identify.fitting.fit import Fit, Problem, fit_structure
from hmpim.identify.fitting.least_squares import without
from hmpim.identify.fitting.sampled_rows import part_of
from hmpim.identify.nonlinear.fine import FINE, finely, linear_part, linear_part_finely, sampled
from hmpim.identify.nonlinear.mechanisms import GAPS, Kind, play, through
from hmpim.identify.worth import MATERIAL, PART
from hmpim.model.sampled import prepare_input
from hmpim.record import Intersample

__all__ = ["TURNS", "Command", "Nonlinearity", "dead_zone", "first_rows", "with_row"]

TURNS = 12
"""Turns after which a row that still changes is given up."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Command:
    """Input samples, (n,), and what the input does between them."""

    u: Real
    intersample: Intersample


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Nonlinearity:
    """A row for a nonlinearity of size 1."""

    kind: Kind
    row: Real  # (n,): its effect on the output
    again: Callable[[Problem, Fit], "Nonlinearity"]  # from the data with this row, and their fit
    counts: Mask | None = None  # (n,): samples that depend on the linear part; None if all do
    size: float = 0.0  # for which the row was made
    begins: int = 0  # first sample at which its effect is known: a gap may begin anywhere in it


def with_row(problem: Problem, one: Nonlinearity) -> Problem:
    """The data with the row, without samples that do not count."""
    valid = problem.valid
    if one.counts is not None:
        valid = one.counts if valid is None else valid & one.counts
    return replace(problem.plain, valid=valid).with_row(one.row)


def first_rows(
    kind: Kind, command: Command, problem: Problem, start: Fit
) -> Iterator[Nonlinearity]:
    """Rows of a kind as the linear fit suggests them."""
    sizes = [gap * float(np.max(np.abs(linear_part(problem, start)))) for gap in GAPS]
    if kind == "backlash":
        yield _likeliest([_waiting(problem, start, size) for size in sizes], problem, start)
    elif kind == "friction" and start.structure.name == "second_order":
        fine = finely(command.u, command.intersample)
        yield _likeliest([_rubbing(fine, problem, start, size) for size in sizes], problem, start)
    elif kind in ("hardening", "softening"):
        yield _forced(kind, problem, start, power=3)
    elif kind == "curvature":
        yield _scaled(kind, problem, start, power=3)
    elif kind == "asymmetry":
        yield _scaled(kind, problem, start, power=2)
        if start.structure.order:
            yield _forced(kind, problem, start, power=2)


def _likeliest(tried: list[Nonlinearity], problem: Problem, fit: Fit) -> Nonlinearity:
    """The row that explains most of the residual together with a linear change of the model."""
    rows = problem.plain.masked(np.stack([one.row for one in tried]))
    own = without(rows, jacobian(problem.plain, fit))
    along = np.maximum(own @ fit.residual, 0.0)
    gains = along**2 / np.maximum(np.vecdot(own, own), np.finfo(float).tiny)
    return tried[int(np.argmax(gains))]


def dead_zone(command: Command, problem: Problem, start: Fit) -> Nonlinearity | None:
    """A dead zone of the input, which is known once its width is: Newton's method for the width."""
    fine = finely(command.u, command.intersample)
    largest, structure = float(np.max(np.abs(fine))), start.structure
    tried = [_dead(fine, problem, start, gap * largest) for gap in GAPS]
    fit, half = start, _likeliest(tried, problem, start).size
    for _ in range(TURNS):
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
    return None


def _dead(fine: Real, problem: Problem, fit: Fit, half: float) -> Nonlinearity:
    """A dead zone of half a width, of an input on the finer clock."""
    row = -_through_model(sampled(np.clip(fine, -half, half)) / half, problem, fit)
    return Nonlinearity(
        kind="dead_zone",
        row=row,
        again=lambda _, fit: _dead(fine, problem, fit, _size_of(fit)),
        size=half,
    )


def _through_model(u: Real, problem: Problem, fit: Fit) -> Real:
    """The response of a model to another input, (n,)."""
    source = prepare_input(u, "bandlimited", rest=problem.begins is None)
    part = part_of(replace(problem, source=source, begins=None), fit.structure, fit.theta)
    return part.driven(fit.linear[:-1])


def _waiting(problem: Problem, fit: Fit, half: float) -> Nonlinearity:
    """Backlash of half a gap; while it waits the output does not depend on the input."""
    fine = linear_part_finely(problem, fit)  # it turns between samples
    moved = ((play(fine, half) - fine) / half)[::FINE]
    counts = np.abs(np.abs(moved) - 1.0) < MATERIAL**2
    reached = np.maximum.accumulate(fine) - np.minimum.accumulate(fine) >= 2.0 * half
    begins = int(np.count_nonzero(~reached[::FINE]))
    counts[:begins] = False
    return Nonlinearity(
        kind="backlash",
        row=moved,
        again=lambda data, fit: _waiting(data, fit, _size_of(fit)),
        counts=counts,
        size=half,
        begins=begins,
    )


def _rubbing(fine: Real, problem: Problem, fit: Fit, force: float) -> Nonlinearity:
    """Coulomb friction of a second-order unit, in the output's unit: at rest it holds the output.

    The unit is stepped in time, from rest, with friction and without.
    """
    size = float(fit.linear[0])
    at = np.arange(fine.size)
    command = size * np.interp(at - FINE * fit.delay, at, fine, left=fine[0])
    between = 0.5 * (command[:-1] + command[1:])
    (_, damping, inertia), still = fit.denominator, command[0]
    rates = np.array([[0.0, 1.0, 0.0], [-1.0, -damping, 1.0], [0.0, 0.0, 0.0]])
    rates[1] /= inertia
    step = scipy.linalg.expm(rates / FINE)[:2]
    top, below = scipy.signal.ss2tf(step[:, :2], step[:, 2:], np.eye(1, 2), np.zeros((1, 1)))
    free = scipy.signal.lfilter(top[0], below, np.append(between, command[-1]) - still) + still
    rubbed, moves = _stick_slip(step, between, still, force, inertia)
    return Nonlinearity(
        kind="friction",
        row=((rubbed - free) / force)[::FINE],
        again=lambda _, fit: _rubbing(fine, problem, fit, _size_of(fit)),
        counts=moves[::FINE],
        size=force,
    )


def _size_of(fit: Fit) -> float:
    """Size of the nonlinearity, whose row is the last."""
    return abs(float(fit.nuisance[-1]))


def _stick_slip(
    step: Real, between: Real, still: float, force: float, inertia: float
) -> tuple[Real, Mask]:
    """Output of a unit with friction, and whether it moves, from rest at `still`.

    `step`, (2, 3), takes position, speed and the command of a step to the next position and speed.
    In the step in which it turns, it is followed to its reversal and from there.
    """
    (p, q, r), (s, t, o) = step.tolist()
    z, v = still, 0.0
    positions, moving = [z], [False]
    for command in between.tolist():
        ahead = command - z if v == 0.0 else v
        if v or abs(ahead) > force:
            driven = command - (force if ahead > 0.0 else -force)
            further, faster = p * z + q * v + r * driven, s * z + t * v + o * driven
            if faster * v < 0.0:
                until = v / (v - faster) / FINE
                further = z + 0.5 * v * until
                pull, rest, faster = command - further, 1.0 / FINE - until, 0.0
                if abs(pull) > force:
                    faster = (pull - (force if pull > 0.0 else -force)) / inertia * rest
                    further += 0.5 * faster * rest
            z, v = further, faster
        positions.append(z)
        moving.append(v != 0.0)
    return np.array(positions), np.array(moving)


def _forced(
    kind: Kind, data: Problem, fit: Fit, *, power: int, own: Real | None = None
) -> Nonlinearity:
    """A force by a power of the output, over the linear one at the largest.

    It is followed on the finer clock, since its harmonics go beyond half the rate; `own` is the
    effect so far.
    """
    z = linear_part_finely(data, fit)
    z = z if own is None else z + own
    slower = fit.denominator * FINE ** np.arange(fit.denominator.size)
    fine = -through(_power(z, power)[None], slower)[0]

    def again(data: Problem, fit: Fit) -> Nonlinearity:
        return _forced(kind, data, fit, power=power, own=float(fit.nuisance[-1]) * fine)

    return Nonlinearity(kind=kind, row=np.asarray(fine[::FINE]), again=again)


def _scaled(kind: Kind, data: Problem, fit: Fit, *, power: int) -> Nonlinearity:
    """A scale that changes with the deflection."""
    return Nonlinearity(
        kind=kind,
        row=_power(linear_part(data, fit), power),
        again=lambda data, fit: _scaled(kind, data, fit, power=power),
    )


def _power(x: Real, power: int) -> Real:
    largest = float(np.max(np.abs(x)))
    return np.asarray(largest * (x / largest) ** power)
