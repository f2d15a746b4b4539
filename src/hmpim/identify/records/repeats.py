"""Several records of one stimulus: averages, repeatability, and whether the error bars hold.

What differs between repeats is noise; the part of the residual that recurs in each is not noise but
dynamics or nonlinearity that the model lacks (Pintelon and Schoukens, System Identification,
2nd ed., Wiley 2012, section 4.3: averages over periods separate the two).
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import scipy

from hmpim.arguments import checked
from hmpim.errors import RecordError
from hmpim.identify.arrays import Real
from hmpim.identify.chance import FALSE_ALARM, HALF
from hmpim.identify.identify import identify
from hmpim.identify.judgement import judged_together
from hmpim.identify.noise.whiteness import effective_share
from hmpim.identify.records.alike import check_alike, check_apart, each_named, names_of
from hmpim.identify.records.repeated import RepeatedPair, RepeatedParameter, Repeats
from hmpim.identify.result import Estimate, FrequencyResponse, PairIdentification
from hmpim.identify.result.error_bars import estimate, noise_estimate
from hmpim.identify.result.groups import EVERY, MODELLED, PHASE_SPLIT, in_words
from hmpim.record import Finding, Intersample, Record

__all__ = ["identify_repeats"]


_ROUNDING = 1e-12
"""Relative size of a difference that is due to arithmetic alone."""

_COUNTED = "delay_correlation"  # a whole number of samples, which may be the same every time


@checked
def identify_repeats(
    records: Sequence[Record],
    *,
    intersample: Intersample | str = "auto",
    structures: Sequence[str] | None = None,
    names: Sequence[str] | None = None,
) -> Repeats:
    """Identify each record, average, and test the stated errors against the scatter.

    Parameters
    ----------
    records : sequence of Record
        At least two, of one stimulus, with the same channels.
    intersample : {'auto', 'zoh', 'foh', 'bandlimited'}
        As in `identify`.
    structures : sequence of str, optional
        As in `identify`.
    names : sequence of str, optional
        What messages call each record, such as its file; numbers from 0 by default.

    Returns
    -------
    Repeats

    Raises
    ------
    RecordError
        For fewer than two records, one record given twice, channels or rates that differ, or
        inputs that are not the same within 5 % (r.m.s.); and whatever `identify` refuses.

    Examples
    --------
    >>> t = np.arange(1000) / 100
    >>> u = np.sin(2 * np.pi * (0.1 * t + 1.0 * t**2))
    >>> rng = np.random.default_rng(1)
    >>> clean = 2.0 * np.interp(t - 0.05, t, u, left=0) + 0.5
    >>> records = [
    ...     Record.from_arrays({"u": u}, {"y": clean + 0.01 * rng.standard_normal(1000)}, fs=100.0)
    ...     for _ in range(3)
    ... ]
    >>> found = identify_repeats(records, structures=["static"])["y", "u"]
    >>> round(found["delay"].mean.value, 3)
    0.05
    """
    given = tuple(records)
    if len(given) < 2:
        raise RecordError(
            f"{len(given)} record is given; repeatability needs at least 2 of one stimulus"
        )
    called = names_of(given, names)
    check_alike(given, called)
    check_apart(given, called)
    alone = partial(identify, intersample=intersample, structures=structures)
    results = each_named(alone, given, called)
    return Repeats(
        results=tuple(results),
        pairs=tuple(
            _pair(tuple(result[pair.output, pair.input] for result in results))
            for pair in results[0].pairs
        ),
    )


def _pair(found: tuple[PairIdentification, ...]) -> RepeatedPair:
    """Average one pair over all repeats."""
    parameters = tuple(one for name in EVERY if (one := _parameter(name, found)) is not None)
    response, scatter = _averaged(found)
    identified = tuple(pair for pair in found if pair.verdict != "not_identifiable")
    noise, unmodelled, probability = _split(identified)
    findings = [*_unlike(found, identified), *_doubts(parameters, found[0].output)]
    if unmodelled and probability is not None and probability < FALSE_ALARM:
        findings.append(
            Finding(
                code="unmodelled",
                message=f"{unmodelled:.3g} (r.m.s.) of the residual recurs in "
                "every repeat, so it is not noise. Compare the residual with the stimulus.",
                severity="doubt",
                parameters=MODELLED,
            )
        )
    return RepeatedPair(
        input=found[0].input,
        output=found[0].output,
        structures=tuple(pair.structure for pair in found),
        parameters=tuple(
            replace(
                p,
                mean=judged_together(p.mean, _known(p.name, found), name=p.name, findings=findings),
            )
            for p in parameters
        ),
        frequency_response=response,
        response_scatter=scatter,
        noise_std=noise,
        unmodelled=unmodelled,
        unmodelled_probability=probability,
        findings=tuple(findings),
    )


def _unlike(
    found: tuple[PairIdentification, ...], identified: tuple[PairIdentification, ...]
) -> Iterator[Finding]:
    """Report that not all repeats could be identified, or not all as the same structure."""
    if len(identified) < len(found):
        yield Finding(
            code="not_identifiable",
            message=f"{len(found) - len(identified)} of {len(found)} repeats could not be "
            "identified. See their own warnings.",
            severity="doubt",
            parameters=EVERY,
        )
    if len({pair.structure for pair in identified}) > 1:
        yield Finding(
            code="structure",
            message=f"The repeats were found to be {', '.join(pair.structure for pair in found)}. "
            "The records barely distinguish them; state one with structures=.",
            severity="doubt",
            parameters=PHASE_SPLIT,
        )


def _known(name: str, found: tuple[PairIdentification, ...]) -> list[Estimate]:
    """Estimates of one parameter that have an error."""
    estimates = [e for pair in found if (e := getattr(pair.parameters, name)) is not None]
    return [e for e in estimates if 0 < e.spread < np.inf and min(_sides(e)) > 0]


def _sides(one: Estimate) -> tuple[float, float]:
    """Reach of the 95 % interval below and above, by a normal error or as stated."""
    low, high = one.ci95 or (None, None)
    if one.std is not None or low is None or high is None:
        return HALF * one.spread, HALF * one.spread
    return one.value - low, high - one.value


def _parameter(name: str, found: tuple[PairIdentification, ...]) -> RepeatedParameter | None:
    """Average one parameter; None if fewer than two repeats determine it with an error."""
    estimates = _known(name, found)
    if len(estimates) < 2:
        return None
    values = np.array([e.value for e in estimates])
    # An interval that covers several models has its own error on the shorter side. The longer side
    # reaches to a model that would change all repeats alike, so their scatter does not show it; one
    # repeat that excludes that model excludes it for all.
    sides = np.array([_sides(e) for e in estimates])
    own = sides.min(axis=1) / HALF
    alike = (sides - HALF * own[:, np.newaxis]).min(axis=0)
    weights = 1.0 / own**2
    mean = float(weights @ values / weights.sum())
    statistic = float(weights @ (values - mean) ** 2)
    freedom = values.size - 1
    probability = float(scipy.stats.chi2.sf(statistic, freedom))
    widened = max(1.0, statistic / freedom) if probability < FALSE_ALARM else 1.0
    # If the scatter determines the error, so do its few degrees of freedom.
    average = estimate(
        mean,
        widened / float(weights.sum()),
        freedom=freedom if widened > 1 else np.inf,
        unit=estimates[0].unit,
    )
    if alike.max() > _ROUNDING * abs(mean):
        low, high = _sides(average)
        average = replace(average, std=None, ci95=(mean - low - alike[0], mean + high + alike[1]))
    too_small = probability > 1 - FALSE_ALARM and all(e.std is not None for e in estimates)
    return RepeatedParameter(
        name=name,
        mean=average,
        values=tuple(float(v) for v in values),
        repeatability=float(values.std(ddof=1)),
        chi_squared=statistic,
        freedom=freedom,
        probability=probability,
        agree=probability >= FALSE_ALARM and (name == _COUNTED or not too_small),
    )


def _doubts(parameters: Sequence[RepeatedParameter], output: str) -> Iterator[Finding]:
    """Report once what scatters more than its stated error, and once what scatters less."""
    apart = [p for p in parameters if not p.agree]
    for how, cause in (
        (
            "more",
            "Something changes between the repeats, or the model lacks something; use the "
            "repeatability as the error.",
        ),
        ("less", "The stated errors are too large, or the repeats are not independent records."),
    ):
        found = [p for p in apart if (p.probability < FALSE_ALARM) == (how == "more")]
        if found:
            ratios = [
                f"{in_words(p.name)} {float(np.sqrt(p.chi_squared / p.freedom)):.3g} times"
                for p in found
            ]
            yield Finding(
                code="scatter",
                message=f"From repeat to repeat {output!r} scatters {how} than the stated errors "
                f"allow: {', '.join(ratios)} the stated error. {cause}",
                severity="doubt",
                parameters=tuple(p.name for p in found),
            )


def _averaged(found: tuple[PairIdentification, ...]) -> tuple[FrequencyResponse, float]:
    """Average the responses at the first one's frequencies; also return the relative scatter."""
    frequency = found[0].frequency_response.frequency
    delay = found[0].parameters.delay
    late = 0.0 if delay is None else delay.value
    known = [one for pair in found if (one := pair.frequency_response).frequency.size]
    if not known or not frequency.size:
        return found[0].frequency_response, float("nan")
    straight = [own.response * np.exp(2j * np.pi * own.frequency * late) for own in known]
    pairs = zip(known, straight, strict=True)
    values = np.stack([np.interp(frequency, own.frequency, y) for own, y in pairs])
    stds = np.stack([np.interp(frequency, own.frequency, own.std) for own in known])
    weights = 1.0 / np.maximum(stds, np.finfo(float).tiny ** 0.25) ** 2
    mean = np.sum(weights * values, axis=0) / np.sum(weights, axis=0)
    scatter = np.sum(weights * np.abs(values - mean) ** 2, axis=0) / max(len(known) - 1, 1)
    finite = scatter[np.isfinite(scatter)]
    return (
        FrequencyResponse(
            frequency=frequency,
            response=mean * np.exp(-2j * np.pi * frequency * late),
            std=np.sqrt(1.0 / np.sum(weights, axis=0)),
            coherence=None,
        ),
        float(np.sqrt(np.mean(finite))) if finite.size else float("nan"),
    )


def _split(
    identified: tuple[PairIdentification, ...],
) -> tuple[Estimate | None, float | None, float | None]:
    """Split the residuals into noise and the part that recurs in every repeat."""
    residuals = [pair.residual for pair in identified if pair.residual is not None]
    if len(residuals) < 2:
        return None, None, None
    length = min(residual.size for residual in residuals)
    stacked: Real = np.stack([residual[:length] for residual in residuals])
    count, mean = stacked.shape[0], stacked.mean(axis=0)
    apart = stacked - mean
    freedom = length * (count - 1)
    share = effective_share(apart[0])
    bias = identified[0].parameters.bias
    noise = noise_estimate(
        float(np.sum(apart**2)),
        freedom=freedom,
        share=share,
        unit="" if bias is None else bias.unit,
    )
    remains = noise.value**2 / count
    power = float(np.mean(mean**2))
    probability = 1.0
    if remains > 0:
        probability = float(scipy.stats.f.sf(power / remains, length * share, freedom * share))
    return noise, float(np.sqrt(max(power - remains, 0.0))), probability
