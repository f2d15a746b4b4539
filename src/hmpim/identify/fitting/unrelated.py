"""Whether an output follows its input at all."""

import numpy as np

from hmpim.identify.fitting.joint import JointFit
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
    y = problem.y if problem.valid is None else problem.y[problem.valid]
    spread = float(np.sum((y - y.mean()) ** 2))
    if spread <= 0 or joint.best.fit.cost <= 0:
        return spread <= 0
    gain = 0.5 * y.size * joint.effective_share * np.log(spread / joint.best.fit.cost)
    if gain >= _RELATED:
        return False
    residual = joint.best.fit.residual
    residual = residual if problem.valid is None else residual[problem.valid]
    return innovation_gain(y, residual) < _INNOVATES
