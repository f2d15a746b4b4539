"""Real poles that meet in two sections of a structure, grouped anew.

Exchanging a pole of one section with a pole of another does not change the model. So the cost
depends only on the square of their difference d, and is stationary where they meet: no descent
leads to a complex pair (d² < 0), which may be likelier, and the errors to first order are
infinite. As the two poles of one section they can become a pair, and have finite errors.
"""

import itertools
from typing import NamedTuple

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.worth import PART
from hmpim.model.dynamics import Structure, coefficients_of, theta_of

__all__ = ["regrouped"]


class _Pole(NamedTuple):
    """Time constant of a real pole, and its section."""

    lag: float
    section: int


def regrouped(structure: Structure, theta: Real) -> Real | None:
    """Parameters, (1 + order,), of the same model with two poles that have met in one section.

    None if no poles have met, or for modes in parallel, of which each has a gain of its own.
    """
    if structure.parallel or len(structure.sections) < 2:
        return None
    real, coefficients = _real_poles(structure, theta)
    apart = [
        (abs(np.log(first.lag / second.lag)), first, second)
        for first, second in itertools.combinations(real, 2)
        if first.section != second.section
    ]
    if not apart:
        return None
    distance, first, second = min(apart)
    if distance > PART:
        return None
    into, out = sorted((first.section, second.section), key=lambda k: -structure.sections[k])
    others = [pole for pole in real if pole is not first and pole is not second]
    free = [pole.lag for pole in others if pole.section in (into, out)]
    coefficients[into] = [first.lag + second.lag, first.lag * second.lag]
    coefficients[out] = [sum(free), float(np.prod(free))][: len(free)]
    return np.append(theta[0], theta_of(structure, np.concatenate(coefficients)))


def _real_poles(structure: Structure, theta: Real) -> tuple[list[_Pole], list[list[float]]]:
    """Real poles of all sections, and each section's coefficients."""
    values = coefficients_of(structure, theta[1:]).tolist()
    found, coefficients, start = [], [], 0
    for k, order in enumerate(structure.sections):
        own = values[start : start + order]
        coefficients.append(own)
        within = own[0] ** 2 - 4.0 * own[1] if order == 2 else 0.0
        if order == 1:
            found.append(_Pole(own[0], k))
        elif within >= 0.0:
            lags = (own[0] + np.sqrt(within)) / 2, (own[0] - np.sqrt(within)) / 2
            found += [_Pole(float(lag), k) for lag in lags if lag > 0.0]
        start += order
    return found, coefficients
