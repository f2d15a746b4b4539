"""The linear part of a fit, at the samples and on the finer clock of `hmpim.model.fine`.

`others`, (n,), is what other inputs move the output by.
"""

import numpy as np
import scipy

from hmpim.identify.arrays import Real
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.fitting.sampled_rows import part_of
from hmpim.model.fine import FINE, joined

__all__ = ["linear_part", "linear_part_finely"]


def linear_part(problem: Problem, fit: Fit, others: Real | None = None) -> Real:
    """Effect of the input and of the initial state on the output, (n,)."""
    x = fit.prediction - fit.linear[-1]
    if others is not None:
        x = x + others
    if problem.nuisance is not None:
        x = x - fit.nuisance @ problem.nuisance
    return np.asarray(x)


def linear_part_finely(problem: Problem, fit: Fit, others: Real | None = None) -> Real:
    """The same on the finer clock."""
    steps = np.arange(FINE)[:, None] * np.eye(1, fit.theta.size) / FINE
    parts = [part_of(problem, fit.structure, fit.theta - step) for step in steps]
    driven = np.stack([part.driven(fit.linear[:-1]) for part in parts], axis=1)
    rest = np.zeros(driven.shape[0]) if others is None else others
    if fit.initial.size:
        rest = linear_part(problem, fit, others) - driven[:, 0]
    if rest.any():
        at = np.arange(rest.size)
        driven += scipy.interpolate.CubicSpline(at, rest)(at[:, None] + np.arange(FINE) / FINE)
    return joined(driven)
