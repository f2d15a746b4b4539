"""Checks of a result, and the verdicts from their findings; no other room sets a verdict.

evidence         the data of a check
checks           the checks in their order, and `judge`, which makes them
residual         lack of fit, colour, changing noise, halves that disagree
errors           wide error bars, a fit that did not converge
reach            outside the band, before the start of the record, after its end
structure        other numbers of poles that the record does not exclude
between_samples  other assumptions about the input between its samples
bent             figures that a nonlinearity or a changing gain has moved
feedback         an input that responds to the noise
response         bandwidths that the measured response contradicts
verdict          from findings to a verdict for each parameter and for the pair
"""

from hmpim.identify.judgement.checks import CHECKS, attempt, judge
from hmpim.identify.judgement.evidence import Evidence
from hmpim.identify.judgement.verdict import all_doubtful, judged, judged_together, unfollowed

__all__ = [
    "CHECKS",
    "Evidence",
    "all_doubtful",
    "attempt",
    "judge",
    "judged",
    "judged_together",
    "unfollowed",
]
