"""Saturation, data hold and quantisation of a simulated sensor, found from the record alone."""

import numpy as np
import pytest

import hmpim

TRUTH = {
    "delay": 0.05,
    "scale_factor": 1.0,
    "bias": 0.1,
    "natural_frequency": 10.0,
    "damping_ratio": 0.4,
}
STIMULUS = hmpim.Stimulus(waveform=hmpim.Chirp(band=(0.1, 20.0), duration=10.0), fs=200.0)


def found(seed=1, **effects):
    sensor = hmpim.Sensor(
        delay=0.05,
        natural_frequency=10.0,
        damping_ratio=0.4,
        bias=0.1,
        noise_std=0.02,
        **effects,
    )
    record = hmpim.run(sensor, STIMULUS, rng=seed)
    bare = hmpim.Record.from_arrays(
        {"u": record.inputs[0].values}, {"y": record.outputs[0].values}, fs=200.0
    )
    return hmpim.identify(bare)["y", "u"]


def assert_true(pair, *, within=4.0):
    for name, value in TRUTH.items():
        estimate = getattr(pair, name)
        assert abs(estimate.value - value) < within * estimate.std, name


def codes(pair):
    return {w.code for w in pair.warnings}


def test_a_clean_sensor_has_none():
    pair = found()
    for name in ("saturation_low", "saturation_high", "hold_period", "quantization_step"):
        assert getattr(pair, name) is None
    assert not codes(pair) & {"saturation", "hold", "quantization"}


@pytest.mark.parametrize(
    "levels",
    [
        {"saturation_high": 0.4},
        {"saturation_low": -0.5, "saturation_high": 0.7},
    ],
)
def test_clipped_samples_count_as_beyond_the_level(levels):
    pair = found(**levels)
    for name, level in levels.items():
        assert getattr(pair, name).value == pytest.approx(level, abs=1e-6)
    assert "saturation" in codes(pair)
    assert pair.structure == "second_order"
    assert_true(pair)
    assert pair.noise_std.value == pytest.approx(0.02, rel=0.08)


@pytest.mark.parametrize("period", [1 / 30, 0.03])
def test_a_held_output_gives_its_period_and_the_delay_of_its_values(period):
    pair = found(hold_period=period)
    assert pair.hold_period.value == pytest.approx(period, rel=1e-3)
    assert "hold" in codes(pair)
    assert_true(pair)


def test_rounding_is_measured_and_said_where_it_matters():
    coarse, fine = found(quantization_step=0.1), found(quantization_step=0.003)
    assert coarse.quantization_step.value == pytest.approx(0.1, rel=1e-6)
    assert fine.quantization_step.value == pytest.approx(0.003, rel=1e-6)
    assert "quantization" in codes(coarse)
    assert "quantization" not in codes(fine)
    assert_true(fine)


@pytest.mark.slow
def test_a_third_clipped_leaves_no_bias(seeds):
    errors, inside, total = {name: [] for name in TRUTH}, 0, 0
    for seed in range(seeds // 2):
        pair = found(seed, saturation_high=0.6)
        for name, value in TRUTH.items():
            estimate = getattr(pair, name)
            errors[name].append((estimate.value - value) / estimate.std)
            inside += estimate.ci95[0] <= value <= estimate.ci95[1]
            total += 1
    for name, off in errors.items():
        assert abs(np.mean(off)) < 0.2 + 3 / np.sqrt(len(off)), name
    assert 0.91 < inside / total < 0.985
