"""Which nonlinearity the residual of a linear fit looks like.

Each kind leaves its own trace in the residual. Let x be the output of the linear model, v its
velocity and 1/A its dynamics:

=================  ========================================================================
hardening          -(1/A) x³: a spring force beyond proportion (softening: the other sign)
friction           -(1/A) sign v: a force of constant size against the motion
backlash           the play operator less x: the output waits at each reversal
rate_limit         the output, or the command, followed at a limited speed, less itself
saturation         x clipped, less x: a plateau
asymmetry          -(1/A) x², or x² itself: more deflection one way than the other
curvature          x³ itself: a scale that changes with the deflection, behind the dynamics
=================  ========================================================================

The residual is regressed on each in turn, together with everything that a linear change of the
model could explain, in autoregressive noise. The likelihoods show which kind fits best, and whether
the next best can be ruled out.

For a sweep, only the harmonics are compared: each kind makes harmonics of its own amplitude, phase
and course. The residual at the sweep's own frequency does not count. So missing dynamics are not
mistaken for a nonlinearity, and the part of a nonlinearity that the linear fit absorbed does not
reduce its estimated size.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.fitting.derivatives import jacobian
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.noise.autoregression import yule_walker
from hmpim.identify.nonlinear.harmonic_regression import HarmonicFit
from hmpim.model.nonlinear import Kind
from hmpim.model.operators import play, pushed, rate_limited, reversals

__all__ = [
    "GAPS",
    "LONGEST",
    "LONGEST_AUTOREGRESSION",
    "RATES",
    "Hypothesis",
    "Mechanism",
    "compare_harmonics",
    "compare_mechanisms",
    "hypotheses",
    "stretch_of",
]

GAPS = (0.002, 0.005, 0.01, 0.02, 0.04, 0.08, 0.15, 0.25, 0.4)
"""Half gaps to try, over the output's largest deviation."""

RATES = (0.15, 0.25, 0.35, 0.45, 0.55, 0.65, 0.75, 0.85, 0.93)
"""Speeds to try, over the largest of the linear model."""

_LEVELS = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.88, 0.95)
"""Plateaus to try, over the largest deviation."""

_STICKS = 0.01
"""Speed, over the largest, at which friction has fully reversed: faster than samples resolve."""

LONGEST_AUTOREGRESSION = 10
"""Largest order of the noise model when a trace is tested."""

LONGEST = 32768
"""Samples in which a nonlinearity is sought; of a longer record, those with the largest residual,
means over blocks, or none where each sample is a step.
"""

