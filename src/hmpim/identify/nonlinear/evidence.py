"""What a sweep's harmonics, or traces, show about one linear fit.

The evidence comes first: harmonics above the noise, or traces that gain likelihood. Then come the
kinds that remain possible, and the question whether a plainer linear structure with one kind
explains more than a rich one alone.
"""

from dataclasses import dataclass, replace

import numpy as np

from hmpim.identify.arrays import Mask, Real, thinned
from hmpim.identify.chance import FALSE_ALARM, LIKELIER, searched
from hmpim.identify.fitting.derivatives import jacobian
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.noise.whiteness import is_white
from hmpim.identify.nonlinear.harmonics import Harmonics, any_harmonics, sweep_harmonics
from hmpim.identify.nonlinear.mechanisms import Mechanism, compare_harmonics, compare_mechanisms
from hmpim.identify.nonlinear.period import find_period
from hmpim.identify.nonlinear.sweep_phase import SweepPhase, sweep_phase
from hmpim.identify.worth import MOST, MUCH, PART, TOLERATED

__all__ = ["Outcome", "Subject", "are_curved", "criterion_of", "inspect_fit"]

_BLOCK = 16_384
"""Samples whose products are summed at once: they fit into a processor's cache."""

_GAIN = searched(36)
"""Log-likelihood that a trace must gain; in linear systems the best one reaches 7."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Subject:
    """The record under test, averaged in blocks of samples if it is long."""

    u: Real  # (n,): input
    problem: Problem
    fs: float  # Hz
    others: tuple[Real, ...]  # other inputs that drove the output at the same time
    sweep: SweepPhase | None  # of the averaged input, if that is a sweep
    block: int  # samples per block


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Outcome:
    """Results of the tests of one linear fit."""

    fit: Fit
    harmonics: Harmonics | None = None
    mechanisms: tuple[Mechanism, ...] = ()  # the likeliest first
    named: tuple[Mechanism, ...] = ()  # those of them that remain possible
    rms: float = 0.0  # of the nonlinear part, in the output's unit

    @property
    def effect(self) -> float:
        """R.m.s. of the whole effect of the likeliest kind, if harmonics determine its size."""
        if self.harmonics is None or not self.named:
            return self.rms
        return max(self.rms, self.named[0].effect)


def inspect_fit(subject: Subject, fit: Fit) -> Outcome:
    """Make all tests that the input allows; a white residual gets a quick test first."""
    counted = slice(None) if subject.problem.valid is None else subject.problem.valid
    white = is_white(fit.residual[counted])
    if subject.sweep is not None:
        return _by_harmonics(subject, subject.sweep, fit, white)
    return Outcome(fit=fit) if subject.others else _by_traces(subject, fit, white)


def _by_harmonics(subject: Subject, sweep: SweepPhase, fit: Fit, white: bool) -> Outcome:
    """Measure the harmonics of a sweep, and find the kinds that may make them."""
    residual = thinned(fit.residual, subject.block)
    rate, delay = subject.fs / subject.block, fit.delay / subject.fs
    if white and any_harmonics(residual[None], sweep, rate, delay=delay)[0] > FALSE_ALARM:
        return Outcome(fit=fit)
    phases = [sweep_phase(thinned(other, subject.block), rate) for other in subject.others]
    others = [phase for phase in phases if phase is not None]
    harmonics = sweep_harmonics(residual, sweep, rate, delay=delay, others=others)
    if harmonics is None:
        return Outcome(fit=fit)
    # No order exceeds the whole residual: if few samples count, orders may cancel each other.
    most = float(np.sqrt(np.mean(residual**2)))
    orders = tuple(replace(order, rms=min(order.rms, most)) for order in harmonics.orders)
    harmonics = replace(harmonics, orders=orders)
    parts = [harmonics.rms(p) for p in (0, 1) if harmonics.probability(p) < FALSE_ALARM]
    kinds: tuple[Mechanism, ...] = ()
    significant = bool(parts) or harmonics.regression.evidence > LIKELIER
    if significant and not subject.others:
        model = thinned(fit.prediction - fit.linear[-1], subject.block)
        denominator = fit.denominator / float(subject.block) ** np.arange(fit.denominator.size)
        kinds = compare_harmonics(harmonics.regression, model, denominator, fs=rate)
    named = _likely(kinds, harmonics.regression.evidence)
    if not parts and not named:
        return Outcome(fit=fit, harmonics=harmonics)
    rms = float(np.sqrt(np.sum(np.square(parts)))) if parts else named[0].rms
    return Outcome(fit=fit, harmonics=harmonics, mechanisms=kinds, named=named, rms=rms)


def _by_traces(subject: Subject, fit: Fit, white: bool) -> Outcome:
    """Test whether any kind explains the residual."""
    if white:
        return Outcome(fit=fit)
    # Missing dynamics resemble every kind a little, more so with few lines.
    share = PART if find_period(subject.u) is None else MOST
    least = share * fit.cost / max(subject.problem.counted, 1)
    kinds = compare_mechanisms(subject.problem, fit, fs=subject.fs)
    found = tuple(m for m in kinds if m.gain > _GAIN and m.rms**2 > least)
    rms = found[0].rms if found else 0.0
    return Outcome(fit=fit, mechanisms=found, named=_likely(found, 0.0), rms=rms)


def _likely(kinds: tuple[Mechanism, ...], evidence: float) -> tuple[Mechanism, ...]:
    """The kinds that remain possible; `evidence` is what all harmonics gain above noise."""
    if not kinds or kinds[0].gain < max(_GAIN, MUCH * evidence):
        return ()
    first = kinds[0]
    unexplained = 1.0 - min(first.gain / max(evidence, first.gain), 1.0)

    def behind(other: Mechanism) -> float:
        alike = {first.kind, other.kind} == {"friction", "backlash"}
        share = (PART if alike else TOLERATED) + 0.5 * unexplained
        return max(searched(1), share * first.gain)

    return tuple(m for m in kinds if m.likelihood > first.likelihood - behind(m))


def criterion_of(subject: Subject, outcome: Outcome) -> float:
    """Schwarz's criterion of a linear fit, with its likeliest kind if there is any."""
    e = thinned(outcome.fit.residual, subject.block)
    unknown, cost = outcome.fit.structure.parameters, float(e @ e)
    if outcome.named and outcome.named[0].trace.size == e.size:
        rows = [thinned(row, subject.block) for row in jacobian(subject.problem, outcome.fit)]
        basis = np.linalg.qr(np.stack([*rows, outcome.named[0].trace]).T)[0]
        cost -= float(np.sum((basis.T @ e) ** 2))
        unknown += 1
    return e.size * float(np.log(max(cost, np.finfo(float).tiny))) + unknown * float(np.log(e.size))


