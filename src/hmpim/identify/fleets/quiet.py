"""Records of a fleet without further findings: the tests of `identify`, for all at once.

The common fit gives parameters only. Here the residuals of all records of a group are tested by the
same functions as in `identify`, with the same chances. A record that fails any test is left to
`identify`, so that no finding is lost and none is invented.
"""

import numpy as np
from numpy.typing import NDArray

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.chance import EXCLUDED, FALSE_ALARM
from hmpim.identify.effects.lost_samples import stand_out
from hmpim.identify.fitting.beginning import (
    first_answers,
    needs_free,
    ringing,
    ringing_of,
    stand_out_of,
)
from hmpim.identify.fitting.fit import FORGETS
from hmpim.identify.fitting.halves import halves_of, products_of_halves
from hmpim.identify.fitting.least_squares import explained
from hmpim.identify.fleets.fleet import Group
from hmpim.identify.fleets.learnt import Fleet
from hmpim.identify.judgement.feedback import chances_without_feedback
from hmpim.identify.judgement.residual import folded_power
from hmpim.identify.nonlinear.evidence import are_curved
from hmpim.identify.nonlinear.harmonics import any_harmonics
from hmpim.identify.nonlinear.sweep_phase import SweepPhase
from hmpim.identify.result.groups import SIZES
from hmpim.identify.section_iv.correlation import likeness
from hmpim.identify.signals import longest_lag
from hmpim.identify.worth import BLURRED, FEW, MUCH, WORTH

__all__ = ["are_quiet"]

Places = NDArray[np.intp]

_AT_ONCE = 16
"""Records whose derivatives are held in memory at once."""

_FORGOTTEN = 40.0
"""Time constants after which a free response has vanished: e⁻⁴⁰ is rounding."""

_DETERMINED = 1e-12
"""Share of the greatest direction, below which the record does not determine a direction."""


def are_quiet(
    fleet: Fleet, group: Group, outputs: Real, *, simpler: Real, sweep: SweepPhase | None
) -> Mask:
    """Return which records of a group pass every test of `identify`, shape (k,).

    Their outputs have shape (k, n); `simpler`, (k, s), are the least residual sums of squares of
    simpler structures; `sweep` is the stimulus' phase, if it is a sweep.
    """
    quiet = group.sound & _is_well_known(fleet, group, simpler)
    alike = [likeness(fleet.u, output, longest_lag(fleet.u.size)) for output in outputs]
    lags = np.array([own.lag for own in alike])
    quiet &= ~stand_out(group.residual) & [own.lead is None for own in alike]
    some = np.flatnonzero(quiet)
    quiet[some] = _unfolded(fleet, group, some)
    some = np.flatnonzero(quiet)  # with feedback the stimulus would depend on the noise
    quiet[some] = chances_without_feedback(fleet.u, group.residual[some]) > FALSE_ALARM
    some = np.flatnonzero(quiet)
    quiet[some] = _linear(fleet, group, some, outputs[some], sweep)
    some = np.flatnonzero(quiet)
    for at in range(0, some.size, _AT_ONCE):
        part = some[at : at + _AT_ONCE]
        rows = np.empty((part.size, group.errors.rows.shape[1] + 1, fleet.u.size))
        rows[:, :-1] = group.errors.rows[part] @ group.fit.member.basis  # by its parameters
        rows[:, -1] = 1.0
        left = group.residual[part]
        halves = products_of_halves(rows, left)
        chance, gained = halves_of(halves, left.shape[1], share=1.0)
        worth = WORTH**2 * outputs.shape[1] * outputs[part].var(axis=1)
        quiet[part] = (chance >= FALSE_ALARM) | (gained <= worth)
        quiet[part] &= _from_rest(fleet, group, part, rows, lags[part])
    return np.asarray(quiet)


def _is_well_known(fleet: Fleet, group: Group, simpler: Real) -> Mask:
    """Where each figure is known well enough, and every simpler structure is excluded."""
    fit, fs, n = group.fit, fleet.fs, fleet.u.size
    cost = fit.cost[group.some]
    known = n * np.log(simpler / cost[:, None]).min(axis=1) > 2 * EXCLUDED
    for name in SIZES:
        if name in group.alone:
            column = group.alone[name]
            known &= np.isnan(column.value) | (column.std <= MUCH * np.abs(column.value))
    delay = group.alone["delay"]
    known &= (delay.value > 0) & (delay.std <= np.maximum(BLURRED / fs, MUCH * delay.value))
    # The slower of two poles, 1 + 2ζ s/ω + s²/ω².
    omega, zeta = np.exp(fit.theta[group.some, 1:].T)
    slowest = (zeta + np.sqrt(np.maximum(zeta**2 - 1.0, 0.0))) / omega
    slowest = np.where(zeta < 1.0, 1.0 / (zeta * omega), slowest)
    known &= np.maximum(fit.theta[group.some, 0], 0.0) + FORGETS * slowest <= n
    return np.asarray(known & (slowest <= MUCH * n))


