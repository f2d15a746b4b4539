"""A nonlinearity as part of the model: one row of the fit, computed from the model in turns.

The row (`hmpim.identify.nonlinear.rows`) changes with the model and the model with the row.
Successive approximations (É. Picard, J. Math. Pures Appl. 6, 1890), extrapolated, end where both
agree.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.fitting.derivatives import jacobian
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.fit import CONVERGED, Fit, Problem, fit_structure
from hmpim.identify.fitting.least_squares import UNSEEN
from hmpim.identify.fitting.sampled_rows import part_of
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.noise.covariance import covariance
from hmpim.identify.noise.whiteness import is_white
from hmpim.identify.nonlinear.bends import bends
from hmpim.identify.nonlinear.mechanisms import LONGEST
from hmpim.identify.nonlinear.rows import (
    TURNS,
    Command,
    NonlinearRow,
    dead_zone,
    first_rows,
    linear_part,
    with_row,
)
from hmpim.identify.result import Estimate
from hmpim.identify.result.error_bars import estimate
from hmpim.identify.result.sizes import size_in_words
from hmpim.identify.worth import FEW, MATERIAL, MOST, PART, TWICE
from hmpim.model.dynamics import STRUCTURES, StructureName
from hmpim.model.nonlinear import KIND_WORDS, Kind, NonlinearPart
from hmpim.record import Finding

__all__ = [
    "ALIKE",
    "Modelled",
    "described",
    "is_explained",
    "is_rounding",
    "kinds_in_question",
    "leaves_noise",
    "linear_starts",
    "modelled_finding",
    "settled_rows",
]

_SERVOS: tuple[StructureName, ...] = ("third_order", "third_order_zero", "third_order_zeros")
"""Dynamics of a servo whose force lags behind its command: of the kinds, friction acts in it."""

_EITHER_WAY: tuple[Kind, ...] = ("hardening", "softening", "asymmetry", "curvature")
"""Kinds whose size has either sign."""

ALIKE: tuple[Kind, ...] = ("backlash", "friction")
"""Kinds whose traces are alike below the natural frequency, against a spring."""

_FEWEST = 100
"""Samples that must count: many times the parameters of a model with plain dynamics."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Modelled:
    """A nonlinearity that is part of the model."""

    trend: Real  # (n,): its effect on the output
    waits: Mask | None  # (n,): samples that do not depend on the linear part
    part: NonlinearPart  # what a model needs of it
    others: Mapping[Kind, Fit] = field(default_factory=dict)  # fits of kinds about as likely

    def estimate(self, units: tuple[str, str]) -> Estimate:
        """The size with its interval; the units are the input's and the output's."""
        unit = units[_UNIT[self.part.kind]] if self.part.kind in _UNIT else ""
        return estimate(self.part.size, self.part.std**2, unit=unit)

    def as_measured(self, joint: JointFit) -> tuple[Problem, Fit]:
        """The output with the nonlinearity, and the linear part, which leaves it over."""
        problem, fit = joint.problem, joint.best.fit
        valid, y = problem.valid, problem.y + self.trend
        if valid is not None and self.waits is not None:
            valid = valid | self.waits
        residual = y - fit.prediction if valid is None else np.where(valid, y - fit.prediction, 0.0)
        whole = replace(fit, residual=residual, cost=float(residual @ residual))
        return replace(problem, y=y, valid=valid), whole


_UNIT: dict[Kind, int] = {"dead_zone": 0, "backlash": 1, "friction": 1}
"""Whose unit a size has: the input's or the output's; others are shares."""


def is_explained(u: Real, joint: JointFit, *, floor: float) -> bool:
    """Whether no nonlinearity is looked for.

    This holds if plain dynamics leave white noise without a trace of a nonlinearity, for software
    and for long records. The input has shape (n,); effects up to `floor`, an r.m.s., are rounding.
    """
    best, fit = joint.best, joint.best.fit
    if fit.structure.sampled or joint.problem.y.size > LONGEST:
        return True
    if fit.structure.name not in PLAIN or not is_white(joint.problem.counting(fit.residual)):
        return False
    seen = bends(u, joint.weighed, fit, intersample=best.intersample, floor=floor)
    return not any(bend.matters for bend in seen)


