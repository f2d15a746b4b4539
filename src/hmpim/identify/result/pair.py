"""The result for one input and one output."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, overload

import numpy as np

from hmpim.equality import ByValue
from hmpim.identify.arrays import Real
from hmpim.identify.result.digits import interval
from hmpim.identify.result.estimate import Estimate, Verdict
from hmpim.identify.result.measured import FrequencyResponse, Nonlinearity, ResponseBandwidths
from hmpim.identify.result.parameters import PaperEstimates, Parameters
from hmpim.identify.result.plain import Plain, by_fields, fields_in
from hmpim.model import Model
from hmpim.model.nonlinear import NonlinearPart
from hmpim.record import Finding, Intersample, Stopping
from hmpim.tables import html_table, shortened

__all__ = ["Candidate", "PairIdentification", "fit_percent", "linear_model", "pair_rows"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate(Plain):
    """One structure that was tried: how well it fits, and its criterion.

    `criterion` is the Bayesian information criterion, lower is better; for `fit_percent` see the
    function of that name.
    """

    structure: str
    intersample: Intersample
    criterion: float
    fit_percent: float
    chosen: bool = False


def fit_percent(left: Real | float, spread: Real | float) -> Real:
    """Return 100 (1 - ||y - ŷ|| / ||y - mean y||) from both sums of squares; 0 for a constant y.

    Examples
    --------
    >>> float(fit_percent(0.01, 1.0)), float(fit_percent(1.0, 0.0))
    (90.0, 0.0)
    """
    shape = np.broadcast_shapes(np.shape(left), np.shape(spread))
    share = np.divide(left, spread, out=np.ones(shape), where=np.greater(spread, 0.0))
    return np.asarray(100.0 * (1.0 - np.sqrt(share)))


class _Figure:
    """A descriptor that gives the parameter of its own name."""

    def __init__(self, doc: str) -> None:
        self.__doc__ = doc

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    @overload
    def __get__(self, pair: None, owner: type) -> "_Figure": ...
    @overload
    def __get__(self, pair: "PairIdentification", owner: type) -> Estimate | None: ...
    def __get__(
        self, pair: "PairIdentification | None", owner: type
    ) -> "_Figure | Estimate | None":
        return self if pair is None else getattr(pair.parameters, self._name)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PairIdentification(ByValue, Plain):
    """The result for one input and one output.

    `numerator` and `denominator` are the fitted dynamics without delay and with unit gain at DC:
    coefficients in powers of s (rad/s), highest first. `covariance`, shape (q, q), is that of the
    delay in s, of the numerator times the scale factor, and of the denominator before its last
    coefficient that is not 0, in the same order; None where nothing was identified. `prediction`
    and `residual` (shape (n,), the output's unit) are on the record's own uniform clock `time`;
    they follow from the record, and are part neither of the JSON nor of equality. `from_response`
    holds bandwidths read off the measured response, for comparison with the model's.
    `nonlinearity` is None where the output does not follow the input at all. `nonlinear_part` is
    what the model includes of it, and None where the model is linear. `stopping` says that
    the run ended early because the result was certain.
    """

    input: str
    output: str
    structure: str
    intersample: Intersample
    fit_percent: float
    parameters: Parameters
    paper: PaperEstimates
    frequency_response: FrequencyResponse
    numerator: tuple[float, ...]
    denominator: tuple[float, ...]
    candidates: tuple[Candidate, ...]
    warnings: tuple[Finding, ...]
    verdict: Verdict = "doubtful"
    from_response: ResponseBandwidths = field(default_factory=ResponseBandwidths)
    time: Real | None = field(default=None, compare=False)
    prediction: Real | None = field(default=None, compare=False)
    residual: Real | None = field(default=None, compare=False)
    nonlinearity: Nonlinearity | None = None
    covariance: Real | None = None
    stopping: Stopping | None = None
    nonlinear_part: NonlinearPart | None = None

    def __repr__(self) -> str:
        known = self.parameters.given
        figures = [f"{name} {known[name]}" for name in _FIRST if name in known]
        what = ", ".join([self.structure, self.verdict, *figures])
        return f"PairIdentification({shortened([self.input])} → {shortened([self.output])}: {what})"

    def _repr_html_(self) -> str:
        """Return a table of the figures, as a notebook shows it."""
        return html_table(
            f"{self.input} → {self.output}: {self.verdict}",
            ["parameter", "value", "95 %", "verdict"],
            pair_rows(self),
            notes=[finding.message for finding in self.warnings],
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the pair as plain JSON values, an entry of `Identification.to_dict`."""
        own = fields_in(self)
        dynamics = {name: own.pop(name) for name in ("numerator", "denominator", "covariance")}
        response = own.pop("from_response")
        return {**own, "bandwidths_from_response": response, "dynamics": dynamics}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "PairIdentification":
        """Read back what `to_dict` wrote."""
        response = data.get("bandwidths_from_response", {})  # older results have none
        return by_fields(cls, {**data, **data["dynamics"], "from_response": response})

    delay = _Figure("Pure delay, s.")
    delay_correlation = _Figure("The paper's delay (equation 8), s.")
    delay_low_frequency = _Figure("Slope of the phase at DC, s.")
    scale_factor = _Figure("Output per input at DC.")
    bias = _Figure("Output at an input of zero.")
    noise_std = _Figure("Standard deviation of the noise.")
    natural_frequency = _Figure("Undamped natural frequency, Hz.")
    damping_ratio = _Figure("Damping over critical damping.")
    time_constant = _Figure("Slowest time constant where the slowest pole is real, s.")
    bandwidth_phase90 = _Figure("Frequency at which the phase is -90°, delay included, Hz.")
    bandwidth_phase90_without_delay = _Figure(
        "Frequency at which the dynamics alone turn the phase by -90°, Hz."
    )
    bandwidth_3db = _Figure("Frequency at which the gain is 3 dB below that at DC, Hz.")
    peak_gain_db = _Figure("Greatest gain over that at DC, dB.")
    hold_period = _Figure("Interval at which the output is renewed, s.")
    saturation_low = _Figure("Value below which the output does not go.")
    saturation_high = _Figure("Value above which the output does not go.")
    quantization_step = _Figure("Smallest step of the output.")


def linear_model(pair: PairIdentification, *, fs: float | None = None) -> Model | None:
    """The linear part without bias, noise and effects; None without delay or scale factor."""
    delay, scale = pair.parameters.delay, pair.parameters.scale_factor
    if delay is None or scale is None:
        return None
    return Model(
        delay=delay.value,
        scale_factor=scale.value,
        numerator=pair.numerator,
        denominator=pair.denominator,
        intersample=pair.intersample,
        fs=fs,
    )


_FIRST = ("delay", "natural_frequency", "time_constant", "damping_ratio")
"""Figures that are shown on one line."""


def pair_rows(pair: PairIdentification) -> list[list[str]]:
    """Name, value with its error, interval and verdict of each known figure."""
    rows = []
    for name, estimate in pair.parameters.given.items():
        low, high = estimate.ci95 or (None, None)
        between = interval(low, high, value=estimate.value, std=estimate.std)
        rows.append([name.replace("_", " "), estimate.text, between, estimate.verdict])
    return rows
