"""Identification: from a record to every parameter, each with its error bar (paper, section IV)."""

from hmpim.identify.bandwidth import gain_and_phase
from hmpim.identify.identify import identify
from hmpim.identify.levels import (
    Level,
    LevelComparison,
    Levels,
    Trend,
    compare_levels,
    identify_levels,
)
from hmpim.identify.local import local_polynomial_response, local_response
from hmpim.identify.multivariable import ResponseMatrix, response_matrix
from hmpim.identify.paper import PaperAnalysis, paper_analysis
from hmpim.identify.predict import Prediction, predict, to_model
from hmpim.identify.repeats import Repeats, identify_repeats
from hmpim.identify.result import (
    Candidate,
    Estimate,
    FrequencyResponse,
    HarmonicCurve,
    Identification,
    Nonlinearity,
    PairIdentification,
    PaperEstimates,
    Parameters,
    RecordSummary,
    ResponseBandwidths,
    Verdict,
)
from hmpim.identify.spectrum import excited_band

__all__ = [
    "Candidate",
    "Estimate",
    "FrequencyResponse",
    "HarmonicCurve",
    "Identification",
    "Level",
    "LevelComparison",
    "Levels",
    "Nonlinearity",
    "PairIdentification",
    "PaperAnalysis",
    "PaperEstimates",
    "Parameters",
    "Prediction",
    "RecordSummary",
    "Repeats",
    "ResponseBandwidths",
    "ResponseMatrix",
    "Trend",
    "Verdict",
    "compare_levels",
    "excited_band",
    "gain_and_phase",
    "identify",
    "identify_levels",
    "identify_repeats",
    "local_polynomial_response",
    "local_response",
    "paper_analysis",
    "predict",
    "response_matrix",
    "to_model",
]
