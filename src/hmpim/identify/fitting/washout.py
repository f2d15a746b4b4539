"""A washout in place of a drift.

A washout responds slowly to an input that keeps its level, or moved before the record. Plain
dynamics and a drift look the same, but the drift does not depend on the input.
"""

import numpy as np

from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.fit import Fit, Problem, fit_structure
from hmpim.identify.fitting.growth import one_more_pole, with_pole
from hmpim.identify.worth import TWICE
from hmpim.model.dynamics import STRUCTURES

__all__ = ["washed_out"]

_SPANS = (0.05, 0.15, 0.5)
"""Time constants of a washout in starts, over the record length."""


def washed_out(problem: Problem, fit: Fit) -> Fit | None:
    """Fit a plain fit's dynamics with a washout; None if they are not plain.

    The data are without a drift, the fit with it.
    """
    if fit.structure.name not in PLAIN:
        return None
    sections = one_more_pole(fit.structure).sections
    washouts = (known for known in STRUCTURES.values() if known.dc_zeros == known.zeros == 1)
    richer = next(washout for washout in washouts if washout.sections == sections)
    found: list[Fit] = []
    for span in _SPANS:
        slow = span * problem.y.size
        theta = with_pole(fit.structure, fit.theta, slow)
        theta[0] += slow
        hopeless = TWICE * min((fit.objective for fit in found), default=np.inf)
        found.append(fit_structure(problem, richer, theta, hopeless=hopeless))
    return min(found, key=lambda fit: fit.objective)
