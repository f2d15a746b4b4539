"""Single poles in closed form against the matrix exponential, and their slopes by differences."""

import numpy as np
import pytest

from hmpim.model.poles import PoleResponses, input_responses, partial_fractions
from hmpim.model.sampled import delayed_response, prepare_input


@pytest.fixture(scope="module")
def sweep():
    time = np.arange(600) / 200.0
    return np.sin(2 * np.pi * (0.1 * time + 9.0 * time**2)) + 0.3


@pytest.mark.parametrize("mode", ["zoh", "foh", "bandlimited"])
@pytest.mark.parametrize("delay", [30.3, -1.7, 0.0, 7.0])
@pytest.mark.parametrize("denominator", [[1.0, 3.0, 20.0], [1.0, 5.0], [1.0, 9.0, 14.0]])
def test_a_sum_of_poles_is_the_rational_system(sweep, mode, delay, denominator):
    source, a = prepare_input(sweep, mode), np.array(denominator)
    exact = delayed_response(source, delay=delay, denominator=a, powers=a.size)
    poles = np.roots(a[::-1]).astype(complex)
    answers = PoleResponses(source, delay, poles).values
    fed = input_responses(source, delay, slopes=False)[0]
    for i, row in enumerate(exact):
        simple, constant, _ = partial_fractions(np.eye(a.size)[i : i + 1], poles, a[-1])
        found = (simple[0] @ answers).real + constant[0] * fed
        np.testing.assert_allclose(found, row, atol=1e-9 * np.abs(row).max())


@pytest.mark.parametrize("mode", ["zoh", "foh", "bandlimited"])
@pytest.mark.parametrize("pole", [-0.1 + 0.3j, -0.02 + 0j, -9.0 + 0j, -1e-7 + 0j])
def test_slopes_are_derivatives_by_the_pole(sweep, mode, pole):
    source, step = prepare_input(sweep, mode), 1e-6 * max(abs(pole), 1e-3)
    up, down = (
        PoleResponses(source, 3.3, np.array([pole + s * step])).values[0] for s in (1.0, -1.0)
    )
    slope = PoleResponses(source, 3.3, np.array([pole])).slopes()[0]
    np.testing.assert_allclose((up - down) / (2 * step), slope, atol=2e-6 * np.abs(slope).max())


@pytest.mark.parametrize("mode", ["foh", "bandlimited"])
def test_the_rate_of_a_delayed_input_is_its_derivative(sweep, mode):
    source, step = prepare_input(sweep, mode), 1e-6
    up, down = (input_responses(source, 3.3 + s * step, slopes=False)[0] for s in (-1.0, 1.0))
    rate = input_responses(source, 3.3, slopes=True)[1]
    np.testing.assert_allclose((up - down) / (2 * step), rate, atol=1e-6 * np.abs(rate).max())


def test_several_numerators_are_expanded_at_once():
    poles = np.array([-1 + 1j, -1 - 1j, -3])
    numerators = np.array([[1.0, 2.0, 0.0, 0.5], [0.0, 0.0, 1.0, 0.0]])
    simple, constant, _ = partial_fractions(numerators, poles, 2.0)
    s = 0.7j
    exact = numerators @ s ** np.arange(4) / (2 * ((s + 1) ** 2 + 1) * (s + 3))
    found = np.sum(simple / (s - poles), axis=1) + constant
    np.testing.assert_allclose(found, exact, rtol=1e-14)
