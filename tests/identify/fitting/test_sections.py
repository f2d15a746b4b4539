"""Sums over poles against the rational function, and their slopes against its differences."""

import numpy as np
import pytest

from hmpim.identify.fitting.sections import poles_of
from hmpim.model.dynamics import STRUCTURES, Structure, coefficients_of, denominator_of

S = 0.3 + 0.9j
THETA = {
    "first_order": [0.3],
    "second_order": [0.4, 3.0],  # a conjugate pair
    "third_order_zeros": [0.4, 0.2, 1.1],  # three real poles, two zeros
    "two_modes": [0.4, 3.0, -0.6, 9.0],
    "integrator_second_order": [0.4, 3.0],
}


def rational(structure, theta, numerator):
    below = denominator_of(structure, coefficients_of(structure, theta))
    return (numerator @ S ** np.arange(numerator.size)) / (below @ S ** np.arange(below.size))


def value(poles, expansion):
    """What rows of single poles come to at S, both poles of each pair counted."""
    total = np.zeros(len(expansion.simple), dtype=complex)
    for k, p in enumerate(poles.upper):
        weights = [(expansion.simple[:, k], 1)]
        if expansion.double.size:
            weights.append((expansion.double[:, k], 2))
        for weight, power in weights:
            if p.imag:  # the real part of twice the one is the sum of both
                total += 0.5 * (weight / (S - p) ** power + weight.conj() / (S - p.conj()) ** power)
            else:
                total += weight.real / (S - p) ** power
    total += expansion.direct
    return total if expansion.rate is None else total + expansion.rate * S


@pytest.mark.parametrize("name", sorted(THETA))
def test_rows_are_the_rational_function(name):
    structure, theta = STRUCTURES[name], np.array(THETA[name])
    numerators = np.eye(structure.zeros + 1)[structure.dc_zeros :]
    poles = poles_of(structure, theta)
    exact = [rational(structure, theta, numerator) for numerator in numerators]
    np.testing.assert_allclose(value(poles, poles.expand(numerators)), exact, rtol=1e-12)


@pytest.mark.parametrize("name", sorted(THETA))
def test_slopes_are_derivatives(name):
    structure, theta = STRUCTURES[name], np.array(THETA[name])
    numerator = np.linspace(1.0, 0.4, structure.zeros + 1)
    poles = poles_of(structure, theta)
    by_delay, *by_sections = value(poles, poles.slopes(numerator))
    exact = -S * rational(structure, theta, numerator)
    np.testing.assert_allclose(by_delay, exact, rtol=1e-12)
    for row, found in enumerate(by_sections):
        step = 1e-6 * np.eye(theta.size)[row]
        up, down = (rational(structure, theta + s * step, numerator) for s in (1.0, -1.0))
        np.testing.assert_allclose(found, (up - down) / 2e-6, rtol=1e-8)


PAIR = Structure(name="two_modes", sections=(2, 2), zeros=3, parallel=True)


def _sum(theta, numerator):
    c1, c2, d1, d2 = coefficients_of(PAIR, theta)
    first = (numerator[0] + numerator[1] * S) / (1 + c1 * S + c2 * S**2)
    return first + (numerator[2] + numerator[3] * S) / (1 + d1 * S + d2 * S**2)


def test_sections_in_parallel_add_up():
    """One with two real poles, one with a conjugate pair."""
    theta, numerator = np.array([0.4, 0.2, -0.6, 9.0]), np.array([1.0, 0.3, -0.5, 0.2])
    poles = poles_of(PAIR, theta)
    rows = value(poles, poles.expand(np.eye(4)))
    np.testing.assert_allclose(rows @ numerator, _sum(theta, numerator), rtol=1e-12)
    by_delay, *by_sections = value(poles, poles.slopes(numerator))
    np.testing.assert_allclose(by_delay, -S * _sum(theta, numerator), rtol=1e-12)
    for row, found in enumerate(by_sections):
        step = 1e-6 * np.eye(4)[row]
        up, down = (_sum(theta + s * step, numerator) for s in (1.0, -1.0))
        np.testing.assert_allclose(found, (up - down) / 2e-6, rtol=1e-8)
