"""The noise of a joint fit: one autoregression, for starts and for the weighing."""

from dataclasses import replace

import numpy as np
import scipy

from hmpim.identify.arrays import Real
from hmpim.identify.chance import FALSE_ALARM
from hmpim.identify.fitting.data import Data, Seen, follows, polished, refit_all
from hmpim.identify.fitting.derivatives import jacobian
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.fitting.start import rough_response
from hmpim.identify.fitting.trial import Trial
from hmpim.identify.noise.autoregression import autoregression
from hmpim.identify.noise.covariance import covariance
from hmpim.identify.signals import longest_lag
from hmpim.identify.worth import PART, TWICE
from hmpim.record import Intersample

__all__ = ["distance_of", "is_contradicted", "prewhitened_of", "refit_whitened", "weighed_by_noise"]


def prewhitened_of(data: Data, mode: Intersample, fits: list[Fit], seen: Seen) -> Data | None:
    """Data with the noise whitened, where its colour hides the response; None elsewhere.

    Input and output are filtered alike, so that the response stays: starts are sought in what a
    wander or a line leaves free.
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
    left = whitened.innovations(fit.prediction, fit.residual)
    if float(left @ left) > PART * fit.cost:
        return None
    u, y = (scipy.signal.lfilter(noise, np.ones(1), x - x.mean()) for x in (data.u, data.y))
    y = y if seen.valid is None else y * whitened.told
    rough = rough_response(u[noise.size :], y[noise.size :], longest_delay=longest_lag(data.u.size))
    return replace(data, noise=noise, rough=rough)


def weighed_by_noise(problem: Problem, fit: Fit, data: Data) -> Data:
    """Data weighed by the colour and the level of what the best fit leaves over.

    As they come where that still follows the input: it is no noise, and whitening it would hide
    what a model lacks.
    """
    if (fit.is_white and fit.is_steady) or follows(data, fit):
        return data.plain
    noise = np.ones(1) if fit.is_white else data.noise_left(problem, fit)
    level = data.level_left(problem, fit, noise)
    if noise.size == 1 and level is None:
        return data.plain
    return replace(data, noise=noise, level=level)


def refit_whitened(
    data: Data, fitted: list[tuple[Intersample, Fit]], seen: Seen
) -> list[tuple[Intersample, Fit]]:
    """All fits once more under one noise model, the hopeless ones as they are."""
    least = min(fit.objective for _, fit in fitted)
    return refit_all(data, fitted, seen, hopeful=TWICE * least)


def is_contradicted(data: Data, best: Trial, seen: Seen) -> bool:
    """Whether whitening moves the estimate farther than noise could.

    A right model is estimated without bias with the noise whitened or not; where the two part,
    what is left over is no noise but what the model lacks (J. A. Hausman, Econometrica 46, 1978).
    The products of a compressed record do not show how far coloured noise moves an estimate.
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
    return not distance_of(apart, cov) < scipy.special.chdtri(unknown, FALSE_ALARM)


def distance_of(apart: Real, cov: Real) -> float:
    """Square of how far two estimates are apart, in deviations: d' C⁻¹ d.

    Each parameter counts in deviations of its own, so that one which the record does not determine,
    as the delay within a held sample, hides none of the others.

    Parameters
    ----------
    apart : ndarray, shape (p,)
        Difference of the estimates.
    cov : ndarray, shape (p, p)
        Its covariance.

    Examples
    --------
    >>> round(distance_of(np.array([0.0, 3.0]), np.diag([1e14, 1.0])), 6)
    9.0
    """
    spread = np.sqrt(np.diag(cov))
    spread[spread == 0.0] = 1.0  # of a fit that leaves nothing
    alike = np.linalg.pinv(cov / np.outer(spread, spread), rcond=1e-12, hermitian=True)
    return float(apart / spread @ alike @ (apart / spread))
