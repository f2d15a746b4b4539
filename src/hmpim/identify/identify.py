"""From a record to every parameter: the paper's steps and the joint fit, side by side."""

from collections.abc import Sequence
from typing import cast, get_args

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import ArgumentError, RecordError
from hmpim.identify.bandwidth import disagreement, response_bandwidths
from hmpim.identify.fit import Fit
from hmpim.identify.imperfections import (
    Imperfections,
    find_imperfections,
    refine,
    with_imperfections,
)
from hmpim.identify.joint import JointFit
from hmpim.identify.local import local_response
from hmpim.identify.multivariable import ResponseMatrix, response_matrix
from hmpim.identify.paper import paper_estimates
from hmpim.identify.readings import read_parameters
from hmpim.identify.remarks import remarks
from hmpim.identify.result import (
    Candidate,
    FrequencyResponse,
    Identification,
    PairIdentification,
    PaperEstimates,
    Parameters,
    RecordSummary,
    Verdict,
)
from hmpim.identify.several import Joined, fit_together
from hmpim.identify.spectrum import excited_band
from hmpim.identify.threads import one_thread
from hmpim.identify.uncertainty import estimate, noise_estimate
from hmpim.identify.verdict import Judgement, judge
from hmpim.identify.whiteness import is_white, misfit
from hmpim.model.dynamics import STRUCTURES, StructureName
from hmpim.record import Aligned, Finding, Intersample, Record, Signal, uniform

__all__ = ["identify"]

_FEWEST_SAMPLES = 50

_NEVER_APART = 0.05
"""Share of the frequencies below which inputs count as one and are refused."""

_TOLD_APART = 0.5
"""Share of the frequencies at which inputs must be told apart for an `ok`."""


def identify(
    record: Record,
    *,
    intersample: Intersample | str = "auto",
    structures: Sequence[StructureName] | None = None,
) -> Identification:
    """Find delay, scale factor, bias, noise, dynamics and bandwidth, with error bars.

    Nothing need be known beforehand: structure, starting values and what the input does
    between its samples come from the record.

    Parameters
    ----------
    record : Record
        Inputs and outputs of one test; every pair is identified.
    intersample : {'auto', 'zoh', 'foh', 'bandlimited'}
        Whether the input is held, linear or band-limited between its samples. 'auto' takes
        what the record states, and else the likeliest.
    structures : sequence of str, optional
        Dynamics to try; all of `hmpim.model.STRUCTURES` by default.

    Returns
    -------
    Identification
        One pair for each input and output; index it output first.

    Raises
    ------
    RecordError
        If the record is too short, an input is constant, or all outputs are.
    ArgumentError
        If `intersample` or a structure is not known.

    Notes
    -----
    The joint fit is maximum likelihood under white Gaussian noise; with coloured noise the
    error bars are widened. The paper's figures (section IV) stand beside it in
    `PairIdentification.paper`.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> t = np.arange(1000) / 100
    >>> u = np.sin(2 * np.pi * (0.1 * t + 1.0 * t**2))
    >>> y = 2.0 * np.interp(t - 0.05, t, u, left=0) + 0.5 + 0.01 * rng.standard_normal(1000)
    >>> result = identify(Record.from_arrays({"u": u}, {"y": y}, fs=100.0))
    >>> round(result["y", "u"].delay.value, 3)
    0.05
    """
    chosen = _checked_intersample(intersample, record)
    names = tuple(structures) if structures is not None else tuple(STRUCTURES)
    for name in names:
        if name not in STRUCTURES:
            raise ArgumentError(f"structure {name!r} is not known; choose of {list(STRUCTURES)}")
    _check_length(record)
    aligned = uniform(record)
    for signal in aligned.inputs:
        if np.ptp(signal.values) == 0:
            raise RecordError(
                f"input {signal.name!r} is constant at {signal.values[0]:g}; nothing can be "
                "identified from an input that does not move"
            )
    dead = [s for s in aligned.outputs if np.ptp(s.values[s.valid]) == 0]
    if len(dead) == len(aligned.outputs):
        raise RecordError(
            f"output {dead[0].name!r} is constant at {dead[0].values[0]:g}; the sensor is dead, "
            "stuck or not connected, or the wrong column is taken as output"
        )
    with one_thread():
        pairs = tuple(
            pair
            for output in aligned.outputs
            for pair in _identify_output(aligned, output, record, chosen, names)
        )
    return Identification(
        record=RecordSummary(
            fs=aligned.fs, samples=record.samples, sha256=record.sha256, source=record.source
        ),
        pairs=pairs,
        data=record,
    )


def _checked_intersample(intersample: str, record: Record) -> Intersample | None:
    if intersample == "auto":
        return record.intersample
    for known in get_args(Intersample):
        if intersample == known:
            return cast(Intersample, known)
    raise ArgumentError(
        f"intersample {intersample!r} is not known; choose of auto, zoh, foh, bandlimited"
    )


