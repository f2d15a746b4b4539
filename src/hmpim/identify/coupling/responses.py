"""Several inputs at once: measured response to each, and findings on weak or similar inputs."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import RecordError
from hmpim.identify.arrays import Mask
from hmpim.identify.chance import DEVIATIONS, FALSE_ALARM
from hmpim.identify.coupling.inputs import input_set
from hmpim.identify.coupling.output_fit import OutputFit
from hmpim.identify.coupling.residual import misfits_of_inputs
from hmpim.identify.coupling.weak import unsettled
from hmpim.identify.frf.multivariable import JointResponse, joint_response
from hmpim.identify.noise.misfit import Misfit
from hmpim.identify.result import (
    Estimate,
    FrequencyResponse,
    InputSet,
    OutputCoherence,
    PairIdentification,
    Parameters,
)
from hmpim.identify.result.digits import percent
from hmpim.identify.result.error_bars import estimate
from hmpim.identify.result.groups import EVERY, MODELLED, in_words
from hmpim.identify.worth import FEW, MOST, MUCH, NEARLY, PART, PAST, TWICE
from hmpim.record import Aligned, Finding, Record, Signal

__all__ = [
    "Responses",
    "inputs_of",
    "responses_of",
    "settled",
    "unfound",
    "unrelated",
    "with_noise_doubted",
]

_UPPER = 1.2
"""Standard deviations of |error| that a bound adds: 95 % if the gain is well known, else more."""

_OF_THE_RESIDUAL = frozenset({"lack_of_fit", "unsampled_input", "uneven_noise", "filled_input"})
"""Codes of doubts whether the residual is noise."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Responses:
    """Response of the residual to each input, and how much of the output all inputs explain."""

    # one for each input, where it excites and is distinguished; with the partial coherence
    columns: tuple[FrequencyResponse, ...]
    coherence: OutputCoherence  # the multiple one
    left: Callable[[], tuple[Misfit, ...]]  # how far the residual still follows each input


def inputs_of(aligned: Aligned, record: Record) -> InputSet:
    """Find which inputs the record distinguishes; refuse inputs that it cannot separate."""
    found = input_set(
        [s.values for s in aligned.inputs],
        [s.name for s in aligned.inputs],
        aligned.fs,
        stated=record.band,
    )
    apart = float(np.mean(found.usable))
    for group in found.alike:
        if group.share >= NEARLY or (apart < FEW and group is found.alike[0]):
            raise RecordError(
                f"inputs {', '.join(group.names)} cannot be distinguished: over "
                f"{100 * group.share:.0f} % of the frequencies they excite, one of them is a copy "
                "of the others, scaled or filtered, or their sum. Drive them one at a time, or "
                "with sweeps that pass each frequency at different times"
            )
    return found


def responses_of(
    aligned: Aligned, output: Signal, counts: Mask | None, joined: OutputFit, inputs: InputSet
) -> Responses:
    """Measure the response of one output to all inputs, each in its own band.

    `counts` are the samples that show the output as it was, (n,); None if all do.
    """
    pieces = _pieces(aligned, output, counts, joined, inputs)
    return Responses(
        columns=tuple(_column(pieces, j) for j in range(len(aligned.inputs))),
        coherence=OutputCoherence(
            output=output.name,
            frequency=_joined([m.frequency for _, m in pieces]),
            multiple=_joined([m.multiple_coherence for _, m in pieces]),
        ),
        left=cache(
            lambda: misfits_of_inputs(
                [source.values for source in aligned.inputs],
                joined.fits,
                [(low / aligned.fs, high / aligned.fs) for low, high in inputs.bands],
            )
        ),
    )


def _pieces(
    aligned: Aligned, output: Signal, counts: Mask | None, joined: OutputFit, inputs: InputSet
) -> list[tuple[list[int], JointResponse]]:
    """Responses in each band, and the inputs that they belong to.

    The band is cut where one of the inputs' begins or ends. The response to an input outside its
    band is subtracted by its model.
    """
    # One delay for all inputs: shifting them relative to each other would make them look different.
    leading = joined.fits[joined.leading].best.fit
    delay = min(max(leading.delay, 0.0), 0.4 * aligned.samples) / aligned.fs
    parts = [fit.best.fit.prediction - fit.best.fit.linear[-1] for fit in joined.fits]
    y, predicted = output.values, joined.prediction
    if joined.disturbance is not None:
        y, predicted = y - joined.disturbance, predicted - joined.disturbance
    span = aligned.samples / aligned.fs - delay
    edges = sorted({edge for band in inputs.bands for edge in band})
    pieces: list[tuple[list[int], JointResponse]] = []
    for low, high in pairwise(edges):
        active = [j for j, band in enumerate(inputs.bands) if band[0] <= low and band[1] >= high]
        bins = (high - low) * span
        if not active or bins < 8 * (len(active) + 1) + 2:
            continue
        others = [j for j, fit in enumerate(joined.fits) if j not in active and fit.related]
        outside = sum((parts[j] for j in others), np.zeros(y.size))
        found = joint_response(
            np.stack([aligned.inputs[j].values for j in active]),
            y - outside,
            aligned.fs,
            predicted=predicted - outside,
            delay=delay,
            band=(low, high),
            valid=counts,
            names=[*(aligned.inputs[j].name for j in active), output.name],
        )
        pieces.append((active, found))
    return pieces


