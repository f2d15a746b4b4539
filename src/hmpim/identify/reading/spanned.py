"""Intervals that cover every model that the record does not exclude.

Held, linear and band-limited are three models without a parameter between them. Where the record
cannot tell them apart and nothing is stated, the figure stays at the likelier one, and its
interval is the hull of the intervals under each that the likelihood does not exclude (a union of
confidence sets: R. L. Berger and D. D. Boos, JASA 89, 1994). So it is with one more pole that is as
likely but for its price, or that is slow and would not show.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import scipy

from hmpim.identify.arrays import Real
from hmpim.identify.chance import CLEARLY, COVERAGE, HALF, LIKELIER, SEEN
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.fit import Fit
from hmpim.identify.fitting.growth import adjusted_for_pole, as_if_hidden, as_if_zero
from hmpim.identify.fitting.held_steps import at_ends, steps_through
from hmpim.identify.fitting.trial import JointFit, Trial
from hmpim.identify.reading.figures import figures_at, figures_of
from hmpim.identify.result import Estimate, Parameters
from hmpim.identify.result.groups import EVERY, MODELLED, PHASE_SPLIT
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

_FAST = (
    *("natural_frequency", "damping_ratio"),
    *("bandwidth_phase90", "bandwidth_phase90_without_delay", "bandwidth_3db"),
)
"""Figures that grow beyond all limits as a second pole becomes infinitely fast, bandwidths last."""


def rivals_of(joint: JointFit, owed: float = 0.0) -> tuple[Trial, ...]:
    """The likeliest trial under each other assumption that the record does not exclude.

    Of software there is one assumption: then every filter and delay about as likely. `owed` is the
    share of the best trial's residual that still follows the input: what no model here describes is
    no noise, and a difference that is smaller excludes nothing.
    """
    best = joint.best
    if best.fit.structure.sampled:
        return tuple(t for t in joint.trials if t is not best and _is_as_likely(t, joint))
    others: dict[str, Trial] = {}
    for trial in sorted(joint.trials, key=lambda trial: trial.criterion):
        if trial.intersample != best.intersample:
            others.setdefault(trial.intersample, trial)
    most = (1.0 + owed) * best.fit.objective if owed else 0.0
    return tuple(
        t
        for t in others.values()
        if t.criterion - best.criterion < 2 * CLEARLY or t.fit.objective < most
    )


def plainer_rivals(joint: JointFit) -> tuple[Trial, ...]:
    """Trials of other structures, with no more parameters, that the record does not exclude.

    Under the chosen assumption. Their price is less, so that the odds are Schwarz's.
    """
    best = joint.best
    if best.fit.structure.sampled:
        return ()
    most = best.fit.structure.parameters
    return tuple(
        trial
        for trial in joint.trials
        if trial.intersample == best.intersample
        and trial.fit.structure != best.fit.structure
        and trial.fit.structure.parameters <= most
        and trial.criterion - best.criterion < 2 * LIKELIER
        and trial.fit.objective < TWICE * best.fit.objective  # else they are of other data
    )


def asked_rivals(joint: JointFit) -> tuple[Trial, ...]:
    """Plain trials with more parameters that the record asks for by more than chance.

    Under the chosen assumption, which was taken for their price alone.
    """
    best = joint.best
    if best.fit.structure.name not in PLAIN:
        return ()
    count = joint.weighed.counted * joint.weighed_share

    def is_asked(trial: Trial) -> bool:
        extra = trial.fit.structure.parameters - best.fit.structure.parameters
        if extra <= 0 or trial.intersample != best.intersample:
            return False
        here, there = (max(one.fit.objective, _TINY) for one in (best, trial))
        gain = count * (np.log(here) - np.log(there))
        enough = scipy.special.chdtri(extra, 1.0 - COVERAGE)
        return trial.fit.structure.name in PLAIN and bool(gain > enough)

    return tuple(filter(is_asked, joint.trials))


def _is_as_likely(trial: Trial, joint: JointFit) -> bool:
    """Whether another filter or delay may be the true one; more taps than are seen say nothing."""
    behind = trial.criterion - joint.best.criterion
    extra = trial.fit.structure.parameters - joint.best.fit.structure.parameters
    price = float(np.log(joint.problem.counted * joint.effective_share))
    return behind < 2 * LIKELIER and (extra <= 0 or extra * price - behind > SEEN * extra)


def spanned(
    parameters: Parameters,
    joint: JointFit,
    *,
    fs: float,
    highest: float,
    bent: Iterable[tuple[Fit, Real]] = (),
    others: Iterable[Fit] = (),
    owed: float = 0.0,
) -> Parameters:
    """Widen each interval to what it would be under the other assumptions, or with one more pole.

    The other fits see the same data with all but the same sensitivity, so that each interval of the
    best trial's parameters is moved to their value, its width kept. `bent` holds linear fits, and
    what a nonlinearity that may be there adds to their parameters, (p,); `others` are fits beside a
    gain that may have changed, or a bias that may have drifted. Beyond `highest`, in Hz, no
    bandwidth is read off; `owed` is as for `rivals_of`.
    """

    def figures(fits: Iterable[Fit]) -> list[dict[str, float | None]]:
        # Of another model a bandwidth may lie beyond the band.
        return [_or_beyond(figures_of(fit, fs=fs, highest=fs / 2), fit) for fit in fits]

    rivals = rivals_of(joint, owed)
    between = figures(trial.fit for trial in rivals)
    between += figures(fit for one in rivals if _steps_through(one) for fit in _ends(one.fit))
    richer = figures(
        trial.fit for trial in (*joint.rivals, *plainer_rivals(joint), *asked_rivals(joint))
    )
    richer += figures(others)
    hidden, fit = joint.hidden, joint.best.fit
    if _steps_through(joint.best):
        richer += figures(_ends(fit))
    if hidden is not None and (joint.rivals or hidden.may_hide):
        longest = figures_of(as_if_hidden(fit, hidden), fs=fs, highest=highest)
        if set(fit.structure.sections) == {1, 2}:  # the pole joins the real one, and is no mode
            room = figures_of(adjusted_for_pole(fit, hidden), fs=fs, highest=highest)
            longest |= {name: room[name] for name in ("natural_frequency", "damping_ratio")}
        richer.append({name: longest[name] for name in (*PHASE_SPLIT, "bandwidth_3db")})
    if hidden is not None and abs(hidden.squared) > HALF * hidden.std and hidden.fit is fit:
        bent = (*bent, (fit, hidden.squared * hidden.shift))  # more than chance asks for it
        proper = fit.structure.zeros < fit.structure.order and not fit.structure.parallel
        if hidden.squared < 0.0 and proper:
            richer += figures([as_if_zero(fit, hidden)])
    richer += [bent_figures(*one, fs=fs, highest=highest) for one in bent]
    moved = {}
    for name in EVERY:
        own = getattr(parameters, name)
        if own is None:
            continue
        whole, tail = _hull(own, _given(between, name)), _hull(own, _given(richer, name))
        if tail is not own and whole is own:  # a tail of one model, not a choice between several
            whole = replace(tail, std=tail.spread)
        elif tail is not own:
            lows, highs = zip(*(_ends_of(e) for e in (tail, whole)), strict=True)
            whole = replace(whole, ci95=(min(lows), max(highs)))
        moved[name] = whole
    return replace(parameters, **moved)


def _steps_through(trial: Trial) -> bool:
    return steps_through(trial.fit.structure, held=trial.intersample == "zoh")


def _ends(fit: Fit) -> list[Fit]:
    """Fits to the same samples, the delay at either end of the sample that it is in."""
    found = at_ends(fit.structure, fit.theta, fit.linear)
    return [replace(fit, theta=theta, linear=linear) for theta, linear in found]


def blurred(parameters: Parameters, share: float) -> Parameters:
    """Widen each interval by a share of its figure on either side.

    To so much no linear model is right where a nonlinearity is known to be there.
    """
    moved = {}
    for name in MODELLED:
        own = getattr(parameters, name)
        if own is None or own.ci95 is None or None in own.ci95 or name == "noise_std":
            continue
        size = 20.0 / np.log(10.0) if name == "peak_gain_db" else abs(own.value)
        room = float(share * size)
        low, high = own.ci95
        wide = replace(own, std=None, ci95=(low - room, high + room))
        moved[name] = replace(wide, std=wide.spread)
    return replace(parameters, **moved)


def without_noise(parameters: Parameters, rounding: float = ROUNDING) -> Parameters:
    """Widen each interval by rounding, and the noise's to 0: the residual need not be noise.

    It may be the error of interpolation between the samples. `rounding` is a share of each figure.
    """
    wide, noise = blurred(parameters, rounding), parameters.noise_std
    if noise is None or noise.ci95 is None:
        return wide
    return replace(wide, noise_std=replace(noise, std=None, ci95=(0.0, noise.ci95[1])))


def bent_figures(fit: Fit, moved: Real, *, fs: float, highest: float) -> dict[str, float | None]:
    """Figures where a nonlinearity adds so much, (p,), to `theta` and `linear`, to first order.

    What a parameter that the record hardly determines takes up leaves a figure that it does alone:
    the figures' own derivatives along the change say so, and no step as long as the change does.
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
        name: None if one is None or other is None else one + (other - one) / part
        for (name, one), other in zip(here.items(), there.values(), strict=True)
    }


