"""What an identification says: estimates with error bars, side by side with the paper's."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from hmpim.equality import ByValue
from hmpim.errors import FormatError, RecordError
from hmpim.identify.coupling.inputs import InputSet
from hmpim.record import Finding, Intersample, Record

__all__ = [
    "SCHEMA",
    "Candidate",
    "Estimate",
    "FrequencyResponse",
    "HarmonicCurve",
    "Identification",
    "Nonlinearity",
    "PairIdentification",
    "PaperEstimates",
    "ParameterVerdict",
    "Parameters",
    "RecordSummary",
    "ResponseBandwidths",
    "Verdict",
]

SCHEMA = "hmpim/identification/2"
_FIRST = "hmpim/identification/1"
ParameterVerdict = Literal["ok", "doubtful"]
Verdict = Literal["ok", "doubtful", "not_identifiable"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A value, its standard deviation, and its 95 % interval, all in `unit`."""

    value: float
    std: float
    ci95: tuple[float, float]
    unit: str = ""
    verdict: ParameterVerdict = "ok"

    def to_dict(self) -> dict[str, Any]:
        """Return the estimate as plain JSON values."""
        return {
            "value": self.value,
            "std": self.std,
            "ci95": [self.ci95[0], self.ci95[1]],
            "unit": self.unit,
            "verdict": self.verdict,
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Estimate":
        """Read back what `to_dict` wrote."""
        low, high = data["ci95"]
        return cls(
            value=data["value"],
            std=data["std"],
            ci95=(low, high),
            unit=data["unit"],
            verdict=data["verdict"],
        )


def _estimates_to_dict(holder: "Parameters | ResponseBandwidths") -> dict[str, Any]:
    named = {field.name: getattr(holder, field.name) for field in fields(holder)}
    return {name: None if e is None else e.to_dict() for name, e in named.items()}


def _estimates_from_dict(data: Mapping[str, Any]) -> dict[str, Estimate | None]:
    return {name: None if d is None else Estimate.from_dict(d) for name, d in data.items()}


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameters:
    """Every parameter of one input-output pair; None where the record cannot tell.

    Frequencies in Hz, times in s, the rest in the channels' own units (`scale_factor`
    in output unit per input unit; `damping_ratio` without unit; `peak_gain_db` in dB).
    """

    delay: Estimate | None = None
    delay_correlation: Estimate | None = None
    delay_low_frequency: Estimate | None = None
    scale_factor: Estimate | None = None
    bias: Estimate | None = None
    noise_std: Estimate | None = None
    natural_frequency: Estimate | None = None
    damping_ratio: Estimate | None = None
    time_constant: Estimate | None = None
    bandwidth_phase90: Estimate | None = None
    bandwidth_phase90_without_delay: Estimate | None = None
    bandwidth_3db: Estimate | None = None
    peak_gain_db: Estimate | None = None
    hold_period: Estimate | None = None
    saturation_low: Estimate | None = None
    saturation_high: Estimate | None = None
    quantization_step: Estimate | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return name to estimate, null where there is none."""
        return _estimates_to_dict(self)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Parameters":
        """Read back what `to_dict` wrote."""
        return cls(**_estimates_from_dict(data))


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperEstimates:
    """The figures that section IV of the paper gives when done step by step, as printed.

    Times in s, frequencies in Hz, bias and noise in the output's unit; None where the
    step has no answer on this record.
    """

    delay: float | None = None
    bias: float | None = None
    scale_factor: float | None = None
    noise_std: float | None = None
    natural_frequency: float | None = None
    damping_ratio: float | None = None
    bandwidth_phase90: float | None = None
    bandwidth_3db: float | None = None
    peak_gain_db: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrequencyResponse(ByValue):
    """Measured frequency response, output over input, with its error at each frequency.

    Parameters
    ----------
    frequency : ndarray, shape (m,)
        Hz, increasing.
    response : complex ndarray, shape (m,)
        Output unit per input unit, e^(+jωt) convention; delay included.
    std : ndarray, shape (m,)
        Standard deviation of |error|: sqrt(E|Ĝ-G|²), same unit as the response.
    coherence : ndarray, shape (m,), or None
        None where it means nothing, as with a single segment.
    """

    frequency: NDArray[np.float64]
    response: NDArray[np.complex128]
    std: NDArray[np.float64]
    coherence: NDArray[np.float64] | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return the response as plain JSON values."""
        return {
            "frequency": self.frequency.tolist(),
            "real": self.response.real.tolist(),
            "imag": self.response.imag.tolist(),
            "std": self.std.tolist(),
            "coherence": None if self.coherence is None else self.coherence.tolist(),
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "FrequencyResponse":
        """Read back what `to_dict` wrote."""
        coherence = data["coherence"]
        return cls(
            frequency=np.asarray(data["frequency"], dtype=float),
            response=np.asarray(data["real"], dtype=float) + 1j * np.asarray(data["imag"]),
            std=np.asarray(data["std"], dtype=float),
            coherence=None if coherence is None else np.asarray(coherence, dtype=float),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ResponseBandwidths:
    """Bandwidths read off the measured response, in Hz; None where it does not reach them."""

    bandwidth_phase90: Estimate | None = None
    bandwidth_phase90_without_delay: Estimate | None = None
    bandwidth_3db: Estimate | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return name to estimate, null where there is none."""
        return _estimates_to_dict(self)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "ResponseBandwidths":
        """Read back what `to_dict` wrote."""
        return cls(**_estimates_from_dict(data))


@dataclass(frozen=True, slots=True, kw_only=True)
class HarmonicCurve:
    """One harmonic along a sweep.

    Parameters
    ----------
    order : int
        Multiple of the sweep's frequency.
    frequency : tuple of float
        Frequency of the sweep itself, Hz.
    amplitude, std : tuple of float
        Amplitude of the harmonic while the sweep is there, and its standard deviation, in the
        output's unit.
    """

    order: int
    frequency: tuple[float, ...]
    amplitude: tuple[float, ...]
    std: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Nonlinearity:
    """What no linear system makes of the input, and what it looks like.

    Parameters
    ----------
    share : float
        R.m.s. of the nonlinear part over that of the output about its mean; 0 if none is seen.
    even, odd : float
        The same for the part that is asymmetric and the part that is alike either way, noise
        taken off.
    noise, linear, nonlinear : float
        What the power of the residual is made of; they add to 1. `linear` still follows the
        input: dynamics left out, and what of a nonlinearity looks linear.
    kinds : tuple of str
        What the record leaves in question: one if it tells ('hardening', 'softening',
        'friction', 'backlash', 'rate_limit', 'saturation', 'asymmetry', 'curvature'), several
        if not, none if it is like none of them or too small to ask.
    size : Estimate or None
        Of the kind, if there is one: half width of the band of friction or backlash, speed,
        level, or share by which the largest deflection departs from proportion.
    harmonics : tuple of HarmonicCurve
        Of a sweep in which there is something to see; order 1 is the output itself.
    """

    share: float
    even: float
    odd: float
    noise: float
    linear: float
    nonlinear: float
    kinds: tuple[str, ...] = ()
    size: Estimate | None = None
    harmonics: tuple[HarmonicCurve, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return the value as plain JSON values."""
        plain = {f.name: getattr(self, f.name) for f in fields(self)}
        return {
            **plain,
            "kinds": list(self.kinds),
            "size": None if self.size is None else self.size.to_dict(),
            "harmonics": [
                {
                    "order": h.order,
                    "frequency": list(h.frequency),
                    "amplitude": list(h.amplitude),
                    "std": list(h.std),
                }
                for h in self.harmonics
            ],
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Nonlinearity":
        """Read back what `to_dict` wrote."""
        return cls(
            **{name: data[name] for name in ("share", "even", "odd")},
            **{name: data[name] for name in ("noise", "linear", "nonlinear")},
            kinds=tuple(data["kinds"]),
            size=None if data["size"] is None else Estimate.from_dict(data["size"]),
            harmonics=tuple(
                HarmonicCurve(
                    order=h["order"],
                    frequency=tuple(h["frequency"]),
                    amplitude=tuple(h["amplitude"]),
                    std=tuple(h["std"]),
                )
                for h in data["harmonics"]
            ),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """One structure that was tried: how well it fits and what its fit costs.

    `criterion` is the Bayesian information criterion, lower is better; `fit_percent` is
    100 (1 - ||y - ŷ|| / ||y - mean y||).
    """

    structure: str
    intersample: Intersample
    criterion: float
    fit_percent: float
    chosen: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PairIdentification(ByValue):
    """Everything found between one input and one output.

    `dynamics` holds the rational dynamics that were fitted, without delay and with unit
    gain at DC: numerator and denominator coefficients in powers of s (rad/s), highest
    first. `covariance`, shape (q, q), is that of the delay in s, of the numerator times the scale
    factor, and of the denominator without its constant 1, each by rising powers of s; None
    where nothing was identified. `prediction` and `residual` (shape (n,), the output's unit)
    are on the record's own uniform clock `time`; they follow from the record, and are part neither
    of the JSON nor of equality. `from_response` holds bandwidths read off the measured response, to
    be held against the model's. `nonlinearity` is None where the output does not follow the input
    at all.
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
    from_response: ResponseBandwidths = ResponseBandwidths()
    time: NDArray[np.float64] | None = field(default=None, compare=False)
    prediction: NDArray[np.float64] | None = field(default=None, compare=False)
    residual: NDArray[np.float64] | None = field(default=None, compare=False)
    nonlinearity: Nonlinearity | None = None
    covariance: NDArray[np.float64] | None = None

    def __getattr__(self, name: str) -> Estimate | None:
        """Return a parameter by its name: ``pair.delay`` is ``pair.parameters.delay``."""
        if name in Parameters.__dataclass_fields__:
            value: Estimate | None = getattr(self.parameters, name)
            return value
        raise AttributeError(f"{type(self).__name__!r} has no attribute {name!r}")

    def to_dict(self) -> dict[str, Any]:
        """Return the pair as plain JSON values (DESIGN.md, Result JSON)."""
        return {
            "input": self.input,
            "output": self.output,
            "structure": self.structure,
            "intersample": self.intersample,
            "fit_percent": self.fit_percent,
            "parameters": self.parameters.to_dict(),
            "paper": {f.name: getattr(self.paper, f.name) for f in fields(self.paper)},
            "frequency_response": self.frequency_response.to_dict(),
            "bandwidths_from_response": self.from_response.to_dict(),
            "dynamics": {
                "numerator": list(self.numerator),
                "denominator": list(self.denominator),
                "covariance": None if self.covariance is None else self.covariance.tolist(),
            },
            "candidates": [
                {f.name: getattr(c, f.name) for f in fields(c)} for c in self.candidates
            ],
            "nonlinearity": None if self.nonlinearity is None else self.nonlinearity.to_dict(),
            "verdict": self.verdict,
            "warnings": [warning.to_dict() for warning in self.warnings],
            "stopping": None,
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "PairIdentification":
        """Read back what `to_dict` wrote."""
        nonlinearity = data.get("nonlinearity")  # results written before it have none
        covariance = data["dynamics"].get("covariance")
        return cls(
            input=data["input"],
            output=data["output"],
            structure=data["structure"],
            intersample=data["intersample"],
            fit_percent=data["fit_percent"],
            parameters=Parameters.from_dict(data["parameters"]),
            paper=PaperEstimates(**data["paper"]),
            frequency_response=FrequencyResponse.from_dict(data["frequency_response"]),
            from_response=ResponseBandwidths.from_dict(data.get("bandwidths_from_response", {})),
            numerator=tuple(data["dynamics"]["numerator"]),
            denominator=tuple(data["dynamics"]["denominator"]),
            candidates=tuple(Candidate(**c) for c in data["candidates"]),
            verdict=data["verdict"],
            warnings=tuple(Finding.from_dict(w) for w in data["warnings"]),
            nonlinearity=None if nonlinearity is None else Nonlinearity.from_dict(nonlinearity),
            covariance=None if covariance is None else np.array(covariance, dtype=np.float64),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordSummary:
    """Which record was identified."""

    fs: float
    samples: int
    sha256: str
    source: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Identification(ByValue):
    """The result of `hmpim.identify`: one `PairIdentification` for each input and output.

    Index it output first, as in a transfer matrix: ``result["y", "u"].delay``.
    `inputs` says how well several inputs are told apart, and how much of each output they
    explain; None where there is one. `data` is the record itself, kept for pictures; its digest
    in `record` stands for it in the JSON and where results are compared.
    """

    record: RecordSummary
    pairs: tuple[PairIdentification, ...]
    inputs: InputSet | None = None
    data: Record | None = field(default=None, compare=False)

    def __getitem__(self, key: tuple[str, str]) -> PairIdentification:
        output, input_ = key
        for pair in self.pairs:
            if (pair.output, pair.input) == (output, input_):
                return pair
        known = ", ".join(f"({p.output!r}, {p.input!r})" for p in self.pairs)
        raise RecordError(f"there is no pair ({output!r}, {input_!r}); the result has {known}")

    @property
    def verdict(self) -> Verdict:
        """The worst verdict of all pairs that count."""
        order: tuple[Verdict, ...] = ("ok", "doubtful", "not_identifiable")
        return max((pair.verdict for pair in self.counted), key=order.index)

    @property
    def counted(self) -> tuple[PairIdentification, ...]:
        """Pairs but those of an output with an input that it is not coupled to.

        That an axis does not follow another one's command is a finding, no failure, as long as
        it follows some input.
        """
        if self.inputs is None:
            return self.pairs
        follows = {pair.output for pair in self.pairs if pair.verdict != "not_identifiable"}
        return tuple(
            pair
            for pair in self.pairs
            if pair.output not in follows
            or pair.parameters.scale_factor is not None
            or all(finding.code != "unrelated" for finding in pair.warnings)
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the result as plain JSON values, `schema` first."""
        return {
            "schema": SCHEMA,
            "record": {f.name: getattr(self.record, f.name) for f in fields(self.record)},
            "pairs": [pair.to_dict() for pair in self.pairs],
            "inputs": None if self.inputs is None else self.inputs.to_dict(),
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Identification":
        """Read back what `to_dict` wrote.

        Raises
        ------
        FormatError
            If `data` is of no schema that is known.
        """
        schema = data.get("schema")
        if schema not in (SCHEMA, _FIRST):
            raise FormatError(f"schema is {schema!r}; {SCHEMA!r} or {_FIRST!r} is needed")
        pairs = data["pairs"] if schema == SCHEMA else [_from_first(p) for p in data["pairs"]]
        return cls(
            record=RecordSummary(**data["record"]),
            pairs=tuple(PairIdentification.from_dict(pair) for pair in pairs),
            inputs=None if data.get("inputs") is None else InputSet.from_dict(data["inputs"]),
        )


def _from_first(pair: Mapping[str, Any]) -> dict[str, Any]:
    """Return a pair of schema 1 as one of schema 2.

    Schema 1 has one verdict for the pair. Where that is not ok, nothing says which of its
    warnings casts the doubt, nor on what: all of them do, on everything.
    """
    trusted = pair["verdict"] == "ok"

    def judged(estimates: Mapping[str, Any]) -> dict[str, Any]:
        verdict = "ok" if trusted else "doubtful"
        return {n: None if e is None else {**e, "verdict": verdict} for n, e in estimates.items()}

    parameters = judged(pair["parameters"])
    nonlinearity = pair.get("nonlinearity")
    size = None if nonlinearity is None else nonlinearity["size"]
    return {
        **pair,
        "parameters": parameters,
        "bandwidths_from_response": judged(pair.get("bandwidths_from_response", {})),
        "nonlinearity": None
        if nonlinearity is None
        else {**nonlinearity, "size": judged({"size": size})["size"]},
        "warnings": [
            {
                "code": warning["code"],
                "message": warning["message"],
                "severity": "info" if trusted else "doubt",
                "parameters": [] if trusted else list(parameters),
            }
            for warning in pair["warnings"]
        ],
    }
