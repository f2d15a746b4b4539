"""Derivatives in closed form against differences, and the free response against a later start."""

import numpy as np
import pytest

from hmpim.identify.fitting.fit import Problem, fit_structure, fit_together
from hmpim.identify.fitting.rows import Part
from hmpim.model.dynamics import STRUCTURES
from hmpim.model.sampled import prepare_input


def _record(size=600):
    time = np.arange(size) / 200.0
    return np.sin(2 * np.pi * (0.5 * time + 3.0 * time**2)) + 0.2


def _problem(u, y, **rest):
    return Problem(
        source=prepare_input(u, "bandlimited"), y=y, valid=None, longest_delay=200.0, **rest
    )


def _theta(structure, delay):
    values = [delay]
    for k, order in enumerate(structure.sections):
        values += [np.log(8.0 + 5.0 * k), 0.7][:order]
    return np.array(values)


@pytest.mark.parametrize("name", list(STRUCTURES))
def test_slopes_are_derivatives(name):
    structure, u = STRUCTURES[name], _record()
    problem = _problem(u, u, begins=30)
    theta = _theta(structure, 12.3)
    rng = np.random.default_rng(1)
    part = Part(problem, structure, theta)
    numerator = rng.standard_normal(part.rows.shape[0])
    initial = rng.standard_normal(part.free.shape[0])
    slopes = part.slopes(numerator, initial)
    for i in range(theta.size):
        sides = []
        for sign in (1.0, -1.0):
            moved = theta.copy()
            moved[i] += sign * 1e-6
            there = Part(problem, structure, moved)
            sides.append(numerator @ there.rows + initial @ there.free)
        numerical = (sides[0] - sides[1]) / 2e-6
        np.testing.assert_allclose(slopes[i], numerical, atol=1e-5 * np.abs(numerical).max())


def test_a_record_cut_in_mid_motion_gives_what_the_whole_one_gives():
    structure, u = STRUCTURES["second_order"], _record(1200)
    theta = np.array([9.4, np.log(6.0), 1.5])
    whole = Part(_problem(u, u), structure, theta)
    y = whole.driven(np.array([2.0])) + 0.6
    begins = 20
    valid = np.arange(800) >= begins
    late = Problem(
        source=prepare_input(u[400:], "bandlimited"),
        y=y[400:],
        valid=valid,
        longest_delay=200.0,
        begins=begins,
    )
    fit = fit_structure(late, structure, theta + np.array([0.5, 0.1, -0.2]), precision=1e-9)
    assert fit.converged
    np.testing.assert_allclose(fit.theta, theta, rtol=1e-4)
    np.testing.assert_allclose(fit.linear, [2.0, 0.6], rtol=1e-4)


def test_two_inputs_and_a_drift_are_found_in_one_fit():
    rng = np.random.default_rng(3)
    first, second = STRUCTURES["second_order"], STRUCTURES["first_order"]
    u, v = _record(), np.convolve(rng.standard_normal(600), np.ones(4) / 4, "same")
    drift = np.linspace(-1.0, 1.0, 600)
    one, two = _problem(u, u), _problem(v, u)
    theta = [np.array([9.4, np.log(6.0), 1.5]), np.array([3.2, np.log(5.0)])]
    y = Part(one, first, theta[0]).driven(np.array([2.0]))
    y = y + Part(two, second, theta[1]).driven(np.array([0.5]))
    y = y + 0.6 + 0.3 * drift
    problems = [_problem(w, y, nuisance=drift[None, :]) for w in (u, v)]
    found = fit_together(
        problems, [first, second], [theta[0] + 0.1, theta[1] - 0.1], precision=1e-9
    )
    for fit, truth, gain in zip(found, theta, (2.0, 0.5), strict=True):
        np.testing.assert_allclose(fit.theta, truth, rtol=1e-4)
        assert fit.linear[0] == pytest.approx(gain, rel=1e-4)
    assert found[0].linear[-1] == pytest.approx(0.6, rel=1e-4)
    assert found[0].nuisance[0] == pytest.approx(0.3, rel=1e-4)


def test_an_input_about_ten_million_is_answered_as_one_about_zero():
    structure, u = STRUCTURES["second_order"], _record(600)
    theta = np.array([9.4, np.log(6.0), 1.5])
    y = Part(_problem(u, u), structure, theta).driven(np.array([2.0])) + 0.6
    start = theta + np.array([0.5, 0.1, -0.2])
    plain, far = (
        fit_structure(_problem(u + level, y), structure, start, precision=1e-9)
        for level in (0.0, 1e7)
    )
    np.testing.assert_allclose(far.theta, plain.theta, rtol=1e-6)
    np.testing.assert_allclose(far.linear, plain.linear - [0.0, 2e7], rtol=1e-6)
