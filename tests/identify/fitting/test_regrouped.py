"""Real poles that meet in two sections: the way on to a complex pair."""

import numpy as np
import pytest

from hmpim.identify.fitting.fit import Problem, fit_structure
from hmpim.identify.fitting.growth import with_pole
from hmpim.identify.fitting.regrouped import regrouped
from hmpim.model.dynamics import STRUCTURES, coefficients_of, denominator_of, theta_of
from hmpim.model.sampled import delayed_response, prepare_input

SECOND, THIRD, FOURTH = (STRUCTURES[f"{n}_order"] for n in ("second", "third", "fourth"))


def theta(structure, *coefficients):
    return np.append(3.0, theta_of(structure, np.array(coefficients)))


@pytest.mark.parametrize(
    ("structure", "coefficients"),
    [
        (THIRD, (24.0, 80.0, 4.2)),
        (FOURTH, (24.0, 80.0, 6.2, 8.4)),  # 20 and 4, 4.2 and 2
    ],
)
def test_grouped_anew_it_is_the_same_model(structure, coefficients):
    before = theta(structure, *coefficients)
    after = regrouped(structure, before)
    assert after[0] == before[0]
    own, other = (coefficients_of(structure, t[1:]) for t in (before, after))
    assert denominator_of(structure, other) == pytest.approx(denominator_of(structure, own))
    assert other[:2] == pytest.approx([8.2, 16.8])


@pytest.mark.parametrize(
    ("structure", "coefficients"),
    [
        (THIRD, (24.0, 80.0, 9.0)),  # none have met
        (THIRD, (4.0, 16.0, 4.0)),  # a complex pair
        (FOURTH, (24.0, 80.0, 4.0, 16.0)),
        (SECOND, (8.0, 16.0)),
    ],
)
def test_poles_that_have_not_met_stay(structure, coefficients):
    assert regrouped(structure, theta(structure, *coefficients)) is None


@pytest.mark.parametrize("mode", ["zoh", "bandlimited"])
def test_a_fit_gets_from_a_grown_pole_to_a_complex_pair(mode):
    """Poles of a plain fit are real there: the one added meets the faster of them."""
    t = np.arange(2000) / 200.0
    u = np.sin(2 * np.pi * (0.1 * t + 2.0 * t**2))
    source = prepare_input(u, mode)
    truth = theta(THIRD, 2.35, 2.48, 4.16)
    below = denominator_of(THIRD, coefficients_of(THIRD, truth[1:]))
    y = delayed_response(source, delay=3.0, denominator=below)[0] + u[0]
    problem = Problem(source=source, y=y, valid=None, longest_delay=800.0)
    plain = fit_structure(problem, SECOND, theta(SECOND, 5.0, 4.0))
    found = fit_structure(problem, THIRD, with_pole(SECOND, plain.theta, 1.0))
    assert found.theta == pytest.approx(truth, abs=1e-6)
