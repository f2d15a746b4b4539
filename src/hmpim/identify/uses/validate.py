"""Validation of a result on another record: fit, residual, and the band of the prediction."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from hmpim.arguments import checked
from hmpim.errors import ArgumentError, RecordError
from hmpim.identify.arrays import Mask, Real
from hmpim.identify.chance import DEVIATIONS, FALSE_ALARM, HALF
from hmpim.identify.effects.hold import detect_hold, updates
from hmpim.identify.fitting.least_squares import solved_exactly
from hmpim.identify.noise.misfit import misfit
from hmpim.identify.noise.whiteness import effective_share, ljung_box
from hmpim.identify.result import Identification, PairIdentification
from hmpim.identify.result.digits import percent
from hmpim.identify.result.plain import plain
from hmpim.identify.section_iv.spectrum import excited_band
from hmpim.identify.uses.gains import check_units
from hmpim.identify.uses.nonlinear import all_applied
from hmpim.identify.uses.predict import (
    fit_percent_of,
    free_responses,
    has_model,
    settling_time,
    to_model,
)
from hmpim.identify.worth import MATERIAL, ROUNDING
from hmpim.model import Model, draw_models, simulate
from hmpim.record import Aligned, Finding, Record, uniform

__all__ = ["Bounds", "Check", "OutputValidation", "Validation", "validate"]

_DRAWS = 32
"""Models drawn for the prediction band; its width is then known to an eighth."""

_SHARES = {"fit_percent": 1.0, "coverage": 100.0}
"""Checks that are written in per cent, and how many of these a value of 1 is."""

_PLACES = {"fit_percent": 2, "coverage": 1}
"""Their decimal places."""

_FEWEST = 50
"""Samples from which a residual can be judged."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """Requirements of a validation; None where a check is only reported.

    Parameters
    ----------
    fit_percent : float or None
        Least fit, 100 (1 - ‖measured - predicted‖ / ‖measured - mean‖).
    noise_ratio : float or None
        Greatest ratio of the residual to the identified noise, both as standard deviations. The
        share of samples in the prediction band must then lie between the shares for noise that is
        greater and smaller by this ratio.
    chance : float or None
        Least p-value of the residual's tests: that it does not follow the input, and that it is
        white where the noise was.

    Raises
    ------
    ArgumentError
        If a bound can never or always be met.
    """

    fit_percent: float | None = None
    noise_ratio: float | None = 1.2
    chance: float | None = FALSE_ALARM

    def __post_init__(self) -> None:
        for name, value in (("fit_percent", self.fit_percent), ("noise_ratio", self.noise_ratio)):
            if value is not None and math.isinf(value):
                raise ArgumentError(f"{name} = {value!r} is no bound; give a finite number")
        if self.fit_percent is not None and not self.fit_percent < 100:
            raise ArgumentError(f"fit_percent = {self.fit_percent!r} cannot be met; stay below 100")
        if self.noise_ratio is not None and not self.noise_ratio > 1.0:
            raise ArgumentError(
                f"noise_ratio = {self.noise_ratio!r} fails right models; give more than 1"
            )
        if self.chance is not None and not 0.0 < self.chance < 0.5:
            raise ArgumentError(f"chance = {self.chance!r} is not a p-value between 0 and 0.5")


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One figure of a validation.

    Parameters
    ----------
    name : str
        Stable word: 'fit_percent', 'noise_ratio', 'coverage', 'follows_input', 'whiteness'.
    value : float
        The figure.
    low, high : float or None
        Its bounds; None where it has none.
    message : str
        The result in a sentence.
    """

    name: str
    value: float
    low: float | None
    high: float | None
    message: str

    @property
    def passed(self) -> bool:
        """Whether it is inside its bounds."""
        above = self.low is None or self.value >= self.low
        return above and (self.high is None or self.value <= self.high)

    @property
    def text(self) -> str:
        """The figure for people: shares in per cent; of a very small p-value only the bound.

        Examples
        --------
        >>> Check(name="coverage", value=0.9513, low=0.88, high=0.99, message="").text
        '95.1 %'
        >>> Check(name="whiteness", value=2e-58, low=1e-4, high=None, message="").text
        'below 0.0001'
        """
        if self.name in _SHARES:
            return f"{_SHARES[self.name] * self.value:.{_PLACES[self.name]}f} %"
        if self.name == "noise_ratio":
            return f"{self.value:.3g}"
        return _p_value(self.value, FALSE_ALARM if self.low is None else self.low)

    @property
    def bound(self) -> str:
        """Its bounds for people; empty where it has none."""
        size = _SHARES.get(self.name, 1.0)
        ends = [f"{size * end:.4g}" for end in (self.low, self.high) if end is not None]
        if not ends:
            return ""
        word = "" if len(ends) == 2 else "at most " if self.low is None else "at least "
        return word + " to ".join(ends) + (" %" if self.name in _SHARES else "")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OutputValidation:
    """One output: measured, predicted with its standard deviation, and the checks.

    Parameters
    ----------
    output : str
        Its name.
    inputs : tuple of str
        Inputs of the prediction.
    time, measured, predicted, std : ndarray, shape (n,)
        Seconds; the output's unit. `std` includes the noise and the uncertainty of the model.
    scored : bool ndarray, shape (n,)
        Samples that count.
    checks : tuple of Check
        The checks.
    findings : tuple of Finding
        As in `Prediction`.
    """

    output: str
    inputs: tuple[str, ...]
    time: Real
    measured: Real
    predicted: Real
    std: Real
    scored: Mask
    checks: tuple[Check, ...]
    findings: tuple[Finding, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether all checks are inside their bounds."""
        return all(check.passed for check in self.checks)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Validation:
    """The validation of a result on a record.

    Parameters
    ----------
    outputs : tuple of OutputValidation
        One for each output that the result has a model of.
    """

    outputs: tuple[OutputValidation, ...]

    @property
    def passed(self) -> bool:
        """Whether every output is inside the bounds."""
        return all(output.passed for output in self.outputs)

    def to_dict(self) -> dict[str, object]:
        """Return the figures as plain JSON values."""
        return {
            "schema": "hmpim/validation/1",
            "passed": self.passed,
            "outputs": [
                {
                    "output": output.output,
                    "inputs": list(output.inputs),
                    "passed": output.passed,
                    "checks": [{**plain(check), "passed": check.passed} for check in output.checks],
                    "findings": [plain(finding) for finding in output.findings],
                }
                for output in self.outputs
            ],
        }


@checked
def validate(result: Identification, record: Record, *, bounds: Bounds | None = None) -> Validation:
    """Validate a result: compare its prediction with a record.

    Parameters
    ----------
    result : Identification
        Identified on another record.
    record : Record
        With channels of the same names.
    bounds : Bounds, optional
        Requirements; by default the residual is at most 1.2 times the noise, and no test of it has
        a p-value below 0.0001.

    Returns
    -------
    Validation
        Its `passed` says whether all bounds are met.

    Raises
    ------
    RecordError
        If no pair has a model, a channel is missing, or too few samples remain to score.

    Notes
    -----
    The whole chain is predicted. The input before the record is unknown, so that scoring begins
    after the settling time of the model, and what is left of the free response then is fitted: of
    an integrator, its offset. Clipped samples do not count, and only the updates of a held output
    do. A residual that follows the input counts against the result only beyond the error bars, at
    the same chance. Rounding is not noise: it may have any colour and follow the input. A residual
    of at most 1e-9 of the output (r.m.s.), as with exact software, has no bounds but that of the
    fit.

    Examples
    --------
    >>> import hmpim
    >>> sensor = hmpim.Sensor(delay=0.1, time_constant=0.05, noise_std=0.05)
    >>> limits = hmpim.Limits(position=10, velocity=1000, acceleration=40000, unit="deg")
    >>> stimulus = hmpim.design(band=(0.1, 10), duration=5, fs=100, limits=limits)
    >>> from hmpim.identify import identify
    >>> result = identify(hmpim.run(sensor, stimulus, rng=1))
    >>> validate(result, hmpim.run(sensor, stimulus, rng=2)).passed
    True
    """
    aligned, by_output = uniform(record), dict[str, list[PairIdentification]]()
    for pair in filter(has_model, result.pairs):
        by_output.setdefault(pair.output, []).append(pair)
    if not by_output:
        raise RecordError(
            "the result has no model to validate: no pair has all figures that a model needs"
        )
    for pair in filter(has_model, result.pairs):
        check_units(pair, aligned)
    limits, fs = bounds or Bounds(), result.record.fs
    return Validation(
        outputs=tuple(_validated(aligned, pairs, limits, fs=fs) for pairs in by_output.values())
    )


def _validated(
    aligned: Aligned, pairs: Sequence[PairIdentification], bounds: Bounds, *, fs: float
) -> OutputValidation:
    """Validate one output, driven by all its inputs."""
    y = aligned.signal(pairs[0].output)
    whole = [to_model(pair, fs=fs) for pair in pairs]
    models, moved, known, findings = all_applied(pairs, whole, aligned)
    wait = max(settling_time(model) for model in models)
    scored = y.valid & known & (aligned.time >= aligned.start + wait)
    if models[0].hold_period is not None:
        held = detect_hold(y.values, aligned.fs)  # the phase of its clock is the record's own
        if held is not None:
            index = updates(held, y.values.size, aligned.fs).index
            scored &= np.isin(np.arange(y.values.size), index)
            models = [replace(m, hold_period=held.period, hold_phase=held.phase) for m in models]
    if any(model.hold_period is not None for model in models):
        moved = [_moved(m, p, aligned) for m, p in zip(models, pairs, strict=True)]
    predicted = _summed(models, moved)
    noise = models[0].noise_std
    model_std = _model_std(models, moved, pairs, aligned)
    for level, side in ((models[0].saturation_low, -1.0), (models[0].saturation_high, 1.0)):
        if level is not None:  # near a level, noise determines which samples are clipped
            scored &= side * (level - predicted) > DEVIATIONS * noise
            scored &= side * (level - y.values) > 0
    if np.count_nonzero(scored) < _FEWEST:
        raise RecordError(
            f"only {np.count_nonzero(scored)} samples of {y.name!r} are left to score, once the "
            "model has settled and without gaps and clipping; give a longer record"
        )
    begins = int(np.argmax(scored))  # the record may begin in motion, and an integrator anywhere
    rows = free_responses(models, aligned.time[begins:])
    if rows.size:
        weights, _ = solved_exactly(rows[:, scored[begins:]], (y.values - predicted)[scored])
        predicted[begins:] += weights @ rows
    residual = np.where(scored, y.values - predicted, 0.0)
    std = np.hypot(noise, model_std)
    fit = fit_percent_of(y.values[scored], residual[scored])
    if np.sqrt(np.mean(residual[scored] ** 2)) <= ROUNDING * np.std(y.values[scored]):
        bounds = Bounds(fit_percent=bounds.fit_percent, noise_ratio=None, chance=None)
    return OutputValidation(
        output=y.name,
        inputs=tuple(pair.input for pair in pairs),
        time=aligned.time,
        measured=y.values,
        predicted=models[0].within(predicted),
        std=std,
        scored=scored,
        checks=(
            Check(
                name="fit_percent",
                value=fit,
                low=bounds.fit_percent,
                high=None,
                message=f"The model predicts the output with a fit of {fit:.2f} %.",
            ),
            *_size(residual[scored], noise, model_std[scored], std[scored], bounds, unit=y.unit),
            *_tests(aligned, pairs, models, residual, scored, model_std, bounds),
        ),
        findings=findings,
    )


def _predicted(
    models: Sequence[Model], pairs: Sequence[PairIdentification], aligned: Aligned
) -> Real:
    """Output of all models together, (n,)."""
    moved = [_moved(model, pair, aligned) for model, pair in zip(models, pairs, strict=True)]
    return _summed(models, moved)


def _moved(model: Model, pair: PairIdentification, aligned: Aligned) -> Real:
    """Output of one model, (n,); a held output is updated by its own clock."""
    u = aligned.signal(pair.input).values
    free = replace(model, saturation_low=None, saturation_high=None, quantization_step=None)
    if model.hold_period is None:
        return simulate(free, u, fs=aligned.fs, intersample=model.intersample)
    return free.simulate(u, aligned.time - aligned.start)


def _summed(models: Sequence[Model], moved: Sequence[Real]) -> Real:
    """Sum over the inputs, (n,), bias once."""
    total = np.full(moved[0].size, models[0].bias)
    for model, output in zip(models, moved, strict=True):
        total += output - model.bias
    return total


def _model_std(
    models: Sequence[Model],
    moved: Sequence[Real],
    pairs: Sequence[PairIdentification],
    aligned: Aligned,
) -> Real:
    """Standard deviation of the prediction, `moved` of each model, by their uncertainty."""
    if any(model.spread is None for model in models):
        return np.zeros(aligned.samples)
    # A force is followed step by step: its own error is added to that of the linear part.
    forced = [m.nonlinear is not None and m.nonlinear.at == "force" for m in models]
    free = [
        replace(model, hold_period=None, nonlinear=None if force else model.nonlinear)
        for model, force in zip(models, forced, strict=True)
    ]
    earliest = (1 - aligned.samples) / aligned.fs  # ahead of the whole record nothing is left
    drawn = [
        [replace(one, delay=max(one.delay, earliest)) for one in draw_models(model, _DRAWS, rng=0)]
        for model in free
    ]
    predictions = [_predicted(some, pairs, aligned) for some in zip(*drawn, strict=True)]
    std = np.asarray(np.std(predictions, axis=0))
    for model, own, one, pair in zip(models, moved, free, pairs, strict=True):
        part = model.nonlinear
        if part is not None and one.nonlinear is None:
            effect = _summed([model], [own]) - _predicted([one], [pair], aligned)
            std = np.hypot(std, np.abs(effect) * part.std / part.size)
    return std


def _size(
    residual: Real, noise: float, model_std: Real, std: Real, bounds: Bounds, *, unit: str
) -> tuple[Check, Check]:
    """Size of the residual, and the share of samples inside the band."""
    expected = float(np.sqrt(np.mean(std**2))) or np.finfo(float).tiny
    ratio = float(np.sqrt(np.mean(residual**2))) / expected
    share = float(np.mean(np.abs(residual) <= HALF * std))
    low = high = None
    if bounds.noise_ratio is not None:
        # With few samples a share varies by its standard deviation.
        count = max(residual.size * effective_share(residual), 4.0)
        low = 2.0 * float(scipy.special.ndtr(HALF / bounds.noise_ratio)) - 1.0
        high = 2.0 * float(scipy.special.ndtr(HALF * bounds.noise_ratio)) - 1.0
        scatter = 3.0 * float(np.sqrt(0.95 * 0.05 / count))
        low, high = max(low - scatter, 0.0), min(high + scatter, 1.0)
    of_model = float(np.sqrt(np.mean(model_std**2)))
    return (
        Check(
            name="noise_ratio",
            value=ratio,
            low=None,
            high=bounds.noise_ratio,
            message=f"The residual (r.m.s.) is {ratio:.3g} times what the result predicts: noise "
            f"{f'{noise:.4g} {unit}'.rstrip()}, error of the model "
            f"{f'{of_model:.2g} {unit}'.rstrip()}.",
        ),
        Check(
            name="coverage",
            value=share,
            low=low,
            high=high,
            message=f"{100 * share:.1f} % of the samples are in the 95 % band of the prediction.",
        ),
    )


def _tests(
    aligned: Aligned,
    pairs: Sequence[PairIdentification],
    models: Sequence[Model],
    residual: Real,
    scored: Mask,
    model_std: Real,
    bounds: Bounds,
) -> tuple[Check, ...]:
    """Whether the residual follows an input, and is white where the noise was."""
    checks, fs, least = [], aligned.fs, bounds.chance or FALSE_ALARM
    # At worst the model's error lies in one direction: its square is chi-squared with 1.
    error = float(np.mean(model_std[scored] ** 2))
    most = float(scipy.special.chdtri(1, least)) * error
    for pair, model in zip(pairs, models, strict=True):
        u = aligned.signal(pair.input).values
        low, high = excited_band(u, fs)
        left = misfit(u, residual, delay=model.delay * fs, band=(low / fs, high / fs))
        admitted = left.share * float(np.mean(residual**2)) / np.mean(scored) <= most
        name = f"follows_{pair.input}" if len(pairs) > 1 else "follows_input"
        result = (
            f"The residual does not follow {pair.input!r}"
            if left.probability >= least
            else f"{percent(left.share)} % of the residual's power follows {pair.input!r}"
            + (", which the error bars admit" if admitted else "")
        )
        checks.append(
            Check(
                name=name,
                value=left.probability,
                low=None if admitted else bounds.chance,
                high=None,
                message=f"{result} (p-value {_p_value(left.probability, least)}).",
            )
        )
    white = float(ljung_box(residual[scored] - residual[scored].mean()))
    coloured = any(
        warning.code in ("coloured_noise", "noise_colour", "quantization", "hum")
        for pair in pairs
        for warning in pair.warnings
    )
    quiet = error < MATERIAL * models[0].noise_std ** 2
    colour = "white"
    if white < least:
        colour = "coloured, as the noise was" if coloured else "coloured"
    whiteness = Check(
        name="whiteness",
        value=white,
        low=bounds.chance if quiet and not coloured else None,
        high=None,
        message=f"The residual is {colour} (p-value {_p_value(white, least)}).",
    )
    return (*checks, whiteness)


def _p_value(value: float, least: float) -> str:
    """A p-value in words; below the least that counts only that bound."""
    least = min(least, FALSE_ALARM)
    return f"{value:.2g}" if value >= least else f"below {least:g}"