def _check_length(record: Record) -> None:
    for channel in (*record.inputs, *record.outputs):
        if channel.values.size < _FEWEST_SAMPLES:
            raise RecordError(
                f"channel {channel.name!r} has {channel.values.size} samples; at least "
                f"{_FEWEST_SAMPLES} are needed to tell dynamics from noise, so record longer"
            )


def _identify_output(
    aligned: Aligned,
    output: Signal,
    record: Record,
    intersample: Intersample | None,
    structures: tuple[StructureName, ...],
) -> list[PairIdentification]:
    """Identify one output against every input, together where there are several."""
    if np.ptp(output.values[output.valid]) == 0:
        dead = Finding(
            code="dead_channel",
            message=f"Output {output.name!r} is constant at {output.values[output.valid][0]:g}. "
            "The sensor is dead, stuck or not connected.",
        )
        return [_untold(aligned, source, output, record, dead) for source in aligned.inputs]
    found = find_imperfections(output.values, aligned.fs)
    joined = _joined(aligned, output, found, intersample, structures)
    seen = found.saturation is not None or found.hold is not None
    if seen or not is_white(joined.fits[0].best.fit.residual):
        # Now that there is a model, a plateau can be told from a crest.
        predicted = joined.fits[0].best.fit.prediction
        again = find_imperfections(output.values, aligned.fs, prediction=predicted)
        if (again.saturation is None) != (found.saturation is None) or (again.hold is None) != (
            found.hold is None
        ):
            joined = _joined(aligned, output, again, intersample, structures)
        found = again
    matrix = _matrix(aligned, output, record, joined) if len(aligned.inputs) > 1 else None
    pairs = []
    for i, source in enumerate(aligned.inputs):
        if joined.related[i]:
            pairs.append(_described(aligned, source, output, record, joined, i, matrix, found))
            continue
        unrelated = Finding(
            code="unrelated",
            message=f"Output {output.name!r} does not follow input {source.name!r}: a constant "
            "explains it as well. Check the channels, or excite more.",
        )
        pairs.append(_untold(aligned, source, output, record, unrelated))
    return pairs


def _joined(
    aligned: Aligned,
    output: Signal,
    found: Imperfections,
    intersample: Intersample | None,
    structures: tuple[StructureName, ...],
) -> Joined:
    """Fit an output to all inputs on the samples that say what it was."""
    valid = None if bool(output.valid.all()) else np.asarray(output.valid)
    told = found.telling(output.values.size, aligned.fs)
    if told is not None:
        valid = told if valid is None else valid & told
    measured = np.logical_and.reduce([source.valid for source in aligned.inputs])
    return fit_together(
        [source.values for source in aligned.inputs],
        output.values,
        valid=valid,
        known=None if bool(measured.all()) else np.asarray(measured),
        intersample=intersample,
        structures=structures,
    )


def _matrix(aligned: Aligned, output: Signal, record: Record, joined: Joined) -> ResponseMatrix:
    """Response of one output to all inputs; inputs that cannot be told apart are refused."""
    bands = [record.band or excited_band(s.values, aligned.fs) for s in aligned.inputs]
    names = [s.name for s in aligned.inputs]
    band = (max(low for low, _ in bands), min(high for _, high in bands))
    # One delay for all inputs: moving them against each other would make them look different.
    follows = [fit for fit, related in zip(joined.fits, joined.related, strict=True) if related]
    strongest = min(follows or joined.fits, key=lambda fit: fit.best.fit.cost)
    delay = min(max(strongest.best.fit.delay, 0.0), 0.4 * aligned.samples) / aligned.fs
    matrix = response_matrix(
        np.stack([s.values for s in aligned.inputs]),
        output.values[None, :],
        aligned.fs,
        delays=[[delay]],
        band=band,
        names=[*names, output.name],
    )
    if np.mean(matrix.usable) < _NEVER_APART:
        raise RecordError(
            f"inputs {', '.join(names)} cannot be told apart: the condition number of their "
            f"spectra is {np.median(matrix.condition):.3g} at the median frequency. Drive them one "
            "at a time, or with sweeps that pass each frequency at different times"
        )
    return matrix


