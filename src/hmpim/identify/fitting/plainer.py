"""Plainer structures: started from a richer fit, and in place of a nonlinear one."""

from dataclasses import replace

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.fitting.data import refit
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.fit import Fit, Problem, fit_structure
from hmpim.identify.fitting.trial import JointFit, trial_of
from hmpim.identify.worth import TWICE
from hmpim.model.dynamics import coefficients_of

__all__ = ["plainer", "reduced", "taking"]

_PRECISION = 1e-4
"""Relative fall of the sum of squares at which the fit stops."""


def plainer(joint: JointFit) -> Fit | None:
    """Best fit of a plain structure, refined; None if the chosen one is plain or none was tried."""
    best = joint.best
    if best.fit.structure.name in PLAIN:
        return None
    rivals = [trial for trial in joint.trials if trial.fit.structure.name in PLAIN]
    # A fit under another assumption between the samples is as good a start.
    rivals = [r for r in rivals if r.intersample == best.intersample] or rivals
    if not rivals:
        return None
    plain = min(rivals, key=lambda trial: trial.criterion).fit
    return refit(joint.problem, plain, precision=_PRECISION)


def taking(joint: JointFit, fit: Fit) -> JointFit:
    """Replace the chosen fit by another one to the same data, of a structure that was tried."""
    mode, name = joint.best.intersample, fit.structure.name
    best = trial_of(mode, fit, joint.problem.counted * joint.effective_share)
    others = [t for t in joint.trials if (t.fit.structure.name, t.intersample) != (name, mode)]
    return replace(
        joint, best=best, trials=(*others, best), effective_share=fit.share, rivals=(), hidden=None
    )


def reduced(problem: Problem, fits: list[Fit], richer: list[Fit]) -> list[Fit]:
    """Fits of plain structures, also from starts that the best of the richer ones provides.

    Each start keeps one of its sections; the others count as delay.
    """
    best = min(richer, key=lambda f: f.objective)
    sections = _sections(best)
    late = best.delay + sum(float(c[0]) for _, c in sections)
    above = best.numerator
    if above.size > 1 and above[0]:
        late -= float(above[1] / above[0])

    def better(fit: Fit) -> Fit:
        if fit.objective <= TWICE * best.objective:
            return fit
        own = [(theta, c) for theta, c in sections if fit.structure.sections == (c.size,)]
        starts = [np.append(late - c[0], theta) for theta, c in own]
        limit = fit.objective
        tried = [fit_structure(problem, fit.structure, t, hopeless=limit) for t in starts]
        return min([fit, *tried], key=lambda f: f.objective)

    return [better(fit) for fit in fits]


def _sections(fit: Fit) -> list[tuple[Real, Real]]:
    """Parameters and coefficients of each section of a denominator."""
    if not fit.structure.sections:
        return []
    edges = np.cumsum(fit.structure.sections)[:-1]
    flat = coefficients_of(fit.structure, fit.theta[1:])
    return list(zip(np.split(fit.theta[1:], edges), np.split(flat, edges), strict=True))
