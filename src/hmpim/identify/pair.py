"""The description of one output and one input, made from the joint fit."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.coupling.output_fit import OutputFit
from hmpim.identify.coupling.responses import (
    Responses,
    responses_of,
    settled,
    unfound,
    unrelated,
    with_noise_doubted,
)
from hmpim.identify.effects.censored import CensoredFit
from hmpim.identify.effects.drift import Drifting, drift_findings
from hmpim.identify.effects.findings import with_imperfections
from hmpim.identify.effects.gain import GainChange
from hmpim.identify.effects.hum import hum_finding
from hmpim.identify.effects.imperfections import Imperfections, refine
from hmpim.identify.fitting.fit import Fit
from hmpim.identify.fitting.plainer import plainer
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.frf.local import local_response
from hmpim.identify.judgement import Evidence, attempt, judge
from hmpim.identify.judgement.verdict import unfollowed
from hmpim.identify.noise.misfit import Misfit, misfit
from hmpim.identify.nonlinear.bends import Bend
from hmpim.identify.nonlinear.modelled import Modelled, modelled_finding
from hmpim.identify.nonlinear.nonlinearity import Inspection
from hmpim.identify.nonlinear.speed import speed_finding
from hmpim.identify.nonlinearities import looked_through, possible_bends
from hmpim.identify.preparation.question import Question
from hmpim.identify.preparation.reference import response_through
from hmpim.identify.reading.bandwidth import disagreeing, less_bias, response_bandwidths
from hmpim.identify.reading.candidates import candidates_of
from hmpim.identify.reading.coefficients import coefficients_of, highest_first
from hmpim.identify.reading.readings import Readings, read_parameters
from hmpim.identify.reading.spanned import blurred, spanned, without_noise
from hmpim.identify.result import (
    FrequencyResponse,
    Nonlinearity,
    OutputCoherence,
    PairIdentification,
    PaperEstimates,
    Parameters,
    ResponseBandwidths,
    fit_percent,
)
from hmpim.identify.result.error_bars import estimate, noise_estimate
from hmpim.identify.result.groups import EVERY
from hmpim.identify.section_iv.paper import paper_estimates
from hmpim.identify.worth import WORTH
from hmpim.model.nonlinear import NonlinearPart
from hmpim.model.response import response_std
from hmpim.record import Finding

__all__ = ["Described", "describe", "describe_dead"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Described:
    """The description of one output: a pair for each input, and their multiple coherence."""

    pairs: tuple[PairIdentification, ...]
    coherence: OutputCoherence | None = None


def describe(question: Question, seen: Imperfections, fitted: OutputFit) -> Described:
    """Describe an output, with respect to each input in the band of that input."""
    aligned, output, inputs = question.aligned, question.output, question.inputs
    if inputs is None:
        (source,) = aligned.inputs
        if fitted.fits[0].related:
            pair = _pair(question, seen, fitted, 0, None)
            if question.swapped is not None:
                pair = replace(pair, warnings=(question.swapped, *pair.warnings))
            return Described(pairs=(pair,))
        said = question.swapped or unfollowed(output.name, source.name)
        return Described(pairs=(_unrelated(question, 0, said),))
    counted = seen.counting(np.asarray(output.valid), aligned.fs)
    responses = responses_of(aligned, output, counted, fitted, inputs)
    more, _ = attempt("misfit", lambda: unfound(fitted, responses, inputs), ())
    pairs = []
    for i, source in enumerate(aligned.inputs):
        if fitted.fits[i].related:
            pair = _pair(question, seen, fitted, i, responses)
            pair = replace(pair, warnings=(*pair.warnings, *more))
            pairs.append(settled(pair, fitted, i, inputs, aligned.fs))
        else:
            finding = unrelated(output.name, source.name, responses.columns[i])
            pairs.append(_unrelated(question, i, finding, responses.columns[i]))
    return Described(pairs=with_noise_doubted(pairs, fitted), coherence=responses.coherence)


def describe_dead(question: Question) -> Described:
    """Describe an output that is constant."""
    output = question.output
    finding = Finding(
        code="dead_channel",
        message=f"Output {output.name!r} is constant at {output.values[output.valid][0]:g}. "
        "The sensor is dead, stuck or not connected.",
        severity="doubt",
        parameters=EVERY,
    )
    every = range(len(question.aligned.inputs))
    return Described(pairs=tuple(_unrelated(question, i, finding) for i in every))


def _pair(
    question: Question, found: Imperfections, joined: OutputFit, i: int, matrix: Responses | None
) -> PairIdentification:
    """Describe an output that follows an input."""
    aligned, output = question.aligned, question.output
    source, band = aligned.inputs[i], question.band(i)
    units, bending = (source.unit, output.unit), joined.bending_of(i)
    joint, censored, covariance = _refined(question, found, joined, i)
    plain = plainer(joint) if question.inputs is None and covariance is None else None
    joint, inspection, unseen = looked_through(question, found, joined, joint, i, plain)
    said = () if inspection is None else inspection.findings
    command = source.values if question.limited is None else question.limited.recorded
    y = output.values if matrix is None else joint.problem.y
    paper = paper_estimates(command, y, aligned.fs, band=band)
    readings = read_parameters(
        joint,
        fs=aligned.fs,
        highest=min(band[1], aligned.fs / 2),
        delay_correlation=paper.delay,
        known_covariance=covariance,
        units=units,
    )
    response = (
        _measured(question, found, joint, readings, i) if matrix is None else matrix.columns[i]
    )
    moves, unmoved = attempt(
        "bends", lambda: possible_bends(question, found, joint, i, plain, said), ()
    )
    from_response, unread = attempt(
        "response_bandwidths",
        lambda: _bandwidths(question, joint, readings, response, i, matrix),
        ResponseBandwidths(),
    )
    left, untested = attempt("misfit", lambda: _left(question, joint, i, matrix), Misfit())
    evidence = _evidence(question, readings, joint, from_response, left, i, moves, joined)
    evidence = replace(evidence, held=found.hold is not None)
    if inspection is not None and said and bending is None:
        bent = max(inspection.summary.nonlinear, evidence.nonlinear)
        evidence = replace(evidence, nonlinear=bent)
    parameters, seen = with_imperfections(evidence.spanned, found, censored, output.unit)
    known = {finding.code for finding in seen}
    findings = (
        *_of_the_question(question, source.unit),
        *judge(evidence),
        *seen,
        *(finding for finding in said if finding.code not in known),
        *_of_the_model(question, joined, i, units, white=readings.white),
        *(*unseen, *unmoved, *unread, *untested),
    )
    fit, spread = joint.best.fit, _spread(joint)
    gaining, disturbance = joined.gaining, joined.disturbance
    course = None if gaining is None or not gaining.taken else gaining.course
    numerator, denominator = coefficients_of(readings.system)
    return PairIdentification(
        input=source.name,
        output=output.name,
        structure=fit.structure.name,
        intersample=joint.best.intersample,
        fit_percent=evidence.fit_percent,
        parameters=parameters,
        paper=paper,
        frequency_response=response,
        numerator=numerator,
        denominator=denominator,
        candidates=candidates_of(joint, lambda one: float(fit_percent(one.cost, spread))),
        warnings=(*aligned.findings, *findings),
        from_response=evidence.measured,
        time=aligned.time,
        prediction=fit.prediction if disturbance is None else fit.prediction + disturbance,
        residual=fit.residual if course is None else fit.residual * course,
        covariance=highest_first(readings.coefficient_covariance, readings.system),
        nonlinearity=None if inspection is None else _summary(inspection, bending, units),
        nonlinear_part=_nonlinear_part(question, bending),
    )


def _nonlinear_part(question: Question, bending: Modelled | None) -> NonlinearPart | None:
    """The nonlinearity that the model includes."""
    if question.limited is not None:
        return question.limited.part(question.aligned.fs)
    return None if bending is None else bending.part


def _summary(
    inspection: Inspection, modelled: Modelled | None, units: tuple[str, str]
) -> Nonlinearity:
    """What is nonlinear; its kind and size as the model has them, if it includes them."""
    summary = inspection.summary
    if modelled is None:
        return summary
    return replace(summary, kinds=(modelled.part.kind,), size=modelled.estimate(units))


def _of_the_question(question: Question, unit: str) -> Iterator[Finding]:
    """Findings about the question itself: a loop's reference, a command of limited speed."""
    if question.instrument is not None:
        yield question.instrument.finding()
    if question.limited is not None:
        yield speed_finding(question.limited, question.aligned.fs, unit)


