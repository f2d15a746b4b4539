"""The noise of a joint fit: one autoregression, for starts and for comparing fits."""

from dataclasses import replace

import numpy as np
import scipy

from hmpim.identify.fitting.data import Counted, Data, follows, refit
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.fitting.start import rough_response
from hmpim.identify.fitting.trial import schwarz
from hmpim.identify.noise.autoregression import autoregression
from hmpim.identify.signals import longest_lag
from hmpim.identify.worth import PART
from hmpim.record import Intersample

__all__ = ["criterion_in_colour", "prewhitened_of", "weighed_by_noise"]


def prewhitened_of(data: Data, mode: Intersample, fits: list[Fit], seen: Counted) -> Data | None:
    """Data with the noise whitened, if its colour hides the response; None otherwise.

    Input and output pass the same filter, so that the response stays the same, and starts are
    sought without wander and lines.
    """
    fit = min(fits, key=lambda f: f.objective)
    problem = data.problem(mode, seen)
    if fit.cost < PART * problem.spread:
        return None
    noise = autoregression(fit.residual, seen.valid)
    if noise.size == 1:
        return None
    whitened = problem.coloured(noise)
    u, y = (scipy.signal.lfilter(noise, np.ones(1), x - x.mean()) for x in (data.u, data.y))
    y = y if seen.valid is None else y * whitened.past_known
    rough = rough_response(u[noise.size :], y[noise.size :], longest_delay=longest_lag(data.u.size))
    return replace(data, noise=noise, rough=rough)


def weighed_by_noise(problem: Problem, fit: Fit, data: Data) -> Data:
    """Data with the colour and the level of the best fit's residual as their noise model.

    Without one if that residual still follows the input: it is no noise, and whitening it would
    hide what the model lacks.
    """
    if (fit.is_white and fit.is_steady) or follows(data, fit):
        return data.plain
    noise = np.ones(1) if fit.is_white else data.noise_left(problem, fit)
    level = data.level_left(problem, fit, noise)
    if noise.size == 1 and level is None:
        return data.plain
    return replace(data, noise=noise, level=level)


def criterion_in_colour(
    data: Data, problem: Problem, fit: Fit, *, hopeless: float = np.inf
) -> float:
    """Schwarz's criterion of a fit in noise of its own colour.

    The fit is given up once it cannot get below the criterion `hopeless`.
    One common colour would favour the fit from whose residual it is estimated.
    """
    noise = data.noise_left(problem, fit)
    coloured = problem.coloured(noise)
    parameters = fit.structure.parameters + noise.size - 1
    count = problem.counted  # whitening omits few samples, but more for a longer filter
    share = coloured.counted / count
    most = share * count * float(np.exp((hopeless - parameters * np.log(count)) / count))
    again = refit(coloured, fit, hopeless=most)
    return schwarz(again.objective / share, count, parameters)
