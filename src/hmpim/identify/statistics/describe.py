"""The result for a pair that is identified from statistics."""

import hashlib

import numpy as np

from hmpim.errors import RecordError
from hmpim.identify.fitting.fit import Fit
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.judgement import Evidence, judge, judged
from hmpim.identify.judgement.checks import COMPRESSED
from hmpim.identify.judgement.verdict import unfollowed
from hmpim.identify.reading.figures import read_figures
from hmpim.identify.reading.readings import Readings
from hmpim.identify.reading.spanned import spanned, without_noise
from hmpim.identify.result import (
    FrequencyResponse,
    Identification,
    PairIdentification,
    PaperEstimates,
    Parameters,
    RecordSummary,
    ResponseBandwidths,
    fit_percent,
)
from hmpim.identify.result.error_bars import estimate, noise_estimate
from hmpim.identify.statistics.beyond import has_cubes, nonlinear_findings
from hmpim.identify.statistics.choose import CompressedData, choose, integrator_of
from hmpim.identify.statistics.fit import Fitted, as_fitted
from hmpim.identify.statistics.limits import LIMITS
from hmpim.identify.statistics.run import Run
from hmpim.identify.statistics.start import correlations
from hmpim.identify.statistics.statistics import Statistics
from hmpim.model.dynamics import StructureName
from hmpim.model.response import response, response_std, slowest_time_constant
from hmpim.record import Finding, Intersample

__all__ = ["identify_statistics"]

_OVER = 1e-3
"""Greatest response at the end of the window, as a share of the impulse response's peak."""

_SETTLES = 7.0
"""Time constants after which the response is smaller than that."""

_DIGITS = float(np.sqrt(np.finfo(float).eps))
"""Relative error of a figure where sums of squares are subtracted."""

_FREQUENCIES = 200


def identify_statistics(
    statistics: Statistics,
    *,
    intersample: Intersample | None,
    structures: tuple[StructureName, ...],
) -> Identification:
    """Identify one pair from compressed records.

    If the input between its samples is not stated, the likeliest assumption is chosen. Integrators,
    whose memory is longer than any window, channels that do not move, and too few samples raise a
    `RecordError`.
    """
    _check_moves(statistics)
    data, joint = choose(statistics, intersample=intersample, structures=structures)
    if joint.related:
        _check_window(statistics, as_fitted(joint.best.fit))
    found = integrator_of(statistics, data, joint)
    if found is not None:
        raise RecordError(
            f"the output moves as if it integrated the input ({found.structure.name}), so that its "
            f"memory is longer than any window, here {statistics.lags} samples; identify the "
            "record itself"
        )
    pair = (_related if joint.related else _unrelated)(statistics, data, joint)
    digest = hashlib.sha256()
    for run in statistics.runs:
        for name in Run.__dataclass_fields__:
            digest.update(np.asarray(getattr(run, name)).tobytes())
    summary = RecordSummary(
        fs=statistics.fs,
        samples=statistics.samples,
        sha256=digest.hexdigest(),
        source=f"statistics of {len(statistics.runs)} run{'s' * (len(statistics.runs) > 1)}",
    )
    return Identification(record=summary, pairs=(judged(pair),))


def _check_moves(statistics: Statistics) -> None:
    runs = statistics.runs
    powers = {"input": [run.uu[0] for run in runs], "output": [run.vv[-1, -1, 0] for run in runs]}
    for k, (role, power) in enumerate(powers.items()):
        if not any(power):
            level = runs[0].level[k] if runs else 0.0
            raise RecordError(
                f"{role} {statistics.names[k]!r} is constant at {level:g}; nothing can be "
                "identified from it"
            )


def _read(statistics: Statistics, joint: JointFit, highest: float) -> Readings:
    """Every figure of the chosen fit, and their covariance."""
    best, fs, share = as_fitted(joint.best.fit), statistics.fs, joint.weighed_share
    left, vector = best.left, np.concatenate([best.theta, best.linear])
    cov = best.covariance
    parameters, system, spread = read_figures(
        best.structure,
        vector,
        cov if share == 1.0 else cov / share,
        fs=fs,
        highest=highest,
        effective=max(joint.weighed.counted - vector.size, 1) * share,
        noise=noise_estimate(
            left.power * left.counted,
            freedom=max(left.counted - vector.size, 1),
            share=left.share,
            unit=statistics.units[1],
        ),
        units=statistics.units,
    )
    return Readings(
        parameters=spanned(parameters, joint, fs=fs, highest=highest),
        system=system,
        vector=vector,
        covariance=cov,
        white=best.is_white,
        halves=np.zeros((2, 0, 0)),
        innovations=np.empty(0),
        coefficient_covariance=spread,
    )


