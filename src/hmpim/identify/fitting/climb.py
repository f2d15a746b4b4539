"""The Levenberg-Marquardt algorithm, for models that are linear in most parameters."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from hmpim.identify.arrays import Mask, Real, parts_of
from hmpim.identify.fitting.least_squares import solved
from hmpim.identify.fitting.regrouped import regrouped
from hmpim.identify.worth import TWICE
from hmpim.model.dynamics import Structure

__all__ = ["Evaluated", "climb"]

_DAMPING = 1e-4
"""Share of each diagonal element that the first steps add to it."""

_NUDGE = 1e-7
"""Change of a parameter that shows whether a bound is in its way."""

_NEAR = 400.0
"""Decrement, over a negligible one, up to which one step may be the last: two standard deviations
at the usual precision."""

_STEEPEST = 1e6
"""Damping from which no smaller step is tried."""

_IN_A_ROW = 5
"""Latest steps by which a search is judged that has not converged."""

_CREEPS = 10.0
"""Average gain of these steps, over a negligible one, below which the search is given up."""

_POORLY, _WELL = 0.25, 0.75
"""Share of the predicted gain below which the damping grows, and above which it falls."""


class Evaluated(Protocol):
    """A model at given nonlinear parameters, its linear ones solved for."""

    @property
    def thetas(self) -> list[Real]:
        """Nonlinear parameters of each input."""

    @property
    def linear(self) -> Real:
        """Linear parameters."""

    @property
    def cost(self) -> float:
        """Sum of squares of the residual."""

    def normal(self) -> tuple[Real, Real]:
        """Normal equations of the nonlinear parameters: matrix, and derivative of the cost."""


E = TypeVar("E", bound=Evaluated)


def climb(
    evaluated: Callable[[Sequence[Real]], E],
    thetas: Sequence[Real],
    *,
    structures: Sequence[Structure],
    bounded: Callable[[Sequence[Real]], list[Real]],
    counted: int,
    iterations: int,
    precision: float,
    hopeless: float = np.inf,
) -> tuple[E, bool]:
    """Minimise the cost by the Levenberg-Marquardt algorithm.

    The damping follows how well the quadratic model predicts each step (J. Nocedal and S. J.
    Wright, Numerical Optimization, 2nd ed., 2006, section 4.1). Parameters at a bound are held.
    Where two real poles meet, the search continues with the poles grouped anew.

    Parameters
    ----------
    evaluated : callable
        From the nonlinear parameters of each input to an `Evaluated`.
    thetas : sequence of ndarray
        Where to begin, inside the bounds.
    structures : sequence of Structure
        One for each input.
    bounded : callable
        Keeps parameters where they are identifiable.
    counted : int
        Samples that count.
    iterations, precision, hopeless
        As for `fit_structure`.

    Returns
    -------
    Evaluated
        Where it ended.
    bool
        Whether the last step was negligible.
    """
    search = _Search(evaluated, structures, bounded, counted, iterations, precision, hopeless)
    best, converged = search.descended(evaluated(thetas))
    other = [regrouped(s, theta) for s, theta in zip(structures, best.thetas, strict=True)]
    if all(theta is None for theta in other):
        return best, converged
    grouped = [
        here if theta is None else theta for here, theta in zip(best.thetas, other, strict=True)
    ]
    again, ended = search.descended(evaluated(bounded(grouped)))
    return (again, ended) if again.cost <= best.cost else (best, converged)


@dataclass(frozen=True, slots=True)
class _Search(Generic[E]):
    """A descent from one start; the parameters are those of `climb`."""

    evaluated: Callable[[Sequence[Real]], E]
    structures: Sequence[Structure]
    bounded: Callable[[Sequence[Real]], list[Real]]
    counted: int
    iterations: int
    precision: float
    hopeless: float

    def descended(self, best: E) -> tuple[E, bool]:
        """Where it ends, and whether the last step was negligible."""
        damping, costs = _DAMPING, [best.cost]
        for _ in range(self.iterations):
            quadratic = _free_directions(best, self.bounded)
            unknowns = sum(theta.size for theta in best.thetas) + best.linear.size
            negligible = self.precision * best.cost / max(self.counted - unknowns, 1)
            decrement = quadratic.decrement
            if decrement < negligible:
                return best, True
            if best.cost - decrement > max(self.hopeless, best.cost / TWICE**2):
                return best, False
            lower = self._lower(best, quadratic, damping, negligible)
            if lower is None:
                return best, True  # no descent: a kink, or the limit of the arithmetic
            fell, refused = best.cost - lower.best.cost, lower.damping > damping
            best, damping = lower.best, lower.damping
            costs.append(best.cost)
            near = decrement < _NEAR * negligible and _remaining(decrement, fell) < negligible
            if near or (fell < negligible and damping <= 10 * _DAMPING):
                return best, True
            creeps = fell < _CREEPS * negligible and _recent(costs) < _CREEPS * negligible
            if creeps or _ends_above(costs, self.hopeless, self.iterations):
                return best, False
            if fell < _POORLY * lower.predicted:
                damping *= 2.0
            elif fell > _WELL * lower.predicted and not refused:
                damping = max(damping / 10.0, 1e-9)
        return best, False

    def _lower(
        self, best: E, quadratic: "_Quadratic", damping: float, negligible: float
    ) -> "_Lower[E] | None":
        """A step that lowers the cost, with as much damping as it takes; None without one."""
        here, moment = np.concatenate(best.thetas), quadratic.moment
        sizes = [theta.size for theta in best.thetas]
        while True:
            step = np.zeros(here.size)
            step[quadratic.free] = solved(quadratic.normal, moment, damping)
            each = zip(self.structures, best.thetas, parts_of(step, sizes), strict=True)
            share = min(_limited(s, t, d) for s, t, d in each)
            moved = self.bounded(parts_of(here + share * step, sizes))
            trial = self.evaluated(moved)
            taken = (np.concatenate(moved) - here)[quadratic.free]
            predicted = float(taken @ (2.0 * moment - quadratic.normal @ taken))
            if trial.cost < best.cost:
                return _Lower(trial, predicted, damping)
            if damping > _STEEPEST or abs(predicted) < negligible:
                return None
            damping *= 10.0


@dataclass(frozen=True, slots=True)
class _Lower(Generic[E]):
    """A step that lowers the cost: where it ends, the gain that was predicted, and its damping."""

    best: E
    predicted: float
    damping: float


@dataclass(frozen=True, slots=True)
class _Quadratic:
    """The cost around a point, along the parameters that no bound holds (`free`).

    The decrement is what a full step would still gain.
    """

    free: Mask
    normal: Real
    moment: Real
    decrement: float


def _free_directions(
    best: Evaluated, bounded: Callable[[Sequence[Real]], list[Real]]
) -> _Quadratic:
    """The quadratic model of the cost, by normal equations.

    A parameter is held where descent leads it out of its bounds (D. P. Bertsekas, SIAM J. Control
    Optim. 20, 1982); the others then move as if it were known.
    """
    normal, moment = best.normal()
    down = np.concatenate(best.thetas) + _NUDGE * np.sign(moment)
    inside = bounded(parts_of(down, [theta.size for theta in best.thetas]))
    free = np.concatenate(inside) == down
    if not free.all():
        normal, moment = normal[np.ix_(free, free)], moment[free]
    toward = solved(normal, moment) if free.any() else moment
    return _Quadratic(free, normal, moment, float(toward @ moment))


def _remaining(decrement: float, fell: float) -> float:
    """Gain that remains after a step that should have gained its decrement but gained `fell`.

    If the curvature is wrong by a share ρ, the step gains less by ρ of the decrement, and ρ² of
    it remains; if the third derivative is the cause, 9/4 as much.
    """
    return 2.25 * (decrement - fell) * ((decrement - fell) / decrement)  # of any unit


def _recent(costs: list[float]) -> float:
    """Average gain of the latest steps; infinite after too few."""
    known = len(costs) > _IN_A_ROW
    return (costs[-_IN_A_ROW - 1] - costs[-1]) / _IN_A_ROW if known else np.inf


def _ends_above(costs: list[float], hopeless: float, iterations: int) -> bool:
    """Whether a search at its pace so far would still end above a hopeless cost.

    In a parabola that allows steps of one size only, the root of the cost falls at a steady pace.
    """
    done = len(costs) - 1
    if done < 2 * _IN_A_ROW or costs[-1] <= hopeless:
        return False
    first, last, enough = np.sqrt([costs[0], costs[-1], hopeless])
    return bool(last - enough > (first - last) / done * (iterations - done))


def _limited(structure: Structure, theta: Real, step: Real) -> float:
    """Share of a step that changes no coefficient by too much."""
    share, start = 1.0, 1
    for order in structure.sections:
        share = min(share, 1.0 / max(abs(step[start]), 1e-300))
        if order == 2:
            room = max(1.0, theta[start + 1])
            share = min(share, room / max(abs(step[start + 1]), 1e-300))
        start += order
    return share
