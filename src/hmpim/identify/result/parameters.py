"""All figures of one input and one output: the joint fit's, and the paper's."""

from dataclasses import dataclass

from hmpim.identify.result.estimate import Estimate, Estimates
from hmpim.identify.result.plain import Plain

__all__ = ["PaperEstimates", "Parameters"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameters(Estimates):
    """Every parameter of one input-output pair; None where the record does not determine it.

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


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperEstimates(Plain):
    """The figures of section IV of the paper, step by step as printed.

    Times in s, frequencies in Hz, bias and noise in the output's unit; None where a step gives
    nothing for this record.
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
