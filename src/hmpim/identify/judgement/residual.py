"""Checks of the residual: lack of fit, colour, halves that disagree, noise on the input."""

from collections.abc import Iterator

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.chance import DEVIATIONS, FALSE_ALARM
from hmpim.identify.fitting.halves import compare_halves
from hmpim.identify.judgement.evidence import Evidence, structure_in_words
from hmpim.identify.judgement.reach import lines_of
from hmpim.identify.noise.colour import noise_colour
from hmpim.identify.noise.input_noise import input_noise
from hmpim.identify.noise.whiteness import is_steady
from hmpim.identify.result.digits import percent
from hmpim.identify.result.groups import GAIN, MODELLED
from hmpim.identify.worth import FEW, MATERIAL, MOST, PART, TOLERATED, WORTH
from hmpim.model import response
from hmpim.record import Finding

__all__ = [
    "changing_noise",
    "coloured_noise",
    "filled_input",
    "folded_power",
    "halves_disagree",
    "lack_of_fit",
    "moved_by",
    "noise_colour_of",
    "noise_on_the_input",
    "uneven_noise",
    "unsampled_input",
]

_FEWEST = 256
"""Fewest samples that determine the end of an input's spectrum."""

_BINS = 16_384
"""Most frequencies, evenly spread, in the sum of the response to aliased input."""

_PARTS = 10
"""Parts of the record for the level of its noise."""

_FAST = 9
"""Samples over which the size of fast motion of the input is averaged."""


def lack_of_fit(evidence: Evidence) -> Iterator[Finding]:
    """Say that the residual still follows the input.

    If more than 3 % of the output follows, all figures of the model are in doubt. The noise is in
    doubt if a tenth of the residual's power follows; if a fifth does, so is each figure that this
    may move by 1 %: a figure moves at most by its deviation, for white noise, times the root of
    this part over the noise (Cauchy-Schwarz).
    """
    misfit = evidence.misfit
    if misfit.probability >= FALSE_ALARM or misfit.share == 0.0:
        return
    owed = float(np.sqrt(misfit.share)) * evidence.unexplained
    name = structure_in_words(evidence.joint.best.fit.structure.name)
    large, moved = owed > TOLERATED, MODELLED
    much = misfit.share > 2 * FEW  # otherwise the noise is off by a few per cent at most
    if large and not much:
        moved = tuple(name for name in MODELLED if name != "noise_std")
    elif much and not large:
        some = owed > WORTH and misfit.share > PART
        moved = moved_by(evidence, misfit.share) if some else ("noise_std",)
    yield Finding(
        code="lack_of_fit",
        message=f"The residual still follows the input: about {percent(owed)} % of the output "
        f"(r.m.s.) is not described by the {name} model. "
        "Look at the Bode plot where model and measurement differ.",
        severity="doubt" if large or much else "info",
        parameters=moved,
    )


def moved_by(evidence: Evidence, share: float) -> tuple[str, ...]:
    """The noise, and figures that a share of the residual's power may move by 1 % at most.

    They move most if that part of the residual is along their own derivatives.
    """
    joint = evidence.joint
    count = joint.problem.counted * joint.effective_share
    times = float(np.sqrt(count * share))
    moves = joint.best.fit.prediction
    # Statistics have no prediction.
    motion = moves.std() if moves.size else np.sqrt(joint.problem.spread / joint.problem.counted)
    late = FEW / evidence.fs
    rooms = {"noise_std": -np.inf, "bias": MATERIAL * float(motion)}
    rooms |= {"delay": late, "delay_low_frequency": late}
    known = evidence.readings.parameters.given
    if "peak_gain_db" in known:
        rooms["peak_gain_db"] = MATERIAL * max(abs(known["peak_gain_db"].value), 1.0)
    return tuple(
        name
        for name, e in known.items()
        if name in MODELLED and times * e.spread > rooms.get(name, MATERIAL * abs(e.value))
    )


