"""Which nonlinearity the residual of a linear fit looks like.

Each kind leaves its own trace in the residual. With x the output of the linear model, v its
velocity and 1/A its dynamics:

=================  ========================================================================
hardening          -(1/A) x³: a spring force beyond proportion (softening: the other sign)
friction           -(1/A) sign v: a force of constant size against the motion
backlash           the play operator less x: the output waits at each reversal
rate_limit         the output, or the command, followed at no more than a fixed speed, less it
saturation         x clipped, less x: a plateau
asymmetry          -(1/A) x², or x² itself: more one way than the other
curvature          x³ itself: a scale that changes with the deflection, behind the dynamics
=================  ========================================================================

The residual is regressed on each in turn, beside all that a linear change of the model could
explain, with noise that is an autoregression. The likelihoods say which fits best, and
whether the next best is far enough behind to be ruled out.

Of a sweep the harmonics alone are held against each kind's: each makes harmonics of its own
amplitude, phase, and course. What follows the sweep at its own frequency does not count: dynamics
left out look like nothing here, and what of a nonlinearity the linear fit took up does not lessen
its size.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.fitting.derivatives import jacobian
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.noise.autoregression import yule_walker
from hmpim.identify.nonlinear.harmonic_regression import HarmonicFit
from hmpim.model.poles import rational_response
from hmpim.model.sampled import prepare_input

__all__ = [
    "GAPS",
    "KIND_WORDS",
    "LONGEST_AUTOREGRESSION",
    "RATES",
    "Hypothesis",
    "Kind",
    "Mechanism",
    "compare_harmonics",
    "compare_mechanisms",
    "hypotheses",
    "play",
    "rate_limited",
    "stretch_of",
]

Kind = Literal[
    "hardening",
    "softening",
    "friction",
    "backlash",
    "rate_limit",
    "saturation",
    "asymmetry",
    "curvature",
    "dead_zone",
]

KIND_WORDS: dict[Kind, str] = {
    "hardening": "a hardening spring",
    "softening": "a softening spring",
    "friction": "Coulomb friction",
    "backlash": "backlash",
    "rate_limit": "a rate limit",
    "saturation": "clipping",
    "asymmetry": "an asymmetric response",
    "dead_zone": "a dead zone of the command",
    "curvature": "a scale factor that changes with the deflection",
}

GAPS = (0.002, 0.005, 0.01, 0.02, 0.04, 0.08, 0.15, 0.25, 0.4)
"""Half gaps tried, over the output's largest deviation."""

RATES = (0.15, 0.25, 0.35, 0.45, 0.55, 0.65, 0.75, 0.85, 0.93)
"""Speeds tried, over the largest of the linear model."""

_LEVELS = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.88, 0.95)
"""Plateaus tried, over the largest deviation."""

_STICKS = 0.01
"""Speed, over the largest, at which friction is fully turned around: below the sampling's reach."""

LONGEST_AUTOREGRESSION = 10
"""Order of the noise that a trace is held against, at most."""

_LONGEST = 32768
"""Samples looked at; of a longer record the stretch with the greatest residual."""