def _related(statistics: Statistics, data: CompressedData, joint: JointFit) -> PairIdentification:
    """The result for an output that follows its input."""
    best, fs = as_fitted(joint.best.fit), statistics.fs
    band = (data.band[0] * fs, data.band[1] * fs)
    readings = _read(statistics, joint, min(band[1], fs / 2))
    system, spread = readings.system, readings.coefficient_covariance
    total = _spread(statistics)

    def percent(fit: Fit) -> float:
        """Where the noise is coloured, that of the whitened output."""
        power = best.left.power * fit.objective / max(best.objective, 1e-300)
        return float(fit_percent(power * statistics.samples, total))

    evidence = Evidence(
        joint=joint,
        readings=readings,
        spanned=readings.parameters,
        misfit=data.misfit(best),
        u=np.empty(0),
        fs=fs,
        band=band,
        fit_percent=percent(best),
        measured=ResponseBandwidths(),
    )
    findings, parameters = judge(evidence, checks=(*COMPRESSED, *LIMITS)), readings.parameters
    if evidence.is_without_noise:
        parameters = without_noise(parameters, _DIGITS)
    else:
        findings = (*findings, *nonlinear_findings(statistics, data.beyond(best), evidence))
    numerator, denominator = readings.coefficients
    # Equation (8): the lag of the cross-correlation's peak. The paper's other steps need samples.
    late = np.abs(correlations(statistics)[1][statistics.reach.forth :])
    frequency = np.geomspace(max(band[0], 1e-3 * band[1]), band[1], _FREQUENCIES)
    return PairIdentification(
        input=statistics.names[0],
        output=statistics.names[1],
        structure=best.structure.name,
        intersample=joint.best.intersample,
        fit_percent=evidence.fit_percent,
        parameters=parameters,
        paper=PaperEstimates(delay=float(np.argmax(late) / fs)),
        frequency_response=FrequencyResponse(
            frequency=frequency,
            response=np.asarray(response(system, frequency)),
            std=response_std(system, spread, frequency)
            if np.isfinite(spread).all()
            else np.full(frequency.size, np.inf),
        ),
        numerator=numerator,
        denominator=denominator,
        candidates=joint.candidates(percent),
        warnings=(*findings, _no_samples(statistics)),
        covariance=readings.by_falling_powers,
    )


def _check_window(statistics: Statistics, fit: Fitted) -> None:
    """Refuse a model whose memory is longer than the window."""
    made = np.abs(fit.response)
    end = made[-max(statistics.lags // 20, 2) :].max()
    if end <= _OVER * made.max():
        return
    slowest = slowest_time_constant(fit.denominator)
    needed = int(np.ceil(max(fit.delay, 0.0) + _SETTLES * slowest)) + 1
    needed = max(needed, 2 * statistics.lags)
    raise RecordError(
        f"the response has not settled within the window of {statistics.lags} samples: delay and "
        f"settling take longer (time constant {slowest / statistics.fs:.3g} s or more); compress "
        f"with lags={needed} or more, or identify the record itself if the output integrates the "
        "input"
    )


def _spread(statistics: Statistics) -> float:
    """Sum of squares of the outputs, each run's about its mean."""
    spread = 0.0
    for run in statistics.runs:
        total = float(run.vv[: statistics.reach.rows, -1, 0].sum())
        spread += float(run.vv[-1, -1, 0]) - total**2 / run.samples
    return spread


def _no_samples(statistics: Statistics) -> Finding:
    left = "clipping, holds, rounding and harmonics were not looked for"
    if has_cubes(statistics):
        left = (
            "clipping, rounding and even harmonics were not looked for, and holds and odd "
            "harmonics are detected but not modelled"
        )
    return Finding(
        code="no_samples",
        message=f"This is identified from statistics of {statistics.samples} samples, which are "
        f"not kept: the frequency response is the model's own, and {left}. "
        "Spikes and lost samples count as noise. To find them, identify the record itself.",
        severity="info",
        parameters=(),
    )


def _unrelated(statistics: Statistics, data: CompressedData, joint: JointFit) -> PairIdentification:
    """The result for an output that a constant explains as well."""
    best = as_fitted(joint.best.fit)
    products = best.products
    variance = products.energy / max(products.counted - 1, 1)
    source, name = statistics.names
    return PairIdentification(
        input=source,
        output=name,
        structure="static",
        intersample=joint.best.intersample,
        fit_percent=0.0,
        parameters=Parameters(
            bias=estimate(
                best.moments.bias,
                variance * best.moments.bias_variance,
                freedom=products.counted - 1,
                unit=statistics.units[1],
            ),
            noise_std=noise_estimate(
                products.plain.energy,
                freedom=max(products.plain.counted - 1, 1),
                share=1.0,
                unit=statistics.units[1],
            ),
        ),
        paper=PaperEstimates(),
        frequency_response=FrequencyResponse(
            frequency=np.array([data.band[1] * statistics.fs]),
            response=np.zeros(1, dtype=np.complex128),
            std=np.full(1, np.sqrt(variance)),
        ),
        numerator=(0.0,),
        denominator=(1.0,),
        candidates=(),
        warnings=(unfollowed(name, source), _no_samples(statistics)),
    )
