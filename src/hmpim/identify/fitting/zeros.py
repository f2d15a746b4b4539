"""Zeros that resemble delay: in the wrong half plane, or a servo's second one.

A fast zero differs little from its mirror image with another delay:

    (1 + sT) e^(-sτ) = (1 - sT) e^(-s(τ - 2T)) (1 + 2/3 (sT)³ + ...).

So a record determines T² long before the sign of T. The likelihood has a minimum for either sign,
2T of delay apart, and a search ends in one of them.

Third order with two zeros often ends in a local minimum from the rough response, or is not tried
because a simpler structure already leaves white noise. A start with a zero at infinity, or with a
pole and a zero that cancel, is as good as the simpler fit.
"""

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.fitting.candidates import best_of, pruned
from hmpim.identify.fitting.fit import Fit, Problem, delayed, fit_structure
from hmpim.identify.fitting.growth import HiddenPole, scale_of, with_pole
from hmpim.identify.fitting.trial import as_likely
from hmpim.model.dynamics import STRUCTURES, Structure, StructureName

__all__ = ["SECOND_ZERO", "is_servo", "mirrored", "second_zeros", "with_second_zero"]

SECOND_ZERO: StructureName = "third_order_zeros"
"""A servo with two zeros."""


def is_servo(structure: Structure) -> bool:
    """Whether a servo with one zero has this structure."""
    return structure.name in ("second_order_zero", "third_order_zero")


def mirrored(problem: Problem, fit: Fit, *, hopeless: float) -> list[Fit]:
    """Fit the same structure with each real zero in the other half plane.

    Parameters
    ----------
    problem, fit : Problem, Fit
        The data, and a fit with zeros; there are none for others.
    hopeless : float
        Objective from which on a fit is given up.
    """
    structure, found = fit.structure, list[Fit]()
    if structure.zeros == structure.dc_zeros or structure.parallel or structure.sampled:
        return found
    zeros = np.roots(fit.numerator[structure.dc_zeros :][::-1])
    for lead in -1.0 / zeros.real[(zeros.imag == 0.0) & (zeros.real != 0.0)]:
        start = delayed(fit.theta, -2.0 * lead)
        other = fit_structure(problem, structure, start, hopeless=hopeless)
        if other.objective < hopeless and abs(other.delay - fit.delay) > abs(lead):
            found.append(other)
    return found


def with_second_zero(
    problem: Problem, fits: list[Fit], richer: list[Fit], structures: tuple[StructureName, ...]
) -> list[Fit]:
    """Add third order with two zeros to the richer fits, if the best has zeros and it is likelier.

    Simpler fits from its poles are added too, as for all richer structures.

    Parameters
    ----------
    problem : Problem
        The data.
    fits, richer : list of Fit
        Fits of the plain and of the richer structures.
    structures : tuple of str
        Structures that may be tried.
    """
    every = [*fits, *richer]
    leading = min(every, key=lambda fit: fit.objective)
    plainer = leading.structure
    servo = plainer.zeros > plainer.dc_zeros == 0 and not plainer.parallel
    if not servo or SECOND_ZERO not in structures:
        return richer
    structure = STRUCTURES[SECOND_ZERO]
    alike = [fit for fit in richer if fit.structure == structure]
    tried = [best_of(problem, structure, [start], every) for start in _starts(richer)]
    best = min([*alike, *tried], key=lambda fit: fit.objective, default=leading)
    count = problem.counted * leading.share
    price = (structure.parameters - plainer.parameters) * np.log(count)
    gain = count * np.log(leading.objective / best.objective)
    if best not in tried or gain < price:  # Schwarz's criterion
        return richer
    richer = [*(fit for fit in richer if fit not in alike), best]
    return [*richer, *pruned(problem, [*fits, *richer], structures)]


def _starts(fits: list[Fit]) -> list[Real]:
    """Starts from third order with one zero, and from second order with a pole in addition."""
    third = [fit.theta for fit in fits if fit.structure.name == "third_order_zero"]
    second = [fit for fit in fits if fit.structure.name == "second_order_zero"]
    richer = [with_pole(fit.structure, fit.theta, scale_of(fit)) for fit in second]
    pairs = zip(second, richer, strict=True)
    return third + [np.append(fit.theta[0], theta[1:]) for fit, theta in pairs]  # delay unchanged


def second_zeros(problem: Problem, fit: Fit, hidden: HiddenPole, *, count: float) -> list[Fit]:
    """Fits with a second zero in either half plane, next to a servo's fit with one.

    Parameters
    ----------
    problem, fit : Problem, Fit
        The data, and the chosen fit.
    hidden : HiddenPole
        Its test for one more pole, which says how slow another zero may be.
    count : float
        Independent samples.
    """
    if not is_servo(fit.structure):
        return []
    theta = fit.theta
    if fit.structure.order == 2:
        theta = with_pole(fit.structure, fit.theta, hidden.lead)
    starts = [delayed(theta, later) for later in (hidden.lead, -hidden.lead)]
    structure = STRUCTURES[SECOND_ZERO]
    hopeless = as_likely(fit, structure.parameters, count)
    return [fit_structure(problem, structure, start, hopeless=hopeless) for start in starts]
