"""A servo's second zero: third order with two zeros, started from fits with one.

From the rough response this fit often ends in a local minimum, or it is not tried because a simpler
one already leaves white noise. A start with a zero at infinity, or with a pole and a zero that
cancel, is as good as the simpler fit.
"""

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.fitting.candidates import best_of, pruned
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.fitting.growth import scale_of, with_pole
from hmpim.model.dynamics import STRUCTURES, StructureName

__all__ = ["with_second_zero"]


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
    if not servo or "third_order_zeros" not in structures:
        return richer
    structure = STRUCTURES["third_order_zeros"]
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