_LAGS = 8
"""Samples of the input on either side that a linear change of the model may use."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mechanism:
    """One kind of nonlinearity, as well as it fits the residual.

    Parameters
    ----------
    kind : str
        Name as in the module's table.
    size : float
        Hardening and softening: share by which the force at the largest deviation departs from
        proportion. Friction and backlash: half width of the band, in the output's unit.
        Rate limit: speed in the unit per second. Saturation: distance of the plateau from
        the bias, in the unit. Asymmetry, curvature: share by which the output at the largest
        deviation departs from proportion.
    size_std : float
        Standard deviation; the spacing of the values tried where it is one of a list.
    gain : float
        Log-likelihood above that of no nonlinearity in noise of the same colour.
    likelihood : float
        Log-likelihood, the same constant left out for all kinds.
    rms : float
        R.m.s. of what of its effect in the output no linear change explains, in its unit.
    effect : float
        R.m.s. of its whole effect, in the output's unit.
    trace : ndarray, shape (n,)
        Its effect in the output, to a factor; empty where only part of the record was looked at.
    """

    kind: Kind
    size: float
    size_std: float
    gain: float
    likelihood: float
    rms: float
    effect: float
    trace: Real


def play(x: Real, half_gap: float) -> Real:
    """Output of backlash: follows `x`, (n,), half a gap behind, and waits at each reversal.

    Examples
    --------
    >>> play(np.array([0.0, 1.0, 2.0, 1.5, 0.0]), 0.5).tolist()
    [0.0, 0.5, 1.5, 1.5, 0.5]
    """
    return _waiting(x, half_gap, _reversals(x))


def _reversals(x: Real) -> NDArray[np.intp]:
    """Where a signal turns, and its end: only there the output of backlash must be known."""
    way = np.sign(np.diff(x))
    return np.asarray(np.append(np.flatnonzero(way[1:] * way[:-1] <= 0.0) + 1, x.size - 1))


def _waiting(x: Real, half_gap: float, turns: NDArray[np.intp]) -> Real:
    """`play`: from one reversal to the next the output moves one way."""
    before, now = [], float(x[0])
    for turn in x[turns].tolist():
        before.append(now)
        now = min(max(now, turn - half_gap), turn + half_gap)
    held = np.repeat(before, np.diff(turns, prepend=-1))
    return np.asarray(np.clip(held, x - half_gap, x + half_gap))


def rate_limited(x: Real, step: float) -> Real:
    """Follow `x` by no more than `step` from sample to sample.

    Examples
    --------
    >>> rate_limited(np.array([0.0, 3.0, 3.0, 3.0]), 1.0).tolist()
    [0.0, 1.0, 2.0, 3.0]
    """
    target, reached = x.tolist(), 0
    out, late = x.copy(), target.copy()
    fast = np.flatnonzero(np.abs(np.diff(x)) > step).tolist()
    for lost in fast:
        if lost < reached:
            continue  # behind already
        now = target[lost]
        for reached in range(lost + 1, len(target)):  # until it has caught up
            ahead = target[reached] - now
            if ahead > step:
                now += step
            elif ahead < -step:
                now -= step
            else:
                break
            late[reached] = now
        else:
            break
    for begin in fast[:1]:
        out[begin : reached + 1] = late[begin : reached + 1]
    return out


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Hypothesis:
    """A kind with one value tried, and its trace.

    Parameters
    ----------
    kind : str
        Name as in the module's table.
    trace : ndarray, shape (n,)
        Effect in the output.
    size : float or None
        None where the weight of the trace is the size.
    spacing : float
        Half the spacing of the values tried.
    """

    kind: Kind
    trace: Real
    size: float | None = None
    spacing: float = 0.0

    def weighed(
        self,
        weight: float,
        error: float,
        *,
        gain: float,
        likelihood: float,
        rms: float,
        effect: float,
    ) -> Mechanism:
        """The kind as well as it fits, its trace taken so many times, with the error of that."""
        return Mechanism(
            kind=self.kind,
            size=weight if self.size is None else self.size,
            size_std=float(np.hypot(error if self.size is None else 0.0, self.spacing)),
            gain=gain,
            likelihood=likelihood,
            rms=rms,
            effect=effect,
            trace=self.trace,
        )


def compare_mechanisms(problem: Problem, fit: Fit, *, fs: float) -> tuple[Mechanism, ...]:
    """Fit each kind of nonlinearity to the residual of a linear fit, the likeliest first.

    One of each kind whose weight has the right sign is returned; `fs` is the rate in Hz.

    Examples
    --------
    >>> from hmpim.identify.fitting.fit import fit_structure
    >>> from hmpim.model import STRUCTURES
    >>> u = np.sin(np.arange(3000) / 30 * (1 + np.arange(3000) / 3000))
    >>> y = play(u, 0.1) + 0.01 * np.random.default_rng(0).standard_normal(3000)
    >>> data = Problem(source=prepare_input(u, "foh"), y=y, valid=None, longest_delay=9.0)
    >>> fit = fit_structure(data, STRUCTURES["static"], np.zeros(1))
    >>> best = compare_mechanisms(data, fit, fs=100.0)[0]
    >>> best.kind, round(best.size, 1)
    ('backlash', 0.1)
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
    """Hold the harmonics of each kind against those of a residual, the likeliest first.

    Parameters
    ----------
    fit : HarmonicFit
        Regression of the residual; each kind's trace is regressed as it was, and orders 2 and up
        are compared.
    x, denominator, fs
        As for `hypotheses`.

    Returns
    -------
    tuple of Mechanism
        One of each kind whose weight has the right sign. `Mechanism.rms` is that of its harmonics.

    Examples
    --------
    >>> from hmpim.identify.nonlinear.harmonics import sweep_harmonics
    >>> from hmpim.identify.nonlinear.sweep_phase import sweep_phase
    >>> u = np.sin(np.arange(3000) / 30 * (1 + np.arange(3000) / 3000))
    >>> y = play(u, 0.1) + 0.01 * np.random.default_rng(0).standard_normal(3000)
    >>> seen = sweep_harmonics(y - u, sweep_phase(u, 100.0), 100.0)
    >>> best = compare_harmonics(seen.regression, u, np.ones(1), fs=100.0)[0]
    >>> best.kind, round(best.size, 2)
    ('backlash', 0.1)
    """
    tried = list(hypotheses(x, denominator, fs))
    group = fit.group(2, 2 * len(fit.orders))
    values, vectors = np.linalg.eigh(fit.covariance[np.ix_(group, group)])
    kept = values > 1e-12 * values[-1]
    whiten = vectors[:, kept] / np.sqrt(values[kept])  # to unit variance each
    seen, gram = fit.weights[group] @ whiten, fit.gram(group)
    best: dict[Kind, Mechanism] = {}
    for one, weights in zip(tried, fit.weights_of(np.stack([h.trace for h in tried])), strict=True):
        own = weights[group]
        made = own @ whiten
        power, along = float(made @ made), float(made @ seen)
        gain = 0.5 * along**2 / power if power > 0.0 and along > 0.0 else 0.0
        if gain > (best[one.kind].gain if one.kind in best else 0.0):
            weight = along / power
            best[one.kind] = one.weighed(
                weight,
                float(np.linalg.norm(made)) ** -1,
                gain=gain,
                likelihood=gain,
                rms=weight * float(own @ gram @ own) ** 0.5,
                effect=weight * float(np.std(one.trace[fit.view.index])),
            )
    return tuple(sorted(best.values(), key=lambda m: -m.likelihood))


