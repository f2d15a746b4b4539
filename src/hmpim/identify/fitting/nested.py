"""First order or second: what a record that cannot tell them apart still leaves open.

A second pole much faster than the first looks like delay. With a pure delay τ - T₂ beside it,

    e^(sT₂) / (1 + sT₂) = 1 + (sT₂)² / 2 + ...,

so the record sees q = T₂², not T₂: its likelihood is quadratic in q, and a bar that is made from
the curvature in T₂ is too short as soon as q is within a few of its own errors of 0.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmpim.identify.fitting.fit import Fit, Problem, fit_structure
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.uncertainty import covariance
from hmpim.model.dynamics import STRUCTURES
from hmpim.model.sampled import delayed_response

__all__ = ["FAR", "HiddenPole", "hidden_pole", "stretched", "widened"]

FAR = 30.0
"""Deviance beyond which the simpler structure is out of the question."""

_PROBE = 0.3
"""Time constant, over the fit's own, by which the derivative with respect to q is taken."""


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
    fit, problem = joint.best.fit, joint.weighed
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
    if _deviance(simple, joint) > 2 * FAR:
        return cov
    simple = fit_structure(problem, STRUCTURES["first_order"], simple.theta)
    deviance = _deviance(simple, joint)
    if deviance > FAR:
        return cov
    return stretched(cov, simple, fit, deviance)


def stretched(
    cov: NDArray[np.float64], simple: Fit, fit: Fit, deviance: float
) -> NDArray[np.float64]:
    """Widen the covariance of a second-order fit until a first-order one lies √deviance away.

    Parameters
    ----------
    cov : ndarray, shape (p, p)
        Of theta and the linear parameters.
    simple, fit : Fit
        Of first and of second order.
    deviance : float
        Twice the difference of their log-likelihoods; at least 1 is taken.
    """
    deviance = max(deviance, 1.0)
    there = np.concatenate([simple.theta, [0.0], simple.linear])
    apart = there - np.concatenate([fit.theta, fit.linear])
    distance = float(apart @ np.linalg.pinv(cov, rcond=1e-12, hermitian=True) @ apart)
    if distance <= deviance:
        return cov
    return np.asarray(cov + np.outer(apart, apart) * (1.0 / deviance - 1.0 / distance))


def _deviance(simple: Fit, joint: JointFit) -> float:
    """Twice the log-likelihood by which the chosen fit beats a simpler one."""
    count = joint.weighed.counted * joint.weighed_share
    return float(count * np.log(max(simple.objective / joint.best.fit.objective, 1.0)))


@dataclass(frozen=True, slots=True, kw_only=True)
class HiddenPole:
    """What a record says of one more pole beside a fit, T its time constant in samples.

    Parameters
    ----------
    squared, std : float
        T² as a score test finds it, and its standard deviation. Below 0 it stands for what one
        more pole cannot be: a zero, or a pair of poles.
    scale : float
        Time in samples that the fit itself has: the time constant, or 1/ω of the natural
        frequency.
    """

    squared: float
    std: float
    scale: float

    @property
    def limit(self) -> float:
        """Longest time constant, in samples, that the record does not exclude."""
        return float(np.sqrt(max(self.squared, 0.0) + 2.0 * self.std))


def hidden_pole(
    problem: Problem, fit: Fit, rows: NDArray[np.float64], *, white: bool
) -> HiddenPole:
    """Test a first- or second-order fit for one more pole, the delay shortened by as much.

    The response to q = T² is fitted to the residual beside the other parameters (a score
    test: C. R. Rao, Proc. Camb. Phil. Soc. 44, 1948).

    Parameters
    ----------
    problem : Problem
        The data.
    fit : Fit
        A fit of order 1 or 2 to them.
    rows : ndarray, shape (p, n)
        Its derivatives, from `hmpim.identify.fitting.fit.jacobian`.
    white : bool
        Whether its residual is white.
    """
    denominator = fit.denominator
    order = fit.structure.order
    scale = float(denominator[order] ** (1.0 / order))
    added = _PROBE * scale
    here, there = (
        delayed_response(problem.source, delay=delay, denominator=poles, powers=1)[0]
        for delay, poles in (
            (fit.delay, denominator),
            (max(fit.delay - added, -19.0), np.convolve(denominator, [1.0, added])),
        )
    )
    row = problem.masked(fit.linear[0] * (there - here)) / added**2
    every = np.vstack([rows, row])
    freedom = max(problem.counted - every.shape[0], 1)
    left = problem.innovations(fit.prediction, fit.residual)
    variance = covariance(every, left, freedom=freedom, white=white)[-1, -1]
    squared = float(np.linalg.lstsq(every.T, left, rcond=None)[0][-1])
    return HiddenPole(squared=squared, std=float(np.sqrt(variance)), scale=scale)
