"""Saturation, data hold and quantisation of a simulated sensor, found from the record alone."""

import numpy as np
import pytest
from scipy import signal

import hmpim
from tests_support import assert_share, holds, room

TRUTH = {
    "delay": 0.05,
    "scale_factor": 1.0,
    "bias": 0.1,
    "natural_frequency": 10.0,
    "damping_ratio": 0.4,
}
AT = np.arange(2000) / 200.0
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
        {"u": record.inputs[0].values},
        {"y": record.outputs[0].values},
        fs=200.0,
        intersample="bandlimited",
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


@pytest.mark.parametrize(("std", "verdict"), [(0.1, "ok"), (0.3, "doubtful")])
def test_noise_on_the_measured_input_is_said_with_what_it_costs(std, verdict):
    sensor = hmpim.Sensor(delay=0.05, natural_frequency=10.0, damping_ratio=0.4, noise_std=0.02)
    record = hmpim.run(sensor, STIMULUS, rng=1)
    u = record.inputs[0].values
    measured = u + std * np.random.default_rng(3).standard_normal(u.size)
    pair = hmpim.identify(
        hmpim.Record.from_arrays({"u": measured}, {"y": record.outputs[0].values}, fs=200.0),
        structures=["second_order"],
    )["y", "u"]
    message = next(w.message for w in pair.warnings if w.code == "input_noise")
    assert float(message.split("noise of ")[1].split()[0]) == pytest.approx(std, rel=0.1)
    # Of the input's power within the sweep, 0.5 is motion and a fifth of std² noise.
    share = 100 * 0.2 * std**2 / (0.5 + 0.2 * std**2)
    assert float(message.split("about ")[1].split()[0]) == pytest.approx(share, rel=0.3)
    assert pair.verdict == verdict


def test_a_noisy_clipped_static_sensor_stays_static():
    y_true = 1.2 * np.roll(np.sin(2 * np.pi * (0.1 * AT + 0.995 * AT**2)), 10)
    y_true[:10] = 0.0
    y = np.clip(y_true + 0.05 * np.random.default_rng(1).standard_normal(AT.size), -0.8, 0.8)
    u = np.sin(2 * np.pi * (0.1 * AT + 0.995 * AT**2))
    record = hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=200.0, intersample="bandlimited")
    pair = hmpim.identify(record)["y", "u"]
    assert pair.structure == "static"
    assert abs(pair.scale_factor.value - 1.2) < 4 * pair.scale_factor.std
    assert abs(pair.delay.value - 0.05) < 4 * pair.delay.std


@pytest.mark.few(8)
def test_a_third_clipped_leaves_no_bias(seeds):
    pairs = [found(seed, saturation_high=0.6) for seed in range(seeds)]
    for name, value in TRUTH.items():
        estimates = [getattr(pair, name) for pair in pairs]
        off = [(estimate.value - value) / estimate.std for estimate in estimates]
        assert abs(np.mean(off)) < 0.2 + room(seeds), name
    inside = [[holds(getattr(pair, name), TRUTH[name]) for name in TRUTH] for pair in pairs]
    assert_share(inside, at_least=0.92, at_most=0.98)


def test_both_levels_behind_a_loud_noise_are_left_out_of_a_new_fit():
    """The samples on them bent the first fit."""
    sensor = hmpim.Sensor(delay=0.15, natural_frequency=10.0, damping_ratio=0.4, bias=0.6)
    record = hmpim.run(sensor, STIMULUS, rng=0)
    u, ideal = record.inputs[0].values, record.outputs[0].values
    noisy = ideal + 0.05 * np.random.default_rng([3, 7]).standard_normal(ideal.size)
    low, high = np.quantile(ideal, [1 / 6, 5 / 6])
    y = np.clip(noisy, low, high)
    pair = hmpim.identify(hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=200.0))["y", "u"]
    assert pair.verdict == "ok"
    assert (pair.saturation_low.value, pair.saturation_high.value) == pytest.approx((low, high))
    assert pair.noise_std.value == pytest.approx(0.05, rel=0.1)
    assert holds(pair.natural_frequency, 10.0)
    assert holds(pair.damping_ratio, 0.4)


