import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmpim.errors import ArgumentError
from hmpim.model import Model, simulate
from hmpim.report.paper.bound import cramer_rao, phase90, resonance_db
from hmpim.report.paper.sample import SYSTEM, sample_stimulus
from hmpim.rigs import Sensor


@pytest.fixture(scope="module")
def stimulus():
    return sample_stimulus()


def test_bound_of_fig_17(stimulus):
    bound = cramer_rao(SYSTEM, stimulus)
    assert bound.delay == pytest.approx(0.095e-3, rel=0.02)
    assert bound.natural_frequency == pytest.approx(0.030, rel=0.02)
    assert bound.damping_ratio == pytest.approx(0.0016, rel=0.04)
    assert bound.bias == pytest.approx(0.0022, rel=0.04)
    assert bound.scale_factor == pytest.approx(0.0011, rel=0.04)
    assert bound.noise_std == pytest.approx(0.1 / math.sqrt(4000))


def test_bound_agrees_with_the_one_of_the_model(stimulus):
    """Derivatives of the frequency-domain model, which shares nothing with the stepped sensor."""

    def output(delay, scale, bias, fn, zeta):
        w = 2 * np.pi * fn
        model = Model(
            delay=delay,
            scale_factor=scale,
            bias=bias,
            numerator=(w * w,),
            denominator=(1.0, 2 * zeta * w, w * w),
        )
        return simulate(model, stimulus.position, fs=stimulus.fs, intersample="bandlimited")

    at = np.array([0.15, 1.0, 0.6, 10.0, 0.4])
    rows = []
    for k in range(5):
        step = np.zeros(5)
        step[k] = 1e-4 * at[k]
        rows.append((output(*(at + step)) - output(*(at - step))) / (2 * step[k]))
    rows = np.array(rows)
    std = 0.1 * np.sqrt(np.diag(np.linalg.inv(rows @ rows.T)))
    bound = cramer_rao(SYSTEM, stimulus)
    found = [
        bound.delay,
        bound.scale_factor,
        bound.bias,
        bound.natural_frequency,
        bound.damping_ratio,
    ]
    np.testing.assert_allclose(found, std, rtol=1e-3)


def test_bound_is_in_proportion_to_the_noise(stimulus):
    one, two = (cramer_rao(replace(SYSTEM, noise_std=s), stimulus) for s in (0.1, 0.2))
    assert two.delay == pytest.approx(2 * one.delay)
    assert two.bandwidth_phase90 == pytest.approx(2 * one.bandwidth_phase90)
    assert two.peak_gain_db == pytest.approx(2 * one.peak_gain_db)


@given(delay=st.floats(0.0, 0.3), natural=st.floats(1.0, 50.0), damping=st.floats(0.05, 2.0))
def test_phase_is_a_quarter_turn_there(delay, natural, damping):
    f = phase90(delay, natural, damping)
    s = 1j * f / natural
    response = np.exp(-2j * np.pi * f * delay) / (1 + 2 * damping * s + s * s)
    assert abs(np.degrees(np.angle(response)) + 90.0) < 1e-4
    assert 0 < f <= natural


@pytest.mark.parametrize("damping", [0.05, 0.3, 0.6, 0.7072, 1.2])
def test_hump_is_the_greatest_gain(damping):
    s = 1j * np.linspace(0.0, 1.5, 200001)
    gain = np.abs(1 / (1 + 2 * damping * s + s * s)).max()
    assert resonance_db(damping) == pytest.approx(20 * math.log10(gain), abs=1e-6)


def test_a_sensor_without_dynamics_is_refused(stimulus):
    with pytest.raises(ArgumentError, match="no second-order dynamics"):
        cramer_rao(Sensor(noise_std=0.1), stimulus)
