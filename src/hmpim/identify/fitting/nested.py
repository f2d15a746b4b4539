"""First order or second: error bars of a second-order fit, widened until they admit first order.

A second pole much faster than the first looks like delay (`hmpim.identify.fitting.growth`). The
record determines q = T₂², so an error bar from the curvature in T₂ is too short when q is within
a few of its own errors of 0.
"""

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.chance import EXCLUDED
from hmpim.identify.fitting.data import refit
from hmpim.identify.fitting.fit import Fit
from hmpim.identify.fitting.trial import JointFit

__all__ = ["widened"]


def widened(joint: JointFit, cov: Real) -> Real:
    """Widen the covariance of a second-order fit until it admits the first-order one.

    By the likelihood ratio the best first-order model is √Δ standard deviations away, Δ the
    deviance between them, at least 1. If it is farther by `cov`, that is widened along the line
    between the two: cov + d dᵀ (1/Δ - 1/D), with d the difference of the parameters and
    D = dᵀ cov⁻¹ d.

    Parameters
    ----------
    joint : JointFit
        The fit. If it is not of second order, `cov` is returned.
    cov : ndarray, shape (p, p)
        Of theta and the linear parameters.

    Returns
    -------
    ndarray, shape (p, p)
    """
    fit = joint.best.fit
    alike = (t.fit for t in joint.trials if t.intersample == joint.best.intersample)
    simple = next((other for other in alike if other.structure.name == "first_order"), None)
    if fit.structure.name != "second_order" or simple is None or not np.isfinite(cov).all():
        return cov
    if _deviance(simple, joint) > 2 * EXCLUDED:
        return cov
    simple = refit(joint.weighed, simple)
    deviance = _deviance(simple, joint)
    if deviance > EXCLUDED:
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
    count = joint.weighed.counted * joint.weighed_share
    least = max(joint.best.fit.objective, np.finfo(float).tiny)
    return float(count * np.log(max(simple.objective / least, 1.0)))
