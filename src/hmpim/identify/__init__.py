"""Identification: from a record to every parameter, each with its error bar (paper, section IV)."""

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

__all__ = [
    "Candidate",
    "Estimate",
    "FrequencyResponse",
    "Identification",
    "PairIdentification",
    "PaperEstimates",
    "Parameters",
    "RecordSummary",
    "Verdict",
]
