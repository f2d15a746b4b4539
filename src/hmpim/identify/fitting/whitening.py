"""The noise of a joint fit: one autoregression, for starts and for comparing fits."""

from dataclasses import replace

import numpy as np
import scipy

from hmpim.identify.arrays import Real
from hmpim.identify.chance import FALSE_ALARM
from hmpim.identify.fitting.data import Counted, Data, Fits, follows, polished, refit_all
from hmpim.identify.fitting.derivatives import jacobian
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.fitting.start import rough_response
from hmpim.identify.fitting.trial import Trial
from hmpim.identify.noise.autoregression import autoregression
from hmpim.identify.noise.covariance import covariance
from hmpim.identify.signals import longest_lag
from hmpim.identify.worth import PART, TWICE
from hmpim.record import Intersample

__all__ = ["is_contradicted", "prewhitened_of", "refit_whitened", "weighed_by_noise"]


def prewhitened_of(data: Data, mode: Intersample, fits: list[Fit], seen: Counted) -> Data | None:
    """Data with the noise whitened, if its colour hides the response; None otherwise.

    Input and output pass the same filter, so that the response stays the same, and starts are
    sought without wander and lines.
    """
    fit = min(fits, key=lambda f: f.objective)
    problem = data.problem(mode, seen)
    spread = problem.masked(problem.y - problem.y.mean())
    if fit.cost < PART * float(spread @ spread):
        return None
    noise = autoregression(fit.residual, seen.valid)
    if noise.size == 1:
        return None
    whitened = problem.coloured(noise)
    innovations = whitened.innovations(fit.prediction, fit.residual)
    if float(innovations @ innovations) > PART * fit.cost:
        return None
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


def refit_whitened(data: Data, fitted: Fits, seen: Counted) -> Fits:
    """Refit all fits under one noise model, but only evaluate hopeless ones."""
    least = min(fit.objective for _, fit in fitted)
    return refit_all(data, fitted, seen, hopeful=TWICE * least)


def is_contradicted(data: Data, best: Trial, seen: Counted) -> bool:
    """Whether whitening moves the estimate farther than noise could.

    A right model is estimated without bias, with the noise whitened or not; if the two estimates
    differ, the residual is no noise but shows a deficient model (J. A. Hausman, Econometrica 46,
    1978). The products of a compressed record do not allow this test.
    """
    if not data.keeps_samples:
        return False
    problem = data.plain.problem(best.intersample, seen)
    plain = polished(problem, best.fit)
    rows = jacobian(problem, plain)
    freedom = max(problem.counted - rows.shape[0], 1)
    unknown = plain.theta.size
    cov = covariance(rows, plain.residual, freedom=freedom, white=False)[:unknown, :unknown]
    apart = plain.theta - best.fit.theta
    return not _squared_distance(apart, cov) < scipy.special.chdtri(unknown, FALSE_ALARM)


def _squared_distance(apart: Real, cov: Real) -> float:
    """Squared distance between two estimates, d' C⁻¹ d.

    Each parameter is scaled by its own deviation, so that one which the record does not determine,
    such as the delay within a held sample, hides none of the others.

    Examples
    --------
    >>> round(_squared_distance(np.array([0.0, 3.0]), np.diag([1e14, 1.0])), 6)
    9.0
    """
    spread = np.sqrt(np.diag(cov))
    spread[spread == 0.0] = 1.0  # for an exact fit
    scaled = np.linalg.pinv(cov / np.outer(spread, spread), rcond=1e-12, hermitian=True)
    return float(apart / spread @ scaled @ (apart / spread))
