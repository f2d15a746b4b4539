"""Whether the system is linear, and if not, in which way and by how much.

A sweep shows a nonlinearity by its harmonics, any other input by how much better a nonlinear trace
explains the residual. If there is one, `hmpim.identify.nonlinear.mechanisms` determines its kind.
Dependence on the amplitude takes several records: `hmpim.identify.records.levels`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from hmpim.identify.arrays import Real, thinned
from hmpim.identify.chance import FALSE_ALARM
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.nonlinear.evidence import Outcome, Subject, criterion_of, inspect_fit
from hmpim.identify.nonlinear.harmonic_regression import SweepView
from hmpim.identify.nonlinear.mechanisms import LONGEST, Mechanism
from hmpim.identify.nonlinear.sweep_phase import sweep_phase
from hmpim.identify.result import HarmonicCurve, Nonlinearity
from hmpim.identify.result.digits import percent, plus_minus
from hmpim.identify.result.error_bars import estimate
from hmpim.identify.result.groups import MODELLED
from hmpim.identify.worth import MATERIAL, MOST, WORTH
from hmpim.model.nonlinear import KIND_WORDS
from hmpim.record import Finding

__all__ = ["Inspection", "inspect_nonlinearity"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Inspection:
    """Result of the search for a nonlinearity."""

    seen: Outcome
    findings: tuple[Finding, ...]  # 'nonlinear' if it matters, then its kind if that is certain
    # the given linear fit, or the plainer one if that and one kind explain the output better
    fit: Fit
    summary: Nonlinearity  # the same, for the result


def inspect_nonlinearity(
    u: Real,
    problem: Problem,
    fit: Fit,
    *,
    fs: float,
    plain: Fit | None = None,
    others: Sequence[Real] = (),
    floor: float = 0.0,
    unit: str = "",
    modelled: bool = False,
) -> Inspection:
    """Look for nonlinearity in the residual of a linear fit.

    The input has shape (n,), `fs` is in Hz. If there is a nonlinearity, `fit` is compared with one
    of a plainer structure: a rich structure may only imitate it. If other inputs, (n,), drove the
    output at the same time, only harmonics are tested. Effects up to `floor` are ignored, the
    r.m.s. error of rounding in the output's unit. If the nonlinearity is `modelled`, `fit` is the
    linear part of that model, and its residual includes the nonlinear part.
    """
    output = float(np.std(problem.counting(problem.y)))
    block = -(-u.size // LONGEST)
    sweep = sweep_phase(thinned(u, block), fs / block)
    subject = Subject(u=u, problem=problem, fs=fs, others=tuple(others), sweep=sweep, block=block)
    outcome = inspect_fit(subject, fit)
    if plain is not None and outcome.rms > 0:
        both = outcome, inspect_fit(subject, plain)
        outcome = min(both, key=partial(criterion_of, subject))
    matters = outcome.effect > WORTH * output and outcome.rms > floor
    named = outcome.named if matters else ()
    shares = _shares(outcome, outcome.fit.cost / max(problem.counted, 1))
    findings: list[Finding] = []
    if matters:
        general = _general(outcome, output, shares, compared=not others, modelled=modelled)
        findings.append(general)
        of_kind = _particular(named[0], unit) if len(named) == 1 and not modelled else None
        if of_kind is not None:
            findings.append(of_kind)
    return Inspection(
        seen=outcome,
        findings=tuple(findings),
        fit=outcome.fit if matters else fit,
        summary=_summary(subject, outcome, shares, output, unit=unit, named=named),
    )


def _shares(outcome: Outcome, power: float) -> dict[str, float]:
    """Shares of the residual's power: noise, linear in the input, nonlinear."""
    noise = linear = nonlinear = 0.0
    if outcome.harmonics is not None and power > 0:
        harmonics = outcome.harmonics
        parts = np.square([harmonics.noise_rms, harmonics.fundamental_rms, outcome.rms])
        noise, linear, nonlinear = (parts / parts.sum()).tolist()
    elif power > 0:
        nonlinear = min(outcome.rms**2 / power, 1.0)
        noise = 1.0 - nonlinear
    return {"noise": noise, "linear": linear, "nonlinear": nonlinear}


def _where(outcome: Outcome, output: float) -> list[str]:
    """Harmonics or symmetry in words."""
    if outcome.harmonics is None:
        even = outcome.mechanisms[0].kind == "asymmetry"
        return [f"{'even' if even else 'odd'} in the deflection"]
    return [
        f"{percent(outcome.harmonics.rms(parity) / output)} % in {name} harmonics of the sweep"
        for name, parity in (("odd", 1), ("even", 0))
        if outcome.harmonics.probability(parity) < FALSE_ALARM
    ]


