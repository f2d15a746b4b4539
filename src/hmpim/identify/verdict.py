"""Can the result be trusted? Warnings in plain sentences, and one verdict."""

from dataclasses import dataclass

import numpy as np

from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.joint import CLEARLY, JointFit
from hmpim.identify.readings import Readings, system_of
from hmpim.identify.result import Estimate, Verdict
from hmpim.identify.whiteness import Misfit, innovation_gain
from hmpim.model import bandwidth_phase, slowest_time_constant
from hmpim.record import Finding

__all__ = ["Judgement", "is_unrelated", "judge"]

_RELATED = 40.0
"""Log-likelihood by which a model must beat "the output is constant": looking at thousands
of delays and dynamics, pure noise reaches about 15."""

_INNOVATES = 60.0
"""And by which it must beat "the output is noise of some colour", where the residual is so
coloured that few of its samples are independent; another sweep reaches about 40."""

_TOLERATED_MISFIT = 0.03
"""Misfit, over the output's own r.m.s., beyond which a result is doubtful."""

_LOOSE = 0.3
"""Relative standard deviation beyond which a parameter is not known."""


_BLURRED = 2.0
"""Standard deviation of the delay, in samples, up to which it is always known well enough."""

_OUTSIDE = 2.0
"""Mode of a richer structure, over the end of the excited band, that no record tells."""

_AMBIGUOUS = 4.0
"""Difference of the criterion within which another plain structure is worth naming."""

_MATTERS = 0.03
"""Share of a bandwidth below which a disagreement casts no doubt."""

_ASKED = 4.0
"""Standard deviations of the score test from which one more pole is asked for."""

_SECOND_POLE = 0.2
"""Share of the time constant up to which a second pole may hide in a first-order result."""

_LIKELIER = 6.0
"""Criterion by which another assumption between the samples is likelier (odds of 20) that the
natural one was preferred to: it then casts doubt."""