def _of_the_model(
    question: Question, joined: OutputFit, i: int, units: tuple[str, str], *, white: bool
) -> Iterator[Finding]:
    """Findings about a drift, hum and a nonlinearity that the model includes."""
    fs, bending = question.aligned.fs, joined.bending_of(i)
    if joined.drifting is not None:
        yield from drift_findings(joined.drifting, fs, units[1], white=white)
    if joined.humming is not None:
        yield hum_finding(joined.humming, fs, units[1])
    if bending is not None:
        yield modelled_finding(bending, units)


def _evidence(
    question: Question,
    readings: Readings,
    joint: JointFit,
    from_response: ResponseBandwidths,
    left: Misfit,
    i: int,
    moves: tuple[Bend, ...],
    joined: OutputFit,
) -> Evidence:
    """The evidence that the checks examine."""
    fs, band, fit = question.aligned.fs, question.band(i), joint.best.fit
    # A change of the gain is not reported with a fit that a nonlinearity has replaced.
    gaining = joined.gaining if fit is joined.fits[i].best.fit else None
    known = question.measured
    evidence = Evidence(
        joint=joint,
        readings=readings,
        spanned=readings.parameters,
        misfit=left,
        u=question.aligned.inputs[i].values,
        fs=fs,
        band=band,
        fit_percent=float(fit_percent(fit.cost, _spread(joint))),
        bends=moves,
        nonlinear=max((one.share for one in moves if one.certain), default=0.0),
        measured=from_response,
        through=question.instrument is not None,
        filled=0 if known is None else int(np.count_nonzero(~known)),
        jittered=any(finding.code == "jitter" for finding in question.aligned.findings),
        limited=question.limited is not None,
        gaining=gaining,
    )
    whole = spanned(
        readings.parameters,
        joint,
        fs=fs,
        highest=min(band[1], fs / 2),
        bent=[(one.fit, one.farthest) for one in moves],
        others=_other_explanations(gaining, joined.drifting if i == joined.asked else None),
        owed=evidence.owed,
    )
    if any(one.matters for one in moves):
        whole = blurred(whole, WORTH)
    if evidence.is_without_noise and not fit.structure.sampled:
        whole = without_noise(whole)
    return replace(evidence, spanned=whole)


