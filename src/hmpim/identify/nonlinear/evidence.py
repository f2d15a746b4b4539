"""What a sweep's harmonics, lines left out, or traces say of one linear fit.

Evidence first: harmonics that no noise makes, lines that no linear system answers, traces that
bring likelihood. Then which kinds are left in question, and whether a plainer linear structure
with one kind beside it says more than a rich one alone.
"""

from dataclasses import dataclass, replace

import numpy as np

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.chance import FALSE_ALARM, LIKELIER, searched
from hmpim.identify.fitting.derivatives import jacobian
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.noise.whiteness import is_white
from hmpim.identify.nonlinear.harmonics import Harmonics, any_harmonics, sweep_harmonics
from hmpim.identify.nonlinear.lines import LineLevel, detection_lines, find_period
from hmpim.identify.nonlinear.mechanisms import Mechanism, compare_harmonics, compare_mechanisms
from hmpim.identify.nonlinear.sweep_phase import SweepPhase, sweep_phase
from hmpim.identify.worth import MOST, MUCH, PART, TOLERATED

__all__ = ["Look", "Seen", "are_curved", "look_at", "plainer_of", "thinned"]

_BLOCK = 16_384
"""Samples whose products are summed at once: as many as fit into a processor's cache."""

_GAIN = searched(36)
"""Log-likelihood that a trace must bring; in linear systems the best of all reaches 7."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Look:
    """The record as it is looked at: in blocks of samples if it is long."""

    u: Real
    problem: Problem
    fs: float
    others: tuple[Real, ...]
    sweep: SweepPhase | None
    block: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Seen:
    """What the tests gave for one linear fit, before it is weighed."""

    fit: Fit
    harmonics: Harmonics | None = None
    lines: tuple[LineLevel, ...] = ()
    mechanisms: tuple[Mechanism, ...] = ()
    named: tuple[Mechanism, ...] = ()
    rms: float = 0.0

    @property
    def effect(self) -> float:
        """R.m.s. of all that the likeliest kind does, where harmonics vouch for its size."""
        if self.harmonics is None or not self.named:
            return self.rms
        return max(self.rms, self.named[0].effect)


def thinned(x: Real, block: int) -> Real:
    """Means over blocks of samples; an incomplete one at the end is left out."""
    if block == 1:
        return x
    return np.asarray(x[: x.size // block * block].reshape(-1, block).mean(axis=1))


def look_at(look: Look, fit: Fit) -> Seen:
    """All tests that the input allows; a quick look first if the residual is white."""
    counted = slice(None) if look.problem.valid is None else look.problem.valid
    white = is_white(fit.residual[counted])
    if look.sweep is not None:
        return _by_harmonics(look, look.sweep, fit, white)
    return Seen(fit=fit) if look.others else _by_traces(look, fit, white)


def _by_harmonics(look: Look, sweep: SweepPhase, fit: Fit, white: bool) -> Seen:
    """Ask a sweep for its harmonics, and which kind makes them."""
    residual = thinned(fit.residual, look.block)
    rate, delay = look.fs / look.block, fit.delay / look.fs
    if (
        white
        and any_harmonics(residual[None], sweep, rate, delay=delay)[0] > FALSE_ALARM
        and not _curved(fit, look.problem)
    ):
        return Seen(fit=fit)
    phases = [sweep_phase(thinned(other, look.block), rate) for other in look.others]
    others = [phase for phase in phases if phase is not None]
    harmonics = sweep_harmonics(residual, sweep, rate, delay=delay, others=others)
    if harmonics is None:
        return Seen(fit=fit)
    harmonics = _within(harmonics, float(np.sqrt(np.mean(residual**2))))
    parts = [harmonics.rms(p) for p in (0, 1) if harmonics.probability(p) < FALSE_ALARM]
    kinds: tuple[Mechanism, ...] = ()
    told = bool(parts) or harmonics.regression.evidence > LIKELIER
    if told and not look.others and np.ptp(fit.prediction) > 0:
        powers = np.arange(fit.denominator.size)
        kinds = compare_harmonics(
            harmonics.regression,
            thinned(fit.prediction - fit.linear[-1], look.block),
            fit.denominator / float(look.block) ** powers,
            fs=rate,
        )
    named = _likely(kinds, harmonics.regression.evidence)
    if not parts and not named:
        return Seen(fit=fit, harmonics=harmonics)
    rms = float(np.sqrt(np.sum(np.square(parts)))) if parts else named[0].rms
    return Seen(fit=fit, harmonics=harmonics, mechanisms=kinds, named=named, rms=rms)


def _within(harmonics: Harmonics, most: float) -> Harmonics:
    """Limit each order to all there is: where few samples count, orders may cancel each other."""
    if all(order.rms <= most for order in harmonics.orders):
        return harmonics
    return replace(
        harmonics,
        orders=tuple(replace(order, rms=min(order.rms, most)) for order in harmonics.orders),
    )


def _by_traces(look: Look, fit: Fit, white: bool) -> Seen:
    """Ask lines left out, if the input repeats, and whether any kind explains the residual."""
    lines = _lines(look.u, look.problem)
    levels = [v for v in lines if v.probability < FALSE_ALARM]
    if white and not levels and not _curved(fit, look.problem):
        return Seen(fit=fit, lines=lines)
    power = fit.cost / max(look.problem.counted, 1)
    least = 0.0
    if not white:  # dynamics left out resemble every kind a little, more so at few lines
        least = power * (PART if find_period(look.u) is None else MOST)
    found = tuple(
        m
        for m in compare_mechanisms(look.problem, fit, fs=look.fs)
        if m.gain > _GAIN and m.rms**2 > least
    )
    distortion = float(np.sqrt(sum(0.5 * v.lines * v.rms**2 for v in levels)))
    return Seen(
        fit=fit,
        lines=lines,
        mechanisms=found,
        named=_likely(found, 0.0),
        rms=max(distortion, found[0].rms if found else 0.0),
    )


def _likely(kinds: tuple[Mechanism, ...], evidence: float) -> tuple[Mechanism, ...]:
    """The kinds that the record leaves in question; one of them, if it tells which.

    `evidence` is the log-likelihood that all harmonics gain beyond what noise would.
    """
    if not kinds or kinds[0].gain < max(_GAIN, MUCH * evidence):
        return ()
    first = kinds[0]
    unexplained = 1.0 - min(first.gain / max(evidence, first.gain), 1.0)

    def behind(other: Mechanism) -> float:
        alike = {first.kind, other.kind} == {"friction", "backlash"}
        share = (PART if alike else TOLERATED) + 0.5 * unexplained
        return max(searched(1), share * first.gain)

    return tuple(m for m in kinds if m.likelihood > first.likelihood - behind(m))


def plainer_of(look: Look, rich: Seen, plain: Seen) -> Seen:
    """The fit that explains more, with the likeliest kind beside it, by Schwarz's criterion."""
    return min(rich, plain, key=lambda one: _criterion(look, one))


