"""What was tried, and what is chosen of it."""

from dataclasses import dataclass

import numpy as np

from hmpim.identify.fitting.enrich import (
    PLAIN,
)
from hmpim.identify.fitting.fit import Fit, Problem, jacobian
from hmpim.record import Intersample

__all__ = ["CLEARLY", "JointFit", "Trial", "likeliest_of", "trial_of", "wary_of"]

CLEARLY = 6.0
"""Difference in log-likelihood that decides against the natural assumption (odds of 400)."""

_FAR = 4.0
"""Standard deviations of the delay beyond which another structure contradicts the chosen one."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trial:
    """One structure under one assumption, fitted; `criterion` lower is better."""

    intersample: Intersample
    fit: Fit
    criterion: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointFit:
    """The chosen trial, all others, and the data they were fitted to.

    Parameters
    ----------
    problem : Problem
        The data under the chosen assumption, with the samples that counted.
    weighed : Problem
        The same with the noise whitened, as all trials were weighed.
    best : Trial
        The chosen one.
    trials : tuple of Trial
        All, the chosen one included.
    forgotten : int
        Samples left out at the beginning because the record does not begin at rest: as long as
        the output still depends on input before it.
    effective_share : float
        Independent samples per sample, from the best residual's correlation.
    related : bool
        Whether the best model explains more than a constant does.
    silent : bool
        Whether no model can: the output does not answer the input at all.
    simpler : Trial or None
        What the criterion alone would have chosen, where a richer structure was taken for its
        wider error bars.
    """

    problem: Problem
    weighed: Problem
    best: Trial
    trials: tuple[Trial, ...]
    forgotten: int
    effective_share: float
    related: bool
    silent: bool = False
    simpler: Trial | None = None

    @property
    def weighed_share(self) -> float:
        """Independent samples per sample of the weighed problem: all, once noise is whitened."""
        return self.effective_share if self.weighed.noise is None else 1.0


def trial_of(mode: Intersample, fit: Fit, count: float, *, floor: float = 0.0) -> Trial:
    """A fit weighed by Schwarz's criterion, of so many independent samples.

    No sum of squares counts as less than `floor`, where rounding tells nothing.
    """
    least = max(floor, float(np.finfo(float).tiny))
    criterion = count * np.log(
        max(fit.objective, least) / count
    ) + fit.structure.parameters * np.log(count)
    return Trial(intersample=mode, fit=fit, criterion=float(criterion))


def likeliest_of(trials: list[Trial], natural: Intersample) -> Trial:
    """The likeliest trial, under the natural assumption unless another is clearly likelier."""
    best = min(trials, key=lambda trial: trial.criterion)
    rivals = [trial for trial in trials if trial.intersample == natural]
    if not rivals or best in rivals:
        return best
    rival = min(rivals, key=lambda trial: trial.criterion)
    return best if rival.criterion - best.criterion > 2 * CLEARLY else rival


def wary_of(chosen: Trial, trials: list[Trial], problem: Problem, count: float) -> Trial:
    """Prefer second order to first where it may well be right and would move the delay.

    The criterion keeps a simpler structure until the evidence is strong, and the simpler one's
    error bars take it for certain. Where the record half speaks for another pole and that
    pole would take the delay far outside those bars, the wider bars are the honest ones.
    """
    if chosen.fit.structure.name != "first_order":
        return chosen
    rows = jacobian(problem, chosen.fit)
    information = np.linalg.pinv(rows @ rows.T, hermitian=True)
    std = np.sqrt(max(information[0, 0], 0.0) * chosen.fit.objective / problem.counted)
    for trial in trials:
        extra = trial.fit.structure.parameters - chosen.fit.structure.parameters
        if (
            trial.intersample == chosen.intersample
            and trial.fit.structure.name in PLAIN
            and extra > 0
            and extra * np.log(count) - (trial.criterion - chosen.criterion) > 0.5 * extra
            and abs(trial.fit.delay - chosen.fit.delay) > _FAR * std
        ):
            return trial
    return chosen
