"""A plainer structure in place of a rich one that was taken for what is not linear."""

from dataclasses import replace

from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.fit import Fit, fit_structure
from hmpim.identify.fitting.trial import JointFit, trial_of

__all__ = ["plainer", "taking"]

_PRECISION = 1e-4
"""Relative fall of the sum of squares at which the fit stops."""


def plainer(joint: JointFit) -> Fit | None:
    """Best fit of a plain structure, refined; None if the chosen one is plain, or none is near.

    Parameters
    ----------
    joint : JointFit
        From `joint_fit`.
    """
    best = joint.best
    if best.fit.structure.name in PLAIN:
        return None
    rivals = [trial for trial in joint.trials if trial.fit.structure.name in PLAIN]
    # Under another assumption between the samples it is a start as good.
    rivals = [r for r in rivals if r.intersample == best.intersample] or rivals
    if not rivals:
        return None
    plain = min(rivals, key=lambda trial: trial.criterion).fit
    return fit_structure(joint.problem, plain.structure, plain.theta, precision=_PRECISION)


def taking(joint: JointFit, fit: Fit) -> JointFit:
    """Take another fit than the one chosen, of a structure that was tried.

    Parameters
    ----------
    joint : JointFit
        From `joint_fit`.
    fit : Fit
        To the same data; the chosen one itself leaves all as it is.
    """
    if fit is joint.best.fit:
        return joint
    mode = joint.best.intersample
    best = trial_of(mode, fit, joint.problem.counted * joint.effective_share)
    others = [
        trial
        for trial in joint.trials
        if (trial.fit.structure.name, trial.intersample) != (fit.structure.name, mode)
    ]
    return replace(
        joint,
        best=best,
        trials=(*others, best),
        effective_share=fit.share,
        rivals=(),
        hidden=None,
    )