def _unfolded(fleet: Fleet, group: Group, some: Places) -> Mask:
    """Where the stimulus beyond half the rate certainly adds nothing to the noise."""
    if group.fit.member.intersample != "bandlimited":
        return np.ones(some.size, dtype=bool)
    which = group.some[some]
    peak = 10 ** (np.maximum(group.fit.figures["peak_gain_db"][which], 0.0) / 10)
    most = float(folded_power(fleet.u, fleet.fs).sum()) * group.fit.gain[which] ** 2 * peak
    return np.asarray(most <= 2 * FEW * group.fit.cost[which] / fleet.u.size)


def _linear(
    fleet: Fleet, group: Group, some: Places, outputs: Real, sweep: SweepPhase | None
) -> Mask:
    """Where the residual shows no nonlinearity."""
    quiet = np.ones(some.size, dtype=bool)
    for at in range(0, some.size, _AT_ONCE):
        here = slice(at, at + _AT_ONCE)
        residual = group.residual[some[here]]
        bias = group.fit.figures["bias"][group.some[some[here]]]
        models = outputs[here] - residual - bias[:, None]
        quiet[here] = ~are_curved(models, residual)
    if sweep is not None:
        left = np.flatnonzero(quiet)
        lags = np.rint(group.fit.theta[group.some[some[left]], 0])
        for lag in np.unique(lags):
            part = left[lags == lag]
            delay = float(lag) / fleet.fs
            chances = any_harmonics(group.residual[some[part]], sweep, fleet.fs, delay=delay)
            quiet[part] = chances > FALSE_ALARM
    return quiet


def _from_rest(fleet: Fleet, group: Group, part: Places, rows: Real, lags: Places) -> Mask:
    """Where the record begins at rest, by the tests of `hmpim.identify.fitting.beginning`.

    The residual is noise before the output responds and at the ends, where a spline may ring, and
    there is no free response.
    """
    n = fleet.u.size
    left, which = group.residual[part], group.some[part]
    delay = group.fit.theta[which, 0]
    begins = first_answers(delay, lags, n)
    at = np.arange(n)
    early = at < begins[:, None]
    quiet = (begins <= longest_lag(n)) & ~stand_out_of(left, early)
    if group.fit.member.intersample == "bandlimited":
        reach = ringing_of(group.fit.member.source)
        quiet &= ~stand_out_of(left, ringing(n, delay[:, None], reach))
    free = _free_responses(np.exp(group.fit.theta[which, 1:]), n)
    since = at - begins[:, None]
    there = (since >= 0) & (since < free.shape[2])
    free = np.take_along_axis(free, np.where(there, since, 0)[:, None], axis=2) * there[:, None]
    every = np.concatenate([rows * ~early[:, None], free], axis=1)
    gram = every @ every.transpose(0, 2, 1)
    slope = (every @ left[:, :, None])[:, :, 0]
    gained, _ = explained(gram, slope, least=_DETERMINED)
    power = np.sum((left * ~early) ** 2, axis=1)
    return np.asarray(quiet & ~needs_free(power, power - gained, n - begins, free.shape[1]))


def _free_responses(modes: Real, samples: int) -> Real:
    """Both free responses, (k, 2, m), of second-order units with ω in rad per sample and ζ, (k, 2).

    They end when all have vanished, or with the record.
    """
    omega, zeta = modes[:, 0, None], modes[:, 1, None]
    away = omega * np.sqrt(zeta**2 - 1.0 + 0j)
    slowest = float((zeta * omega - np.maximum(away.real, 0.0)).min())
    at = np.arange(min(samples, int(_FORGOTTEN / slowest) + 1))
    first, second = (np.exp((sign * away - zeta * omega) * at) for sign in (1.0, -1.0))
    apart = np.where(np.abs(away) > 0.0, away, 1.0)
    return np.stack([(first + second).real, ((first - second) / apart).real], axis=1)
