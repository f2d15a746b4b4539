"""The model of Fig. 1: delay, dynamics, scale factor, bias, and what lies between samples."""

from hmpim.model.chain import Chain, Readout, chain_of, run_chain
from hmpim.model.discrete import Discrete, RowPiece, discretise
from hmpim.model.draws import coefficient_vector, draw_models, response_error
from hmpim.model.dynamics import (
    STRUCTURES,
    Structure,
    StructureName,
    coefficients_of,
    denominator_of,
    second_order_coefficients,
    theta_of,
)
from hmpim.model.margin import AddedPhase, Margin, add_to_loop
from hmpim.model.mode import Mode
from hmpim.model.model import Model, frequency_response, simulate
from hmpim.model.nonlinear import NonlinearPart
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
from hmpim.model.spread import Spread

__all__ = [
    "STRUCTURES",
    "AddedPhase",
    "Chain",
    "Discrete",
    "Margin",
    "Mode",
    "Model",
    "NonlinearPart",
    "PeakGain",
    "RationalDelay",
    "Readout",
    "RowPiece",
    "SampledInput",
    "Spread",
    "Structure",
    "StructureName",
    "add_to_loop",
    "bandwidth_3db",
    "bandwidth_phase",
    "chain_of",
    "coefficient_vector",
    "coefficients_of",
    "delayed_response",
    "denominator_of",
    "discretise",
    "dominant_time_constant",
    "draw_models",
    "frequency_response",
    "peak_gain",
    "phase",
    "prepare_input",
    "response",
    "response_error",
    "run_chain",
    "second_order_coefficients",
    "simulate",
    "slowest_time_constant",
    "theta_of",
]
