"""Rounding steps: found exactly, through noise and rounded files, and never imagined."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

import hmpim
from hmpim.identify.effects.quantization import detect_quantization, is_predicted
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
    assert found.exact


def test_an_encoder_printed_with_six_decimals():
    step = 360 / 2**17
    y = np.array([float(f"{v:.6f}") for v in step * np.rint(sweep() / step)])
    found = detect_quantization(y)
    assert found.step == pytest.approx(step, abs=5 * found.std)
    assert found.std < 1e-10
    assert found.noise_std == pytest.approx(step / np.sqrt(12), rel=1e-6)


@pytest.mark.parametrize("share", [0.05, 0.1, 0.2])
def test_a_little_noise_after_the_rounding(share):
    noise = 0.1 * share * np.random.default_rng(1).standard_normal(2000)
    found = detect_quantization(0.1 * np.rint(sweep() / 0.1) + noise)
    assert found.step == pytest.approx(0.1, abs=5 * found.std)
    assert not found.exact


def test_levels_moved_to_another_clock_still_cluster():
    t = np.arange(2000) / 200
    y = 0.1 * np.rint(10 * np.sin(2 * np.pi * 0.3 * t) / 0.1)
    moved = np.random.default_rng(0).uniform(-1e-3, 1e-3, t.size)
    found = detect_quantization(np.interp(t + moved, t, y))
    assert found.step == pytest.approx(0.1, rel=1e-3)


def test_steps_far_below_the_operating_point_are_found():
    found = detect_quantization(1e7 + 0.02 * np.rint(np.sin(np.arange(2000) / 50) / 0.02))
    assert found.step == pytest.approx(0.02, rel=1e-6)
    assert found.exact


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


HELD = [(8, 0.0), (16, 0.0), (16, 0.14), (5, 0.5)]
"""Levels of an input, and the pole of a unit that settles before the next one."""


def held(levels: int, pole: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    u = np.repeat(np.random.default_rng(seed).integers(0, levels, 100), 20) / levels
    return u, 0.2 + 1.3 * lfilter([1.0 - pole], [1.0, -pole], np.concatenate([u[:1], u[:-1]]))


@pytest.mark.parametrize(("levels", "pole"), HELD)
def test_levels_of_a_held_input_are_no_rounding_of_the_output(levels, pole):
    for seed in range(4):
        u, clean = held(levels, pole, seed)
        y = clean + 0.004 * np.random.default_rng(seed).standard_normal(u.size)
        record = hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=100.0)
        pair = hmpim.identify(record, intersample="zoh")["y"]
        assert pair.parameters.quantization_step is None
        assert "quantization" not in [warning.code for warning in pair.warnings]


@pytest.mark.parametrize(("levels", "pole"), HELD[1:])
@pytest.mark.parametrize("before", [0.0, 0.05, 0.6])
@pytest.mark.parametrize("after", [0.0, 0.05])
def test_rounding_of_an_answer_to_a_held_input_stays_seen(levels, pole, before, after):
    """Steps that are not the levels' own, under noise of up to 0.6 of them before rounding."""
    step, steps = 0.029, []
    for seed in range(4):
        _, clean = held(levels, pole, seed)
        rng = np.random.default_rng([1, seed])
        y = step * np.rint(clean / step + before * rng.standard_normal(clean.size))
        y += after * step * rng.standard_normal(clean.size)
        found = detect_quantization(y)
        if found is not None:
            assert not is_predicted(found, y, clean)
            steps.append(found.step)
    assert len(steps) >= 3
    assert steps == pytest.approx([step] * len(steps), rel=0.01)