def _criterion(look: Look, seen: Seen) -> float:
    """Bayesian criterion of a linear fit with the likeliest kind beside it, if there is one."""
    e = thinned(seen.fit.residual, look.block)
    unknown, cost = seen.fit.structure.parameters, float(e @ e)
    if seen.named and seen.named[0].trace.size == e.size:
        valid = look.problem.valid
        trace = seen.named[0].trace
        if valid is not None:
            trace = trace * thinned(valid.astype(np.float64), look.block)
        rows = [thinned(row, look.block) for row in jacobian(look.problem, seen.fit)]
        basis = np.linalg.qr(np.stack([*rows, trace]).T)[0]
        cost -= float(np.sum((basis.T @ e) ** 2))
        unknown += 1
    return e.size * float(np.log(max(cost, np.finfo(float).tiny))) + unknown * float(np.log(e.size))


def _curved(fit: Fit, problem: Problem) -> bool:
    """Whether a white residual follows square, cube or direction of the linear model's output."""
    x = fit.prediction - fit.linear[-1]
    return bool(are_curved(x[None], fit.residual[None], problem.valid)[0])


def are_curved(models: Real, residuals: Real, counted: Mask | None = None) -> Mask:
    """Which white residuals, (k, n), follow square, cube or direction of what their models say.

    `models` holds the outputs of the linear models, without bias; all samples count, or `counted`.
    """
    size = np.std(models, axis=1)
    told = size > 0
    size = np.where(told, size, 1.0)[:, None]
    gram = np.zeros((len(models), 7, 7))
    for first in range(0, models.shape[1], _BLOCK):
        here = slice(first, first + _BLOCK)
        x, e, before = models[:, here], residuals[:, here], min(first, 1)
        near = models[:, first - before : first + _BLOCK + 1]
        step = np.gradient(near, axis=1)[:, before : before + x.shape[1]]
        cube, turned = x * x * x / size, np.sign(step) * size
        rows = np.stack([np.ones_like(x), x, step, x**2, cube, turned, e], axis=1)
        rows = rows if counted is None else rows[:, :, counted[here]]
        gram += rows @ rows.transpose(0, 2, 1)
    count, power = gram[:, 0, 0], gram[:, 6, 6]
    scale = np.sqrt(np.einsum("kii->ki", gram[:, :6, :6]))
    scale = np.where(scale > 0, scale, 1.0)
    moment = gram[:, :6, 6] / scale
    gram = gram[:, :6, :6] / (scale[:, :, None] * scale[:, None, :])
    # What each gains beside a constant, the output, and its rate.
    mixed = np.linalg.solve(gram[:, :3, :3] + 1e-9 * np.eye(3), gram[:, :3, 3:])
    left = 1.0 - np.einsum("kij,kij->kj", mixed, gram[:, :3, 3:])
    taken = (moment[:, 3:] - np.einsum("kij,ki->kj", mixed, moment[:, :3])) ** 2
    needed = 2 * np.log(1 / FALSE_ALARM) * (power / count)[:, None]
    return np.asarray(told & np.any((left > 1e-6) & (taken > needed * left), axis=1))


def _lines(u: Real, problem: Problem) -> tuple[LineLevel, ...]:
    """Distortion at lines left out, if the input repeats; the first period may be transient."""
    period = find_period(u) if problem.valid is None else None
    if period is None or u.size < 3 * period:
        return ()
    return detection_lines(u[period:], problem.y[period:], period=period)