def are_curved(models: Real, residuals: Real) -> Mask:
    """Which white residuals, (k, n), follow the square, cube or direction of their models' output.

    `models` holds the outputs of the linear models, without bias.
    """
    size = np.std(models, axis=1)
    moving = size > 0
    size = np.where(moving, size, 1.0)[:, None]
    gram = np.zeros((len(models), 7, 7))
    for first in range(0, models.shape[1], _BLOCK):
        here = slice(first, first + _BLOCK)
        x, e, before = models[:, here], residuals[:, here], min(first, 1)
        near = models[:, first - before : first + _BLOCK + 1]
        step = np.gradient(near, axis=1)[:, before : before + x.shape[1]]
        cube, direction = x * x * x / size, np.sign(step) * size
        rows = np.stack([np.ones_like(x), x, step, x**2, cube, direction, e], axis=1)
        gram += rows @ rows.transpose(0, 2, 1)
    count, power = gram[:, 0, 0], gram[:, 6, 6]
    scale = np.sqrt(np.einsum("kii->ki", gram[:, :6, :6]))
    scale = np.where(scale > 0, scale, 1.0)
    moment = gram[:, :6, 6] / scale
    gram = gram[:, :6, :6] / (scale[:, :, None] * scale[:, None, :])
    # What each explains in addition to a constant, the output, and its rate.
    mixed = np.linalg.solve(gram[:, :3, :3] + 1e-9 * np.eye(3), gram[:, :3, 3:])
    rest = 1.0 - np.einsum("kij,kij->kj", mixed, gram[:, :3, 3:])
    explained = (moment[:, 3:] - np.einsum("kij,ki->kj", mixed, moment[:, :3])) ** 2
    needed = 2 * np.log(1 / FALSE_ALARM) * (power / count)[:, None]
    return np.asarray(moving & np.any((rest > 1e-6) & (explained > needed * rest), axis=1))
