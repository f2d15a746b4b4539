"""Figures outside the band, and motion before the record's start or after its end."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from hmpim.identify.arrays import Real
from hmpim.identify.chance import FALSE_ALARM
from hmpim.identify.fitting.beginning import in_motion
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.growth import scale_of
from hmpim.identify.judgement.evidence import Evidence, structure_in_words
from hmpim.identify.kept import kept
from hmpim.identify.noise.spectra import windowed_power
from hmpim.identify.result.groups import BANDWIDTHS, MODELLED, PHASE_SPLIT, TIMING, in_words
from hmpim.identify.worth import DEEPEST, FEW, PART, PAST, ROUNDING, TWICE
from hmpim.model import response
from hmpim.record import Finding, is_held
from hmpim.record.runs import runs_of

__all__ = [
    "beyond_band",
    "fast_mode",
    "few_lines",
    "initial_transient",
    "integrator",
    "lines_of",
    "natural_frequency_beyond",
    "negative_delay",
    "short_record",
    "unreached_bandwidths",
]

_LOBE = 4
"""Bins from the middle of a Blackman-Harris window's main lobe to its first zero."""

_SPARE = 2
"""Values from lines in excess of the figures, for a wrong structure to show."""

_OF_RATE = 0.4
"""Highest end of a sweep, over the sampling rate."""

_STAMPED_LATE = 5.0
"""Samples by which late stamps may put an output ahead."""

_COMPUTED = (
    " Software that computes each output sample from the input sample of the same instant is one "
    "sample ahead of a held input: state intersample='sampled' if this is the case."
)

_OF_SLOWEST = ("time_constant", "natural_frequency", "damping_ratio")
"""Figures of the slowest poles."""


def initial_transient(evidence: Evidence) -> Iterator[Finding]:
    """Say what is left out because the record does not begin at rest.

    A slow free response looks like a drift: the bias and that pole's figures are then in doubt.
    """
    joint, fit = evidence.joint, evidence.joint.best.fit
    if not joint.forgotten:
        if fit.structure.integrators and _may_have_moved(evidence):
            yield Finding(
                code="initial_transient",
                message="The input is not at rest in the first sample. What the output had "
                "integrated before is part of the bias, unless the unit was at rest.",
                severity="doubt",
                parameters=("bias",),
            )
        return
    first = f"first {joint.forgotten / evidence.fs:.4g} s"
    message = (
        "The record does not begin at rest. The free response of its initial state is fitted too, "
        f"and its {first}, which respond to input before the record, are left out."
        if evidence.has_samples
        else f"The {first} of each run may respond to input before it, and are left out."
    )
    doubted: tuple[str, ...] = ()
    if joint.lingers:
        doubted = ("bias", *_OF_SLOWEST)
        message += f" The free response lasts {fit.memory / evidence.fs:.3g} s and may be a drift."
    if fit.structure.integrators:
        doubted = doubted or ("bias",)
        message += " The integrator's initial value is part of the bias."
    yield Finding(
        code="initial_transient",
        message=message,
        severity="doubt" if doubted else "info",
        parameters=doubted,
    )


def _may_have_moved(evidence: Evidence) -> bool:
    """Whether the output may have moved before the record, hidden by the noise."""
    u = evidence.u
    if not u.size or not (in_motion(u) or u[0] ** 2 > PART * float(np.mean(u**2))):
        return False
    fit = evidence.joint.best.fit
    late = int(fit.delay)  # for so long the motion would go on
    if late < 1:
        return True
    motion = np.mean((fit.prediction[late:] - fit.prediction[:-late]) ** 2)
    noise = float(np.mean(fit.residual**2)) * float(scipy.special.chdtri(late, FALSE_ALARM))
    return bool(PART * late * motion < noise)


