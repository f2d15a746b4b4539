"""The description of one output and one input, made from the joint fit."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

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
from hmpim.identify.effects.drift import drift_findings
from hmpim.identify.effects.findings import with_imperfections
from hmpim.identify.effects.hum import hum_finding
from hmpim.identify.effects.imperfections import Imperfections, refine
from hmpim.identify.fitting.fit import Fit, delayed
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
from hmpim.identify.reading.bandwidth import beside_model, response_bandwidths
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
from hmpim.record import Finding, Signal

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
            pair = _pair(_Followed(question=question, found=seen, joined=fitted, i=0, matrix=None))
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
            pair = _pair(
                _Followed(question=question, found=seen, joined=fitted, i=i, matrix=responses)
            )
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Followed:
    """An output and an input that it follows."""

    question: Question
    found: Imperfections
    joined: OutputFit  # of the output to all inputs
    i: int  # which input
    matrix: Responses | None  # measured responses to all inputs; None with one input

    @property
    def source(self) -> Signal:
        """The input."""
        return self.question.aligned.inputs[self.i]

    @property
    def band(self) -> tuple[float, float]:
        """Band in Hz that the input excites."""
        return self.question.band(self.i)

    @property
    def units(self) -> tuple[str, str]:
        """Units of input and output."""
        return self.source.unit, self.question.output.unit

    @property
    def bending(self) -> Modelled | None:
        """The nonlinearity that the model includes, other than a limited speed."""
        return self.joined.bending_of(self.i)

    @property
    def command(self) -> Real:
        """The input as recorded."""
        limited = self.question.limited
        return self.source.values if limited is None else limited.recorded

    @property
    def nonlinear_part(self) -> NonlinearPart | None:
        """What the model includes besides its linear part."""
        if self.question.limited is not None:
            return self.question.limited.part(self.question.aligned.fs)
        return None if self.bending is None else self.bending.part

    def as_recorded(self, fit: Fit) -> tuple[Real, Real]:
        """Prediction and residual of the output with its disturbance and its changing gain."""
        prediction, residual = fit.prediction, fit.residual
        if self.joined.disturbance is not None:
            prediction = prediction + self.joined.disturbance
        if self.joined.gaining is not None and self.joined.gaining.taken:
            residual = residual * self.joined.gaining.course
        return prediction, residual


def _pair(own: _Followed) -> PairIdentification:
    """Describe an output that follows an input."""
    question, aligned, output = own.question, own.question.aligned, own.question.output
    joint, censored, covariance = _refined(own)
    plain = plainer(joint) if question.inputs is None and covariance is None else None
    joint, inspection, unseen = looked_through(question, own.found, own.joined, joint, own.i, plain)
    said = () if inspection is None else inspection.findings
    y = output.values if own.matrix is None else joint.problem.y
    paper = paper_estimates(own.command, y, aligned.fs, band=own.band)
    readings = read_parameters(
        joint,
        fs=aligned.fs,
        highest=min(own.band[1], aligned.fs / 2),
        delay_correlation=paper.delay,
        known_covariance=covariance,
        units=own.units,
    )
    response = _measured(own, joint, readings)
    bent = partial(possible_bends, question, own.found, joint, own.i, said)
    moves, unmoved = attempt("bends", bent, ())
    read = partial(
        response_bandwidths,
        response,
        readings.system,
        readings.parameters,
        fs=aligned.fs,
        intersample=joint.best.intersample,
    )
    from_response, unread = attempt("response_bandwidths", read, ResponseBandwidths())
    left, untested = attempt("misfit", partial(_left, own, joint), Misfit())
    evidence = _evidence(own, joint, readings, from_response, left, moves, inspection)
    parameters, seen = with_imperfections(evidence.spanned, own.found, censored, output.unit)
    spread = _spread(joint)
    prediction, residual = own.as_recorded(joint.best.fit)
    numerator, denominator = readings.coefficients
    return PairIdentification(
        input=own.source.name,
        output=output.name,
        structure=joint.best.fit.structure.name,
        intersample=joint.best.intersample,
        fit_percent=evidence.fit_percent,
        parameters=parameters,
        paper=paper,
        frequency_response=response,
        numerator=numerator,
        denominator=denominator,
        candidates=joint.candidates(lambda one: float(fit_percent(one.cost, spread))),
        warnings=(
            *aligned.findings,
            *_of_the_question(question, own.units[0]),
            *judge(evidence),
            *seen,
            *said,
            *_of_the_model(own, white=readings.white),
            *(*unseen, *unmoved, *unread, *untested),
        ),
        from_response=evidence.measured,
        time=aligned.time,
        prediction=prediction,
        residual=residual,
        covariance=readings.by_falling_powers,
        nonlinearity=None if inspection is None else _summary(inspection, own.bending, own.units),
        nonlinear_part=own.nonlinear_part,
    )


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


def _of_the_model(own: _Followed, *, white: bool) -> Iterator[Finding]:
    """Findings about a drift, hum and a nonlinearity that the model includes."""
    fs, joined, unit = own.question.aligned.fs, own.joined, own.units[1]
    if joined.drifting is not None:
        yield from drift_findings(joined.drifting, fs, unit, white=white)
    if joined.humming is not None:
        yield hum_finding(joined.humming, fs, unit)
    if own.bending is not None:
        yield modelled_finding(own.bending, own.units)


def _evidence(
    own: _Followed,
    joint: JointFit,
    readings: Readings,
    from_response: ResponseBandwidths,
    left: Misfit,
    moves: tuple[Bend, ...],
    inspection: Inspection | None,
) -> Evidence:
    """The evidence that the checks examine."""
    question, joined, fit = own.question, own.joined, joint.best.fit
    fs, known = question.aligned.fs, question.measured
    nonlinear = max((one.share for one in moves if one.certain), default=0.0)
    if inspection is not None and inspection.findings and own.bending is None:
        nonlinear = max(nonlinear, inspection.summary.nonlinear)
    # A change of the gain is not reported with a fit that a nonlinearity has replaced.
    gaining = joined.gaining if fit is joined.fits[own.i].best.fit else None
    evidence = Evidence(
        joint=joint,
        readings=readings,
        spanned=readings.parameters,
        misfit=left,
        u=own.source.values,
        fs=fs,
        band=own.band,
        fit_percent=float(fit_percent(fit.cost, _spread(joint))),
        bends=moves,
        nonlinear=nonlinear,
        measured=from_response,
        held=own.found.hold is not None,
        through=question.instrument is not None,
        filled=0 if known is None else int(np.count_nonzero(~known)),
        jittered=any(finding.code == "jitter" for finding in question.aligned.findings),
        limited=question.limited is not None,
        gaining=gaining,
    )
    others = [] if gaining is None else [*gaining.others]
    bending = joined.bending_of(own.i)
    if bending is not None:
        others.extend(bending.others.values())
    if own.i in question.later:
        others.append(replace(fit, theta=delayed(fit.theta, question.later[own.i])))
    whole = spanned(
        readings.parameters,
        joint,
        fs=fs,
        highest=min(own.band[1], fs / 2),
        bent=[(one.fit, one.farthest) for one in moves],
        others=others,
    )
    if any(one.matters for one in moves):
        whole = blurred(whole, WORTH)
    if evidence.is_without_noise and not fit.structure.sampled:
        whole = without_noise(whole)
    return replace(evidence, spanned=whole)


def _left(own: _Followed, joint: JointFit) -> Misfit:
    """How much of the residual still follows the input."""
    if own.matrix is not None:
        return own.matrix.left()[own.i]
    fs, (low, high), fit = own.question.aligned.fs, own.band, joint.best.fit
    return misfit(own.source.values, fit.residual, delay=fit.delay, band=(low / fs, high / fs))


def _refined(own: _Followed) -> tuple[JointFit, CensoredFit | None, Real | None]:
    """The fit with the likelihood of clipped and held samples, and its covariance if known."""
    question, joined = own.question, own.joined
    joint = joined.fits[own.i]
    covariance = joined.covariances[own.i] if joined.covariances else None
    software = joint.best.fit.structure.sampled  # it holds its output between samples
    if question.inputs is not None or question.instrument is not None or software:
        return joint, None, covariance
    u, fs = own.source.values, question.aligned.fs
    refined = refine(joint, own.found, u, fs, joined.disturbance)
    if refined is None:
        return joint, None, covariance
    return *refined, refined[1].covariance


def _measured(own: _Followed, joint: JointFit, readings: Readings) -> FrequencyResponse:
    """The model's response and the local response of the residual.

    The residual is linear in the output, and so is a local fit: together they are the response of
    the output, at the samples that count. But what biases a local fit (few lines, a notch of the
    input, motion before or after the record) then biases only what the model misses.
    """
    question, fit, u = own.question, joint.best.fit, own.source.values
    fs = question.aligned.fs
    if question.instrument is not None:
        return response_through(question.instrument, joint.problem.y, fs, band=own.band)
    if own.matrix is None:
        late = fit.delay / fs
        left = local_response(u, fit.residual, fs, delay=late, band=own.band, residual=True)
    else:
        left = own.matrix.columns[own.i]
    return beside_model(
        left,
        readings.system,
        readings.coefficient_covariance,
        fs=fs,
        intersample=joint.best.intersample,
        whole=own.found.counting(np.asarray(question.output.valid), fs) is None,
    )


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
