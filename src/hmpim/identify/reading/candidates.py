"""The table of the structures that were tried."""

from collections.abc import Callable

from hmpim.identify.fitting.fit import Fit
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.result import Candidate

__all__ = ["candidates_of"]


def candidates_of(joint: JointFit, percent: Callable[[Fit], float]) -> tuple[Candidate, ...]:
    """Every trial of a joint fit, the likeliest first; `percent` gives the fit in per cent."""
    return tuple(
        Candidate(
            structure=trial.fit.structure.name,
            intersample=trial.intersample,
            criterion=trial.criterion,
            fit_percent=percent(trial.fit),
            chosen=trial is joint.best,
        )
        for trial in sorted(joint.trials, key=lambda trial: trial.criterion)
    )
