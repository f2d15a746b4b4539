"""All that is said of a pair that was identified from statistics."""

import hashlib

import numpy as np

from hmpim.errors import RecordError
from hmpim.identify.fitting.nested import widened
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.judgement import Evidence, judge, judged
from hmpim.identify.judgement.between_samples import other_intersample, wide_span
from hmpim.identify.judgement.checks import Check
from hmpim.identify.judgement.errors import not_converged, weak_delay, weak_excitation
from hmpim.identify.judgement.reach import (
    beyond_band,
    fast_mode,
    initial_transient,
    integrator,
    natural_frequency_beyond,
    negative_delay,
)
from hmpim.identify.judgement.residual import lack_of_fit
from hmpim.identify.judgement.structure import missed_pole, other_order
from hmpim.identify.judgement.verdict import unfollowed
from hmpim.identify.reading.coefficients import coefficients_of, highest_first
from hmpim.identify.reading.figures import read_figures
from hmpim.identify.reading.propagation import response_std
from hmpim.identify.reading.readings import Readings
from hmpim.identify.reading.spanned import spanned, without_noise
from hmpim.identify.result import (
    Candidate,
    FrequencyResponse,
    Identification,
    PairIdentification,
    PaperEstimates,
    Parameters,
    RecordSummary,
    ResponseBandwidths,
)
from hmpim.identify.result.error_bars import estimate, noise_estimate
from hmpim.identify.statistics.beyond import is_told, said_beyond
from hmpim.identify.statistics.choose import CompressedData, choose, integrator_of
from hmpim.identify.statistics.fit import Fitted, as_fitted
from hmpim.identify.statistics.limits import cut_response, drift_or_noise, perhaps_software
from hmpim.identify.statistics.run import Run
from hmpim.identify.statistics.start import correlations
from hmpim.identify.statistics.statistics import Statistics
from hmpim.model.dynamics import StructureName
from hmpim.model.response import response, slowest_time_constant
from hmpim.record import Finding, Intersample

__all__ = ["identify_statistics"]

_CHECKS: tuple[Check, ...] = (
    initial_transient,
    lack_of_fit,
    not_converged,
    weak_excitation,
    weak_delay,
    fast_mode,
    natural_frequency_beyond,
    integrator,
    beyond_band,
    other_order,
    missed_pole,
    other_intersample,
    wide_span,
    negative_delay,
    drift_or_noise,
    cut_response,
    perhaps_software,
)
"""Those that need no samples."""

_OVER = 1e-3
"""Share of an impulse response's peak that may be left at the end of the window."""

_SETTLES = 7.0
"""Time constants after which less than that is left."""

_DIGITS = float(np.sqrt(np.finfo(float).eps))
"""Share of a figure that is lost where sums of squares are subtracted."""

_FREQUENCIES = 200


def identify_statistics(
    statistics: Statistics,
    *,
    intersample: Intersample | None = None,
    structures: tuple[StructureName, ...] | None = None,
) -> Identification:
    """Identify one pair from what was kept of its records.

    Parameters
    ----------
    statistics : Statistics
        From `hmpim.compress`.
    intersample : {'zoh', 'foh', 'bandlimited'}, optional
        What the input does between its samples; as the statistics say, or the likeliest.
    structures : tuple of str, optional
        Which to try; all by default. Integrators are asked for in any case, and refused.

    Raises
    ------
    RecordError
        If the channels do not move, too little was read, or the memory is longer than the window,
        as that of an integrator is.
    """
    _check_moves(statistics)
    data, joint = choose(
        statistics,
        intersample=intersample or statistics.intersample,
        structures=structures,
    )
    best = as_fitted(joint.best.fit)
    if joint.related:
        _check_window(statistics, best)
    _check_integrator(statistics, integrator_of(statistics, data, joint))
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
    names = dict(zip(("input", "output"), statistics.names, strict=True))
    still = {
        "input": all(run.uu[0] == 0.0 for run in statistics.runs),
        "output": all(run.vv[-1, -1, 0] == 0.0 for run in statistics.runs),
    }
    for role, name in names.items():
        if still[role]:
            level = statistics.runs[0].level[int(role == "output")] if statistics.runs else 0.0
            raise RecordError(
                f"{role} {name!r} is constant at {level:g}; nothing can be identified from it"
            )


def _read(statistics: Statistics, joint: JointFit, highest: float) -> Readings:
    """Every figure of the chosen fit, and the covariance behind it."""
    best, fs, share = as_fitted(joint.best.fit), statistics.fs, joint.weighed_share
    left, vector = best.left, np.concatenate([best.theta, best.linear])
    cov = widened(joint, best.covariance)
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
        whitened=True,
        coefficient_covariance=spread,
    )


