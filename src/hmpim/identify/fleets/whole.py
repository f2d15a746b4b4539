"""Everything that `identify` says, of the records of a fleet of which nothing else is to be said.

The parameters are those of `fleet.py`; `quiet.py` makes the tests. What is left is read off as
`hmpim.identify.pair` reads it: the measured response and its bandwidths, the paper's steps, and
what simpler structures leave. Those are the only candidates there are: a record that asks for
richer ones is not quiet.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.chance import CLEARLY
from hmpim.identify.fleets.fleet import (
    Column,
    Fleet,
    FleetFit,
    Group,
    fit_fleet,
    parameters_of,
    widen,
)
from hmpim.identify.fleets.learnt import is_alike, theta_at
from hmpim.identify.fleets.pole import alone_of, joint_of
from hmpim.identify.fleets.quiet import are_quiet
from hmpim.identify.fleets.simpler import Simpler, costs_of, learn_simpler
from hmpim.identify.frf.local import local_responses
from hmpim.identify.judgement.between_samples import undetermined_between
from hmpim.identify.judgement.reach import lines_of, unreached_bandwidths
from hmpim.identify.judgement.structure import barely_distinguished
from hmpim.identify.judgement.verdict import judged
from hmpim.identify.noise.input_noise import input_noise
from hmpim.identify.nonlinear.bends import bends, bent_shapes
from hmpim.identify.nonlinear.lines import find_period
from hmpim.identify.nonlinear.sweep_phase import SweepPhase, sweep_phase
from hmpim.identify.reading.bandwidth import disagreeing, response_bandwidths
from hmpim.identify.reading.figures import system_of
from hmpim.identify.reading.readings import from_lag
from hmpim.identify.reading.spanned import spanned
from hmpim.identify.result import (
    Candidate,
    Nonlinearity,
    PairIdentification,
    Parameters,
)
from hmpim.identify.section_iv.paper import estimates_of_many
from hmpim.identify.worth import WORTH
from hmpim.model import RationalDelay
from hmpim.record import Finding

__all__ = ["Whole", "learn_whole", "whole_pairs"]

_LONGEST = 32768
"""Samples of a record that `identify` looks at one by one."""

_SPARE = 6
"""Figures that the lines of a stimulus must tell: four of a second-order model, and two more."""

_APART = 0.05
"""Standard deviations by which a figure of a unit that was learnt from may be off."""

_ASKED = 0.5 * (np.sqrt(2.0 * CLEARLY) - 0.5) ** 2
"""Log-likelihood half a deviation below CLEARLY, from which a record is asked for a nonlinearity:
what one leaves of the unit in the middle is not quite what it leaves of each."""

_BANDWIDTHS = ("bandwidth_phase90", "bandwidth_phase90_without_delay", "bandwidth_3db")

_NOTHING = Nonlinearity(share=0.0, even=0.0, odd=0.0, noise=1.0, linear=0.0, nonlinear=0.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Whole:
    """What the records of a fleet share beyond their parameters."""

    fleet: Fleet  # the parameters' part
    simpler: tuple[Simpler, ...]  # structures that are weighed against that of the fleet
    sweep: SweepPhase | None  # the stimulus' phase, if it is a sweep
    shapes: Real  # (m, n): what nonlinearities leave of the unit in the middle


def learn_whole(fleet: Fleet, pairs: Sequence[PairIdentification]) -> Whole | None:
    """Learn from some units what everything takes; None where each must be asked by itself.

    What is learnt is held against what it is learnt from, `pairs` of `identify`: where anything is
    said of these units that `identify` did not say, nothing is learnt.
    """
    u, fs = fleet.u, fleet.fs
    sweep = sweep_phase(u, fs)
    noise = input_noise(u, fs, band=fleet.band)
    if u.size > _LONGEST or (sweep is None and find_period(u) is not None):
        return None
    if 2 * lines_of(u).count < _SPARE or (noise is not None and noise.attenuation > WORTH):
        return None
    known = [pair for pair in pairs if is_alike(pair)]
    outputs = [output for pair in known if (output := _output(pair)) is not None]
    if not known or len(outputs) < len(known):
        return None
    simpler = learn_simpler(fleet, known, outputs)
    if not simpler:
        return None
    whole = Whole(fleet=fleet, simpler=simpler, sweep=sweep, shapes=_shapes_of(fleet))
    every = np.stack(outputs)
    again = whole_pairs(whole, fit_fleet(fleet, every), every)
    told = [_is_said(own, pair) for own, pair in zip(again, known, strict=True) if own is not None]
    return whole if all(told) and 2 * len(told) >= len(known) else None


def _output(pair: PairIdentification) -> Real | None:
    if pair.prediction is None or pair.residual is None:
        return None
    return np.asarray(pair.prediction + pair.residual)


def _is_said(own: PairIdentification, pair: PairIdentification) -> bool:
    """Whether what all together say of a unit is what was said of it alone."""
    if own.intersample != pair.intersample or own.verdict != pair.verdict:
        return False
    if not {w.code for w in pair.warnings} >= {w.code for w in own.warnings}:
        return False
    for name in (field.name for field in fields(Parameters)):
        one, other = getattr(own.parameters, name), getattr(pair.parameters, name)
        if (one is None) != (other is None):
            return False
        if one is None or other is None:
            continue
        if abs(one.value - other.value) > _APART * other.spread:
            return False
    return True


def whole_pairs(
    whole: Whole,
    fit: FleetFit,
    outputs: Real,
    *,
    names: tuple[str, str] = ("u", "y"),
    findings: tuple[Finding, ...] = (),
) -> list[PairIdentification | None]:
    """Everything that `identify` says of many records; None for those that it must be asked for.

    Outputs have shape (N, n); names are those of input and output; `findings` are what is said of
    the stimulus and the clock.
    """
    fleet, count = whole.fleet, outputs.shape[1]
    centred = outputs - outputs.mean(axis=1, keepdims=True)
    power = np.vecdot(centred, centred)
    simpler = np.stack([costs_of(fleet, one, centred, power) for one in whole.simpler], axis=1)
    found: list[PairIdentification | None] = [None] * outputs.shape[0]
    bandwidths = [name for name in _BANDWIDTHS if name in fleet.names]
    columns = {name: column.copy() for name, column in fit.columns.items()}
    for group in fit.groups:
        behind, some = simpler[group.some], group.some
        quiet = are_quiet(fleet, group, outputs[some], behind=behind, sweep=whole.sweep)
        places = np.flatnonzero(quiet)
        measured = outputs[some[places]]
        covered = _cover_bends(fleet, group, places, measured, shapes=whole.shapes, columns=columns)
        places, measured = places[covered], measured[covered]
        responses = local_responses(
            fleet.u,
            measured,
            fleet.fs,
            delays=group.fit.theta[some[places], 0] / fleet.fs,
            band=fleet.band,
        )
        papers = estimates_of_many(fleet.u, measured, fleet.fs, fleet.band)
        for k, response, paper in zip(places.tolist(), responses, papers, strict=True):
            i = int(some[k])
            system = _system(fleet, group, k)
            own = parameters_of({name: group.alone[name] for name in bandwidths}, k)
            crossings = response_bandwidths(
                response, system, own, fs=fleet.fs, intersample=group.fit.member.intersample
            )
            if disagreeing(crossings, own):
                continue
            pair = PairIdentification(
                input=names[0],
                output=names[1],
                structure=fleet.structure.name,
                intersample=group.fit.member.intersample,
                fit_percent=float(fit.fit_percent[i]),
                parameters=replace(
                    parameters_of(columns, i), delay_correlation=from_lag(paper.delay, fleet.fs)
                ),
                paper=paper,
                frequency_response=response,
                numerator=(1.0,),
                denominator=(*system.denominator[::-1].tolist(),),
                candidates=_candidates(whole, fit, group, k, behind[k], float(power[i])),
                warnings=(*findings, *_findings(fleet, group, k, own, count)),
                from_response=crossings,
                nonlinearity=_NOTHING,
                covariance=_covariance(fleet, group, k, system),
            )
            found[i] = judged(pair)
    return found


def _shapes_of(fleet: Fleet) -> Real:
    """Return what nonlinearities leave of the unit in the middle of a fleet, shape (m, n)."""
    usual = (one for one in fleet.members if one.intersample == fleet.natural)
    member = next(usual, fleet.members[0])
    place = (member.surface.low + member.surface.high) / 2
    values = member.surface.values(place[None])[0]
    problem, best = alone_of(fleet, member, place, values[:-1] @ member.basis + values[-1])
    return bent_shapes(fleet.u, problem, best.fit, intersample=member.intersample, fs=fleet.fs)


def _cover_bends(
    fleet: Fleet,
    group: Group,
    some: NDArray[np.intp],
    outputs: Real,
    *,
    shapes: Real,
    columns: dict[str, Column],
) -> Mask:
    """Let intervals cover a nonlinearity that may be there; return where no more is to be said.

    Units of a fleet are much alike, and so is what a nonlinearity leaves of them. So all residuals
    are held against what each kind leaves of the unit in the middle, and only where one takes
    nearly enough is the record asked by itself, by `hmpim.identify.nonlinear.bends`.

    Of `some` k records of the group, with outputs (k, n), and `shapes`, (m, n), from `shapes_of`.
    What is widened is written to `columns`, which are of all records. False where a nonlinearity
    brings more than chance would, or comes beside one more pole or zero: such a record is for
    `identify`.
    """
    member = group.fit.member
    found = group.residual[some] @ shapes.T / np.sqrt(group.errors.variance[some, None])
    gains = 0.5 * np.maximum(found, 0.0).max(axis=1, initial=0.0) ** 2
    covered = np.ones(some.size, dtype=bool)
    for k in np.flatnonzero(gains > _ASKED).tolist():
        i, j = int(some[k]), int(group.some[some[k]])
        problem, best = alone_of(fleet, member, group.fit.theta[j], outputs[k])
        bent = bends(fleet.u, problem, best.fit, intersample=member.intersample, fs=fleet.fs)
        if not bent:
            continue
        covered[k] = not bent[0].certain and not group.has_tail(i)
        if covered[k]:
            own = parameters_of(group.alone, i)
            wide = spanned(
                own,
                joint_of(problem, best),
                fs=fleet.fs,
                highest=fleet.highest,
                bent=[(one.fit, one.farthest) for one in bent],
            )
            widen(columns, j, own, wide)
    return covered


def _system(fleet: Fleet, group: Group, k: int) -> RationalDelay:
    """The model of one record, in s."""
    i = int(group.some[k])
    vector = np.concatenate([theta_at(group.fit.theta[i]), [group.fit.gain[i], 0.0]])
    return system_of(fleet.structure, vector, fleet.fs)


def _covariance(fleet: Fleet, group: Group, k: int, system: RationalDelay) -> Real:
    """Of delay, scale factor, and the denominator's coefficients, highest power first."""
    _, first, second = system.denominator
    slopes = np.array(
        [
            [1.0 / fleet.fs, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
            [0.0, -2.0 * second, 0.0, 0.0],
            [0.0, -first, first, 0.0],
        ]
    )
    inner = group.errors.variance[k] * group.errors.inner[k]
    return np.asarray(slopes @ inner @ slopes.T)


def _candidates(
    whole: Whole, fit: FleetFit, group: Group, k: int, behind: Real, power: float
) -> tuple[Candidate, ...]:
    """All structures that were tried, the likeliest first."""
    fleet, i = whole.fleet, int(group.some[k])
    n = fleet.u.size
    tried = [
        (fleet.structure, one.member.intersample, float(one.cost[i]), one is group.fit)
        for one in (group.fit, *(other for other, _ in group.others))
    ]
    tried += [
        (one.structure, fleet.natural, float(cost), False)
        for one, cost in zip(whole.simpler, behind, strict=True)
    ]
    found = [
        Candidate(
            structure=structure.name,
            intersample=mode,
            criterion=float(n * np.log(cost / n) + structure.parameters * np.log(n)),
            fit_percent=float(100.0 * (1.0 - np.sqrt(cost / power))),
            chosen=chosen,
        )
        for structure, mode, cost, chosen in tried
    ]
    return tuple(sorted(found, key=lambda c: c.criterion))


def _findings(fleet: Fleet, group: Group, k: int, own: Parameters, n: int) -> tuple[Finding, ...]:
    """What is said of a quiet record: what it cannot tell, which its intervals cover."""
    i = int(group.some[k])
    found: list[Finding] = []
    missing = [name for name in _BANDWIDTHS if getattr(own, name) is None]
    if missing:
        found.append(unreached_bandwidths(missing, band_end=fleet.band[1]))
    delay = group.tails.get(k)
    if delay is not None:
        poles = fleet.structure.order + 1
        found.append(barely_distinguished(fleet.structure.name, poles=poles, delay=delay))
    rivals = sorted(
        (float(other.cost[i]), other) for other, stays in group.others if bool(stays[k])
    )
    apart = [
        (other.member.intersample, float(other.theta[i, 0] - group.fit.theta[i, 0]), "")
        for _, other in rivals
    ]
    found += undetermined_between(group.fit.member.intersample, apart)
    return tuple(found)
