"""The model of Fig. 1: delay, dynamics, scale factor, bias, and what lies between samples."""

from hmpim.model.dynamics import (
    STRUCTURES,
    Structure,
    StructureName,
    coefficients_of,
    denominator_of,
    second_order_coefficients,
    theta_of,
)
from hmpim.model.model import Model, frequency_response, simulate
from hmpim.model.response import (
    PeakGain,
    RationalDelay,
    bandwidth_3db,
    bandwidth_phase,
    dominant_time_constant,
    peak_gain,
    phase,
    response,
    slowest_time_constant,
)
from hmpim.model.sampled import SampledInput, delayed_response, prepare_input

__all__ = [
    "STRUCTURES",
    "Model",
    "PeakGain",
    "RationalDelay",
    "SampledInput",
    "Structure",
    "StructureName",
    "bandwidth_3db",
    "bandwidth_phase",
    "coefficients_of",
    "delayed_response",
    "denominator_of",
    "dominant_time_constant",
    "frequency_response",
    "peak_gain",
    "phase",
    "prepare_input",
    "response",
    "second_order_coefficients",
    "simulate",
    "slowest_time_constant",
    "theta_of",
]
