"""What the findings weigh: the only room in which a verdict is made.

evidence         what a check looks at
checks           the checks in their order, and `judge`, which makes them
residual         what the model leaves over: lack of fit, colour, halves that disagree
errors           error bars that are too wide, a fit that did not end
reach            what lies outside the band, before the record's start or beyond its end
structure        other numbers of poles that the record does not exclude
between_samples  other assumptions on what the input does between its samples
bent             figures that a nonlinearity has moved
response         bandwidths that the measured response contradicts
failed           a check that raises costs itself, and nothing else
verdict          from findings to a verdict for each parameter and for the pair
"""

from hmpim.identify.judgement.checks import CHECKS, Check, judge
from hmpim.identify.judgement.evidence import Evidence
from hmpim.identify.judgement.failed import attempt
from hmpim.identify.judgement.verdict import all_doubted, judged, judged_together, unfollowed

__all__ = [
    "CHECKS",
    "Check",
    "Evidence",
    "all_doubted",
    "attempt",
    "judge",
    "judged",
    "judged_together",
    "unfollowed",
]
