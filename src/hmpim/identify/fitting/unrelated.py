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

__all__ = ["UNDENIED", "is_unrelated", "says_nothing"]

UNDENIED = TWICE * SEARCHED
"""Log-likelihood that an answer must promise, or a model gain where it is told by innovations.

Twice as much as a search finds: of a coloured residual few samples are independent."""


def says_nothing(
    u: Real, problem: Problem, fit: Fit, band: tuple[float, float], *, least: float = SEARCHED
) -> bool:
    """Whether no model can be expected to explain an output that this fit does not.

    A test without a model: input and output pass the filter that leaves white noise of the
    output, so that neither wander nor lines hide an answer, and their coherence over groups of
    neighbouring bins is held against chance, and against the likelihood that a model must gain.

    Parameters
    ----------
    u : ndarray, shape (n,)
        Input.
    problem : Problem
        The output, and the samples that count.
    fit : Fit
        The best so far. Its delay aligns input and output, or else the lag at which what is left
        of the two by that filter is most alike.
    band : tuple of float
        Excited band, in cycles per sample.
    least : float
        Log-likelihood that an answer without a model must promise.
    """
    if not is_unrelated(problem, fit, effective_share(fit.residual)):
        return False
    y = problem.y - problem.masked(problem.y).sum() / problem.counted
    noise = autoregression(problem.masked(y), problem.valid)
    heard, seen = (scipy.signal.lfilter(noise, np.ones(1), x - x.mean()) for x in (u, y))
    if problem.valid is not None:
        seen = seen * problem.coloured(noise).told
    seen[: noise.size] = 0.0
    lags = (fit.delay, float(likeness(heard, seen, y.size // 2).lag))
    answers = [misfit(heard, seen, delay=lag, band=band) for lag in lags]
    answer = min(answers, key=lambda one: one.probability)
    reachable = -0.5 * problem.counted * float(np.log1p(-min(answer.share, 0.999)))
    return answer.probability > FALSE_ALARM or reachable < least


def is_unrelated(problem: Problem, fit: Fit, share: float) -> bool:
    """Whether a constant explains the output as well as the input does.

    Parameters
    ----------
    problem : Problem
        The data.
    fit : Fit
        The best model of them.
    share : float
        Independent samples per sample of what it leaves over.
    """
    y = _without_input(problem, fit)
    y = y if problem.valid is None else y[problem.valid]
    spread = float(np.sum((y - y.mean()) ** 2))
    if spread <= 0 or fit.cost <= 0:
        return spread <= 0
    gain = 0.5 * y.size * share * np.log(spread / fit.cost)
    if gain >= SEARCHED and problem.begins is None:
        return False
    residual = fit.residual if problem.valid is None else fit.residual[problem.valid]
    # A free response may be any sine or exponential: the input must tell what they cannot.
    return innovation_gain(y, residual) < UNDENIED


def _without_input(problem: Problem, fit: Fit) -> Real:
    """The output less what free response alone makes of it: that needs no input."""
    if problem.begins is None:
        return problem.y
    free = part_of(problem, fit.structure, fit.theta).free
    rows = np.vstack([free, np.ones(problem.y.size)])
    counted = problem.masked(rows)
    weights = solved(counted @ counted.T, counted @ problem.masked(problem.y))
    return np.asarray(problem.y - weights[:-1] @ free)
