"""Identification: from a record to every parameter, each with its error bar (paper, section IV)."""

from hmpim.identify.identify import identify
from hmpim.identify.records.alike import same_at_levels
from hmpim.identify.records.levels import LevelComparison, Levels, Trend, identify_levels
from hmpim.identify.records.repeated import RepeatedPair, RepeatedParameter, Repeats
from hmpim.identify.records.repeats import identify_repeats
from hmpim.identify.result import (
    Alike,
    Candidate,
    Estimate,
    FrequencyResponse,
    HarmonicCurve,
    Identification,
    InputSet,
    Nonlinearity,
    OutputCoherence,
    PairIdentification,
    PaperEstimates,
    Parameters,
    ParameterVerdict,
    RecordSummary,
    ResponseBandwidths,
    Verdict,
)
from hmpim.identify.section_iv.paper import PaperAnalysis, paper_analysis
from hmpim.identify.section_iv.spectrum import excited_band
from hmpim.identify.statistics import LiveEstimator, Look, Statistics, compress
from hmpim.identify.uses.compare import Change, compare
from hmpim.identify.uses.gain_phase import GainPhase, gain_and_phase, measurable
from hmpim.identify.uses.nonlinear import left_out
from hmpim.identify.uses.predict import Prediction, has_model, predict, to_model
from hmpim.identify.uses.validate import Bounds, Check, OutputValidation, Validation, validate

__all__ = [
    "Alike",
    "Bounds",
    "Candidate",
    "Change",
    "Check",
    "Estimate",
    "FrequencyResponse",
    "GainPhase",
    "HarmonicCurve",
    "Identification",
    "InputSet",
    "LevelComparison",
    "Levels",
    "LiveEstimator",
    "Look",
    "Nonlinearity",
    "OutputCoherence",
    "OutputValidation",
    "PairIdentification",
    "PaperAnalysis",
    "PaperEstimates",
    "ParameterVerdict",
    "Parameters",
    "Prediction",
    "RecordSummary",
    "RepeatedPair",
    "RepeatedParameter",
    "Repeats",
    "ResponseBandwidths",
    "Statistics",
    "Trend",
    "Validation",
    "Verdict",
    "compare",
    "compress",
    "excited_band",
    "gain_and_phase",
    "has_model",
    "identify",
    "identify_levels",
    "identify_repeats",
    "left_out",
    "measurable",
    "paper_analysis",
    "predict",
    "same_at_levels",
    "to_model",
    "validate",
]