def _column(pieces: list[tuple[list[int], JointResponse]], j: int) -> FrequencyResponse:
    """The residual's response to an input, where the inputs are distinguished."""
    parts = [piece.inputs[active.index(j)] for active, piece in pieces if j in active]
    return FrequencyResponse(
        frequency=_joined([part.frequency for part in parts]),
        response=np.asarray(_joined([part.response for part in parts]), dtype=np.complex128),
        std=_joined([part.std for part in parts]),
        coherence=_joined([part.coherence for part in parts if part.coherence is not None]),
    )


def _joined(parts: Sequence[NDArray[Any]]) -> NDArray[Any]:
    """All parts, if any, one after the other."""
    return np.concatenate([np.zeros(0), *parts])


def unrelated(output: str, source: str, response: FrequencyResponse) -> Finding:
    """Report that no structure describes how an output follows one of several inputs.

    Either the response still shows a coupling, such as an inertia's, which is zero at DC; or there
    is none above a bound.
    """
    significant = np.abs(response.response) > DEVIATIONS * response.std
    if response.frequency.size and np.mean(significant) > PART:
        k = int(np.argmax(np.where(significant, np.abs(response.response), 0.0)))
        level = 20 * float(np.log10(np.abs(response.response[k])))
        return Finding(
            code="weak_coupling",
            message=f"Output {output!r} follows input {source!r} weakly, by {level:.0f} dB at most "
            f"(at {response.frequency[k]:.3g} Hz), in a shape that no simple structure describes. "
            "Read it off the frequency response.",
            severity="doubt",
            parameters=EVERY,
        )
    bound = _bound(response)
    what = "but it is nowhere distinguished from the other inputs"
    if bound is not None:
        level, low, high = bound
        what = (
            f"and from {low:.3g} to {high:.3g} Hz any coupling is below {level:.0f} dB "
            "(95 %, at nine in ten frequencies)"
        )
    return Finding(
        code="unrelated",
        message=f"Output {output!r} does not follow input {source!r}, {what}. "
        "Check the channels if it should, or excite it more.",
        severity="doubt",
        parameters=EVERY,
    )


def _bound(response: FrequencyResponse) -> tuple[float, float, float] | None:
    """Bound of the gain in dB, and the band in which it holds, Hz."""
    if response.frequency.size == 0:
        return None
    upper = np.abs(response.response) + _UPPER * response.std
    level = 20 * float(np.log10(max(float(np.quantile(upper, 0.9)), 1e-300)))
    return level, float(response.frequency[0]), float(response.frequency[-1])


def unfound(joined: OutputFit, matrix: Responses, inputs: InputSet) -> tuple[Finding, ...]:
    """Doubt the noise if the residual follows an input whose response was not found."""
    return tuple(
        Finding(
            code="unfound_response",
            message=f"The residual still follows input {name!r}, whose response was not found: "
            f"about {percent(found.share)} % of the residual's power. "
            f"Excite {name!r} more, or alone.",
            severity="doubt",
            parameters=("noise_std",),
        )
        for name, fit, found in zip(inputs.names, joined.fits, matrix.left(), strict=True)
        if not fit.related and found.probability < FALSE_ALARM and found.share > 2 * FEW
    )


def with_noise_doubted(
    pairs: Sequence[PairIdentification], joined: OutputFit
) -> tuple[PairIdentification, ...]:
    """Doubt the noise of each pair of an output if that of another is doubted.

    All inputs share one residual, so a doubt about it holds for all.
    """
    elsewhere = {f.code: (one.input, f) for one in pairs for f in one.warnings if _of_the_noise(f)}
    found = []
    for pair, fit in zip(pairs, joined.fits, strict=True):
        known = {finding.code for finding in pair.warnings if _of_the_noise(finding)}
        more = tuple(
            replace(
                finding,
                message=f"As for input {source!r}: {finding.message}",
                parameters=("noise_std",),
            )
            for code, (source, finding) in elsewhere.items()
            if fit.related and code not in known
        )
        found.append(replace(pair, warnings=(*pair.warnings, *more)))
    return tuple(found)