def spoiled(y, kept=slice(None)):
    record = hmpim.run(
        hmpim.Sensor(
            delay=0.05, natural_frequency=10.0, damping_ratio=0.4, bias=0.1, noise_std=0.02
        ),
        STIMULUS,
        rng=4,
    )
    values = y(record.outputs[0].values)
    bare = hmpim.Record.from_arrays(
        {"u": record.inputs[0].values[kept]},
        {"y": values[kept]},
        time=AT[kept],
        intersample="bandlimited",
    )
    return hmpim.identify(bare)["y", "u"]


def test_a_spike_that_is_clipped_is_not_taken_for_the_plateau():
    def beyond(y):
        y = y.copy()
        y[[150, 430, 901]] += 5.0  # where the output is low
        return np.clip(y, -np.inf, 0.6)

    pair = spoiled(beyond)
    assert pair.saturation_high.value == pytest.approx(0.6, abs=1e-6)
    assert pair.noise_std.value == pytest.approx(0.02, rel=0.1)
    assert_true(pair)


def test_a_step_is_found_where_the_output_is_clipped_on_no_level():
    pair = spoiled(lambda y: np.clip(0.025 * np.rint(y / 0.025), -np.inf, 0.6123))
    assert pair.quantization_step.value == pytest.approx(0.025, rel=1e-6)


def test_samples_filled_in_are_on_no_level():
    kept = np.random.default_rng(0).uniform(size=2000) > 0.05
    pair = spoiled(lambda y: 0.025 * np.rint(y / 0.025), kept)
    assert "gaps" in codes(pair)
    assert pair.quantization_step.value == pytest.approx(0.025, rel=1e-6)


def identified(u, y):
    return hmpim.identify(hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=200.0))["y", "u"]


@pytest.mark.parametrize("seed", [4, 5, 9, 10, 11])
def test_a_record_that_begins_under_way_is_not_clipped_there(seed):
    """A binary sequence at full swing from the first sample on, a lag at rest until then."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], 400), 5)
    kept = np.exp(-1 / (200.0 * 0.03))
    y = signal.lfilter([0.0, 1.0 - kept], [1.0, -kept], u)
    pair = identified(u, y + 0.01 * rng.standard_normal(u.size))
    assert pair.saturation_high is None
    assert pair.saturation_low is None
    assert holds(pair.time_constant, 0.03)


@pytest.mark.parametrize("seed", [15, 33])
def test_an_output_that_settles_is_not_clipped_where_the_model_expects_no_more(seed):
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-2.0, -1.0, 0.0, 1.0, 2.0], 10), 200)
    omega, damping = 2 * np.pi * rng.uniform(3, 9), rng.uniform(0.3, 0.9)
    lag = ([omega**2], [1.0, 2 * damping * omega, omega**2])
    above, below, _ = signal.cont2discrete(lag, 1 / 200.0)
    y = signal.lfilter(above[0], below, u)
    y = y + np.std(y) * 10 ** (-rng.uniform(25, 50) / 20) * rng.standard_normal(u.size)
    pair = identified(u, y)
    assert pair.saturation_high is None
    assert holds(pair.damping_ratio, damping)


@pytest.mark.parametrize("seed", [0, 1])
def test_clipping_does_not_speak_against_a_band_limited_input(seed):
    """The samples inside the range are no fair choice: by those a linear input is likelier."""
    t = np.arange(2000) / 1000.0
    u = np.sin(2 * np.pi * (5.0 * t + 36.25 * t**2))
    sensor = hmpim.Sensor(
        delay=0.0013, natural_frequency=40, damping_ratio=0.3, scale_factor=1.4, noise_std=0.05
    )
    y = sensor.respond(u, fs=1000.0, intersample="bandlimited", rng=seed)
    record = hmpim.Record.from_arrays({"u": u}, {"y": np.minimum(y, np.quantile(y, 0.65))}, fs=1e3)
    pair = hmpim.identify(record)["y", "u"]
    assert pair.intersample == "bandlimited"
    assert abs(pair.delay.value - 0.0013) < 5e-5
    assert "saturation" in codes(pair)
