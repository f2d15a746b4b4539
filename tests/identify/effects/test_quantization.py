"""Rounding steps: found exactly, also in rounded files, and never imagined."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from hmpim.identify.effects.quantization import detect_quantization
from tests_support import examples


def sweep(amplitude: float = 10.0, samples: int = 2000) -> np.ndarray:
    t = np.arange(samples) / 200
    return amplitude * np.sin(2 * np.pi * (0.1 * t + 0.995 * t * t))


@examples(30)
@given(
    levels=st.floats(4, 1e5),
    noise=st.sampled_from([0.0, 0.1, 1.0, 10.0]),
    offset=st.floats(0, 1),
    seed=st.integers(0, 100),
)
def test_any_step_is_found_whatever_the_noise_before_it(levels, noise, offset, seed):
    step = 20.0 / levels
    clean = sweep() + noise * step * np.random.default_rng(seed).standard_normal(2000)
    y = step * np.rint(clean / step) + offset * step
    found = detect_quantization(y)
    assert found is not None
    assert found.step == pytest.approx(step, rel=1e-9)


def test_an_encoder_printed_with_six_decimals():
    step = 360 / 2**17
    y = np.array([float(f"{v:.6f}") for v in step * np.rint(sweep() / step)])
    found = detect_quantization(y)
    assert found.step == pytest.approx(step, abs=5 * found.std)
    assert found.std < 1e-10
    assert found.noise_std == pytest.approx(step / np.sqrt(12), rel=1e-6)


def test_steps_far_below_the_operating_point_are_found():
    found = detect_quantization(1e7 + 0.02 * np.rint(np.sin(np.arange(2000) / 50) / 0.02))
    assert found.step == pytest.approx(0.02, rel=1e-6)


@pytest.mark.parametrize(
    "y",
    [
        sweep(),
        sweep().astype(np.float32).astype(float),
        np.sign(sweep()),
        np.sign(sweep()) + 0.01 * np.random.default_rng(0).standard_normal(2000),
        np.clip(sweep(), -5, 5),
        np.concatenate([np.zeros(2000), sweep()]),
        np.array([float(f"{v:.4g}") for v in sweep()]),
        np.array([float(f"{v:.6g}") for v in sweep()]),
        np.full(100, 3.0),
    ],
    ids=["sweep", "float32", "square", "noisy square", "clipped", "rest", "4 g", "6 g", "constant"],
)
def test_nothing_is_imagined(y):
    assert detect_quantization(y) is None


def test_continuous_data_give_no_false_alarm(seeds):
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        n = int(rng.integers(50, 4000))
        white = rng.standard_normal(n)
        for y in (
            white,
            lfilter([1.0], [1.0, -0.9], white),
            np.cumsum(white),
            np.sin(np.arange(n) * rng.uniform(0.001, 1)),
            rng.uniform(-1, 1, n // 10 + 1).repeat(10)[:n] + 0.001 * white,
        ):
            assert detect_quantization(y) is None
