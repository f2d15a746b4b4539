"""What was tried, and what is chosen of it."""

from dataclasses import dataclass

import numpy as np

from hmpim.identify.chance import LIKELIER
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.fitting.growth import HiddenPole
from hmpim.identify.worth import MUCH
from hmpim.record import Intersample

__all__ = ["JointFit", "Trial", "likeliest_of", "trial_of"]


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
    rivals : tuple of Trial
        Fits with one more pole, under the chosen assumption, that are as likely but for its price.
    hidden : HiddenPole or None
        What the record says of one more pole; None where it was not asked.
    """

    problem: Problem
    weighed: Problem
    best: Trial
    trials: tuple[Trial, ...]
    forgotten: int
    effective_share: float
    related: bool
    silent: bool = False
    rivals: tuple[Trial, ...] = ()
    hidden: HiddenPole | None = None

    @property
    def lingers(self) -> bool:
        """Whether a free response lasts long that no plain model has: a drift looks like it."""
        fit = self.best.fit
        long = fit.memory > MUCH * self.problem.y.size
        return bool(self.forgotten) and long and fit.structure.name not in PLAIN

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
    """The likeliest trial; a natural one no richer than it unless the odds are beyond 20."""
    best = min(trials, key=lambda trial: trial.criterion)
    most = best.fit.structure.parameters
    rivals = [t for t in trials if t.intersample == natural and t.fit.structure.parameters <= most]
    if not rivals or best in rivals:
        return best
    rival = min(rivals, key=lambda trial: trial.criterion)
    return best if rival.criterion - best.criterion > 2 * LIKELIER else rival
