"""Modes and their errors, read off the coefficients."""

import numpy as np
import pytest

from hmpim.model import Model, Spread, coefficient_vector

PAIRS = ((3.1, 0.03), (5.2, 0.05), (8.6, 0.04), (14.3, 0.03), (23.7, 0.05), (34.9, 0.9))


def below(pairs: tuple[tuple[float, float], ...] = PAIRS) -> tuple[float, ...]:
    product = np.ones(1)
    for natural, damping in pairs:
        omega = 2 * np.pi * natural
        product = np.polymul(product, [omega**-2, 2 * damping / omega, 1.0])
    return tuple(product.tolist())


@pytest.mark.parametrize("behind", [(), (0.02, 1.0), (1.0, 0.0)])
def test_each_mode_is_found_and_no_lag_or_integrator_taken_for_one(behind):
    whole = np.polymul(below(), behind) if behind else np.array(below())
    model = Model(delay=0.0, scale_factor=2.0, denominator=tuple(whole))
    found = [(mode.natural_frequency, mode.damping_ratio) for mode in model.modes]
    assert np.array(found) == pytest.approx(np.array(PAIRS), rel=1e-8)
    assert all(mode.natural_frequency_std is None for mode in model.modes)


@pytest.mark.parametrize("integrates", [False, True])
def test_errors_are_those_of_small_changes_of_the_coefficients(integrates):
    behind = (1.0, 0.0) if integrates else (0.02, 1.0)
    rng = np.random.default_rng(3)
    plain = Model(
        delay=0.1, scale_factor=2.0, denominator=tuple(np.polymul(below(PAIRS[:3]), behind))
    )
    vector = coefficient_vector(plain)
    count = vector.size - 2
    mixed = 1e-5 * rng.standard_normal((count, count)) * vector[2:, None]
    covariance = np.zeros((vector.size, vector.size))
    covariance[2:, 2:] = mixed @ mixed.T

    def figures(change: np.ndarray) -> np.ndarray:
        moved = np.array(plain.denominator)
        moved[:count] += change
        one = Model(delay=0.1, scale_factor=2.0, denominator=tuple(moved))
        return np.array([[m.natural_frequency, m.damping_ratio] for m in one.modes])

    slopes = np.array([(figures(1e-3 * row) - figures(-1e-3 * row)) / 2e-3 for row in mixed.T])
    spread = Spread(covariance=tuple(map(tuple, covariance.tolist())))
    found = Model(delay=0.1, scale_factor=2.0, denominator=plain.denominator, spread=spread).modes
    stated = [[m.natural_frequency_std, m.damping_ratio_std] for m in found]
    assert np.array(stated) == pytest.approx(np.sqrt(np.sum(slopes**2, axis=0)), rel=1e-4)


def test_software_has_none():
    filtered = Model(
        delay=0.0, scale_factor=1.0, denominator=(1.0, -1.2, 0.5), intersample="sampled", fs=100.0
    )
    assert filtered.modes == ()
