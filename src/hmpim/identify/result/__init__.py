"""What an identification says. The ground floor: nothing here imports what makes it.

digits          numbers for people: the error to its digits, the value to match
estimate        one figure, its error, its interval, its verdict
plain           results as plain JSON values
parameters      all figures of one pair; the paper's
measured        frequency response, bandwidths read off it, what is nonlinear
inputs          several inputs at once, and how well they are told apart
pair            all that is known of one input and one output
lookup          pairs by their names, output first
powers          coefficients and their covariance, highest power first
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
from hmpim.identify.result.pair import Candidate, PairIdentification
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
]