def _of_the_noise(finding: Finding) -> bool:
    """Whether a finding doubts that the residual is noise."""
    doubted = finding.severity == "doubt" and "noise_std" in finding.parameters
    return doubted and finding.code in _OF_THE_RESIDUAL


def settled(
    pair: PairIdentification, joined: OutputFit, i: int, inputs: InputSet, fs: float
) -> PairIdentification:
    """Keep only what the record determines of weak couplings and of inputs that are alike."""
    parameters = pair.parameters
    unknown: list[str] = []
    if not joined.strong[i]:
        late, gain = unsettled(joined.fits[i])
        parameters = replace(
            parameters,
            delay=_widened(parameters.delay, late / fs**2),
            scale_factor=_widened(parameters.scale_factor, gain),
        )
        parameters, unknown = _determined(parameters, inputs.bands[i])
    parameters = _finite(parameters)
    findings = list(pair.warnings)
    if unknown:
        bound = _bound(pair.frequency_response)
        words = ", ".join(in_words(name) for name in unknown)
        most = "" if bound is None else f" It is below {bound[0]:.0f} dB (95 %)."
        findings.append(
            Finding(
                code="weak_coupling",
                message=f"The coupling from {pair.input!r} to {pair.output!r} is too weak here, or "
                f"outside what {pair.input!r} excites, to determine its {words}.{most} "
                "Excite it more, or alone.",
                severity="doubt",
                parameters=EVERY if "scale_factor" in unknown else tuple(unknown),
            )
        )
    for group in inputs.alike:
        if pair.input in group.names and group.share >= PART:
            others = [inputs.names.index(name) for name in group.names if name != pair.input]
            # A coupling too weak to be found may have been attributed to this input.
            hidden = not joined.strong[i] and not all(joined.fits[j].related for j in others)
            findings.append(
                Finding(
                    code="coupled_inputs",
                    message=f"Inputs {', '.join(group.names)} cannot be distinguished at "
                    f"{group.where} ({100 * group.share:.0f} % of the frequencies they excite): "
                    "there the error bars rest on the models alone. Drive them with sweeps that "
                    "pass each frequency at different times.",
                    severity="doubt" if group.share >= MOST or hidden else "info",
                    parameters=MODELLED,
                )
            )
    return replace(pair, parameters=parameters, warnings=tuple(findings))


def _finite(p: Parameters) -> Parameters:
    """The parameters without those whose error is not finite."""
    bad = [name for name, e in p.given.items() if not np.isfinite(e.spread)]
    return replace(p, **dict.fromkeys(bad, None))


def _widened(known: Estimate | None, variance: float) -> Estimate | None:
    if known is None or variance == 0.0:
        return known
    return estimate(known.value, known.spread**2 + variance, unit=known.unit)


_WITH_GAIN = (
    "scale_factor",
    "delay",
    "natural_frequency",
    "damping_ratio",
    "time_constant",
    "bandwidth_phase90",
    "bandwidth_phase90_without_delay",
    "bandwidth_3db",
    "peak_gain_db",
)


def _determined(p: Parameters, band: tuple[float, float]) -> tuple[Parameters, list[str]]:
    """Parameters that a weak coupling's record determines, and the names of the others."""

    def loose(e: Estimate) -> bool:
        return not e.spread <= MUCH * abs(e.value)

    def beyond(e: Estimate) -> bool:
        return loose(e) or not band[0] <= e.value <= PAST * band[1]

    def late(e: Estimate) -> bool:
        return not e.spread <= 0.5 / band[1]

    def uncertain(e: Estimate) -> bool:
        return not e.spread <= 20 * np.log10(TWICE)

    tests = (
        (loose, ("scale_factor", "time_constant", "damping_ratio")),
        (beyond, ("natural_frequency", "bandwidth_phase90")),
        (beyond, ("bandwidth_phase90_without_delay", "bandwidth_3db")),
        (uncertain, ("peak_gain_db",)),
        (late, ("delay", "delay_low_frequency")),
    )
    known = p.given
    gone = {n for bad, names in tests for n in names if n in known and bad(known[n])}
    if "natural_frequency" in gone:
        gone |= {"damping_ratio", "peak_gain_db"}
    if "scale_factor" in gone:
        gone |= set(_WITH_GAIN) | {"delay_low_frequency", "delay_correlation"}
    unknown = [name for name in _WITH_GAIN if name in gone and name in known]
    return replace(p, **dict.fromkeys(gone, None)), unknown
