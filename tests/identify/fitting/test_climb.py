"""When a search gives up: on costs that are known in closed form."""

from dataclasses import dataclass

import numpy as np

from hmpim.identify.fitting.climb import climb
from hmpim.model.dynamics import STRUCTURES


@dataclass
class Parabola:
    """floor + scale (t - t0)² of the logarithm t of a time constant, its curvature overstated."""

    thetas: list
    floor: float
    scale: float
    t0: float
    overstated: float

    linear = np.zeros(1)

    @property
    def cost(self):
        return self.floor + self.scale * (self.thetas[0][1] - self.t0) ** 2

    def normal(self):
        curvature = np.diag([1.0, self.scale * self.overstated])
        return curvature, np.array([0.0, self.scale * (self.t0 - self.thetas[0][1])])


def climbed(t, *, floor, scale, t0, overstated=1.0, counted=1000, hopeless=np.inf):
    """Climb from t; return the end, whether it converged, and how many evaluations it took."""
    taken = []

    def evaluated(thetas):
        taken.append(thetas)
        return Parabola(list(thetas), floor, scale, t0, overstated)

    end, converged = climb(
        evaluated,
        [np.array([0.0, t])],
        structures=[STRUCTURES["first_order"]],
        bounded=list,
        counted=counted,
        iterations=40,
        precision=1e-2,
        hopeless=hopeless,
    )
    return end.thetas[0][1], converged, len(taken)


def test_a_parabola_ends_in_a_step_or_two():
    t, converged, taken = climbed(0.5, floor=1.0, scale=1.0, t0=0.0)
    assert converged
    assert abs(t) < 1e-3
    assert taken <= 3


def test_a_search_that_creeps_is_given_up():
    """Steps that gain less than ten negligible gains; a negligible gain is 1e-5 here."""
    creeping = {"floor": 1.0, "scale": 1.0, "t0": 0.0, "overstated": 1000.0}
    _, converged, taken = climbed(0.15, **creeping)  # gains 4.5e-5 a step
    assert not converged
    assert taken == 6
    _, converged, taken = climbed(0.5, **creeping)  # 5e-4: that matters
    assert not converged
    assert taken == 41


def test_a_search_that_would_end_far_above_hopeless_is_given_up():
    """A step changes a time constant by e at most: a thousand such steps are too many."""
    far = {"floor": 0.0, "scale": 1.0, "t0": 1000.0}
    t, converged, taken = climbed(0.0, **far, hopeless=1.0)
    assert not converged
    assert taken == 11
    assert t == 10.0
    assert climbed(0.0, **far)[2] == 41
    t, converged, _ = climbed(0.0, floor=1e-3, scale=1.0, t0=30.0, hopeless=1.0)
    assert converged  # 30 of 40 steps are enough
    assert abs(t - 30.0) < 1e-3