def _described(
    aligned: Aligned,
    source: Signal,
    output: Signal,
    record: Record,
    joined: Joined,
    i: int,
    matrix: ResponseMatrix | None,
    found: Imperfections,
) -> PairIdentification:
    """Say all that is known of an output that follows an input."""
    fs, joint = aligned.fs, joined.fits[i]
    covariance = joined.covariances[i] if matrix is not None else None
    refined = refine(joint, found, fs) if matrix is None else None
    censored = None
    if refined is not None:
        joint, censored = refined
        covariance = censored.covariance
    fit = joint.best.fit
    u, y = source.values, joint.problem.y  # what the other inputs leave over
    band = record.band or excited_band(u, fs)
    paper = paper_estimates(u, y, fs, band=band)
    readings = read_parameters(
        joint,
        fs=fs,
        highest=min(band[1], fs / 2),
        delay_correlation=paper.delay,
        known_covariance=covariance,
        input_unit=source.unit,
        output_unit=output.unit,
    )
    fit_percent = _fit_percent(joint)
    left = misfit(u, fit.residual, delay=fit.delay, band=(band[0] / fs, band[1] / fs))
    judgement = judge(joint, readings, left, fs=fs, band=band, fit_percent=fit_percent)
    if matrix is None:
        response = local_response(
            u, _told(y, fit, found, fs), fs, delay=max(fit.delay, 0.0) / fs, band=band
        )
        findings, verdict = judgement.findings, judgement.verdict
    else:
        response = _column(matrix, i)
        findings, verdict = _with_condition(judgement, matrix, aligned)
    from_response = response_bandwidths(
        response,
        readings.system,
        readings.parameters,
        fs=fs,
        intersample=joint.best.intersample,
    )
    parameters, seen = with_imperfections(readings.parameters, found, censored, output.unit)
    counts = slice(None) if joint.problem.valid is None else joint.problem.valid
    said = remarks(
        fit.residual[counts],
        aligned.time[counts],
        u,
        fs=fs,
        band=band,
        white=readings.white,
        unit=output.unit,
    )
    findings = (*findings, *seen, *said)
    parted = disagreement(from_response, readings.parameters)
    if parted is not None and found.hold is None:
        findings, verdict = (*findings, parted), "doubtful"
    return PairIdentification(
        input=source.name,
        output=output.name,
        structure=fit.structure.name,
        intersample=joint.best.intersample,
        fit_percent=fit_percent,
        parameters=parameters,
        paper=paper,
        frequency_response=response,
        numerator=_descending(readings.system.numerator / readings.system.numerator[0]),
        denominator=_descending(readings.system.denominator),
        candidates=_candidates(joint),
        verdict=verdict,
        warnings=(*aligned.findings, *findings),
        from_response=from_response,
        time=aligned.time,
        prediction=fit.prediction,
        residual=fit.residual,
    )


def _told(y: NDArray[np.float64], fit: Fit, found: Imperfections, fs: float) -> NDArray[np.float64]:
    """Output with the model in place of clipped and held samples, for spectra."""
    told = found.telling(y.size, fs)
    return y if told is None else np.where(told, y, fit.prediction)


def _column(matrix: ResponseMatrix, i: int) -> FrequencyResponse:
    """One input's response at the frequencies where the inputs can be told apart."""
    told = matrix.usable
    return FrequencyResponse(
        frequency=matrix.frequency[told],
        response=matrix.response[told, 0, i],
        std=matrix.std[told, 0, i],
        coherence=matrix.partial_coherence[told, 0, i],
    )


def _with_condition(
    judgement: Judgement, matrix: ResponseMatrix, aligned: Aligned
) -> tuple[tuple[Finding, ...], Verdict]:
    """Add a warning where the inputs cannot be told apart over a good part of the band."""
    told = float(np.mean(matrix.usable))
    if told > _TOLD_APART:
        return judgement.findings, judgement.verdict
    names = ", ".join(s.name for s in aligned.inputs)
    coupled = Finding(
        code="coupled_inputs",
        message=f"Inputs {names} can be told apart at {100 * told:.0f} % of the frequencies only "
        f"(median condition number {np.median(matrix.condition):.3g}). Drive them with sweeps that "
        "pass each frequency at different times.",
    )
    verdict: Verdict = "doubtful" if judgement.verdict == "ok" else judgement.verdict
    return (*judgement.findings, coupled), verdict


def _descending(coefficients: NDArray[np.float64]) -> tuple[float, ...]:
    return tuple(float(c) for c in coefficients[::-1])


def _spread(joint: JointFit) -> float:
    problem = joint.problem
    y = problem.y if problem.valid is None else problem.y[problem.valid]
    return float(np.sum((y - y.mean()) ** 2))


def _fit_percent(joint: JointFit, cost: float | None = None) -> float:
    cost = joint.best.fit.cost if cost is None else cost
    return float(100.0 * (1.0 - np.sqrt(cost / _spread(joint))))


def _candidates(joint: JointFit) -> tuple[Candidate, ...]:
    ordered = sorted(joint.trials, key=lambda trial: trial.criterion)
    return tuple(
        Candidate(
            structure=trial.fit.structure.name,
            intersample=trial.intersample,
            criterion=trial.criterion,
            fit_percent=_fit_percent(joint, trial.fit.cost),
            chosen=trial is joint.best,
        )
        for trial in ordered
    )


def _untold(
    aligned: Aligned,
    source: Signal,
    output: Signal,
    record: Record,
    finding: Finding,
) -> PairIdentification:
    """Say what little can be said of an output that does not follow the input."""
    band = record.band or excited_band(source.values, aligned.fs)
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
        frequency_response=local_response(source.values, output.values, aligned.fs, band=band),
        numerator=(0.0,),
        denominator=(1.0,),
        candidates=(),
        verdict="not_identifiable",
        warnings=(*aligned.findings, finding),
        time=aligned.time,
        prediction=np.full(aligned.samples, mean),
        residual=np.where(output.valid, output.values - mean, 0.0),
    )