def _or_beyond(found: dict[str, float | None], fit: Fit) -> dict[str, float | None]:
    """The figures of a fit, infinite where it has none because what they are of lies beyond.

    A lag alone is a pair of poles of which one is infinitely fast, and no bandwidth is a high one.
    An integrator and a washout have no gain at DC that a bandwidth could refer to.
    """
    structure = fit.structure
    if structure.integrators or structure.dc_zeros or structure.sampled:
        return found
    beyond = _FAST if structure.order < 2 else _FAST[2:]
    return found | {name: np.inf for name in beyond if found[name] is None}


def _given(found: list[dict[str, float | None]], name: str) -> list[float]:
    """What each fit says of one figure."""
    return [float(value) for other in found if (value := other.get(name)) is not None]


def _ends_of(one: Estimate) -> tuple[float, float]:
    """The interval's ends, infinite where it is open."""
    low, high = one.ci95 or (None, None)
    return -np.inf if low is None else low, np.inf if high is None else high


def _hull(own: Estimate, values: list[float]) -> Estimate:
    """An interval that holds those around all values; the deviation only where none widens it."""
    low, high = own.ci95 or (None, None)
    if low is None or high is None or not values:
        return own
    below, above = min([own.value, *values]) - own.value, max([own.value, *values]) - own.value
    if max(above, -below) <= FEW * (high - low) / 2:
        return own
    return replace(own, std=None, ci95=(low + below, high + above))
