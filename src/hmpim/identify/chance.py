"""The two probabilities behind all decisions.

A test compares a record with the assumptions of a model, and rejects them if the observation would
occur by chance in fewer than `FALSE_ALARM` of the records that satisfy them. A record meets about
twenty tests, so one sound record in five hundred is rejected. A test of many hypotheses at once
shares the rate among them (C. E. Bonferroni, 1936).

Intervals contain the truth in `COVERAGE` of the records. Whatever such an interval does not exclude
is excluded nowhere: neither one more pole nor another assumption between the samples.
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
    "deviations",
    "searched",
]

FALSE_ALARM = 1e-4
"""Probability that a test rejects a record which satisfies its assumptions."""

COVERAGE = 0.95
"""Share of the intervals that contain the truth."""

_NORMAL = NormalDist()  # scipy.special takes 0.2 s to import


def deviations(questions: int = 1) -> float:
    """Two-sided limit of so many normal errors at once, in standard deviations.

    An error beyond it is due to chance at the rate of false alarms.

    Examples
    --------
    >>> round(deviations(), 2), round(deviations(1000), 2)
    (3.89, 5.33)
    """
    return -_NORMAL.inv_cdf(FALSE_ALARM / (2 * questions))


DEVIATIONS = deviations(1)
"""The same of a single error: 3.89."""

EXCLUDED = DEVIATIONS**2
"""Deviance at which the rate of false alarms excludes a model with one parameter less: 15.1."""


def searched(alternatives: int) -> float:
    """Log-likelihood that the best of so many alternatives gains by chance as rarely.

    Examples
    --------
    >>> round(searched(1), 1), round(searched(36), 1)
    (9.2, 12.8)
    """
    return math.log(alternatives / FALSE_ALARM)


SEARCHED = searched(10_000_000)
"""The same of a search over all delays, frequencies and dynamics: 25.3."""

HALF = _NORMAL.inv_cdf(0.5 + COVERAGE / 2)
"""Half width of such an interval of a normal error, in standard deviations: 1.96."""

ONE_SIDED = _NORMAL.inv_cdf(COVERAGE)
"""One-sided limit of a normal error at the same probability: 1.645."""

BULK = _NORMAL.inv_cdf(0.75)
"""Deviations within which half of all normal errors lie: 0.674."""

LIKELIER = -math.log(1 - COVERAGE)
"""Log-likelihood of the same odds, 20 to 1: 3.0."""

CLEARLY = 2 * LIKELIER
"""Log-likelihood of these odds squared, 400 to 1, for comparing two models: 6.0."""
