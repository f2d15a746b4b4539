"""From a record to every parameter: the paper's steps and the joint fit, side by side."""

from collections.abc import Sequence
from typing import cast, get_args

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import ArgumentError, RecordError
from hmpim.identify.joint import JointFit, joint_fit
from hmpim.identify.local import local_polynomial_response
from hmpim.identify.paper import paper_estimates
from hmpim.identify.readings import read_parameters
from hmpim.identify.result import (
    Candidate,
    Identification,
    PairIdentification,
    PaperEstimates,
    Parameters,
    RecordSummary,
)
from hmpim.identify.spectrum import excited_band
from hmpim.identify.threads import one_thread
from hmpim.identify.uncertainty import estimate, noise_estimate
from hmpim.identify.verdict import is_unrelated, judge
from hmpim.identify.whiteness import misfit
from hmpim.model.dynamics import STRUCTURES, StructureName
from hmpim.record import Aligned, Finding, Intersample, Record, Signal, uniform

__all__ = ["identify"]

_FEWEST_SAMPLES = 50


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
            _identify_pair(aligned, u, y, record=record, intersample=chosen, structures=names)
            for y in aligned.outputs
            for u in aligned.inputs
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


def _identify_pair(
    aligned: Aligned,
    source: Signal,
    output: Signal,
    *,
    record: Record,
    intersample: Intersample | None,
    structures: tuple[StructureName, ...],
) -> PairIdentification:
    fs = aligned.fs
    u, y = source.values, output.values
    valid = None if bool(output.valid.all()) else np.asarray(output.valid)
    band = record.band or excited_band(u, fs)
    if np.ptp(y[output.valid]) == 0:
        dead = Finding(
            code="dead_channel",
            message=f"Output {output.name!r} is constant at {y[output.valid][0]:g}. "
            "The sensor is dead, stuck or not connected.",
        )
        return _untold(aligned, source, output, band, dead)
    known = None if bool(source.valid.all()) else np.asarray(source.valid)
    joint = joint_fit(
        u, y, valid=valid, known=known, intersample=intersample, structures=structures
    )
    if is_unrelated(joint):
        unrelated = Finding(
            code="unrelated",
            message=f"Output {output.name!r} does not follow input {source.name!r}: a constant "
            "explains it as well. Check the channels, or excite more.",
        )
        return _untold(aligned, source, output, band, unrelated)
    paper = paper_estimates(u, y, fs, band=band)
    readings = read_parameters(
        joint,
        fs=fs,
        highest=min(band[1], fs / 2),
        delay_correlation=paper.delay,
        input_unit=source.unit,
        output_unit=output.unit,
    )
    fit_percent = _fit_percent(joint)
    delay = joint.best.fit.delay
    left = misfit(u, joint.best.fit.residual, delay=delay, band=(band[0] / fs, band[1] / fs))
    judgement = judge(joint, readings, left, fs=fs, band=band, fit_percent=fit_percent)
    return PairIdentification(
        input=source.name,
        output=output.name,
        structure=joint.best.fit.structure.name,
        intersample=joint.best.intersample,
        fit_percent=fit_percent,
        parameters=readings.parameters,
        paper=paper,
        frequency_response=local_polynomial_response(
            u, y, fs, delay=max(delay, 0.0) / fs, band=band
        ),
        numerator=_descending(readings.system.numerator / readings.system.numerator[0]),
        denominator=_descending(readings.system.denominator),
        candidates=_candidates(joint),
        verdict=judgement.verdict,
        warnings=(*aligned.findings, *judgement.findings),
        time=aligned.time,
        prediction=joint.best.fit.prediction,
        residual=joint.best.fit.residual,
    )


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
    band: tuple[float, float],
    finding: Finding,
) -> PairIdentification:
    """Say what little can be said of an output that does not follow the input."""
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
        frequency_response=local_polynomial_response(
            source.values, output.values, aligned.fs, band=band
        ),
        numerator=(0.0,),
        denominator=(1.0,),
        candidates=(),
        verdict="not_identifiable",
        warnings=(*aligned.findings, finding),
        time=aligned.time,
        prediction=np.full(aligned.samples, mean),
        residual=np.where(output.valid, output.values - mean, 0.0),
    )