_LAGS = 8
"""Samples by which a linear change of the model may shift its output, either way."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mechanism:
    """The best fit of one kind of nonlinearity to the residual.

    The size of hardening, softening, asymmetry and curvature is the relative deviation of force or
    output from proportionality at the largest deflection. That of friction and backlash is the half
    width of the band, that of saturation the distance of the plateau from the bias, both in the
    output's unit. That of a rate limit is the speed, in the same unit per second.
    """

    kind: Kind
    size: float
    size_std: float  # standard deviation; for a size from a list, half the spacing of the list
    gain: float  # log-likelihood gained over no nonlinearity, in noise of the same colour
    likelihood: float  # log-likelihood, up to a constant that is the same for all kinds
    rms: float  # of the part that no linear change explains, in the output's unit
    effect: float  # r.m.s. of the whole effect, in the output's unit
    trace: Real  # (n,): effect in the output, up to a factor, over the samples analysed


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Hypothesis:
    """A kind with one value to try, and its trace."""

    kind: Kind
    trace: Real  # (n,): effect in the output
    size: float | None = None  # None if the weight of the trace is the size
    spacing: float = 0.0  # half the spacing of the values to try

    def weighed(self, weight: float, error: float, **figures: float) -> Mechanism:
        """The kind with a weight and its error; `figures` are gain, likelihood, rms and effect."""
        size, size_std = (weight, error) if self.size is None else (self.size, 0.0)
        return Mechanism(
            kind=self.kind,
            size=size,
            size_std=float(np.hypot(size_std, self.spacing)),
            trace=self.trace,
            **figures,
        )


def compare_mechanisms(problem: Problem, fit: Fit, *, fs: float) -> tuple[Mechanism, ...]:
    """Fit each kind of nonlinearity to the residual of a linear fit, the likeliest first.

    Each kind whose weight has the right sign is returned once; `fs` is the rate in Hz.
    """
    if not np.any(fit.residual) or np.ptp(fit.prediction) == 0:
        return ()
    here = stretch_of(fit.residual)
    counted = np.ones(problem.y.size, dtype=bool) if problem.valid is None else problem.valid
    background = _background(problem, fit, here)
    x = fit.prediction[here] - fit.linear[-1]
    best: dict[Kind, Mechanism] = {}
    for hypothesis in hypotheses(x, fit.denominator, fs):
        found = _fitted(hypothesis, fit.residual[here], background, counted[here])
        known = best.get(hypothesis.kind)
        if found is not None and (known is None or found.likelihood > known.likelihood):
            best[found.kind] = found
    return tuple(sorted(best.values(), key=lambda m: -m.likelihood))


def compare_harmonics(
    fit: HarmonicFit, x: Real, denominator: Real, *, fs: float
) -> tuple[Mechanism, ...]:
    """Compare the harmonics of each kind with those of a residual, the likeliest first.

    Each trace is regressed as the residual was in `fit`, and orders 2 and up are compared. Each
    kind whose weight has the right sign is returned once; its `rms` is that of its harmonics. The
    other arguments are as for `hypotheses`.
    """
    tried = list(hypotheses(x, denominator, fs))
    group = fit.group(2, 2 * len(fit.orders))
    values, vectors = np.linalg.eigh(fit.covariance[np.ix_(group, group)])
    kept = values > 1e-12 * values[-1]
    whiten = vectors[:, kept] / np.sqrt(values[kept])  # to unit variance each
    observed, gram = fit.weights[group] @ whiten, fit.gram(group)
    best: dict[Kind, Mechanism] = {}
    traces = np.stack([hypothesis.trace for hypothesis in tried])
    for hypothesis, all_weights in zip(tried, fit.weights_of(traces), strict=True):
        weights = all_weights[group]
        expected = weights @ whiten
        power, along = float(expected @ expected), float(expected @ observed)
        gain = 0.5 * along**2 / power if power > 0.0 and along > 0.0 else 0.0
        known = best.get(hypothesis.kind)
        if gain > (known.gain if known else 0.0):
            weight = along / power
            best[hypothesis.kind] = hypothesis.weighed(
                weight,
                float(np.linalg.norm(expected)) ** -1,
                gain=gain,
                likelihood=gain,
                rms=weight * float(weights @ gram @ weights) ** 0.5,
                effect=weight * float(np.std(hypothesis.trace[fit.view.index])),
            )
    return tuple(sorted(best.values(), key=lambda m: -m.likelihood))


def stretch_of(residual: Real) -> slice:
    """The stretch to analyse: all, or the part of a long record with the largest residual."""
    n = residual.size
    if n <= LONGEST:
        return slice(0, n)
    power = np.concatenate([[0.0], np.cumsum(residual**2)])
    starts = np.arange(0, n - LONGEST + 1, LONGEST // 8)
    start = int(starts[np.argmax(power[starts + LONGEST] - power[starts])])
    return slice(start, start + LONGEST)


def _background(problem: Problem, fit: Fit, here: slice) -> Real:
    """Orthonormal basis of all that a linear change of the model could explain, shape (k, m)."""
    x = fit.prediction - fit.linear[-1]
    index = np.arange(x.size)
    lags = range(-_LAGS, _LAGS + 1, 2)
    shifted = [problem.masked(x[np.clip(index - k, 0, x.size - 1)])[here] for k in lags]
    stacked = np.vstack([jacobian(problem, fit)[:, here], *shifted])
    norms = np.linalg.norm(stacked, axis=1)
    stacked = stacked[norms > 0] / norms[norms > 0, None]
    values, vectors = np.linalg.eigh(stacked @ stacked.T)
    keep = values > 1e-9 * values[-1]
    return np.asarray((vectors[:, keep] / np.sqrt(values[keep])).T @ stacked)


def hypotheses(
    x: Real, denominator: Real, fs: float = 1.0, *, every: int = 1
) -> Iterator[Hypothesis]:
    """Every kind with every value to try.

    `x`, (n,), is the linear model's output less its bias; the denominator, by rising powers of s
    per sample, is of the dynamics that a force acts on. With the rate `fs` in Hz, speeds are per
    second. With `every` = 3, the middle value of each three is tried.
    """
    largest = float(np.max(np.abs(x)))
    step = np.gradient(x)
    fastest = float(np.max(np.abs(step)))
    if fastest == 0.0:  # it stands still
        return

    share = x / largest
    square = largest * share**2
    cube = square * share
    yield Hypothesis(kind="curvature", trace=cube)
    yield Hypothesis(kind="curvature", trace=-cube)
    yield Hypothesis(kind="asymmetry", trace=square)
    yield Hypothesis(kind="asymmetry", trace=-square)
    if denominator[0] > 0 and denominator.size > 1:  # an integrator has no restoring force
        direction = np.tanh(step / (_STICKS * fastest))
        cubic, quadratic, friction = pushed(np.stack((cube, square, direction)), denominator)
        yield Hypothesis(kind="hardening", trace=-cubic)
        yield Hypothesis(kind="softening", trace=cubic)
        yield Hypothesis(kind="asymmetry", trace=-quadratic)
        yield Hypothesis(kind="asymmetry", trace=quadratic)
        yield Hypothesis(kind="friction", trace=-friction)
    turns = reversals(x)
    for gap in GAPS[every // 2 :: every]:
        half = gap * largest
        trace = (play(x, half, turns) - x) / half
        yield Hypothesis(kind="backlash", trace=trace, spacing=0.15 * half)
    for level in _LEVELS[every // 2 :: every]:
        size, spacing = level * largest, 0.05 * largest
        trace = np.clip(x, -size, size) - x
        yield Hypothesis(kind="saturation", trace=trace, size=size, spacing=spacing)
    for rate in RATES[every // 2 :: every]:
        size, spacing = rate * fastest, 0.05 * fastest * fs
        trace = rate_limited(x, size) - x
        yield Hypothesis(kind="rate_limit", trace=trace, size=size * fs, spacing=spacing)


def _fitted(hypothesis: Hypothesis, e: Real, background: Real, counted: Mask) -> Mechanism | None:
    """Fit a hypothesis by generalised least squares, with the noise colour of a first residual."""
    h = hypothesis.trace * counted
    alone = h - (background @ h) @ background
    power = max(float(alone @ alone), np.finfo(float).tiny)
    weight = max(float(alone @ e) / power, 0.0)
    residual = e - (background @ e) @ background - weight * alone
    colour, _ = yule_walker(residual[counted], LONGEST_AUTOREGRESSION)
    # Samples that do not count are skipped: the others keep their linear relation.
    rows = scipy.signal.lfilter(colour, [1.0], np.vstack([background, h])[:, counted], axis=1)
    white = scipy.signal.lfilter(colour, [1.0], e[counted])
    q, r = np.linalg.qr(rows.T)  # the trace last
    if abs(r[-1, -1]) < 1e-9 * float(np.linalg.norm(rows[-1])):
        return None
    projected = q.T @ white
    weight = float(projected[-1] / r[-1, -1])
    if weight <= 0:
        return None
    n = white.size
    rest = max(float(white @ white - projected @ projected), 1e-30 * float(white @ white))
    error = float(np.sqrt(rest / max(n - rows.shape[0], 1))) / abs(float(r[-1, -1]))
    return hypothesis.weighed(
        weight,
        error,
        gain=0.5 * n * float(np.log1p(projected[-1] ** 2 / rest)),
        likelihood=-0.5 * n * float(np.log(rest / n)),
        rms=weight * float(np.sqrt(np.mean(alone**2))),
        effect=weight * float(np.std(h[counted])),
    )
