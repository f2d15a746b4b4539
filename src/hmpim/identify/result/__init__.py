"""The result of an identification. Nothing here imports the code that produces it.

digits          numbers for people: the error to its digits, the value to match
estimate        one figure, its error, its interval, its verdict
error_bars      estimates from a variance
plain           results as plain JSON values
parameters      all figures of one pair; the paper's
groups          groups of parameters that findings name
measured        frequency response, bandwidths read off it, nonlinearity
inputs          several inputs at once, and how well they are distinguished
pair            the result for one input and one output
lookup          pairs by their names, output first
sizes           the size of a nonlinearity in words
first_schema    results written by the first version
identification  the whole result, and its JSON
"""

from hmpim.identify.result.estimate import Estimate, ParameterVerdict, Verdict
from hmpim.identify.result.identification import SCHEMA, Identification, RecordSummary
from hmpim.identify.result.inputs import Alike, InputSet, OutputCoherence
from hmpim.identify.result.measured import (
    FrequencyResponse,
    HarmonicCurve,
    Nonlinearity,
    ResponseBandwidths,
)
from hmpim.identify.result.pair import Candidate, PairIdentification, fit_percent
from hmpim.identify.result.parameters import PaperEstimates, Parameters

__all__ = [
    "SCHEMA",
    "Alike",
    "Candidate",
    "Estimate",
    "FrequencyResponse",
    "HarmonicCurve",
    "Identification",
    "InputSet",
    "Nonlinearity",
    "OutputCoherence",
    "PairIdentification",
    "PaperEstimates",
    "ParameterVerdict",
    "Parameters",
    "RecordSummary",
    "ResponseBandwidths",
    "Verdict",
    "fit_percent",
]