def coloured_noise(evidence: Evidence) -> Iterator[Finding]:
    """Say that the residual is not white; a doubt if it is most of the output and follows u."""
    if evidence.readings.white:
        return
    follows = evidence.misfit.probability < FALSE_ALARM
    yield Finding(
        code="coloured_noise",
        message="The residual is not white (one independent sample in "
        f"{1 / evidence.joint.effective_share:.3g}); the error bars are widened for it.",
        severity="doubt" if evidence.unexplained > MOST and follows else "info",
        parameters=MODELLED,
    )


def changing_noise(evidence: Evidence) -> Iterator[Finding]:
    """Say that the noise is louder at some times than at others."""
    noise, valid = _noise_of(evidence), evidence.joint.problem.valid
    if is_steady(noise):
        return
    counted = np.arange(noise.size) if valid is None else np.flatnonzero(valid)
    spans = np.array_split(counted, _PARTS)
    levels = np.array([float(np.sqrt(np.mean(noise[span] ** 2))) for span in spans])
    levels /= float(np.sqrt(np.mean(noise[counted] ** 2)))
    loudest = spans[int(np.argmax(levels))]
    first, last = (float(k) / evidence.fs for k in (loudest[0], loudest[-1] + 1))
    yield Finding(
        code="changing_noise",
        message=f"The noise is louder at some times than at others: from {levels.min():.2g} to "
        f"{levels.max():.2g} times its r.m.s. in tenths of the record, loudest from "
        f"{first:.3g} to {last:.3g} s after its first sample. The error bars allow for it.",
        severity="info",
        parameters=MODELLED,
    )


def _noise_of(evidence: Evidence) -> Real:
    """The whitened residual with its own level at each sample, (n,)."""
    return evidence.joint.weighed.as_loud(evidence.readings.innovations)


def filled_input(evidence: Evidence) -> Iterator[Finding]:
    """Doubt the noise if it varies with time where samples of the input were filled in.

    Samples that depend on filled-in input count where few others would be left. Its errors enter
    the residual, and are large where the input moves fast.
    """
    if not evidence.filled or is_steady(_noise_of(evidence)):
        return
    yield Finding(
        code="filled_input",
        message=f"{evidence.filled} samples of the input were filled in, and the noise is louder "
        "at some times than at others: errors of the filled-in input may be part of it. Record "
        "without gaps.",
        severity="doubt",
        parameters=("noise_std",),
    )


def uneven_noise(evidence: Evidence) -> Iterator[Finding]:
    """Doubt the noise if it grows with fast motion of the input, as jittering stamps make it.

    A sample taken late by δ is off by δ times the signal's rate. So the power of the residual is a
    constant, that of the noise, plus a share of the power of fast motion.
    """
    if not evidence.jittered:
        return
    u, problem = evidence.u, evidence.joint.problem
    fast = np.convolve(np.diff(u, 4) ** 2, np.ones(_FAST) / _FAST, mode="full")[2 : 2 + u.size]
    power, fast = evidence.residual**2, problem.counting(fast)
    if power.size < _FAST or np.ptp(power) == 0.0 or np.ptp(fast) == 0.0:
        return
    related = float(np.corrcoef(power, fast)[0, 1])
    slope = related * float(power.std() / fast.std())
    share = slope * float(fast.mean() / power.mean())
    if related * np.sqrt(power.size) <= DEVIATIONS or share <= PART:
        return
    yield Finding(
        code="uneven_noise",
        message=f"The residual grows with the speed of the input: about "
        f"{100 * min(share, 1.0):.0f} % of its power is not the sensor's noise; jittering "
        "time stamps look like this. Record with a hardware clock.",
        severity="doubt",
        parameters=("noise_std",),
    )


