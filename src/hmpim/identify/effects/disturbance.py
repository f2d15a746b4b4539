"""What moves an output apart from its input: rows of the same fit, then taken off the output."""

from dataclasses import replace

import numpy as np

from hmpim.identify.fitting.fit import FORGETS, Fit, Problem
from hmpim.identify.fitting.trial import JointFit, Trial
from hmpim.identify.noise.autoregression import innovation_gain

__all__ = ["gain_by_rows", "without_rows"]


def gain_by_rows(one: JointFit, count: int, former: Fit, without: Problem) -> float:
    """Gain in Schwarz's criterion by adding `count` rows; `former` is the fit without them.

    Each residual is modelled as an autoregression over the samples that count in both. An initial
    state that is fitted has its parameters too.
    """
    counts = np.ones(one.problem.y.size, bool)
    for problem, begins in ((one.problem, one.forgotten), (without, without.begins)):
        counts[: begins or 0] = False
        if problem.valid is not None:
            counts &= problem.valid
    if not counts.any():
        return -np.inf
    fit, samples = one.best.fit, int(np.count_nonzero(counts))
    gained = 2.0 * innovation_gain(former.residual[counts], fit.residual[counts])
    unknown = fit.structure.parameters + count - former.structure.parameters
    states = _price_of_state(fit, samples) - _price_of_state(former, samples)
    return gained - unknown * float(np.log(samples)) - states


def _price_of_state(fit: Fit, samples: int) -> float:
    """What Schwarz's criterion asks for a free response: a mode is seen for as long as it lasts."""
    if not fit.initial.size:
        return 0.0
    rates = np.abs(np.polynomial.polynomial.polyroots(fit.denominator).real)
    lasting = FORGETS / np.maximum(rates, FORGETS / samples)
    return float(np.sum(np.log(np.maximum(lasting, 1.0))))


def without_rows(joint: JointFit, which: slice) -> JointFit:
    """A fit of the output without what some of its rows explain; they stay free to move."""
    problem = joint.problem
    rows = problem.fixed()[1:][which]
    y = problem.y - joint.best.fit.nuisance[which] @ rows

    def plain(trial: Trial) -> Trial:
        fit = trial.fit
        if not fit.prediction.size:  # no more than a start
            return trial
        part, left = fit.nuisance[which] @ rows, fit.nuisance.copy()
        left[which] = 0.0
        moved = replace(fit, prediction=fit.prediction - part, nuisance=left)
        return replace(trial, fit=moved)

    trials = {id(trial): plain(trial) for trial in joint.trials}
    return replace(
        joint,
        problem=replace(problem, y=y),
        weighed=replace(joint.weighed, y=y),
        best=trials.get(id(joint.best)) or plain(joint.best),
        trials=tuple(trials.values()),
    )