def _left(question: Question, joint: JointFit, i: int, matrix: Responses | None) -> Misfit:
    """How much of the residual still follows the input."""
    if matrix is not None:
        return matrix.left()[i]
    fs, (low, high), fit = question.aligned.fs, question.band(i), joint.best.fit
    u = question.aligned.inputs[i].values
    return misfit(u, fit.residual, delay=fit.delay, band=(low / fs, high / fs))


def _other_explanations(gaining: GainChange | None, drifting: Drifting | None) -> list[Fit]:
    """Alternative fits, with or without a changing gain or bias, that the record cannot exclude."""
    others = [] if gaining is None else [*gaining.others]
    if drifting is not None and drifting.rival is not None:
        others.append(drifting.rival)
    return others


def _bandwidths(
    question: Question,
    joint: JointFit,
    readings: Readings,
    response: FrequencyResponse,
    i: int,
    matrix: Responses | None,
) -> ResponseBandwidths:
    """Bandwidths of the measured response, less the estimator's bias if the model's differ.

    Between lines, and next to a notch of the input, a local fit is biased whatever the noise. The
    bias is that which it has when the record is the model's own output.
    """
    fs, fit = question.aligned.fs, joint.best.fit

    def read(seen: FrequencyResponse) -> ResponseBandwidths:
        return response_bandwidths(
            seen,
            readings.system,
            readings.parameters,
            fs=fs,
            intersample=joint.best.intersample,
        )

    found = read(response)
    if question.instrument is not None or not disagreeing(found, readings.parameters):
        return found
    if matrix is None:
        u = question.aligned.inputs[i].values
        own = _local(u, fit.prediction, fit, fs, question.band(i))
    else:
        own = matrix.of_models()[i]
    return less_bias(found, read(own), readings.parameters)


