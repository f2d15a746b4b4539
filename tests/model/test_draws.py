"""Models drawn from a covariance."""

from dataclasses import replace

import numpy as np
import pytest

from hmpim.errors import ArgumentError
from hmpim.model import Model, Spread, coefficient_vector, draw_models, frequency_response

COVARIANCE = np.array(
    [
        [1e-8, 0.0, 0.0, 2e-9],
        [0.0, 4e-4, 0.0, 0.0],
        [0.0, 0.0, 1e-12, 1e-10],
        [2e-9, 0.0, 1e-10, 9e-8],
    ]
)
MODEL = Model(
    delay=0.1,
    scale_factor=2.0,
    denominator=(2.5e-4, 0.0127, 1.0),
    bias=0.5,
    noise_std=0.1,
    spread=Spread(covariance=tuple(map(tuple, COVARIANCE.tolist())), bias=0.02, noise_std=0.005),
)


def test_draws_have_the_mean_and_covariance_they_are_drawn_from():
    drawn = draw_models(MODEL, 2000, rng=1)
    vectors = np.array([coefficient_vector(m) for m in drawn])
    scale = np.sqrt(np.diag(COVARIANCE))
    away = (vectors - coefficient_vector(MODEL)) / scale
    assert np.abs(away.mean(axis=0)).max() < 4 / np.sqrt(2000)
    assert np.cov(away.T) == pytest.approx(COVARIANCE / np.outer(scale, scale), abs=0.08)
    assert np.std([m.bias for m in drawn]) == pytest.approx(0.02, rel=0.06)
    assert np.std([m.noise_std for m in drawn]) == pytest.approx(0.005, rel=0.06)


def test_draws_carry_the_spread_of_the_response():
    f = np.array([5.0])
    gains = [abs(frequency_response(m, f)[0]) for m in draw_models(MODEL, 2000, rng=2)]
    s = 2j * np.pi * f
    below = 1 + 0.0127 * s + 2.5e-4 * s**2
    slope = np.array([0, 0.5, *(-np.concatenate([s**2, s]) / below)]) * (2 / abs(below))
    turned = slope.copy()
    first_order = np.sqrt(np.real(turned).T @ COVARIANCE @ np.real(turned))
    assert np.std(gains) == pytest.approx(first_order, rel=0.1)


def test_draws_are_reproducible_and_their_own():
    assert draw_models(MODEL, 3, rng=5) == draw_models(MODEL, 3, rng=5)
    assert draw_models(MODEL, 3, rng=5) != draw_models(MODEL, 3, rng=6)
    assert draw_models(MODEL, 0) == ()
    assert all(m.spread is None for m in draw_models(MODEL, 2, rng=1))


def test_an_integrator_keeps_its_pole_at_zero():
    spread = Spread(covariance=((1e-8, 0.0, 0.0), (0.0, 1e-4, 0.0), (0.0, 0.0, 1e-6)))
    model = Model(delay=0.1, scale_factor=1.0, denominator=(0.05, 1.0, 0.0), spread=spread)
    drawn = draw_models(model, 50, rng=0)
    assert all(m.denominator[-1] == 0.0 and m.denominator[-2] == 1.0 for m in drawn)
    assert np.std([m.denominator[0] for m in drawn]) == pytest.approx(1e-3, rel=0.4)


def test_what_cannot_be_drawn_is_refused():
    with pytest.raises(ArgumentError, match="says nothing of its errors"):
        draw_models(replace(MODEL, spread=None), 1)
    with pytest.raises(ArgumentError, match="2 by 2 for 4 coefficients"):
        draw_models(replace(MODEL, spread=Spread(covariance=((1.0, 0.0), (0.0, 1.0)))), 1)
    with pytest.raises(ArgumentError, match="count = -1"):
        draw_models(MODEL, -1)


def test_without_error_every_draw_is_the_model():
    known = replace(MODEL, spread=Spread(covariance=((0.0,) * 4,) * 4))
    (drawn,) = draw_models(known, 1, rng=0)
    assert coefficient_vector(drawn) == pytest.approx(coefficient_vector(MODEL))
    assert drawn.bias == MODEL.bias
