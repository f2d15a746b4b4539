"""First order or second: what a record that cannot tell them apart still leaves open.

A second pole much faster than the first looks like delay. With a pure delay τ - T₂ beside it,

    e^(sT₂) / (1 + sT₂) = 1 + (sT₂)² / 2 + ...,

so the record sees q = T₂², not T₂: its likelihood is quadratic in q, and a bar that is made from
the curvature in T₂ is too short as soon as q is within a few of its own errors of 0.
"""

import numpy as np
from numpy.typing import NDArray

from hmpim.identify.fitting.fit import Fit, Problem, fit_structure
from hmpim.identify.fitting.joint import JointFit
from hmpim.identify.uncertainty import covariance
from hmpim.model.dynamics import STRUCTURES
from hmpim.model.sampled import delayed_response

__all__ = ["second_pole_limit", "widened"]

_FAR = 30.0
"""Deviance beyond which the simpler structure is out of the question."""

_PROBE = 0.3
"""Second time constant, over the first, by which the derivative with respect to q is taken."""


def widened(joint: JointFit, cov: NDArray[np.float64]) -> NDArray[np.float64]:
    """Widen the covariance of a second-order fit until it admits the first-order one.

    By the likelihood ratio the best first-order model lies √Δ standard deviations away, Δ the
    deviance between them. Where `cov` puts it farther, it is widened along the line between the
    two: cov + d dᵀ (1/Δ - 1/D), with d the difference of the parameters and D = dᵀ cov⁻¹ d.

    Parameters
    ----------
    joint : JointFit
        The fit; anything but a second-order one is left as it is.
    cov : ndarray, shape (p, p)
        Of theta and the linear parameters.

    Returns
    -------
    ndarray, shape (p, p)
    """
    fit, problem = joint.best.fit, joint.problem
    simple = next(
        (
            trial.fit
            for trial in joint.trials
            if trial.fit.structure.name == "first_order"
            and trial.intersample == joint.best.intersample
        ),
        None,
    )
    if fit.structure.name != "second_order" or simple is None or not np.isfinite(cov).all():
        return cov
    if _deviance(simple, joint) > 2 * _FAR:
        return cov
    simple = fit_structure(problem, STRUCTURES["first_order"], simple.theta)
    deviance = _deviance(simple, joint)
    if deviance > _FAR:
        return cov
    deviance = max(deviance, 1.0)
    there = np.concatenate([simple.theta, [0.0], simple.linear])
    apart = there - np.concatenate([fit.theta, fit.linear])
    distance = float(apart @ np.linalg.pinv(cov, rcond=1e-12, hermitian=True) @ apart)
    if distance <= deviance:
        return cov
    return np.asarray(cov + np.outer(apart, apart) * (1.0 / deviance - 1.0 / distance))


def _deviance(simple: Fit, joint: JointFit) -> float:
    """Twice the log-likelihood by which the chosen fit beats a simpler one."""
    count = joint.problem.counted * joint.effective_share
    return float(count * np.log(max(simple.cost / joint.best.fit.cost, 1.0)))


def second_pole_limit(
    problem: Problem, fit: Fit, rows: NDArray[np.float64], *, white: bool
) -> float:
    """Longest second time constant that a first-order record does not exclude, in samples.

    A score test: the response to q = T₂² is fitted to the residual beside the other
    parameters, and the limit is √(q + 2σ).

    Parameters
    ----------
    problem : Problem
        The data.
    fit : Fit
        A first-order fit to them.
    rows : ndarray, shape (4, n)
        Its derivatives, from `hmpim.identify.fitting.fit.jacobian`.
    white : bool
        Whether its residual is white.
    """
    first = float(np.exp(fit.theta[1]))
    second = _PROBE * first
    here = delayed_response(problem.source, delay=fit.delay, denominator=np.array([1.0, first]))
    there = delayed_response(
        problem.source,
        delay=max(fit.delay - second, -19.0),
        denominator=np.array([1.0, first + second, first * second]),
    )
    added = problem.masked(fit.linear[0] * (there - here)[0]) / second**2
    every = np.vstack([rows, added])
    freedom = max(problem.counted - every.shape[0], 1)
    variance = covariance(every, fit.residual, freedom=freedom, white=white)[-1, -1]
    squared = float(np.linalg.lstsq(every.T, fit.residual, rcond=None)[0][-1])
    return float(np.sqrt(max(squared, 0.0) + 2.0 * np.sqrt(variance)))
