"""Which records of a fleet `identify` would say nothing more of: its own tests, for all at once.

A fit of all together tells parameters; that nothing else is to be said takes the tests that
`identify` makes of what a fit leaves over. Here each is made for all records of a group by the
same functions, with the same chances. A record for which any of them is not clearly quiet is for
`identify` itself, so that no finding is lost and none is made up.
"""

from collections.abc import Iterator

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.chance import EXCLUDED, FALSE_ALARM
from hmpim.identify.effects.lost_samples import stand_out
from hmpim.identify.fitting.beginning import REACH, ringing_of, stand_out_of
from hmpim.identify.fitting.fit import FORGETS
from hmpim.identify.fitting.halves import halves_of, products_of_halves
from hmpim.identify.fleets.fleet import Fleet, Group
from hmpim.identify.judgement.feedback import chances_without_feedback
from hmpim.identify.judgement.residual import folded_power
from hmpim.identify.nonlinear.evidence import are_curved
from hmpim.identify.nonlinear.harmonics import any_harmonics
from hmpim.identify.nonlinear.sweep_phase import SweepPhase
from hmpim.identify.section_iv.correlation import likeness
from hmpim.identify.signals import longest_lag
from hmpim.identify.worth import BLURRED, FEW, MUCH, PART, WORTH

__all__ = ["are_quiet"]

Places = NDArray[np.intp]

_AT_ONCE = 16
"""Records whose derivatives are held at once."""

_FORGOTTEN = 40.0
"""Time constants after which nothing is left of a free response: e⁻⁴⁰ is rounding."""

_TOLD = ("scale_factor", "natural_frequency", "damping_ratio", "bandwidth_phase90",
         "bandwidth_phase90_without_delay", "bandwidth_3db")  # fmt: skip
"""Figures whose deviation is held against them."""


def are_quiet(
    fleet: Fleet, group: Group, outputs: Real, *, behind: Real, sweep: SweepPhase | None
) -> Mask:
    """Return which records of a group give no test of `identify` anything to say, shape (k,).

    Their outputs have shape (k, n); `behind`, (k, s), holds the least sums of squares that simpler
    structures leave of each; `sweep` is the stimulus' phase, if it is a sweep.
    """
    quiet = group.sound & _is_told(fleet, group, behind)
    alike = [likeness(fleet.u, output, longest_lag(fleet.u.size)) for output in outputs]
    lags = np.array([one.lag for one in alike])
    quiet &= ~stand_out(group.residual) & [one.lead is None for one in alike]
    for test in (_unfolded, _unanswered):
        some = np.flatnonzero(quiet)
        quiet[some] = test(fleet, group, some)
    some = np.flatnonzero(quiet)
    quiet[some] = _linear(fleet, group, some, outputs[some], sweep)
    some = np.flatnonzero(quiet)
    for part, rows in _derivatives(fleet, group, some):
        left = group.residual[part]
        halves = products_of_halves(rows, left)
        chance, gained = halves_of(halves, left.shape[1], share=1.0)
        worth = WORTH**2 * outputs.shape[1] * outputs[part].var(axis=1)
        quiet[part] = (chance >= FALSE_ALARM) | (gained <= worth)
        quiet[part] &= _from_rest(fleet, group, part, rows, lags[part])
    return np.asarray(quiet)


def _is_told(fleet: Fleet, group: Group, behind: Real) -> Mask:
    """Where each figure is known well enough, and no simpler structure comes near."""
    fit, fs, n = group.fit, fleet.fs, fleet.u.size
    cost = fit.cost[group.some]
    told = n * np.log(behind / cost[:, None]).min(axis=1) > 2 * EXCLUDED
    for name in _TOLD:
        if name in group.alone:
            column = group.alone[name]
            told &= column.std <= MUCH * np.abs(column.value)
    delay = group.alone["delay"]
    told &= (delay.value > 0) & (delay.std <= np.maximum(BLURRED / fs, MUCH * delay.value))
    # The slower of two poles, 1 + 2ζ s/ω + s²/ω².
    omega, zeta = np.exp(fit.theta[group.some, 1:].T)
    slowest = (zeta + np.sqrt(np.maximum(zeta**2 - 1.0, 0.0))) / omega
    slowest = np.where(zeta < 1.0, 1.0 / (zeta * omega), slowest)
    told &= np.maximum(fit.theta[group.some, 0], 0.0) + FORGETS * slowest <= n
    return np.asarray(told & (slowest <= MUCH * n))


