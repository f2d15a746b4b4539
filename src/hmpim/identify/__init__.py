"""Identification: from a record to every parameter, each with its error bar (paper, section IV)."""

from hmpim.identify.identify import identify
from hmpim.identify.local import local_polynomial_response
from hmpim.identify.paper import PaperAnalysis, paper_analysis
from hmpim.identify.predict import Prediction, predict, to_model
from hmpim.identify.result import (
    Candidate,
    Estimate,
    FrequencyResponse,
    Identification,
    PairIdentification,
    PaperEstimates,
    Parameters,
    RecordSummary,
    Verdict,
)
from hmpim.identify.spectrum import excited_band

__all__ = [
    "Candidate",
    "Estimate",
    "FrequencyResponse",
    "Identification",
    "PairIdentification",
    "PaperAnalysis",
    "PaperEstimates",
    "Parameters",
    "Prediction",
    "RecordSummary",
    "Verdict",
    "excited_band",
    "identify",
    "local_polynomial_response",
    "paper_analysis",
    "predict",
    "to_model",
]
