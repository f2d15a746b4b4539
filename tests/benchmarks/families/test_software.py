"""Software under test, sample over sample."""

import numpy as np
import pytest
from families.software import Filter, alpha_beta, figures_of


def test_six_samples_at_200_hz_are_30_ms():
    found = figures_of(Filter(top=np.array([2.0]), below=np.ones(1), late=6), 200.0)
    assert found["delay"] == 0.03
    assert found["scale_factor"] == 2.0
    assert found["bandwidth_phase90"] == pytest.approx(1 / (4 * 0.03), rel=1e-6)


def test_the_tracker_predicts_and_corrects():
    alpha, beta = 0.4, 0.1
    u = np.random.default_rng(0).standard_normal(50)
    x, v, expected = u[0], 0.0, []
    for measured in u:
        x += v
        left = measured - x
        x, v = x + alpha * left, v + beta * left
        expected.append(x)
    assert alpha_beta(alpha, beta).run(u) == pytest.approx(np.array(expected))


def test_a_sine_comes_out_as_the_response_says():
    unit = Filter(top=np.array([0.2, 0.1]), below=np.array([1.0, -0.7]), late=3)
    t = np.arange(600) / 100.0
    out = unit.run(np.sin(2 * np.pi * 4 * t))
    value = unit.response(np.array([4.0]), 100.0)[0]
    expected = (value * np.exp(2j * np.pi * 4 * t)).imag
    assert out[200:] == pytest.approx(expected[200:], abs=1e-12)
    assert unit.run(np.full(20, 3.0)) == pytest.approx(np.full(20, 3.0))
