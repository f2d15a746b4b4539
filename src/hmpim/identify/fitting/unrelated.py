"""Whether an output follows its input at all."""

import numpy as np
import scipy

from hmpim.identify.arrays import Real
from hmpim.identify.chance import FALSE_ALARM, SEARCHED
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.fitting.least_squares import solved
from hmpim.identify.fitting.sampled_rows import part_of
from hmpim.identify.noise.autoregression import autoregression, innovation_gain
from hmpim.identify.noise.misfit import misfit
from hmpim.identify.noise.whiteness import effective_share
from hmpim.identify.section_iv.correlation import likeness
from hmpim.identify.worth import TWICE

__all__ = ["LEAST_ANSWER", "is_unexplainable"]

LEAST_ANSWER = TWICE * SEARCHED
"""Log-likelihood that an answer must promise, or that a model must gain in innovations.

Twice that of a search by chance: in a coloured residual few samples are independent."""


def is_unexplainable(
    u: Real, problem: Problem, fit: Fit, band: tuple[float, float], *, least: float = SEARCHED
) -> bool:
    """Whether no model can be expected to explain an output that this fit does not.

    A test without a model: input `u`, (n,), and output pass the filter that whitens the output,
    so that neither wander nor lines hide an answer. Their coherence over groups of neighbouring
    bins in the `band`, in cycles per sample, is compared with chance, and with the `least`
    log-likelihood that an answer must promise. They are aligned by the delay of the best fit so
    far, or by the lag of their greatest correlation.
    """
    if np.ptp(problem.counting(problem.y)) == 0.0:
        return True  # it stands still wherever it counts
    if not _is_unrelated(problem, fit):
        return False
    y = problem.y - problem.masked(problem.y).sum() / problem.counted
    noise = autoregression(problem.masked(y), problem.valid)
    white_u, white_y = (scipy.signal.lfilter(noise, np.ones(1), x - x.mean()) for x in (u, y))
    if problem.valid is not None:
        white_y = white_y * problem.coloured(noise).past_known
    white_y[: noise.size] = 0.0
    lags = (fit.delay, float(likeness(white_u, white_y, y.size // 2).lag))
    answers = [misfit(white_u, white_y, delay=lag, band=band) for lag in lags]
    answer = min(answers, key=lambda answer: answer.probability)
    reachable = -0.5 * problem.counted * float(np.log1p(-min(answer.within, 0.999)))
    return answer.probability > FALSE_ALARM or reachable < least


def _is_unrelated(problem: Problem, fit: Fit) -> bool:
    """Whether a constant explains the output as well as the best fit does."""
    every = slice(None) if problem.valid is None else problem.valid
    y = _without_free_response(problem, fit)[every]
    spread = float(np.sum((y - y.mean()) ** 2))
    if spread <= 0 or fit.cost <= 0:
        return spread <= 0
    gain = 0.5 * y.size * effective_share(fit.residual) * np.log(spread / fit.cost)
    if gain >= SEARCHED and problem.begins is None:
        return False
    # A free response may be any sine or exponential: the input must explain more than these.
    return innovation_gain(y, fit.residual[every]) < LEAST_ANSWER


def _without_free_response(problem: Problem, fit: Fit) -> Real:
    """The output less its regression on the free responses, which need no input."""
    if problem.begins is None:
        return problem.y
    free = part_of(problem, fit.structure, fit.theta).free
    rows = np.vstack([free, np.ones(problem.y.size)])
    counted = problem.masked(rows)
    weights = solved(counted @ counted.T, counted @ problem.masked(problem.y))
    return np.asarray(problem.y - weights[:-1] @ free)