def _general(
    outcome: Outcome, output: float, shares: dict[str, float], *, compared: bool, modelled: bool
) -> Finding:
    """Report a nonlinearity, its size, parity and kind; `compared` if kinds were compared."""
    noise, linear, nonlinear = (100 * share for share in shares.values())
    share, effect = outcome.rms / output, outcome.effect / output
    names = [KIND_WORDS[mechanism.kind] for mechanism in outcome.named]
    if modelled:
        guess = "The model includes it."
    elif len(names) == 1:
        guess = f"It looks like {names[0]}."
    elif names:
        guess = f"It may be {' or '.join(names)}; this record does not show which."
    elif compared:
        guess = "None of the kinds tried fits alone."
    else:
        guess = "Drive one input at a time to see which kind it is."
    if effect > (1 + MOST) * share:
        guess += f" Its whole effect, most of which a linear model absorbs, is {percent(effect)} %."
    where = _where(outcome, output)
    at = f": {' and '.join(where)}" if where else ""
    found = f"{percent(share)} % of the output (r.m.s.) is nonlinear{at}. {guess}"
    if modelled:
        return Finding(code="nonlinear", message=found, severity="info", parameters=())
    split = f"Of the residual's power {nonlinear:.0f} % is nonlinear and {noise:.0f} % noise"
    if outcome.harmonics is None:  # only a sweep distinguishes missing dynamics from noise
        split += " or dynamics left out"
    elif linear >= 0.5:
        split += f"; {linear:.0f} % still follows the input"
    return Finding(
        code="nonlinear",
        message=f"{found} {split}. "
        "Identify at several amplitudes to see where the linear model holds.",
        severity="doubt" if outcome.effect > MATERIAL * output else "info",
        parameters=MODELLED,
    )


def _particular(found: Mechanism, unit: str) -> Finding | None:
    """Explain a kind, its size, and what to do about it; None for those without an explanation."""
    of = f" {unit}" if unit else ""
    share = f"{plus_minus(100 * found.size, 100 * found.size_std)} %"
    size = f"{plus_minus(found.size, found.size_std)}{of}"
    match found.kind:
        case "hardening" | "softening":
            way, moves = ("above", "higher") if found.kind == "hardening" else ("below", "lower")
            # Under a sinusoid, three quarters of a cubic force act like a spring; the frequency
            # changes by half of the spring's change.
            message = (
                f"At the largest deflection the restoring force is {share} {way} that of a linear "
                f"spring, so the natural frequency there is about {percent(0.375 * found.size)} % "
                f"{moves} than for small motion. Use a smaller amplitude for the linear model."
            )
        case "friction":
            message = (
                f"Coulomb friction equals the restoring force at a deflection of {size}. "
                "Motions of that size barely show in the output; use larger ones, or put friction "
                "into the model."
            )
        case "backlash":
            message = (
                f"There is play of {plus_minus(2 * found.size, 2 * found.size_std)}{of} in total. "
                "Look at gears and couplings, or put backlash into the model."
            )
        case "rate_limit":
            message = (
                f"The speed seems limited to {size}{'/s' if unit else ' per second'}. "
                "Keep the stimulus's velocity below it."
            )
        case "saturation":
            message = (
                f"The output seems clipped {size} from its bias. Drive it less hard, or "
                "look for a stop."
            )
        case _:
            return None
    return Finding(code=found.kind, message=message, severity="info", parameters=MODELLED)


def _summary(
    subject: Subject,
    outcome: Outcome,
    shares: dict[str, float],
    output: float,
    *,
    unit: str,
    named: tuple[Mechanism, ...],
) -> Nonlinearity:
    """Summarise for the result."""
    even = odd = 0.0
    curves: list[HarmonicCurve] = []
    if (harmonics := outcome.harmonics) is not None:
        even, odd = (harmonics.rms(p) / output for p in (0, 1))
        model = thinned(outcome.fit.prediction, subject.block)
        own = _own_amplitude(harmonics.regression.view, model, subject.fs / subject.block)
        curves = [own, *(harmonic.curve for harmonic in harmonics.orders)]
    elif outcome.mechanisms:
        share = outcome.mechanisms[0].rms / output
        even, odd = (share, 0.0) if outcome.mechanisms[0].kind == "asymmetry" else (0.0, share)
    size = None
    if len(named) == 1:
        units = {"friction": unit, "backlash": unit, "saturation": unit}
        units["rate_limit"] = f"{unit}/s" if unit else "1/s"
        of_kind = units.get(named[0].kind, "")
        size = estimate(named[0].size, named[0].size_std ** 2, unit=of_kind)
    return Nonlinearity(
        share=outcome.rms / output if output else 0.0,
        even=even,
        odd=odd,
        kinds=tuple(mechanism.kind for mechanism in named),
        size=size,
        harmonics=tuple(curves),
        **shares,
    )


def _own_amplitude(view: SweepView, x: Real, fs: float) -> HarmonicCurve:
    """Amplitude of the linear model's output at the places of the harmonics."""
    frequency, amplitude = [], []
    for place in range(view.places + 1):
        near = view.index[np.abs(view.along - place) < 0.5]
        if near.size:
            frequency.append(fs * float(np.interp(place, view.along, view.rate)))
            amplitude.append(float(np.std(x[near]) * np.sqrt(2.0)))
    return HarmonicCurve(
        order=1, frequency=tuple(frequency), amplitude=tuple(amplitude), std=(0.0,) * len(frequency)
    )
