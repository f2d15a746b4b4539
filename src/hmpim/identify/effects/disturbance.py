"""Output motion that no input causes: fitted as rows, then subtracted from the output."""

from dataclasses import replace

import numpy as np

from hmpim.identify.fitting.fit import FORGETS, Fit, Problem
from hmpim.identify.fitting.trial import JointFit, Trial
from hmpim.identify.noise.autoregression import innovation_gain

__all__ = ["criterion_gain", "held_rows", "without_rows"]


def criterion_gain(joint: JointFit, count: int, former: Fit, without: Problem) -> float:
    """Gain in Schwarz's criterion by adding `count` rows; `former` is the fit without them.

    Each residual is modelled as an autoregression over the samples that count in both fits. A
    fitted initial state has its parameters too.
    """
    counts = np.ones(joint.problem.y.size, bool)
    for problem, begins in ((joint.problem, joint.forgotten), (without, without.begins)):
        counts[: begins or 0] = False
        if problem.valid is not None:
            counts &= problem.valid
    if not counts.any():
        return -np.inf
    fit, samples = joint.best.fit, int(np.count_nonzero(counts))
    gained = 2.0 * innovation_gain(former.residual[counts], fit.residual[counts])
    unknown = fit.structure.parameters + count - former.structure.parameters
    states = _price_of_state(fit, samples) - _price_of_state(former, samples)
    return gained - unknown * float(np.log(samples)) - states


def _price_of_state(fit: Fit, samples: int) -> float:
    """Penalty of Schwarz's criterion for a free response: a mode counts for as long as it lasts."""
    if not fit.initial.size:
        return 0.0
    rates = np.abs(np.polynomial.polynomial.polyroots(fit.denominator).real)
    lasting = FORGETS / np.maximum(rates, FORGETS / samples)
    return float(np.sum(np.log(np.maximum(lasting, 1.0))))


def without_rows(joint: JointFit, which: slice) -> JointFit:
    """Subtract what some rows explain from the output of a fit; they stay free to move."""
    problem = joint.problem
    rows = problem.fixed()[1:][which]
    y = problem.y - joint.best.fit.nuisance[which] @ rows

    def reduced(trial: Trial) -> Trial:
        fit = trial.fit
        if not fit.prediction.size:  # starting values only
            return trial
        others = fit.nuisance.copy()
        others[which] = 0.0
        part = fit.nuisance[which] @ rows
        return replace(trial, fit=replace(fit, prediction=fit.prediction - part, nuisance=others))

    trials = {id(trial): reduced(trial) for trial in joint.trials}
    return replace(
        joint,
        problem=replace(problem, y=y),
        weighed=replace(joint.weighed, y=y),
        best=trials.get(id(joint.best)) or reduced(joint.best),
        trials=tuple(trials.values()),
    )


def held_rows(joint: JointFit, kept: int) -> JointFit:
    """Subtract from the output what rows after the first `kept` explain, and drop these rows."""
    found, rows = without_rows(joint, slice(kept, None)), joint.problem.fixed()[1 + kept :]

    def fewer(problem: Problem) -> Problem:
        own = problem.nuisance
        return replace(problem, nuisance=own[:kept] if kept and own is not None else None)

    def reduced(trial: Trial) -> Trial:
        fit = trial.fit
        if fit.prediction.size:  # of rivals, nothing is subtracted yet
            fit = replace(fit, prediction=fit.prediction - fit.nuisance[kept:] @ rows)
        return replace(trial, fit=replace(fit, nuisance=fit.nuisance[:kept]))

    trials = {id(trial): reduced(trial) for trial in found.trials}
    return replace(
        found,
        problem=fewer(found.problem),
        weighed=fewer(found.weighed),
        best=trials.get(id(found.best)) or reduced(found.best),
        trials=tuple(trials.values()),
        rivals=tuple(map(reduced, found.rivals)),
    )