def linear_starts(
    problem: Problem, plain: Fit, joint: JointFit, structures: tuple[StructureName, ...]
) -> list[Fit]:
    """Linear fits to which a nonlinearity may be added: the plain one, and better ones of a servo.

    A servo's lag makes a third pole, which a plain fit takes for delay, and commands of velocity
    and acceleration make zeros.
    """
    if plain.is_white:
        return [plain]
    # `kinds_in_question` skips such a fit.
    hopeless = np.inf if problem.filtered else joint.best.fit.cost / PART**2
    starts = {}
    if plain.structure.name == "second_order" and plain.delay > 0.0:
        start = np.append(plain.theta, np.log(MOST * plain.delay))
        start[0] *= 1.0 - MOST
        starts[_SERVOS[0]] = start
    for trial in sorted(joint.trials, key=lambda trial: -trial.fit.objective):
        if trial.fit.structure.name in _SERVOS:
            starts[trial.fit.structure.name] = trial.fit.theta
    if _SERVOS[2] in starts:
        starts.setdefault(_SERVOS[1], starts[_SERVOS[2]])
    precision = CONVERGED / plain.share
    servos = [
        fit_structure(
            problem, STRUCTURES[name], starts[name], precision=precision, hopeless=hopeless
        )
        for name in _SERVOS
        if name in starts and name in structures
    ]
    return [plain, *(fit for fit in servos if fit.cost < plain.cost)]


def kinds_in_question(
    command: Command, problem: Problem, starts: list[Fit], best: Fit
) -> dict[Kind, list[Fit]]:
    """Kinds that may explain the residual of linear fits, the likeliest first, with these fits.

    Empty if poles explain what no nonlinearity can. For a servo only friction is considered, also
    where backlash looks likely.
    """
    if problem.counted < _FEWEST:
        return {}
    found: dict[Kind, list[Fit]] = {}
    for fit in starts:
        if best.cost < PART**2 * fit.cost:
            continue
        seen = bends(command.u, problem, fit, intersample=command.intersample)
        kinds = [one.kind for one in seen if one.certain]
        # Where a linear fit leaves white noise, a nonlinearity must explain about as much.
        rest = (1.0 - seen[0].share) * fit.cost if seen else np.inf
        if best.is_white and rest > TWICE * best.cost:
            continue
        if fit.structure.name in _SERVOS:
            kinds = ["friction"] if any(kind in ALIKE for kind in kinds) else []
        for kind in dict.fromkeys(kinds):
            found.setdefault(kind, []).append(fit)
    return found


def settled_rows(
    kind: Kind, command: Command, problem: Problem, start: Fit
) -> Iterator[NonlinearRow]:
    """Rows of a kind, each from a fit of the same structure that agrees with it.

    The data are without a row, and `start` is a linear fit to them. Not every kind has a row.
    """
    if kind == "dead_zone":
        found = dead_zone(command, problem, start)
        if found is not None:
            yield replace(found, between=command.intersample)
    for one in first_rows(kind, command, problem, start):
        found = _in_turns(one, problem, start)
        if found is not None:
            yield replace(found, between=command.intersample)