def stretch_of(residual: Real) -> slice:
    """The stretch that is looked at: all, or the part of a long record with most to explain."""
    n = residual.size
    if n <= _LONGEST:
        return slice(0, n)
    power = np.concatenate([[0.0], np.cumsum(residual**2)])
    starts = np.arange(0, n - _LONGEST + 1, _LONGEST // 8)
    start = int(starts[np.argmax(power[starts + _LONGEST] - power[starts])])
    return slice(start, start + _LONGEST)


def _background(problem: Problem, fit: Fit, here: slice) -> Real:
    """All that a linear change of the model could explain, orthonormal, shape (k, m)."""
    x = fit.prediction - fit.linear[-1]
    shifted = [problem.masked(_shifted(x, k))[here] for k in range(-_LAGS, _LAGS + 1, 2)]
    stacked = np.vstack([jacobian(problem, fit)[:, here], np.stack(shifted)])
    norms = np.linalg.norm(stacked, axis=1)
    stacked = stacked[norms > 0] / norms[norms > 0, None]
    values, vectors = np.linalg.eigh(stacked @ stacked.T)
    keep = values > 1e-9 * values[-1]
    return np.asarray((vectors[:, keep] / np.sqrt(values[keep])).T @ stacked)


def _shifted(x: Real, by: int) -> Real:
    index = np.clip(np.arange(x.size) - by, 0, x.size - 1)
    return x[index]


def hypotheses(x: Real, denominator: Real, fs: float, *, every: int = 1) -> Iterator[Hypothesis]:
    """Every kind with every value tried.

    Parameters
    ----------
    x : ndarray, shape (n,)
        The linear model's output less its bias.
    denominator : ndarray
        Of the dynamics that a force goes through, by rising powers of s per sample.
    fs : float
        Rate in Hz.
    every : int
        One of so many values is tried, in the middle of each run of them.
    """
    largest = float(np.max(np.abs(x)))
    step = np.gradient(x)
    fastest = float(np.max(np.abs(step)))

    def through(forces: Real) -> Real:
        """Answers of the dynamics, without delay, to forces given in the output's unit."""
        first = forces[:, :1]
        source = prepare_input(forces - first, "foh")
        answer = rational_response(source, delay=0.0, numerator=np.ones(1), denominator=denominator)
        return np.asarray(answer + first)

    share = x / largest
    square = largest * share**2
    cube = square * share
    yield Hypothesis(kind="curvature", trace=cube)
    yield Hypothesis(kind="curvature", trace=-cube)
    yield Hypothesis(kind="asymmetry", trace=square)
    yield Hypothesis(kind="asymmetry", trace=-square)
    if denominator[0] > 0 and denominator.size > 1:  # an integrator gives way to any force
        dry = np.tanh(step / (_STICKS * fastest))
        stiff, uneven, rubbed = through(np.stack((cube, square, dry)))
        yield Hypothesis(kind="hardening", trace=-stiff)
        yield Hypothesis(kind="softening", trace=stiff)
        yield Hypothesis(kind="asymmetry", trace=-uneven)
        yield Hypothesis(kind="asymmetry", trace=uneven)
        yield Hypothesis(kind="friction", trace=-rubbed)
    turns = _reversals(x)
    for gap in GAPS[every // 2 :: every]:
        half = gap * largest
        trace = (_waiting(x, half, turns) - x) / half
        yield Hypothesis(kind="backlash", trace=trace, spacing=0.15 * half)
    for level in _LEVELS[every // 2 :: every]:
        size = level * largest
        yield Hypothesis(
            kind="saturation", trace=np.clip(x, -size, size) - x, size=size, spacing=0.05 * largest
        )
    for rate in RATES[every // 2 :: every]:
        size = rate * fastest
        yield Hypothesis(
            kind="rate_limit",
            trace=rate_limited(x, size) - x,
            size=size * fs,
            spacing=0.05 * fastest * fs,
        )


def _fitted(hypothesis: Hypothesis, e: Real, background: Real, counted: Mask) -> Mechanism | None:
    """Weight by generalised least squares, the noise's colour from what is then left."""
    h = hypothesis.trace * counted
    alone = h - (background @ h) @ background
    power = float(alone @ alone)
    if power <= 1e-10 * float(h @ h) or power == 0.0:
        return None
    weight = max(float(alone @ e) / power, 0.0)
    left = e - (background @ e) @ background - weight * alone
    colour, _ = yule_walker(left[counted], LONGEST_AUTOREGRESSION)
    # Samples that do not count are passed over: what is left keeps its linear relation.
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