def halves_disagree(evidence: Evidence) -> Iterator[Finding]:
    """Say that the halves of the record do not share the model.

    As in `lack_of_fit`, all figures are in doubt if models of the halves would explain much more of
    the output, else those that the difference may move.
    """
    share, weighed = evidence.joint.weighed_share, evidence.joint.weighed
    output = weighed.masked(weighed.y - weighed.counting(weighed.y).mean())
    halves = compare_halves(evidence.readings.halves, output, share=share)
    alarm = FALSE_ALARM * share  # the share of coloured noise is estimated
    if halves.probability >= alarm or halves.owed <= WORTH:
        return
    moved = MODELLED if halves.owed > TOLERATED else ()
    if not moved and halves.share > PART:
        moved = moved_by(evidence, halves.share)
    yield Finding(
        code="halves_disagree",
        message="The two halves of the record require different models, which describe "
        f"{percent(halves.owed)} % of the output (r.m.s.) more than one model does: the unit "
        "changed during the test, or responds differently to large and small motion. Repeat "
        "it, or lower the amplitude.",
        severity="doubt" if moved else "info",
        parameters=moved or MODELLED,
    )


def noise_colour_of(evidence: Evidence) -> Iterator[Finding]:
    """Say which colour a residual has that is not white."""
    if evidence.readings.white:
        return
    colour = noise_colour(evidence.residual, evidence.fs)
    if colour.description == "white":  # none of the known colours
        return
    yield Finding(
        code="noise_colour",
        message=f"The residual is {colour.description}. "
        "Look for hum, drift or motion that the model does not contain.",
        severity="info",
        parameters=("noise_std",),
    )


def noise_on_the_input(evidence: Evidence) -> Iterator[Finding]:
    """Say that the input is noisy; a doubt if gains come out too small by 1 %."""
    if evidence.limited:  # the corners of a limited command are no noise
        return
    noise = input_noise(evidence.u, evidence.fs, band=evidence.band)
    if noise is None or noise.attenuation <= WORTH:
        return
    yield Finding(
        code="input_noise",
        message=f"The input carries noise of {noise.std:.3g} (standard deviation), which "
        f"lowers the gain found by about {percent(noise.attenuation)} %. Use the "
        "command instead of its measurement, if you have it.",
        severity="doubt" if noise.attenuation > MATERIAL else "info",
        parameters=(*GAIN, "noise_std"),
    )


def unsampled_input(evidence: Evidence) -> Iterator[Finding]:
    """Doubt the noise if the input still moves at half the rate, and so beyond it.

    Extrapolation of the spectrum gives the motion beyond. The response to it is aliased into the
    band, and is not the sensor's noise.
    """
    if evidence.joint.best.intersample != "bandlimited":
        return
    size = evidence.u.size
    every = 1 + size // 2 // _BINS
    folded = folded_power(evidence.u, evidence.fs, every=every)
    if not folded.any():
        return
    frequency = np.arange(1, size // 2 + 1, every) / size * evidence.fs
    gain = np.abs(response(evidence.readings.system, frequency)) ** 2
    noise = float(np.mean(evidence.residual**2))
    share = every * float(folded @ gain) / noise if noise > 0.0 else 0.0
    if share <= 2 * FEW:
        return
    yield Finding(
        code="unsampled_input",
        message="The input moves faster than half the sampling rate: about "
        f"{percent(min(share, 1.0))} % of what counts as noise is a response to motion "
        "between its samples. Sample faster, or filter the command before it is sampled.",
        severity="doubt",
        parameters=("noise_std",),
    )


def folded_power(u: Real, fs: float, *, every: int = 1) -> Real:
    """Power of an input beyond half the rate, at the frequencies to which it is aliased.

    The slope of its spectrum over the last octave gives it. One of `every` bins is returned.
    """
    bins = np.arange(1, u.size // 2 + 1, every)
    lines = lines_of(u)
    known = u.size >= _FEWEST and lines.end > 0.0
    steep = float(np.log2(lines.octave / lines.end)) if known else 0.0
    if steep < 1.0:  # as white noise, or none at all
        return np.zeros(bins.size)
    frequency = bins / u.size * fs
    return np.asarray(lines.end * (2.0 * (1.0 - frequency / fs)) ** -steep)
