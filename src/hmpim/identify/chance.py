"""The two chances that decisions rest on.

A test holds a record against what a model supposes, and accuses it where what is seen would come
by chance in fewer than `FALSE_ALARM` of the records that are as supposed. A record meets about
twenty tests: of five hundred sound ones, one is accused. Where a test asks many questions at once
the rate is shared among them (C. E. Bonferroni, 1936).

Intervals hold the truth in `COVERAGE` of the records. What such an interval does not exclude is
excluded nowhere: neither one more pole, nor another assumption between the samples.
"""

import math
from statistics import NormalDist

__all__ = [
    "BULK",
    "CLEARLY",
    "COVERAGE",
    "DEVIATIONS",
    "EXCLUDED",
    "FALSE_ALARM",
    "HALF",
    "LIKELIER",
    "ONE_SIDED",
    "SEARCHED",
    "SEEN",
    "deviations",
    "searched",
]

FALSE_ALARM = 1e-4
"""Chance that a test accuses a record which is as the test supposes."""

COVERAGE = 0.95
"""Share of the intervals that hold the truth."""

_NORMAL = NormalDist()  # scipy.special would be a third of the time of `import hmpim`


def deviations(questions: int = 1) -> float:
    """Deviations of a normal error that the rate of false alarms allows, on either side.

    Parameters
    ----------
    questions : int
        How many are asked at once.

    Returns
    -------
    float
        Above it one of them is no chance any more.

    Examples
    --------
    >>> round(deviations(), 2), round(deviations(1000), 2)
    (3.89, 5.33)
    """
    return -_NORMAL.inv_cdf(FALSE_ALARM / (2 * questions))


DEVIATIONS = deviations(1)
"""The same of a single question: 3.89."""

EXCLUDED = DEVIATIONS**2
"""Deviance at which the rate of false alarms excludes one parameter less: 15.1."""


def searched(alternatives: int) -> float:
    """Log-likelihood that the likeliest of many alternatives gains as seldom by chance.

    Parameters
    ----------
    alternatives : int
        How many are looked at.

    Examples
    --------
    >>> round(searched(1), 1), round(searched(36), 1)
    (9.2, 12.8)
    """
    return math.log(alternatives / FALSE_ALARM)


SEARCHED = searched(10_000_000)
"""The same of a search over all delays, frequencies and dynamics: 25.3."""

HALF = _NORMAL.inv_cdf(0.5 + COVERAGE / 2)
"""Deviations of a normal error on either side that such an interval spans: 1.96."""

ONE_SIDED = _NORMAL.inv_cdf(COVERAGE)
"""Deviations that a normal error stays below as often: 1.645."""

SEEN = HALF**2
"""Twice the log-likelihood that one parameter more gains as seldom by chance: 3.84."""

BULK = _NORMAL.inv_cdf(0.75)
"""Deviations within which half of all normal errors lie: 0.674."""

LIKELIER = -math.log(1 - COVERAGE)
"""Log-likelihood of the same odds, 20 to 1: 3.0."""

CLEARLY = 2 * LIKELIER
"""Log-likelihood of those odds twice over, 400 to 1, where two models are weighed: 6.0."""
