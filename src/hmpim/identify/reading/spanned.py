"""Intervals that cover every model that the record does not exclude.

Held, linear and band-limited inputs are three models without a parameter between them. Where the
record cannot distinguish them and none is stated, the figure is that of the likeliest, and its
interval is the hull of the intervals under each that the likelihood does not exclude (a union of
confidence sets: R. L. Berger and D. D. Boos, JASA 89, 1994). The same holds for one more pole that
is as likely except for its price, or that would not show.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import scipy

from hmpim.identify.arrays import Real
from hmpim.identify.chance import CLEARLY, COVERAGE, HALF, LIKELIER
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.fit import Fit
from hmpim.identify.fitting.growth import adjusted_for_pole, as_if_hidden, as_if_zero
from hmpim.identify.fitting.held_steps import at_ends, in_whole_samples
from hmpim.identify.fitting.trial import JointFit, Trial
from hmpim.identify.fitting.zeros import SECOND_ZERO, is_servo
from hmpim.identify.reading.figures import figures_at, figures_of
from hmpim.identify.result import Estimate, Parameters
from hmpim.identify.result.groups import BANDWIDTHS, MODELLED, PHASE_SPLIT
from hmpim.identify.worth import FEW, ROUNDING, TWICE

__all__ = [
    "asked_rivals",
    "bent_figures",
    "blurred",
    "plainer_rivals",
    "rivals_of",
    "spanned",
    "without_noise",
]

_STEP = 1e-6
"""Step of a derivative: logarithms of times, samples of delay, share of the numerator."""

_TINY = float(np.finfo(float).tiny)

_FAST = ("natural_frequency", "damping_ratio", *BANDWIDTHS)
"""Figures that grow without limit as a second pole becomes infinitely fast, bandwidths last."""


def rivals_of(joint: JointFit) -> tuple[Trial, ...]:
    """The likeliest trial under each other assumption that the record does not exclude.

    Software has one assumption: there these are all filters and delays that are about as likely.
    """
    best = joint.best
    if best.fit.structure.sampled:
        return tuple(
            t
            for t in joint.trials
            if t is not best
            and t.criterion - best.criterion < 2 * LIKELIER
            and t.fit.structure.parameters <= best.fit.structure.parameters
        )
    others: dict[str, Trial] = {}
    for trial in sorted(joint.trials, key=lambda trial: trial.criterion):
        if trial.intersample != best.intersample:
            others.setdefault(trial.intersample, trial)
    return tuple(t for t in others.values() if t.criterion - best.criterion < 2 * CLEARLY)


def plainer_rivals(joint: JointFit) -> tuple[Trial, ...]:
    """Other trials with no more parameters that the record does not exclude.

    They have other structures, or a zero in the other half plane. Only the chosen assumption
    counts. Their price is no higher, so that the odds are Schwarz's.
    """
    best = joint.best
    if best.fit.structure.sampled:
        return ()
    most = best.fit.structure.parameters
    return tuple(
        trial
        for trial in joint.trials
        if trial.intersample == best.intersample
        and trial is not best
        and trial.fit.structure.parameters <= most
        and trial.criterion - best.criterion < 2 * LIKELIER
        and trial.fit.objective < TWICE * best.fit.objective  # else they are of other data
    )


def asked_rivals(joint: JointFit) -> tuple[Trial, ...]:
    """Trials under the chosen assumption, with more parameters, better by more than chance.

    They were not chosen because of their price alone: plain ones next to a plain one, and two zeros
    next to one. Two zeros also count if the second one would not show.
    """
    best = joint.best
    structure = best.fit.structure
    hides_zero = joint.hidden is not None and joint.hidden.may_hide_zero

    def is_asked(trial: Trial) -> bool:
        other = trial.fit.structure
        extra = other.parameters - structure.parameters
        alike = structure.name in PLAIN and other.name in PLAIN
        second = is_servo(structure) and other.name == SECOND_ZERO
        if extra <= 0 or trial.intersample != best.intersample or not (alike or second):
            return False
        by_chance = scipy.special.chdtri(extra, 1.0 - COVERAGE)
        return bool(joint.gain(trial, best) > by_chance or (second and hides_zero))

    return tuple(filter(is_asked, joint.trials))


def spanned(
    parameters: Parameters,
    joint: JointFit,
    *,
    fs: float,
    highest: float,
    bent: Iterable[tuple[Fit, Real]] = (),
    others: Iterable[Fit] = (),
) -> Parameters:
    """Widen each interval to cover the other assumptions and one more pole.

    The other fits have almost the same sensitivity to the data, so that each interval of the best
    trial's parameters is moved to their value, with its width unchanged. `bent` holds linear fits,
    each with the change of its parameters, (p,), by a possible nonlinearity; `others` are fits with
    a gain that may have changed. Beyond `highest`, in Hz, no bandwidth is read off.
    """

    def figures(fits: Iterable[Fit]) -> list[dict[str, float | None]]:
        # The bandwidth of another model may lie beyond the band.
        return [_or_beyond(figures_of(fit, fs=fs, highest=fs / 2), fit) for fit in fits]

    rivals = rivals_of(joint)
    between = figures(trial.fit for trial in rivals)
    between += figures(fit for rival in rivals for fit in _ends(rival))
    richer = figures(
        trial.fit for trial in (*joint.rivals, *plainer_rivals(joint), *asked_rivals(joint))
    )
    richer += figures([*others, *_ends(joint.best)])
    hidden, fit = joint.hidden, joint.best.fit
    if hidden is not None and (joint.rivals or hidden.may_hide):
        longest = figures_of(as_if_hidden(fit, hidden), fs=fs, highest=highest)
        if set(fit.structure.sections) == {1, 2}:  # the pole joins the real one, and is no mode
            room = figures_of(adjusted_for_pole(fit, hidden), fs=fs, highest=highest)
            longest |= {name: room[name] for name in ("natural_frequency", "damping_ratio")}
        richer.append({name: longest[name] for name in (*PHASE_SPLIT, "bandwidth_3db")})
    if hidden is not None and abs(hidden.squared) > HALF * hidden.std and hidden.fit is fit:
        bent = (*bent, (fit, hidden.squared * hidden.shift))  # more than chance
        proper = fit.structure.zeros < fit.structure.order and not fit.structure.parallel
        if hidden.squared < 0.0 and proper:
            richer += figures([as_if_zero(fit, hidden)])
    richer += [bent_figures(*change, fs=fs, highest=highest) for change in bent]
    moved = {}
    for name, own in parameters.given.items():
        whole, tail = _hull(own, _given(between, name)), _hull(own, _given(richer, name))
        if tail is not own and whole is own:  # a tail of one model, not a choice between several
            whole = replace(tail, std=tail.spread)
        elif tail is not own:
            lows, highs = zip(*(_ends_of(e) for e in (tail, whole)), strict=True)
            whole = replace(whole, ci95=(min(lows), max(highs)))
        moved[name] = whole
    return replace(parameters, **moved)


def _ends(trial: Trial) -> list[Fit]:
    """Fits with the delay at either end of its sample, if only that sample is known."""
    fit = trial.fit
    held = trial.intersample == "zoh"
    if not (fit.structure.order and in_whole_samples(fit.structure, held=held)):
        return []
    found = at_ends(fit.structure, fit.theta, fit.linear)
    return [replace(fit, theta=theta, linear=linear) for theta, linear in found]


def blurred(parameters: Parameters, share: float) -> Parameters:
    """Widen each interval by a share of its figure on either side.

    In the presence of a nonlinearity no linear model is more exact.
    """
    moved = {}
    for name, own in parameters.given.items():
        low, high = own.ci95 or (None, None)
        if low is None or high is None or name not in MODELLED or name == "noise_std":
            continue
        size = 20.0 / np.log(10.0) if name == "peak_gain_db" else abs(own.value)
        room = float(share * size)
        wide = replace(own, std=None, ci95=(low - room, high + room))
        moved[name] = replace(wide, std=wide.spread)
    return replace(parameters, **moved)


def without_noise(parameters: Parameters, rounding: float = ROUNDING) -> Parameters:
    """Widen each interval by rounding, and that of the noise to 0: the residual may not be noise.

    It may be the error of interpolation between the samples. `rounding` is a share of each figure.
    """
    wide, noise = blurred(parameters, rounding), parameters.noise_std
    if noise is None or noise.ci95 is None:
        return wide
    return replace(wide, noise_std=replace(noise, std=None, ci95=(0.0, noise.ci95[1])))


def bent_figures(fit: Fit, moved: Real, *, fs: float, highest: float) -> dict[str, float | None]:
    """Figures where a nonlinearity adds `moved`, (p,), to `theta` and `linear`, to first order.

    A large change of a parameter that the record hardly determines may leave the figures as they
    are. Derivatives of the figures along the change show that; a step of its length would not.
    """
    vector, size = np.concatenate([fit.theta, fit.linear]), fit.theta.size
    sides = (
        float(np.abs(moved[:size]).max()),
        float(np.abs(moved[size:]).max()) / max(float(np.abs(fit.linear).max()), _TINY),
    )
    part = min(1.0, _STEP / max(*sides, _TINY))
    here = figures_at(fit.structure, vector, fs=fs, highest=highest)
    there = figures_at(fit.structure, vector + part * moved, fs=fs, highest=highest)
    return {
        name: None if own is None or other is None else own + (other - own) / part
        for (name, own), other in zip(here.items(), there.values(), strict=True)
    }


def _or_beyond(found: dict[str, float | None], fit: Fit) -> dict[str, float | None]:
    """The figures of a fit, infinite where they are missing because they lie beyond the band.

    A single lag is a pair of poles of which one is infinitely fast, and a missing bandwidth is a
    high one. An integrator and a washout have no gain at DC that a bandwidth could refer to.
    """
    structure = fit.structure
    if structure.integrators or structure.dc_zeros or structure.sampled:
        return found
    beyond = _FAST if structure.order < 2 else _FAST[2:]
    return found | {name: np.inf for name in beyond if found[name] is None}


def _given(found: list[dict[str, float | None]], name: str) -> list[float]:
    """One figure of each fit that has it."""
    return [float(value) for other in found if (value := other.get(name)) is not None]


def _ends_of(own: Estimate) -> tuple[float, float]:
    """The ends of an interval, infinite where it is open."""
    low, high = own.ci95 or (None, None)
    return -np.inf if low is None else low, np.inf if high is None else high


def _hull(own: Estimate, values: list[float]) -> Estimate:
    """Widen an interval to contain its copies around all values; then it has no deviation."""
    low, high = own.ci95 or (None, None)
    if low is None or high is None or not values:
        return own
    below, above = min([own.value, *values]) - own.value, max([own.value, *values]) - own.value
    if max(above, -below) <= FEW * (high - low) / 2:
        return own
    return replace(own, std=None, ci95=(low + below, high + above))