def fast_mode(evidence: Evidence) -> Iterator[Finding]:
    """Doubt a richer structure with a mode far beyond the excited band.

    The mode imitates something else, successfully only if the residual is white.
    """
    name = evidence.joint.best.fit.structure.name
    if name in PLAIN:
        return
    poles = np.roots(evidence.readings.system.denominator[::-1])
    fastest = float(np.max(np.abs(poles), initial=0.0) / (2 * np.pi))
    if fastest <= TWICE * evidence.band[1]:
        return
    yield Finding(
        code="extrapolated",
        message=f"A {structure_in_words(name)} model needs a mode at {fastest:.4g} Hz, beyond the "
        f"excited band, which ends at {evidence.band[1]:.4g} Hz: the delay may not be constant, "
        f"or the clocks may drift apart. Check the time stamps, or {_sweep_to(fastest, evidence)}.",
        severity="doubt",
        parameters=evidence.of_other_poles,
    )


def natural_frequency_beyond(evidence: Evidence) -> Iterator[Finding]:
    """Doubt a natural frequency beyond the excited band, and the delay that depends on it."""
    natural = evidence.readings.parameters.natural_frequency
    if natural is None or natural.value <= PAST * evidence.band[1]:
        return
    yield Finding(
        code="extrapolated",
        message=f"The natural frequency of {natural.value:.4g} Hz lies beyond the excited "
        f"band, which ends at {evidence.band[1]:.4g} Hz. To see it, "
        f"{_sweep_to(natural.value, evidence)}.",
        severity="doubt",
        parameters=PHASE_SPLIT,
    )


def _sweep_to(mode: float, evidence: Evidence) -> str:
    """The sweep that shows a mode, in words: to 1.5 times its frequency, within 0.4 of the rate."""
    top = round(1.5 * mode, 2 - math.floor(math.log10(1.5 * mode)))
    if top <= _OF_RATE * evidence.fs:
        return f"sweep to {top:.7g} Hz"
    rate = round(top / _OF_RATE, 1 - math.floor(math.log10(top / _OF_RATE)))
    return f"sweep to {top:.7g} Hz, sampled at {rate:.7g} Hz or faster"


def integrator(evidence: Evidence) -> Iterator[Finding]:
    """Say which figures do not exist for an integrator or a zero at DC."""
    structure = evidence.joint.best.fit.structure
    if structure.dc_zeros:
        rate = "rate" if structure.dc_zeros == 1 else "acceleration"
        why, scale = "A constant input does not move the output", f"output per {rate} of the input"
    elif structure.integrators:
        why, scale = "The output integrates the input", "output's rate per input"
    else:
        return
    yield Finding(
        code="zero_at_dc" if structure.dc_zeros else "integrator",
        message=f"{why}: there is no gain at DC to measure bandwidths from, and the scale factor "
        f"is the {scale}.",
        severity="info",
        parameters=("scale_factor", *BANDWIDTHS),
    )


def beyond_band(evidence: Evidence) -> Iterator[Finding]:
    """Name the bandwidths that the excited band does not reach."""
    structure, p = evidence.joint.best.fit.structure, evidence.readings.parameters
    expected = ["bandwidth_phase90"]
    if structure.order > 1:  # a first-order lag alone never reaches -90°
        expected.append("bandwidth_phase90_without_delay")
    if structure.order > 0:
        expected.append("bandwidth_3db")
    missing = [name for name in expected if getattr(p, name) is None]
    if structure.integrators or structure.dc_zeros or not missing:
        return
    yield unreached_bandwidths(missing, band_end=evidence.band[1])


def unreached_bandwidths(missing: Sequence[str], *, band_end: float) -> Finding:
    """Name the bandwidths that a band with this end in Hz does not reach."""
    return Finding(
        code="beyond_band",
        message=f"Not reached within the excited band, which ends at {band_end:.4g} Hz: "
        + ", ".join(in_words(name) for name in missing)
        + ". Sweep higher to measure it.",
        severity="info",
        parameters=tuple(missing),
    )


def short_record(evidence: Evidence) -> Iterator[Finding]:
    """Say that a record ends before the system has settled: a longer one would tell more.

    A record from rest, or with a free initial state, needs no settling: the intervals hold.
    """
    fit = evidence.joint.best.fit
    settle = (max(fit.delay, 0.0) + fit.memory) / evidence.fs
    length = evidence.joint.problem.y.size / evidence.fs
    if settle <= length:
        return
    yield Finding(
        code="short_record",
        message=f"The record of {length:.4g} s is short against the system's settling time of "
        f"{settle:.4g} s. Record at least {2 * settle:.3g} s.",
        severity="info",
        parameters=MODELLED,
    )


