"""Fits under each assumption between the samples, from where fits under another ended."""

import numpy as np

from hmpim.identify.chance import CLEARLY
from hmpim.identify.fitting.candidates import pruned
from hmpim.identify.fitting.data import RETURNS, TASTE, Counted, Data, Fits, shifted
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.fit import Fit, Problem, fit_structure
from hmpim.identify.fitting.trial import as_likely
from hmpim.identify.worth import TWICE
from hmpim.model.dynamics import StructureName
from hmpim.record import BETWEEN, Intersample

__all__ = ["fit_under_each_assumption", "refit_between"]


def refit_between(
    problem: Problem,
    fit: Fit,
    origin: Intersample,
    mode: Intersample,
    *,
    iterations: int = RETURNS,
    hopeless: float = np.inf,
) -> Fit:
    """Fit the same structure under another assumption, from where the first fit ended."""
    theta = shifted(fit.theta, origin, mode)
    return fit_structure(problem, fit.structure, theta, iterations=iterations, hopeless=hopeless)


def fit_under_each_assumption(
    data: Data,
    natural: Intersample,
    fits: list[Fit],
    seen: Counted,
    structures: tuple[StructureName, ...],
    *,
    alone: bool,
) -> Fits:
    """Add fits under the other assumptions, unless the natural one is `alone`.

    Poles and zeros of a rich structure may have made up for a wrong assumption. So plainer
    structures are fitted under the other assumptions if they may be about as likely, and so are
    members of `structures` that lack poles and zeros which the leading fits do not need.
    """
    fitted = [(natural, fit) for fit in fits]
    if alone:
        return fitted
    best = min(fits, key=lambda fit: fit.objective)
    least, count = best.objective, data.problem(natural, seen).counted * best.share
    clearly = float(np.expm1(2 * CLEARLY / count)) * least
    leading, trailing, behind = _by_promise(fits, least, clearly)
    problems = {mode: data.problem(mode, seen) for mode in BETWEEN if mode != natural}

    def most(fit: Fit) -> float:
        """Largest objective at which a fit is continued; the likelihood counts if noise is left."""
        own = as_likely(best, fit.structure.parameters, count) if best.is_white else np.inf
        return min(own, TWICE * least)

    def moved(some: list[Fit]) -> Fits:
        return [
            (mode, refit_between(problem, fit, natural, mode, hopeless=most(fit)))
            for mode, problem in problems.items()
            for fit in some
        ]

    fitted += moved(leading)
    if min(fit.objective for _, fit in fitted) < least - clearly:
        fitted += moved(trailing)  # these may trail only because the assumption was wrong
    else:
        behind += trailing
    if best.structure.name in PLAIN:
        return fitted
    for fit in behind:
        fewer = best.structure.parameters - fit.structure.parameters
        if fewer <= 0 or fit.structure.name in PLAIN:  # plain ones are far behind a rich one
            continue
        likely = as_likely(best, fit.structure.parameters, count)
        for mode, problem in problems.items():
            other = refit_between(problem, fit, natural, mode, iterations=TASTE, hopeless=likely)
            if not other.converged and other.objective < TWICE**2 * least:
                other = refit_between(problem, other, mode, mode, hopeless=likely)
            fitted.append((mode, other))
    for mode, problem in problems.items():
        own = [fit for m, fit in fitted if m == mode]
        enough = as_likely(best, 0, count) if best.is_white else TWICE * least
        if min(fit.objective for fit in own) < enough:
            fitted += [(mode, fit) for fit in pruned(problem, own, structures)]
    return fitted


def _by_promise(
    fits: list[Fit], least: float, clearly: float
) -> tuple[list[Fit], list[Fit], list[Fit]]:
    """Fits that may lead under another assumption, that would trail there, and all others."""
    leading, trailing, behind = list[Fit](), list[Fit](), list[Fit]()
    for fit in fits:
        plain, hopeful = fit.structure.name in PLAIN, fit.objective < TWICE * least
        if hopeful and (plain or fit.objective < least + clearly):
            leading.append(fit)
        elif hopeful or plain:
            trailing.append(fit)
        else:
            behind.append(fit)
    return leading, trailing, behind
