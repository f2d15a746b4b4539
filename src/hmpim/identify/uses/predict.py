"""A model from an identification, and its prediction of another record."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from hmpim.arguments import checked
from hmpim.errors import RecordError
from hmpim.identify.arrays import Mask, Real
from hmpim.identify.fitting.fit import FORGETS
from hmpim.identify.result import Estimate, PairIdentification, fit_percent
from hmpim.identify.result.groups import in_words
from hmpim.identify.result.pair import linear_model
from hmpim.identify.uses.nonlinear import applied, known_state
from hmpim.model import Model, Spread, slowest_time_constant
from hmpim.record import Finding, Record, uniform

__all__ = [
    "Prediction",
    "fit_percent_of",
    "free_responses",
    "has_model",
    "predict",
    "rate_of",
    "settling_time",
    "to_model",
]

_NEEDED = ("delay", "scale_factor", "bias", "noise_std")
"""Parameters without which there is no model."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prediction:
    """The output of a model, together with the measured output.

    Parameters
    ----------
    time, measured, predicted : ndarray, shape (n,)
        Seconds; the output's unit.
    scored : ndarray of bool, shape (n,)
        Samples that `fit_percent` is computed from.
    fit_percent : float
        100 (1 - ‖measured - predicted‖ / ‖measured - mean‖) over the scored samples.
    findings : tuple of Finding
        What to know about it: that the input goes beyond the amplitude at which a nonlinearity was
        identified (`beyond_reach`), or that the prediction is that of the linear part alone
        (`linear_only`).
    """

    time: Real
    measured: Real
    predicted: Real
    scored: Mask
    fit_percent: float
    findings: tuple[Finding, ...] = ()


def has_model(pair: PairIdentification) -> bool:
    """Whether a pair has every figure that a model needs, doubtful or not."""
    return None not in [getattr(pair.parameters, name) for name in _NEEDED]


@checked
def to_model(pair: PairIdentification, *, fs: float | None = None) -> Model:
    """Return a model that simulates the whole identified sensor chain, its errors included.

    Parameters
    ----------
    pair : PairIdentification
        From `hmpim.identify`, or read back.
    fs : float, optional
        Rate of the record in Hz, ``result.record.fs``, which the model stores.

    Raises
    ------
    RecordError
        If the record does not determine a figure that a model needs.
    """
    p, linear = pair.parameters, linear_model(pair, fs=rate_of(pair) if fs is None else fs)
    if linear is None or p.bias is None or p.noise_std is None:
        raise RecordError(
            f"{pair.output!r} from {pair.input!r} has no model, because the record does not "
            f"determine its {_why(pair)}"
        )
    frequency = pair.frequency_response.frequency
    return replace(
        linear,
        bias=p.bias.value,
        noise_std=p.noise_std.value,
        input=pair.input,
        output=pair.output,
        output_unit=p.bias.unit,
        saturation_low=_value(p.saturation_low),
        saturation_high=_value(p.saturation_high),
        hold_period=_value(p.hold_period),
        quantization_step=_value(p.quantization_step),
        band=float(frequency[-1]) if frequency.size else None,
        spread=_spread(pair),
        nonlinear=pair.nonlinear_part,
    )


def _why(pair: PairIdentification) -> str:
    """Name the figures that a pair without a model lacks, and the doubt that explains it."""
    missing = [name for name in _NEEDED if getattr(pair.parameters, name) is None]
    *names, last = (in_words(name) for name in missing)
    words = f"{', '.join(names)} and {last}" if names else last
    doubts = (w for w in pair.warnings if w.severity == "doubt" and missing[0] in w.parameters)
    cause = next(doubts, None)
    return words if cause is None else f"{words}. {cause.message}"


def fit_percent_of(y: Real, residual: Real) -> float:
    """Fit in per cent over the samples that count, (n,)."""
    away = y - y.mean()
    return float(fit_percent(float(residual @ residual), float(away @ away)))


def rate_of(pair: PairIdentification) -> float | None:
    """Rate in Hz at which software was identified, if the result contains its samples."""
    if pair.intersample != "sampled" or pair.time is None or pair.time.size < 2:
        return None
    return float((pair.time.size - 1) / (pair.time[-1] - pair.time[0]))


def settling_time(model: Model) -> float:
    """Settling time of a model in s: its delay and five slowest time constants."""
    if model.intersample != "sampled" or model.fs is None:
        slowest = slowest_time_constant(np.asarray(model.denominator[::-1]))
    else:
        size = np.clip(np.abs(np.roots(model.denominator)), 1e-12, 1 - 1e-12)
        slowest = float(np.max(-1.0 / np.log(size), initial=0.0) / model.fs)
    return max(model.delay, 0.0) + FORGETS * slowest


def free_responses(models: Sequence[Model], time: Real) -> Real:
    """Free responses of the models' initial states, (k, n), from the first of times in s on."""
    after = time - time[0]
    rows = []
    for model in models:
        poles = np.roots(model.denominator)
        if model.intersample == "sampled" and model.fs is not None:
            poles = model.fs * np.log(poles[np.abs(poles) > np.finfo(float).eps].astype(complex))
        upper = poles[poles.imag >= 0.0]
        waves = np.exp(upper[:, None] * after)
        rows += [waves.real, waves.imag[upper.imag > 0.0]]
    return np.concatenate(rows)


def _value(estimate: Estimate | None) -> float | None:
    return None if estimate is None else estimate.value


def _spread(pair: PairIdentification) -> Spread | None:
    """Errors of a model's figures; None where the record does not determine them."""
    if pair.covariance is None or pair.intersample == "sampled":
        return None
    known = {f.name: getattr(pair.parameters, f.name, None) for f in fields(Spread)}
    stds = {name: e.spread for name, e in known.items() if e is not None}
    if not all(map(math.isfinite, stds.values())):
        return None
    return Spread(covariance=tuple(tuple(row) for row in pair.covariance.tolist()), **stds)


@checked
def predict(pair: PairIdentification, record: Record, *, start: float | None = None) -> Prediction:
    """Simulate the identified model on a record and score it.

    The model is the linear part, the nonlinear part where the result has one, and the range of the
    output.

    Parameters
    ----------
    pair : PairIdentification
        Identified on this or another record.
    record : Record
        With channels of the pair's names.
    start : float, optional
        Time in s from which to score; by default after the settling time, the delay and five of the
        slowest time constants, since the input before the record is unknown.

    Raises
    ------
    RecordError
        If a channel is missing, or no samples remain to score.
    """
    aligned = uniform(record)
    u, y = aligned.signal(pair.input), aligned.signal(pair.output)
    model, moved, findings = applied(pair, to_model(pair, fs=aligned.fs), u.values, aligned.fs)
    predicted = model.within(moved)
    if start is None:
        start = aligned.start + settling_time(model)
    scored = y.valid & (aligned.time >= start) & known_state(model, u.values, aligned.fs)
    if np.count_nonzero(scored) < 2:
        raise RecordError(
            f"no samples are left to score from {start:.4g} s on; give a longer record"
        )
    measured = y.values[scored]
    return Prediction(
        time=aligned.time,
        measured=y.values,
        predicted=predicted,
        scored=scored,
        fit_percent=fit_percent_of(measured, measured - predicted[scored]),
        findings=findings,
    )