def negative_delay(evidence: Evidence) -> Iterator[Finding]:
    """Doubt an output that moves before its input, if all models that the record allows agree.

    Dynamics with a lead that no structure has may cause a negative delay up to the time constants.
    A larger one is due to the clock, and the figures are those of the record.
    """
    delay = evidence.spanned.delay
    latest = None if delay is None or delay.ci95 is None else delay.ci95[1]
    if delay is None or latest is None or latest * evidence.fs >= -ROUNDING:
        return
    best = evidence.joint.best
    fit = best.fit
    by_a_lead = -fit.delay < max(TWICE * scale_of(fit), _STAMPED_LATE)
    is_computed = is_held(best.intersample) and abs(fit.delay + 1.0) < FEW
    yield Finding(
        code="negative_delay",
        message=f"The delay is negative ({delay.value:.4g} s): the output moves before the "
        "input. Check that the input column is not stamped late, and which column is which."
        + (_COMPUTED if is_computed else ""),
        severity="doubt" if by_a_lead else "info",
        parameters=PHASE_SPLIT if by_a_lead else TIMING,
    )


def _at_the_line(evidence: Evidence) -> str:
    """Gain and phase at the only line, in words."""
    power = windowed_power(evidence.u)
    near = int(np.argmax(power)) + np.arange(-3, 4)
    near = near[(near >= 0) & (near < power.size)]
    place = float(near @ power[near] / power[near].sum()) * evidence.fs / evidence.u.size
    value = complex(response(evidence.readings.system, np.array([place]))[0])
    return (
        f" At {place:.4g} Hz the gain is {abs(value):.4g} and the phase "
        f"{np.degrees(np.angle(value)):.4g}°."
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class InputLines:
    """Properties of an input's spectrum."""

    count: int  # distinct frequencies
    octave: float  # mean power of a bin at the start of the last octave
    end: float  # mean power of a bin at its end


@kept
def lines_of(u: Real) -> InputLines:
    """Count the lines of an input, (n,), and measure its spectrum at both ends of the last octave.

    Examples
    --------
    >>> time = np.arange(1000) / 100
    >>> lines_of(np.sin(2 * np.pi * 3.3 * time)).count, lines_of(np.sin(time**2)).count > 4
    (1, True)
    """
    power = windowed_power(u)
    first, stop = runs_of(power > DEEPEST * power.max())
    count = int(np.sum(1 + np.maximum(stop - first - (2 * _LOBE - 1), 0) // _LOBE))
    part = max(power.size // 16, 1)
    octave, end = power[7 * part : 8 * part], power[-part:]
    return InputLines(count=count, octave=float(octave.mean()), end=float(end.mean()))


def few_lines(evidence: Evidence) -> Iterator[Finding]:
    """Doubt a model with more figures than the input's lines can determine.

    A line determines gain and phase at its frequency only. A white residual is still the noise.
    What follows a start from rest may determine more: if it excludes one more pole, it shows
    dynamics that the model lacks.
    """
    lines = lines_of(evidence.u).count
    fit, hidden = evidence.joint.best.fit, evidence.joint.hidden
    unknown = fit.theta.size + fit.linear.size - 1
    if 2 * lines >= unknown + _SPARE:
        return
    rests = evidence.joint.problem.begins is None
    if rests and hidden is not None and hidden.limit < PART * hidden.scale:
        return
    known = ("bias", "noise_std") if evidence.readings.white else ("bias",)
    yield Finding(
        code="few_lines",
        message=f"The input excites {lines} frequenc{'y' if lines == 1 else 'ies'}, which give "
        f"gain and phase there and nothing else: {unknown} figures of a "
        f"{structure_in_words(fit.structure.name)} model cannot be found from them."
        f"{_at_the_line(evidence) if lines == 1 else ''} Sweep, or add lines.",
        severity="doubt",
        parameters=tuple(n for n in MODELLED if n not in known),
    )