def _related(statistics: Statistics, data: CompressedData, joint: JointFit) -> PairIdentification:
    """Say all that is known of an output that follows its input."""
    best, fs = as_fitted(joint.best.fit), statistics.fs
    band = (data.band[0] * fs, data.band[1] * fs)
    readings = _read(statistics, joint, min(band[1], fs / 2))
    system, spread = readings.system, readings.coefficient_covariance
    evidence = Evidence(
        joint=joint,
        readings=readings,
        spanned=readings.parameters,
        misfit=data.misfit(best),
        u=np.empty(0),
        fs=fs,
        band=band,
        fit_percent=_fit_percent(statistics, best.left.power),
        measured=ResponseBandwidths(),
    )
    findings = judge(evidence, checks=_CHECKS)
    if not evidence.is_without_noise:
        findings = (*findings, *said_beyond(statistics, data.beyond(best), evidence))
    parameters = readings.parameters
    if evidence.is_without_noise:
        parameters = without_noise(parameters, _DIGITS)
    numerator, denominator = coefficients_of(system)
    frequency = np.geomspace(max(band[0], 1e-3 * band[1]), band[1], _FREQUENCIES)
    return PairIdentification(
        input=statistics.names[0],
        output=statistics.names[1],
        structure=best.structure.name,
        intersample=joint.best.intersample,
        fit_percent=evidence.fit_percent,
        parameters=parameters,
        paper=_paper(statistics),
        frequency_response=FrequencyResponse(
            frequency=frequency,
            response=np.asarray(response(system, frequency)),
            std=response_std(system, spread, frequency)
            if np.isfinite(spread).all()
            else np.full(frequency.size, np.inf),
        ),
        numerator=numerator,
        denominator=denominator,
        candidates=_candidates(statistics, joint),
        warnings=(*findings, _no_samples(statistics)),
        covariance=highest_first(spread, system),
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


def _check_integrator(statistics: Statistics, found: Fitted | None) -> None:
    """Refuse an output that integrates its input."""
    if found is not None:
        raise RecordError(
            f"the output moves as if it integrated the input ({found.structure.name}), so that its "
            f"memory is longer than any window, here {statistics.lags} samples; identify the "
            "record itself"
        )


def _fit_percent(statistics: Statistics, power: float) -> float:
    spread = 0.0
    for run in statistics.runs:
        total = float(run.vv[: statistics.reach.rows, -1, 0].sum())
        spread += float(run.vv[-1, -1, 0]) - total**2 / run.samples
    return float(100.0 * (1.0 - np.sqrt(power * statistics.samples / spread)))


def _candidates(statistics: Statistics, joint: JointFit) -> tuple[Candidate, ...]:
    """All trials; the fit is said of the whitened output where the noise is coloured."""
    best = as_fitted(joint.best.fit)
    return tuple(
        Candidate(
            structure=trial.fit.structure.name,
            intersample=trial.intersample,
            criterion=trial.criterion,
            fit_percent=_fit_percent(
                statistics, best.left.power * trial.fit.objective / max(best.objective, 1e-300)
            ),
            chosen=trial.fit is best,
        )
        for trial in sorted(joint.trials, key=lambda trial: trial.criterion)
    )


def _paper(statistics: Statistics) -> PaperEstimates:
    """Equation (8): the lag of the cross-correlation's peak; the other steps need samples."""
    _, cross = correlations(statistics)
    late = np.abs(cross[statistics.reach.forth :])
    return PaperEstimates(delay=float(np.argmax(late) / statistics.fs))


def _no_samples(statistics: Statistics) -> Finding:
    left = "clipping, holds, rounding and harmonics were not looked for"
    if is_told(statistics):
        left = (
            "clipping, rounding and even harmonics were not looked for, and holds and odd "
            "harmonics are detected but not modelled"
        )
    return Finding(
        code="no_samples",
        message=f"This is identified from statistics of {statistics.samples} samples, which are "
        f"not kept: the frequency response is the model's own, and {left}. "
        "Spikes and lost samples count as noise. Identify the record to see them.",
        severity="info",
        parameters=(),
    )


def _unrelated(statistics: Statistics, data: CompressedData, joint: JointFit) -> PairIdentification:
    """Say what little can be said of an output that a constant explains as well."""
    best = as_fitted(joint.best.fit)
    products = best.products
    mean = best.moments.bias
    variance = products.energy / max(products.counted - 1, 1)
    name, source = statistics.names[1], statistics.names[0]
    frequency = np.array([data.band[1] * statistics.fs])
    return PairIdentification(
        input=source,
        output=name,
        structure="static",
        intersample=joint.best.intersample,
        fit_percent=0.0,
        parameters=Parameters(
            bias=estimate(
                mean,
                variance * best.moments.bias_variance,
                freedom=products.counted - 1,
                unit=statistics.units[1],
            ),
        ),
        paper=PaperEstimates(),
        frequency_response=FrequencyResponse(
            frequency=frequency,
            response=np.zeros(1, dtype=np.complex128),
            std=np.full(1, np.sqrt(variance)),
        ),
        numerator=(0.0,),
        denominator=(1.0,),
        candidates=(),
        warnings=(
            unfollowed(name, source),
            _no_samples(statistics),
        ),
    )