def _refined(
    question: Question, found: Imperfections, joined: OutputFit, i: int
) -> tuple[JointFit, CensoredFit | None, Real | None]:
    """The fit with the likelihood of clipped and held samples, and its covariance if known."""
    joint = joined.fits[i]
    covariance = joined.covariances[i] if joined.covariances else None
    software = joint.best.fit.structure.sampled  # it holds its output between samples
    if question.inputs is not None or question.instrument is not None or software:
        return joint, None, covariance
    refined = refine(
        joint, found, question.aligned.inputs[i].values, question.aligned.fs, joined.disturbance
    )
    if refined is None:
        return joint, None, covariance
    return *refined, refined[1].covariance


def _measured(
    question: Question, found: Imperfections, joint: JointFit, readings: Readings, i: int
) -> FrequencyResponse:
    """Local response; the model replaces samples that are not informative, and its error is added.

    Noise decides which samples near a level are clipped, so the others are not a fair selection.
    The model alone in their place would pull the response towards the level.
    """
    u, fs, band = question.aligned.inputs[i].values, question.aligned.fs, question.band(i)
    fit, y = joint.best.fit, joint.problem.y  # without the drift
    if question.instrument is not None:
        return response_through(question.instrument, y, fs, band=band)
    counted = found.counting(np.asarray(question.output.valid), fs)
    if counted is None:
        return _local(u, y, fit, fs, band)
    response = _local(u, np.where(counted, y, fit.prediction + fit.residual), fit, fs, band)
    covariance = readings.coefficient_covariance
    if not np.isfinite(covariance).all():
        return response
    own = response_std(readings.system, covariance, response.frequency)
    return replace(response, std=np.hypot(response.std, own))


def _local(u: Real, y: Real, fit: Fit, fs: float, band: tuple[float, float]) -> FrequencyResponse:
    """Local response; that of an integrator from the output's differences.

    An integrating output does not end where it began, and that step leaks into every bin.
    """
    delay = fit.delay / fs
    if not fit.structure.integrators:
        return local_response(u, y, fs, delay=delay, band=band)
    steps = local_response(u, np.diff(y, prepend=y[0]), fs, delay=delay, band=band)
    difference = 1.0 - np.exp(-2j * np.pi * steps.frequency / fs)
    return replace(steps, response=steps.response / difference, std=steps.std / np.abs(difference))


def _spread(joint: JointFit) -> float:
    """Sum of squares of the samples that count about their mean."""
    y = joint.problem.counting(joint.problem.y)
    away = y - y.mean()
    return float(away @ away)


def _unrelated(
    question: Question, i: int, finding: Finding, response: FrequencyResponse | None = None
) -> PairIdentification:
    """Describe an output that does not follow the input."""
    aligned, output = question.aligned, question.output
    source, band = aligned.inputs[i], question.band(i)
    counted = output.values[output.valid]
    mean, variance = float(counted.mean()), float(counted.var(ddof=1))
    return PairIdentification(
        input=source.name,
        output=output.name,
        structure="static",
        intersample="bandlimited",
        fit_percent=0.0,
        parameters=Parameters(
            bias=estimate(
                mean, variance / counted.size, freedom=counted.size - 1, unit=output.unit
            ),
            noise_std=noise_estimate(
                variance * (counted.size - 1),
                freedom=counted.size - 1,
                share=1.0,
                unit=output.unit,
            ),
        ),
        paper=PaperEstimates(),
        frequency_response=local_response(source.values, output.values, aligned.fs, band=band)
        if response is None
        else response,
        numerator=(0.0,),
        denominator=(1.0,),
        candidates=(),
        warnings=(*aligned.findings, finding),
        time=aligned.time,
        prediction=np.full(aligned.samples, mean),
        residual=np.where(output.valid, output.values - mean, 0.0),
    )