def _unfolded(fleet: Fleet, group: Group, some: Places) -> Mask:
    """Where what the stimulus does beyond half the rate is certainly no part of the noise."""
    if group.fit.member.intersample != "bandlimited":
        return np.ones(some.size, dtype=bool)
    which = group.some[some]
    peak = 10 ** (np.maximum(group.fit.figures["peak_gain_db"][which], 0.0) / 10)
    most = float(folded_power(fleet.u, fleet.fs).sum()) * group.fit.gain[which] ** 2 * peak
    return np.asarray(most <= 2 * FEW * group.fit.cost[which] / fleet.u.size)


def _unanswered(fleet: Fleet, group: Group, some: Places) -> Mask:
    """Where the stimulus answers nothing of the noise."""
    return np.asarray(chances_without_feedback(fleet.u, group.residual[some]) > FALSE_ALARM)


def _linear(
    fleet: Fleet, group: Group, some: Places, outputs: Real, sweep: SweepPhase | None
) -> Mask:
    """Where nothing of the residual is what a linear system cannot make."""
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


def _derivatives(fleet: Fleet, group: Group, some: Places) -> Iterator[tuple[Places, Real]]:
    """Some records, and the derivatives of their predictions, shape (k, 5, n)."""
    for at in range(0, some.size, _AT_ONCE):
        part = some[at : at + _AT_ONCE]
        rows = np.empty((part.size, group.errors.rows.shape[1] + 1, fleet.u.size))
        rows[:, :-1] = group.errors.rows[part] @ group.fit.member.basis
        rows[:, -1] = 1.0
        yield part, rows


def _from_rest(fleet: Fleet, group: Group, part: Places, rows: Real, lags: Places) -> Mask:
    """Where the record begins at rest, as `hmpim.identify.fitting.beginning` asks it.

    Neither what comes before the first answer is more than noise, nor what rings at the ends, nor
    is there a free response.
    """
    n = fleet.u.size
    left, which = group.residual[part], group.some[part]
    delay = group.fit.theta[which, 0]
    lag = np.where(lags <= PART * n, lags, 0)
    begins = np.ceil(np.maximum(np.maximum(delay, lag), 0.0)).astype(np.intp) + REACH
    at = np.arange(n)
    early = at < begins[:, None]
    quiet = (begins <= longest_lag(n)) & ~stand_out_of(left, early)
    if group.fit.member.intersample == "bandlimited":
        away = at - delay[:, None]
        reach = ringing_of(group.fit.member.source)
        ringing = (np.abs(away) <= reach) | (away >= n - 1 - reach)
        quiet &= ~stand_out_of(left, ringing)
    free = _free_responses(np.exp(group.fit.theta[which, 1:]), n)
    since = at - begins[:, None]
    there = (since >= 0) & (since < free.shape[2])
    free = np.take_along_axis(free, np.where(there, since, 0)[:, None], axis=2) * there[:, None]
    every = np.concatenate([rows * ~early[:, None], free], axis=1)
    gram = every @ every.transpose(0, 2, 1)
    slope = (every @ left[:, :, None])[:, :, 0]
    scale = np.sqrt(np.maximum(np.einsum("iaa->ia", gram), np.finfo(float).tiny))
    gram /= scale[:, :, None] * scale[:, None, :]
    slope /= scale
    inverse = np.linalg.pinv(gram, rcond=1e-12, hermitian=True)
    gained = np.einsum("ia,iab,ib->i", slope, inverse, slope)
    power = np.sum((left * ~early) ** 2, axis=1)
    count = n - begins
    rest = np.maximum(power - gained, np.finfo(float).tiny)
    statistic = count * np.log(np.maximum(power, np.finfo(float).tiny) / rest)
    return np.asarray(quiet & (statistic <= scipy.special.chdtri(2, FALSE_ALARM)))


def _free_responses(modes: Real, samples: int) -> Real:
    """Both free responses of second-order units, ω in rad a sample and ζ, (k, 2); (k, 2, m).

    No longer than the record, and none of them lasts longer than m samples.
    """
    omega, zeta = modes[:, 0, None], modes[:, 1, None]
    away = omega * np.sqrt(zeta**2 - 1.0 + 0j)
    slowest = float((zeta * omega - np.maximum(away.real, 0.0)).min())
    at = np.arange(min(samples, int(_FORGOTTEN / slowest) + 1))
    first, second = (np.exp((sign * away - zeta * omega) * at) for sign in (1.0, -1.0))
    apart = np.where(np.abs(away) > 0.0, away, 1.0)
    return np.stack([(first + second).real, ((first - second) / apart).real], axis=1)
