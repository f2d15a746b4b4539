"""All trials of a joint fit, and the choice among them."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hmpim.identify.chance import CLEARLY, LIKELIER
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.fitting.growth import HiddenPole
from hmpim.identify.result import Candidate
from hmpim.identify.worth import MUCH
from hmpim.record import Intersample

__all__ = ["JointFit", "Trial", "as_likely", "likeliest_of", "schwarz", "trial_of"]

_TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trial:
    """One structure fitted under one assumption; a lower `criterion` is better."""

    intersample: Intersample
    fit: Fit
    criterion: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointFit:
    """The chosen trial, all others, and the data they were fitted to."""

    problem: Problem  # the data under the chosen assumption, with the samples that counted
    weighed: Problem  # the same with the noise whitened, as all trials were compared
    best: Trial
    trials: tuple[Trial, ...]  # all, the chosen one included
    # samples omitted at the beginning because the record does not begin at rest: the output
    # there still depends on earlier input
    forgotten: int
    effective_share: float  # independent samples per sample, from the best residual's correlation
    related: bool  # whether the best model explains more than a constant does
    silent: bool = False  # whether no model can: the output does not respond to the input
    # fits with one more pole, under the chosen assumption, that lose only by the extra parameter
    rivals: tuple[Trial, ...] = ()
    hidden: HiddenPole | None = None  # the test for one more pole; None if it was not made

    @property
    def lingers(self) -> bool:
        """Whether the free response of a rich model is so slow that it may be a drift."""
        fit = self.best.fit
        long = fit.memory > MUCH * self.problem.y.size
        return bool(self.forgotten) and long and fit.structure.name not in PLAIN

    @property
    def weighed_share(self) -> float:
        """Independent samples per sample of `weighed`: 1 if the noise is whitened."""
        return self.effective_share if self.weighed.noise is None else 1.0

    @property
    def counted(self) -> float:
        """Independent samples with which all trials were compared."""
        return self.weighed.counted * self.weighed_share

    def gain(self, trial: Trial, former: Trial) -> float:
        """Twice the log-likelihood that a trial gains over a former one."""
        before, after = (max(each.fit.objective, _TINY) for each in (former, trial))
        return float(self.counted * np.log(before / after))

    def with_fit(self, fit: Fit) -> "JointFit":
        """The same with another fit of the chosen trial."""
        best = replace(self.best, fit=fit)
        trials = tuple(best if trial is self.best else trial for trial in self.trials)
        return replace(self, best=best, trials=trials)

    def candidates(self, percent: Callable[[Fit], float]) -> tuple[Candidate, ...]:
        """Every trial, the likeliest first; `percent` gives the fit in per cent."""
        return tuple(
            Candidate(
                structure=trial.fit.structure.name,
                intersample=trial.intersample,
                criterion=trial.criterion,
                fit_percent=percent(trial.fit),
                chosen=trial is self.best,
            )
            for trial in sorted(self.trials, key=lambda trial: trial.criterion)
        )


def schwarz(cost: float, count: float, parameters: int) -> float:
    """Schwarz's criterion of a sum of squares over so many independent samples; lower is better."""
    return float(count * np.log(cost / count) + parameters * np.log(count))


def as_likely(fit: Fit, parameters: int, count: float, *, behind: float = 2 * CLEARLY) -> float:
    """Objective at which a fit with so many parameters is less likely than another one.

    By `behind` in Schwarz's criterion of `count` independent samples; by default the odds are 400
    to 1.
    """
    fewer = fit.structure.parameters - parameters
    return fit.objective * float(np.exp((fewer * np.log(count) + behind) / count))


def trial_of(mode: Intersample, fit: Fit, count: float, *, floor: float = 0.0) -> Trial:
    """A fit with Schwarz's criterion for `count` independent samples.

    Sums of squares below `floor` are only rounding, and count as `floor`.
    """
    least = max(floor, _TINY)
    criterion = schwarz(max(fit.objective, least), count, fit.structure.parameters)
    return Trial(intersample=mode, fit=fit, criterion=criterion)


def likeliest_of(trials: list[Trial], natural: Intersample) -> Trial:
    """The likeliest trial; a natural one no richer, unless the odds against it exceed 20."""
    best = min(trials, key=lambda trial: trial.criterion)
    most = best.fit.structure.parameters
    rivals = [t for t in trials if t.intersample == natural and t.fit.structure.parameters <= most]
    if not rivals or best in rivals:
        return best
    rival = min(rivals, key=lambda trial: trial.criterion)
    return best if rival.criterion - best.criterion > 2 * LIKELIER else rival
