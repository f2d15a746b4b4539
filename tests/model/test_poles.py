"""Single poles in closed form against the matrix exponential, and their slopes by differences."""

import numpy as np
import pytest

from hmpim.model.discrete import discretise
from hmpim.model.dynamics import STRUCTURES, denominator_of, numerator_of
from hmpim.model.fractions import partial_fractions
from hmpim.model.poles import PoleResponses, rational_response
from hmpim.model.response import RationalDelay, response
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
    simple, constants, _ = partial_fractions(np.eye(a.size), poles, a[-1])
    found = PoleResponses(source, delay, poles).summed(simple, direct=constants)
    for own, row in zip(found, exact, strict=True):
        np.testing.assert_allclose(own, row, atol=1e-9 * np.abs(row).max())


@pytest.mark.parametrize("mode", ["zoh", "foh", "bandlimited"])
@pytest.mark.parametrize("pole", [-0.1 + 0.3j, -0.02 + 0j, -9.0 + 0j, -1e-7 + 0j])
def test_slopes_are_derivatives_by_the_pole(sweep, mode, pole):
    source, step = prepare_input(sweep, mode), 1e-6 * max(abs(pole), 1e-3)
    both = np.array([[1.0], [-1.0j]])  # real and imaginary part
    up, down = (
        PoleResponses(source, 3.3, np.array([pole + s * step])).summed(both) for s in (1.0, -1.0)
    )
    slope = PoleResponses(source, 3.3, np.array([pole])).summed(0.0 * both, double=both)
    np.testing.assert_allclose((up - down) / (2 * step), slope, atol=2e-6 * np.abs(slope).max())


@pytest.mark.parametrize("mode", ["foh", "bandlimited"])
def test_the_rate_of_a_delayed_input_is_its_derivative(sweep, mode):
    source, step = prepare_input(sweep, mode), 1e-6
    none, one = np.zeros((1, 0)), np.ones(1)

    def input_at(delay, **kinds):
        return PoleResponses(source, delay, np.zeros(0, dtype=complex)).summed(none, **kinds)

    up, down = (input_at(3.3 + s * step, direct=one) for s in (-1.0, 1.0))
    rate = input_at(3.3, rate=one)
    np.testing.assert_allclose((up - down) / (2 * step), rate, atol=1e-6 * np.abs(rate).max())


@pytest.mark.parametrize("precision", [3e-5, 1e-7])
@pytest.mark.parametrize("delay", [-19.3, 0.0, 55.7, 700.0])
def test_a_record_of_any_length_is_answered_block_by_block(sweep, precision, delay):
    """Lengths about a multiple of a block's; 17 000 samples take two turns of blocks."""
    for samples in (4, 15, 16, 17, 600, 17_000):
        u = np.resize(sweep, samples)
        source, a = prepare_input(u, "bandlimited", precision=precision), np.array([1.0, 3.0, 20.0])
        exact = delayed_response(source, delay=delay, denominator=a)
        poles = np.roots(a[::-1]).astype(complex)
        simple, _, _ = partial_fractions(np.ones((1, 1)), poles, a[-1])
        found = PoleResponses(source, delay, poles).summed(simple)
        np.testing.assert_allclose(found, exact, atol=1e-11 * max(np.abs(exact).max(), 1.0))


def test_several_numerators_are_expanded_at_once():
    poles = np.array([-1 + 1j, -1 - 1j, -3])
    numerators = np.array([[1.0, 2.0, 0.0, 0.5], [0.0, 0.0, 1.0, 0.0]])
    simple, constant, _ = partial_fractions(numerators, poles, 2.0)
    s = 0.7j
    exact = numerators @ s ** np.arange(4) / (2 * ((s + 1) ** 2 + 1) * (s + 3))
    found = np.sum(simple / (s - poles), axis=1) + constant
    np.testing.assert_allclose(found, exact, rtol=1e-14)


EIGHT = STRUCTURES["eight_modes"]
PLACES = 0.05 * 1.35 ** np.arange(8)
"""Natural frequencies in radians per sample."""
SECTIONS = np.stack([2 * 0.03 / PLACES, 1 / PLACES**2], axis=1)
GAINS = np.array([1.0, 0.5, -0.7, 0.4, 0.9, -0.3, 0.6, 0.2])
WEIGHTS = np.concatenate([[GAINS.sum()], GAINS[1:]])


def _eight():
    coefficients = SECTIONS.ravel()
    return numerator_of(EIGHT, coefficients, WEIGHTS), denominator_of(EIGHT, coefficients)


def test_the_polynomials_of_eight_modes_are_their_sum():
    numerator, denominator = _eight()
    system = RationalDelay(delay=0.0, numerator=numerator, denominator=denominator)
    s = 1j * np.linspace(0.01, 1.0, 500)
    exact = sum(g / (1 + c1 * s + c2 * s**2) for g, (c1, c2) in zip(GAINS, SECTIONS, strict=True))
    found = response(system, s.imag / (2 * np.pi))
    np.testing.assert_allclose(found, exact, atol=1e-11 * np.abs(exact).max())


@pytest.mark.parametrize("mode", ["zoh", "foh", "bandlimited"])
def test_eight_modes_are_simulated_as_their_sum(sweep, mode):
    source, (numerator, denominator) = prepare_input(sweep, mode), _eight()
    found = rational_response(source, delay=3.3, numerator=numerator, denominator=denominator)
    exact = sum(
        g * delayed_response(source, delay=3.3, denominator=np.array([1.0, *section]))[0]
        for g, section in zip(GAINS, SECTIONS, strict=True)
    )
    np.testing.assert_allclose(found, exact, atol=1e-9 * np.abs(exact).max())


def test_eight_modes_are_stepped_exactly(sweep):
    numerator, denominator = _eight()
    system = RationalDelay(delay=3.3, numerator=numerator, denominator=denominator)
    step = discretise(system, fs=1.0, intersample="zoh")
    assert np.abs(np.linalg.eigvals(step.transition)).max() < 1.0
    source = prepare_input(sweep, "zoh")
    exact = rational_response(source, delay=3.3, numerator=numerator, denominator=denominator)
    held = np.concatenate([np.zeros(step.delay + 2), sweep - sweep[0]])
    x, y = np.zeros(step.order), []
    for k in range(sweep.size):
        v = held[k : k + 3][::-1]
        x = step.transition @ x + step.drive @ v
        y.append(step.output @ x + step.feed @ v)
    np.testing.assert_allclose(y, exact, atol=1e-9 * np.abs(exact).max())


def test_many_equal_poles_are_no_sum_of_single_ones(sweep):
    """Their residues would cancel: the companion matrix answers for them."""
    source, below = prepare_input(sweep, "foh"), np.poly(-np.ones(8))[::-1]
    once = delayed_response(source, delay=2.0, denominator=below)[0]
    found = rational_response(source, delay=2.0, numerator=np.ones(1), denominator=below)
    np.testing.assert_array_equal(found, once)