def _in_turns(one: NonlinearRow, problem: Problem, start: Fit) -> NonlinearRow | None:
    """The row and the fit, each from the other until both agree; None if they do not.

    They agree where the fit gains nothing that an error bar shows.
    """
    structure, largest = start.structure, float(np.max(np.abs(linear_part(problem, start))))
    scale = largest / float(np.max(np.abs(one.row)))  # of a size as large as the linear part
    at = np.append(start.theta, one.size / scale)
    tried: list[Real] = []
    changes: list[Real] = []
    nearest, least, last, counted = None, PART, np.inf, problem.counted
    ever: Mask | None = None  # samples that have counted in every turn since the first restart
    for turn in range(TURNS):
        data = with_row(problem, one)
        if data.counted < _FEWEST:
            break
        before = fit_structure(data, structure, at[:-1], iterations=0)
        fit = fit_structure(data, structure, at[:-1])
        deviance = data.counted * float(np.log(before.cost / fit.cost))
        if deviance < least:  # of the samples that count some come and go
            nearest, least = one, deviance
        if least < MATERIAL:
            break
        many = deviance > last and abs(data.counted - counted) > FEW * counted
        if many or turn == TURNS // 2:  # restart: many samples come and go, or a few ever again
            tried.clear()
            changes.clear()
            ever = one.counts
        last, counted = deviance, data.counted
        tried.append(at)
        changes.append(np.append(fit.theta, fit.nuisance[-1] / scale) - at)
        at = _ahead(tried, changes)
        if not abs(at[-1]) < 1.0:
            break
        there = fit_structure(data, structure, at[:-1], iterations=0)
        sizes = np.append(there.nuisance[:-1], at[-1] * scale)
        one = one.again(data, replace(there, nuisance=sizes))
        if ever is not None and one.counts is not None:
            one = replace(one, counts=one.counts & ever)
            ever = one.counts
    return nearest


def _ahead(tried: list[Real], changes: list[Real]) -> Real:
    """Where the changes vanish, from the last few (D. G. Anderson, J. ACM 12, 1965)."""
    last = tried[-1] + changes[-1]
    memory = slice(-1 - tried[-1].size, None)
    moves, differences = (np.diff(np.array(some[memory]), axis=0) for some in (tried, changes))
    if not len(moves):
        return last
    weights = np.linalg.lstsq(differences.T, changes[-1], rcond=None)[0]
    return np.asarray(last - weights @ (moves + differences))


def is_rounding(problem: Problem, fit: Fit, rounding: float) -> bool:
    """Whether most of a residual is rounding error, of that r.m.s.; it need not be white."""
    return fit.cost < TWICE * problem.counted * rounding**2


def leaves_noise(joint: JointFit, one: NonlinearRow, rounding: float) -> bool:
    """Whether a fit leaves noise, also at samples that do not depend on the linear part.

    Rounding may look like an effect that is smaller than itself.
    """
    problem, fit = joint.problem, joint.best.fit
    size = float(fit.nuisance[-1])
    if size <= 0.0 and one.kind not in _EITHER_WAY:
        return False
    if is_rounding(problem, fit, rounding) and float(np.std(size * one.row)) > rounding:
        return True
    every = (problem.y - fit.prediction)[max(joint.forgotten, one.begins) :]
    return fit.is_white and is_white(every)


