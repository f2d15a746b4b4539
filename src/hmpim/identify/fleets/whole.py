"""The whole result of `identify`, for the records of a fleet that pass every test.

The parameters come from `fleet.py`, and the tests from `quiet.py`. The rest is read as in
`hmpim.identify.pair`: the measured response and its bandwidths, the paper's steps, and the
candidates. These are the simpler structures alone: a record that needs a richer one fails a test.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.chance import CLEARLY
from hmpim.identify.fitting.trial import schwarz
from hmpim.identify.fleets.fleet import Column, FleetFit, Group, fit_fleet, parameters_of, widen
from hmpim.identify.fleets.learnt import Fleet, is_alike, theta_at
from hmpim.identify.fleets.pole import alone_of
from hmpim.identify.fleets.quiet import are_quiet
from hmpim.identify.fleets.simpler import Simpler, costs_of, learn_simpler
from hmpim.identify.frf.local import local_responses
from hmpim.identify.judgement.between_samples import undetermined_between
from hmpim.identify.judgement.reach import lines_of, unreached_bandwidths
from hmpim.identify.judgement.structure import barely_distinguished
from hmpim.identify.judgement.verdict import judged
from hmpim.identify.noise.input_noise import input_noise
from hmpim.identify.nonlinear.bends import bends, bent_shapes
from hmpim.identify.nonlinear.mechanisms import LONGEST
from hmpim.identify.nonlinear.period import find_period
from hmpim.identify.nonlinear.sweep_phase import SweepPhase, sweep_phase
from hmpim.identify.reading.bandwidth import beside_model, disagreeing, response_bandwidths
from hmpim.identify.reading.figures import system_of
from hmpim.identify.reading.readings import from_lag
from hmpim.identify.reading.spanned import spanned
from hmpim.identify.result import (
    Candidate,
    Nonlinearity,
    PairIdentification,
    Parameters,
    fit_percent,
)
from hmpim.identify.result.groups import BANDWIDTHS, EVERY
from hmpim.identify.section_iv.paper import estimates_of_many
from hmpim.identify.worth import WORTH
from hmpim.model import RationalDelay
from hmpim.model.response import by_falling_powers
from hmpim.record import Finding

__all__ = ["Whole", "learn_whole", "whole_pairs"]

_SPARE = 6
"""Figures that the lines of a stimulus must determine: four of a second-order model, and two."""

_APART = 0.05
"""Greatest error, in standard deviations, of a figure of a unit that was learnt from."""

_ASKED = 0.5 * (np.sqrt(2.0 * CLEARLY) - 0.5) ** 2
"""Log-likelihood half a deviation below CLEARLY, from which a record is tested for a nonlinearity:
the residual that it causes in the unit in the middle is not quite that in each unit."""

_NOTHING = Nonlinearity(share=0.0, even=0.0, odd=0.0, noise=1.0, linear=0.0, nonlinear=0.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Whole:
    """Common properties of the records of a fleet, for whole results."""

    fleet: Fleet  # for the parameters
    simpler: tuple[Simpler, ...]  # structures that are compared with that of the fleet
    sweep: SweepPhase | None  # the stimulus' phase, if it is a sweep
    shapes: Real  # (m, n): residuals that nonlinearities cause in the unit in the middle


def learn_whole(fleet: Fleet, pairs: Sequence[PairIdentification]) -> Whole | None:
    """Learn the properties for whole results; None if each record must be identified by itself.

    They are checked on the units that they are learnt from, `pairs` of `identify`: if any result
    differs, nothing is learnt.
    """
    u, fs = fleet.u, fleet.fs
    sweep = sweep_phase(u, fs)
    noise = input_noise(u, fs, band=fleet.band)
    if u.size > LONGEST or (sweep is None and find_period(u) is not None):
        return None
    if 2 * lines_of(u).count < _SPARE or (noise is not None and noise.attenuation > WORTH):
        return None
    known = [pair for pair in pairs if is_alike(pair)]
    outputs = [
        pair.prediction + pair.residual
        for pair in known
        if pair.prediction is not None and pair.residual is not None
    ]
    if not known or len(outputs) < len(known):
        return None
    simpler = learn_simpler(fleet, known, outputs)
    if not simpler:
        return None
    whole = Whole(fleet=fleet, simpler=simpler, sweep=sweep, shapes=_shapes_of(fleet))
    every = np.stack(outputs)
    again = whole_pairs(whole, fit_fleet(fleet, every), every)
    same = [_agrees(own, pair) for own, pair in zip(again, known, strict=True) if own is not None]
    return whole if all(same) and 2 * len(same) >= len(known) else None


def _agrees(together: PairIdentification, alone: PairIdentification) -> bool:
    """Whether a unit has the same result in the fleet as alone."""
    if together.intersample != alone.intersample or together.verdict != alone.verdict:
        return False
    if not {w.code for w in alone.warnings} >= {w.code for w in together.warnings}:
        return False
    for name in EVERY:
        here, there = getattr(together.parameters, name), getattr(alone.parameters, name)
        if (here is None) != (there is None):
            return False
        if here is not None and abs(here.value - there.value) > _APART * there.spread:
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
    """Return the results of `identify` for many records; None for those that are left to it.

    Outputs have shape (N, n); `names` are those of input and output; `findings` are about the
    stimulus and the clock.
    """
    fleet = whole.fleet
    centred = outputs - outputs.mean(axis=1, keepdims=True)
    power = np.vecdot(centred, centred)
    simpler = np.stack([costs_of(each, centred, power) for each in whole.simpler], axis=1)
    found: list[PairIdentification | None] = [None] * outputs.shape[0]
    bandwidths = [name for name in BANDWIDTHS if name in fleet.names]
    columns = {name: column.copy() for name, column in fit.columns.items()}
    for group in fit.groups:
        some, mode = group.some, group.fit.member.intersample
        costs = simpler[some]
        quiet = are_quiet(fleet, group, outputs[some], simpler=costs, sweep=whole.sweep)
        places = np.flatnonzero(quiet)
        measured = outputs[some[places]]
        covered = _cover_bends(fleet, group, places, measured, shapes=whole.shapes, columns=columns)
        places, measured = places[covered], measured[covered]
        responses = local_responses(
            fleet.u,
            group.residual[places],
            fleet.fs,
            delays=group.fit.theta[some[places], 0] / fleet.fs,
            band=fleet.band,
            residual=True,
        )
        papers = estimates_of_many(fleet.u, measured, fleet.fs, fleet.band)
        for k, left, paper in zip(places.tolist(), responses, papers, strict=True):
            i = int(some[k])
            vector = np.concatenate([theta_at(group.fit.theta[i]), [group.fit.gain[i], 0.0]])
            system = system_of(fleet.structure, vector, fleet.fs)
            covariance = _covariance(fleet, group, k, system)
            rising = by_falling_powers(covariance, 1)
            response = beside_model(left, system, rising, fs=fleet.fs, intersample=mode)
            own = parameters_of({name: group.alone[name] for name in bandwidths}, k)
            crossings = response_bandwidths(response, system, own, fs=fleet.fs, intersample=mode)
            if disagreeing(crossings, own):
                continue
            pair = PairIdentification(
                input=names[0],
                output=names[1],
                structure=fleet.structure.name,
                intersample=mode,
                fit_percent=float(fit.fit_percent[i]),
                parameters=replace(
                    parameters_of(columns, i), delay_correlation=from_lag(paper.delay, fleet.fs)
                ),
                paper=paper,
                frequency_response=response,
                numerator=(1.0,),
                denominator=(*system.denominator[::-1].tolist(),),
                candidates=_candidates(whole, group, k, costs[k], float(power[i])),
                warnings=(*findings, *_findings(fleet, group, k, own)),
                from_response=crossings,
                nonlinearity=_NOTHING,
                covariance=covariance,
            )
            found[i] = judged(pair)
    return found


def _shapes_of(fleet: Fleet) -> Real:
    """Residuals that nonlinearities cause in the unit in the middle of a fleet, shape (m, n)."""
    usual = (member for member in fleet.members if member.intersample == fleet.natural)
    member = next(usual, fleet.members[0])
    place = (member.surface.low + member.surface.high) / 2
    values = member.surface.values(place[None])[0]
    alone = alone_of(fleet, member, place, values[:-1] @ member.basis + values[-1])
    mode, fit = member.intersample, alone.best.fit
    return bent_shapes(fleet.u, alone.problem, fit, intersample=mode)


def _cover_bends(
    fleet: Fleet,
    group: Group,
    some: NDArray[np.intp],
    outputs: Real,
    *,
    shapes: Real,
    columns: dict[str, Column],
) -> Mask:
    """Let intervals cover a nonlinearity that is possible; return which records need no more.

    Units of a fleet are much alike, and so are the residuals that a nonlinearity causes. So all
    residuals are compared with those of each kind in the unit in the middle, (m, n), and only where
    one explains nearly enough is the record tested by itself, by `hmpim.identify.nonlinear.bends`.

    Given are `some` k records of the group with their outputs, (k, n). The wider intervals are
    written to `columns`, which hold all records. False where a nonlinearity explains more than
    chance would, or occurs together with one more pole or zero: `identify` decides.
    """
    member = group.fit.member
    found = group.residual[some] @ shapes.T / np.sqrt(group.errors.variance[some, None])
    gains = 0.5 * np.maximum(found, 0.0).max(axis=1, initial=0.0) ** 2
    covered = np.ones(some.size, dtype=bool)
    for k in np.flatnonzero(gains > _ASKED).tolist():
        i, j = int(some[k]), int(group.some[some[k]])
        alone = alone_of(fleet, member, group.fit.theta[j], outputs[k])
        mode, fit = member.intersample, alone.best.fit
        bent = bends(fleet.u, alone.problem, fit, intersample=mode)
        if not bent:
            continue
        covered[k] = not bent[0].certain and not group.has_tail(i)
        if covered[k]:
            own, moved = parameters_of(group.alone, i), [(each.fit, each.farthest) for each in bent]
            wide = spanned(own, alone, fs=fleet.fs, highest=fleet.highest, bent=moved)
            widen(columns, j, own, wide)
    return covered


def _covariance(fleet: Fleet, group: Group, k: int, system: RationalDelay) -> Real:
    """Covariance of delay, scale factor, and denominator, highest power first."""
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
    whole: Whole, group: Group, k: int, costs: Real, power: float
) -> tuple[Candidate, ...]:
    """All structures that were tried, the likeliest first."""
    fleet, i = whole.fleet, int(group.some[k])
    tried = [
        (fleet.structure, fits.member.intersample, float(fits.cost[i]), fits is group.fit)
        for fits in (group.fit, *(other for other, _ in group.others))
    ]
    tried += [
        (simpler.structure, fleet.natural, float(cost), False)
        for simpler, cost in zip(whole.simpler, costs, strict=True)
    ]
    found = [
        Candidate(
            structure=structure.name,
            intersample=mode,
            criterion=schwarz(cost, fleet.u.size, structure.parameters),
            fit_percent=float(fit_percent(cost, power)),
            chosen=chosen,
        )
        for structure, mode, cost, chosen in tried
    ]
    return tuple(sorted(found, key=lambda c: c.criterion))


def _findings(fleet: Fleet, group: Group, k: int, own: Parameters) -> tuple[Finding, ...]:
    """Findings on a quiet record: figures beyond its band, and models that its intervals cover."""
    i = int(group.some[k])
    found: list[Finding] = []
    missing = [name for name in BANDWIDTHS if getattr(own, name) is None]
    if missing:
        found.append(unreached_bandwidths(missing, band_end=fleet.band[1]))
    delay = group.tails.get(k)
    if delay is not None:
        poles = fleet.structure.order + 1
        found.append(barely_distinguished(fleet.structure.name, poles=poles, delay=delay))
    rivals = sorted((float(fits.cost[i]), fits) for fits, possible in group.others if possible[k])
    apart = [
        (fits.member.intersample, float(fits.theta[i, 0] - group.fit.theta[i, 0]), "")
        for _, fits in rivals
    ]
    found += undetermined_between(group.fit.member.intersample, apart)
    return tuple(found)
