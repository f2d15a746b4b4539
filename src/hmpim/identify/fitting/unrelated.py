"""Whether an output follows its input at all."""

import numpy as np
from numpy.typing import NDArray

from hmpim.identify.fitting.fit import solved
from hmpim.identify.fitting.joint import JointFit
from hmpim.identify.fitting.rows import Part
from hmpim.identify.whiteness import innovation_gain

__all__ = ["is_unrelated"]

_RELATED = 40.0
"""Log-likelihood by which a model must beat "the output is constant": looking at thousands
of delays and dynamics, pure noise reaches about 15."""

_INNOVATES = 60.0
"""And by which it must beat "the output is noise of some colour", where the residual is so
coloured that few of its samples are independent; another sweep reaches about 40."""


def is_unrelated(joint: JointFit) -> bool:
    """Whether a constant explains the output as well as the input does."""
    problem = joint.problem
    y = _without_input(joint)
    y = y if problem.valid is None else y[problem.valid]
    spread = float(np.sum((y - y.mean()) ** 2))
    if spread <= 0 or joint.best.fit.cost <= 0:
        return spread <= 0
    gain = 0.5 * y.size * joint.effective_share * np.log(spread / joint.best.fit.cost)
    if gain >= _RELATED and problem.begins is None:
        return False
    residual = joint.best.fit.residual
    residual = residual if problem.valid is None else residual[problem.valid]
    # A free response may be any sine or exponential: the input must tell what they cannot.
    return innovation_gain(y, residual) < _INNOVATES


def _without_input(joint: JointFit) -> NDArray[np.float64]:
    """The output less what free response alone makes of it: that needs no input."""
    problem, fit = joint.problem, joint.best.fit
    if problem.begins is None:
        return problem.y
    free = Part(problem, fit.structure, fit.theta).free
    rows = np.vstack([free, np.ones(problem.y.size)])
    counted = problem.masked(rows)
    weights = solved(counted @ counted.T, counted @ problem.masked(problem.y))
    return np.asarray(problem.y - weights[:-1] @ free)