_DISAGREES = 4.0
"""Standard deviations by which its delay must differ to cast doubt."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """A verdict and the sentences that support it."""

    verdict: Verdict
    findings: tuple[Finding, ...]


def is_unrelated(joint: JointFit) -> bool:
    """Whether a constant explains the output as well as the input does."""
    problem = joint.problem
    y = problem.y if problem.valid is None else problem.y[problem.valid]
    spread = float(np.sum((y - y.mean()) ** 2))
    if spread <= 0 or joint.best.fit.cost <= 0:
        return spread <= 0
    gain = 0.5 * y.size * joint.effective_share * np.log(spread / joint.best.fit.cost)
    if gain >= _RELATED:
        return False
    residual = joint.best.fit.residual
    residual = residual if problem.valid is None else residual[problem.valid]
    return innovation_gain(y, residual) < _INNOVATES


def judge(
    joint: JointFit,
    readings: Readings,
    misfit: Misfit,
    *,
    fs: float,
    band: tuple[float, float],
    fit_percent: float,
    nonlinear: bool = False,
) -> Judgement:
    """Weigh the residual, the error bars and the band against each other.

    Parameters
    ----------
    joint, readings, misfit
        The fit, what was read off it, and what the residual still owes to the input.
    fs : float
        Rate in Hz.
    band : tuple of float
        Excited band in Hz.
    fit_percent : float
        100 (1 - ‖residual‖ / ‖deviation of the output‖).
    nonlinear : bool
        Whether the residual is known to be nonlinear, and so asks for no pole.
    """
    notes: list[tuple[Finding, bool]] = []  # a finding, and whether it casts doubt

    def note(code: str, message: str, *, doubt: bool) -> None:
        notes.append((Finding(code=code, message=message), doubt))

    p = readings.parameters
    fit = joint.best.fit
    unexplained = 1.0 - fit_percent / 100.0
    if joint.forgotten:
        note(
            "initial_transient",
            f"The record does not begin at rest; its first {joint.forgotten / fs:.4g} s were "
            "left out. Begin the record before the stimulus to keep them.",
            doubt=False,
        )
    owed = float(np.sqrt(misfit.share)) * unexplained
    if misfit.probability < 1e-4:
        note(
            "lack_of_fit",
            f"The residual still follows the input: about {100 * owed:.2g} % of the output "
            f"(r.m.s.) is not described by the {_words(fit.structure.name)} model. "
            "Look at the Bode plot where model and measurement part.",
            doubt=owed > _TOLERATED_MISFIT,
        )
    if not readings.white:
        note(
            "coloured_noise",
            "The residual is not white (one independent sample in "
            f"{1 / joint.effective_share:.3g}); the error bars are widened for it.",
            doubt=unexplained > 0.5 and misfit.probability < 1e-4,
        )
    if not fit.converged:
        note(
            "not_converged",
            "The fit stopped before its last step was negligible. "
            "Try a longer record, or one with more excitation.",
            doubt=True,
        )
    for name, spread in _loose(readings):
        note(
            "weak_excitation",
            f"The record hardly tells the {name}: its standard deviation is {100 * spread:.0f} % "
            "of its value. Excite more around the natural frequency, or longer.",
            doubt=True,
        )
    blurred = p.delay is not None and p.delay.std > max(_BLURRED / fs, _LOOSE * abs(p.delay.value))
    if p.delay is not None and blurred:
        note(
            "weak_excitation",
            f"The record hardly tells the delay: its standard deviation is {p.delay.std:.2g} s. "
            "Excite more, or sweep higher.",
            doubt=True,
        )
    fastest = _fastest_mode(readings)
    if fit.structure.name not in PLAIN and fastest > _OUTSIDE * band[1]:
        note(
            "extrapolated",
            f"A {_words(fit.structure.name)} model needs a mode at {fastest:.4g} Hz, beyond the "
            f"excited band, which ends at {band[1]:.4g} Hz: the delay may not be constant, or the "
            f"clocks may part. Check the time stamps, or sweep to {1.5 * fastest:.3g} Hz.",
            doubt=True,
        )
    natural = p.natural_frequency
    if natural is not None and natural.value > 1.2 * band[1]:
        note(
            "extrapolated",
            f"The natural frequency of {natural.value:.4g} Hz lies beyond the excited band, which "
            f"ends at {band[1]:.4g} Hz. Sweep to at least {1.5 * natural.value:.3g} Hz.",
            doubt=True,
        )
    asked = [("-90° frequency", p.bandwidth_phase90)]
    if fit.structure.order > 1:  # a first-order lag alone never gets to -90°
        asked.append(("-90° frequency without delay", p.bandwidth_phase90_without_delay))
    if fit.structure.order > 0:
        asked.append(("-3 dB frequency", p.bandwidth_3db))
    missing = [words for words, estimate in asked if estimate is None]
    if fit.structure.integrators:
        note(
            "integrator",
            "The output integrates the input: it has no gain at DC to measure bandwidths from, "
            "and the scale factor is the output's rate per input.",
            doubt=False,
        )
        missing = []
    if missing:
        note(
            "beyond_band",
            f"Not reached within the excited band, which ends at {band[1]:.4g} Hz: "
            + ", ".join(missing)
            + ". Sweep higher to measure it.",
            doubt=False,
        )
    other = _other_structure(joint, readings, fs=fs, highest=min(band[1], fs / 2))
    if other is not None:
        note("structure", other, doubt=True)
    if readings.halves.probability < 1e-6 and readings.halves.owed > _TOLERATED_MISFIT:
        note(
            "halves_disagree",
            "The two halves of the record ask for different models, worth "
            f"{100 * readings.halves.owed:.2g} % of the output (r.m.s.): the unit changed during "
            "the test, or answers large and small motion differently. Repeat it, or lower the "
            "amplitude.",
            doubt=True,
        )
    if joint.simpler is not None:
        note(
            "structure",
            "The number of poles this record hardly tells: a "
            f"{_words(fit.structure.name)} model is taken for its wider error bars; a "
            f"{_words(joint.simpler.fit.structure.name)} one would put the delay at "
            f"{joint.simpler.fit.delay / fs:.4g} s. Lower the noise, or sweep higher.",
            doubt=True,
        )
    missed = None if nonlinear else _missed_pole(readings, fs=fs, order=fit.structure.order)
    if missed is not None:
        note("structure", missed, doubt=True)
    rival = _rival(joint)
    if rival is not None:
        note("intersample", rival[0], doubt=rival[1])
    settle = _settling(readings)
    length = joint.problem.y.size / fs
    if settle > 0.5 * length:
        note(
            "short_record",
            f"The record of {length:.4g} s is short against the system's settling time of "
            f"{settle:.4g} s. Record at least {2 * settle:.3g} s.",
            doubt=True,
        )
    if p.delay is not None and p.delay.ci95[1] < 0:
        note(
            "negative_delay",
            f"The delay is negative ({p.delay.value:.4g} s): the output moves before the input. "
            "Check that the input column is not stamped late, and which column is which.",
            doubt=True,
        )
    verdict: Verdict = "doubtful" if any(doubt for _, doubt in notes) else "ok"
    return Judgement(verdict=verdict, findings=tuple(finding for finding, _ in notes))


def _loose(readings: Readings) -> list[tuple[str, float]]:
    p = readings.parameters
    named: tuple[tuple[str, Estimate | None], ...] = (
        ("scale factor", p.scale_factor),
        ("natural frequency", p.natural_frequency),
        ("damping ratio", p.damping_ratio),
        ("time constant", p.time_constant if p.natural_frequency is None else None),
    )
    loose = []
    for name, estimate in named:
        if estimate is None:
            continue
        spread = estimate.std / abs(estimate.value) if estimate.value else float("inf")
        if not spread <= _LOOSE:
            loose.append((name, min(spread, 99.0)))
    return loose


def _missed_pole(readings: Readings, *, fs: float, order: int) -> str | None:
    """Sentence on one more pole that the record asks for, or cannot exclude."""
    hidden = readings.hidden
    if hidden is None:
        return None
    moved = float(np.sqrt(abs(hidden.squared)))
    if abs(hidden.squared) > _ASKED * hidden.std and moved > _MATTERS * hidden.scale:
        return (
            f"The record asks for more than {order} pole{'s' if order > 1 else ''} "
            f"({abs(hidden.squared) / hidden.std:.0f} standard deviations), and the delay may be "
            f"{moved / fs:.2g} s off. Lower the noise, or sweep higher, until a richer structure "
            "can be told."
        )
    if order == 1 and hidden.limit > _SECOND_POLE * hidden.scale:
        return (
            f"A second pole of up to {hidden.limit / fs:.3g} s beside the time constant would not "
            "show in this record, and would shorten the delay by as much. Lower the noise, or "
            "sweep higher."
        )
    return None


def _other_structure(
    joint: JointFit, readings: Readings, *, fs: float, highest: float
) -> str | None:
    """Sentence on another structure that fits hardly worse and says another delay or bandwidth."""
    best = joint.best
    std = float(np.sqrt(max(readings.covariance[0, 0], np.finfo(float).tiny)))
    for trial in joint.trials:
        if (
            trial.intersample != best.intersample
            or trial.fit.structure.name == best.fit.structure.name
            or not {trial.fit.structure.name, best.fit.structure.name} <= set(PLAIN)
            or trial.criterion - best.criterion > _AMBIGUOUS
        ):
            continue
        names = (
            f"A {_words(trial.fit.structure.name)} model fits about as well as the "
            f"{_words(best.fit.structure.name)} one and puts the "
        )
        cure = "Lower the noise, or sweep higher, to tell them apart."
        apart = abs(trial.fit.delay - best.fit.delay)
        if apart > _DISAGREES * std:
            return f"{names}delay {apart / std:.0f} standard deviations away. {cure}"
        stated = readings.parameters.bandwidth_phase90
        vector = np.concatenate([trial.fit.theta, trial.fit.linear])
        other = bandwidth_phase(system_of(trial.fit.structure, vector, fs), highest=highest)
        if stated is not None and other is not None:
            parted = abs(other - stated.value)
            if parted > max(_DISAGREES * stated.std, _MATTERS * stated.value):
                return (
                    f"{names}-90° bandwidth at {other:.4g} instead of {stated.value:.4g} Hz. {cure}"
                )
        poles = best.fit.structure.order - trial.fit.structure.order
        if poles > 0 and joint.simpler is None:  # wide as the bars are, the second pole may be none
            return f"{names}delay at {trial.fit.delay / fs:.4g} s. {cure}"
    return None


def _rival(joint: JointFit) -> tuple[str, bool] | None:
    """Say which other assumption between the samples fits as well, and whether it casts doubt.

    It does if it is rather the likelier one, or asks for another structure.
    """
    best = joint.best
    words = {"zoh": "held", "foh": "linear", "bandlimited": "band-limited"}
    here = words[best.intersample]
    likeliest = min(joint.trials, key=lambda trial: trial.criterion)
    if (
        joint.simpler is None
        and likeliest.intersample != best.intersample
        and likeliest.fit.structure.name != best.fit.structure.name
    ):
        there = words[likeliest.intersample]
        apart = likeliest.fit.delay - best.fit.delay
        return (
            f"Whether the input is {here} or {there} between its samples, this record cannot tell, "
            f"and the structure depends on it: {there}, a {_words(likeliest.fit.structure.name)} "
            f"model fits as well as the {_words(best.fit.structure.name)} one, with a delay that "
            f"is {apart:+.2f} samples away. State it with intersample=.",
            True,
        )
    for trial in joint.trials:
        if trial.intersample == best.intersample or (
            trial.fit.structure.name != best.fit.structure.name
        ):
            continue
        apart = abs(trial.fit.delay - best.fit.delay)
        if trial.criterion - best.criterion < 2 * CLEARLY and apart > 0.25:
            likelier = best.criterion - trial.criterion > _LIKELIER
            tells = "speaks for the other, though not clearly" if likelier else "cannot tell"
            return (
                f"Whether the input is {here} or {words[trial.intersample]} "
                f"between its samples, this record {tells}. "
                f"{here.capitalize()} is assumed; the other would "
                f"move the delay by {trial.fit.delay - best.fit.delay:+.2f} samples. "
                "State it with intersample=.",
                likelier,
            )
    return None


def _words(name: str) -> str:
    """A structure's name in plain words."""
    plain = {
        "first_order": "first-order",
        "second_order": "second-order",
        "third_order": "third-order",
        "fourth_order": "fourth-order",
        "second_order_zero": "second-order (with a zero)",
        "two_modes": "two-mode",
        "integrator_first_order": "lagging integrator",
    }
    return plain.get(name, name.replace("_", " "))


def _fastest_mode(readings: Readings) -> float:
    """Frequency in Hz of the fastest pole, 0 if there is none."""
    poles = np.roots(readings.system.denominator[::-1])
    return float(np.max(np.abs(poles), initial=0.0) / (2 * np.pi))


def _settling(readings: Readings) -> float:
    """Delay and five times the slowest time constant, in s."""
    slowest = slowest_time_constant(readings.system.denominator)
    return max(readings.system.delay, 0.0) + 5.0 * slowest
