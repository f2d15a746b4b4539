"""Plain structures in place of a richer one that a nonlinearity may have caused."""

from dataclasses import replace

from hmpim.identify.fitting.data import refit
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.fit import Fit
from hmpim.identify.fitting.trial import JointFit, trial_of

__all__ = ["plainer", "taking"]

_PRECISION = 1e-4
"""Relative fall of the sum of squares at which the fit stops."""


def plainer(joint: JointFit) -> Fit | None:
    """Best fit of a plain structure, refined; None if the chosen one is plain, or none was tried.

    Parameters
    ----------
    joint : JointFit
        From `joint_fit`.
    """
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
    """Replace the chosen fit by another one, of a structure that was tried.

    Parameters
    ----------
    joint, fit : JointFit, Fit
        From `joint_fit`, and a fit to the same data; nothing changes if it is the chosen one.
    """
    if fit is joint.best.fit:
        return joint
    mode, name = joint.best.intersample, fit.structure.name
    best = trial_of(mode, fit, joint.problem.counted * joint.effective_share)
    others = [t for t in joint.trials if (t.fit.structure.name, t.intersample) != (name, mode)]
    return replace(
        joint, best=best, trials=(*others, best), effective_share=fit.share, rivals=(), hidden=None
    )
