"""A washout in place of a drift.

Where the input keeps its level, or moved before the record, a washout leaves a slow response
behind. Plain dynamics and a drift look like it, but the drift knows nothing of the input.
"""

import numpy as np

from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.fit import Fit, Problem, fit_structure
from hmpim.identify.fitting.growth import one_more_pole, with_pole
from hmpim.identify.worth import TWICE
from hmpim.model.dynamics import STRUCTURES

__all__ = ["washed_out"]

_SPANS = (0.05, 0.15, 0.5)
"""Time constants of a washout to begin with, over the record."""


def washed_out(problem: Problem, fit: Fit) -> Fit | None:
    """Return a plain fit's dynamics with a washout; None if they are not plain.

    Parameters
    ----------
    problem : Problem
        The data, without a drift.
    fit : Fit
        As it ended beside the drift.
    """
    if fit.structure.name not in PLAIN:
        return None
    sections = one_more_pole(fit.structure).sections
    richer = next(
        known
        for known in STRUCTURES.values()
        if known.sections == sections and known.dc_zeros == known.zeros == 1
    )
    best: Fit | None = None
    for span in _SPANS:
        slow = span * problem.y.size
        theta = with_pole(fit.structure, fit.theta, slow)
        theta[0] += slow
        hopeless = np.inf if best is None else TWICE * best.objective
        found = fit_structure(problem, richer, theta, hopeless=hopeless)
        if best is None or found.objective < best.objective:
            best = found
    return best