def described(joint: JointFit, one: NonlinearRow, fs: float) -> tuple[Modelled, Real]:
    """The nonlinearity as the fit with its row, the last of its rows, has it, at `fs` in Hz.

    The second value is the covariance of the fit's parameters, (p, p). The fit holds the row fixed:
    its derivatives are instruments, and those of the model include how the row moves (Söderström
    and Stoica, System Identification, 1989, ch. 8).
    """
    weighed, fit = joint.weighed, joint.best.fit
    known = weighed.fixed()[1:-1]
    others = replace(weighed, nuisance=known if len(known) else None)
    tools = jacobian(others, fit, one.row)
    residual = weighed.innovations(fit.prediction, fit.residual)
    freedom = max(weighed.counted - len(tools), 1)
    own = covariance(tools, residual, freedom=freedom, white=is_white(residual))
    moves = _moved_rows(joint, one, np.sqrt(own.diagonal()))
    moved = jacobian(others, fit, *moves)[-len(tools) :]
    power = np.vecdot(tools, tools)
    sizes = np.sqrt(np.where(power > 0.0, power, 1.0))
    rows, moved = tools / sizes[:, None], moved / sizes[:, None]
    # In directions that the record does not determine, the row is taken as fixed: they keep their
    # errors.
    gram = rows @ rows.T
    inverse = np.linalg.pinv(gram, rcond=UNSEEN, hermitian=True)
    shift = inverse @ (rows @ moved.T) @ (gram @ inverse)
    turn = np.linalg.pinv(np.eye(len(rows)) + shift) * sizes / sizes[:, None]
    own = turn @ own @ turn.T
    size, kind, row = float(fit.nuisance[-1]), one.kind, one.row
    if kind in ("hardening", "softening"):
        kind = "hardening" if size > 0.0 else "softening"
    if kind == "softening":
        size, row = -size, -row
    waits = None if one.counts is None else ~one.counts
    if waits is not None:
        waits[: max(one.begins, joint.forgotten)] = False
    least = float(residual @ residual) / freedom / float(tools[-1] @ tools[-1])  # others known
    std = float(np.sqrt(max(own[-1, -1], least)))
    part = NonlinearPart(
        kind=kind,
        at=one.at,
        size=size,
        std=std,
        reach=one.reach,
        between=one.between,
        lag=one.lag / fs,
    )
    found = Modelled(trend=size * row, waits=waits, part=part)
    return found, np.asarray(own[:-1, :-1])


def _moved_rows(joint: JointFit, one: NonlinearRow, scale: Real) -> Real:
    """Derivatives of the nonlinear effect by theta, `fit.linear` and its size, (p + 1, n).

    Differences over a standard deviation, `scale`, to either side, since samples begin and cease to
    wait; over less where the model would become unstable or other dynamics.
    """
    problem, fit = joint.problem, joint.best.fit
    vector = np.concatenate([fit.theta, fit.linear, fit.nuisance[-1:]])
    out = np.zeros((vector.size, problem.y.size))

    def effect(at: Real) -> Real:
        theta, linear = at[: fit.theta.size], at[fit.theta.size : -1]
        part = part_of(problem, fit.structure, theta)
        nuisance = np.append(fit.nuisance[:-1], at[-1])
        x = part.driven(linear[:-1]) + linear[-1] + fit.initial @ part.free
        moved = replace(
            fit,
            theta=theta,
            linear=linear,
            nuisance=nuisance,
            prediction=x + nuisance @ problem.fixed()[1:],
        )
        return np.asarray(fit.nuisance[-1] * one.again(problem, moved).row)

    steps = _stable_steps(fit, scale)
    steps[-2] = 0.0  # the effect does not depend on the bias
    for i, step in enumerate(steps):
        if not step:
            continue  # also at the edge of the structure
        aside = np.zeros(vector.size)
        aside[i] = step
        out[i] = (effect(vector + aside) - effect(vector - aside)) / (2.0 * step)
    return out


def _stable_steps(fit: Fit, steps: Real) -> Real:
    """Steps of theta to either side of which the model is stable and of like dynamics, (p + 1,)."""
    out, start = steps.copy(), 1
    out[0] = min(out[0], 1.0)  # of the delay: a sample
    for order in fit.structure.sections:
        out[start] = min(out[start], PART)  # a logarithm
        if order == 2:
            out[start + 1] = min(out[start + 1], PART * fit.theta[start + 1])
        start += order
    return np.asarray(out)


def modelled_finding(one: Modelled, units: tuple[str, str]) -> Finding:
    """State which nonlinearity is part of the model; the units are the input's and the output's."""
    others = " or ".join(KIND_WORDS[kind] for kind in one.others)
    doubt = f" The record may contain {others} instead: the intervals allow for it."
    return Finding(
        code=one.part.kind,
        message=f"The model includes {one.part.words}: {size_in_words(one.part, units)}."
        f"{doubt if others else ''} The figures are those of the linear part. Include this "
        "effect in a simulation, or keep the stimulus away from it.",
        severity="info",
        parameters=(),
    )
