"""Clipping: levels and samples found; crests, steps and rounding left alone."""

from functools import cache

import numpy as np
import pytest

from hmpim.identify.effects.quantization import detect_quantization
from hmpim.identify.effects.saturation import detect_saturation
from hmpim.identify.effects.smeared import smeared_plateaus
from hmpim.rigs import Sensor
from tests_support import assert_share, in_studies

FS = 200.0
T = np.arange(2000) / FS
CHIRP = np.sin(2 * np.pi * (0.1 * T + 19.9 / 20 * T * T))
SLOW = np.sin(2 * np.pi * 0.3 * T)
SQUARE = np.sign(np.sin(2 * np.pi * 0.5 * T + 0.1))
DYNAMICS = {
    "static": {},
    "second order": {"natural_frequency": 10.0, "damping_ratio": 0.4},
    "overdamped": {"natural_frequency": 10.0, "damping_ratio": 1.2},
    "first order": {"time_constant": 0.05},
    "fast": {"time_constant": 0.005},
}


def inputs(rng: np.random.Generator) -> dict[str, np.ndarray]:
    return {
        "chirp": CHIRP,
        "extinguished": CHIRP / (1 + 0.3 * T),
        "slow sine": SLOW,
        "binary": rng.choice([-1.0, 1.0], 200).repeat(10),
        "random levels": rng.uniform(-1, 1, 200).repeat(10),
        "square": SQUARE,
        "triangle": np.abs((2 * T) % 2 - 1) * 2 - 1,
        "one-sided": (1 - np.cos(2 * np.pi * (0.1 * T + 19.9 / 20 * T * T))) / 2,
        "rest first": np.concatenate([np.zeros(500), CHIRP[:1500]]),
    }


INPUTS = inputs(np.random.default_rng(5))


@cache
def ideal_response(dynamics, name, held):
    sensor = Sensor(delay=0.0123, **DYNAMICS[dynamics])
    return sensor.respond(INPUTS[name], fs=FS, intersample=held)


@pytest.mark.parametrize("dynamics", DYNAMICS, ids=str)
@pytest.mark.parametrize("step", [None, 0.05, *in_studies(0.003, 0.2)])
@pytest.mark.parametrize("noise", [0.0, 0.02, *in_studies(0.002, 0.1)])
def test_nothing_is_clipped_that_is_not(dynamics, step, noise):
    for name, u in INPUTS.items():
        held = "zoh" if name in ("binary", "random levels", "square") else "bandlimited"
        sensor = Sensor(delay=0.0123, noise_std=noise, quantization_step=step, **DYNAMICS[dynamics])
        y = sensor.respond(u, fs=FS, intersample=held, rng=5)
        ideal = ideal_response(dynamics, name, held)
        rounded = detect_quantization(y)
        found = detect_saturation(y, ideal, step=0.0 if rounded is None else rounded.step)
        assert (found.low, found.high) == (None, None), name
        assert not found.clipped.any()


@pytest.mark.parametrize("u", [CHIRP, SLOW], ids=["sweep", "slow sine"])
@pytest.mark.parametrize("step", [0.0, 0.003])
def test_an_ideal_clip_is_found_to_the_sample(u, step):
    moved = Sensor(natural_frequency=10.0, damping_ratio=0.4).respond(u, fs=FS)
    y = np.clip(moved, -0.75, 0.9)
    if step:
        y = step * np.rint(y / step)
    found = detect_saturation(y, 0.8 * moved, step=step)
    assert found.high.level == pytest.approx(0.9, abs=1e-9 + step / 2)
    assert found.low.level == pytest.approx(-0.75, abs=1e-9 + step / 2)
    assert found.noise == "before"
    differs = (moved >= 0.9 + step) & ~found.high.at
    assert not differs.any()
    assert not found.high.at[moved < 0.9 - step].any()
    assert found.high.std == pytest.approx(step / np.sqrt(12), abs=1e-9)


def test_noise_before_the_clip_repeats_the_level():
    sensor = Sensor(noise_std=0.05, saturation_high=0.7, natural_frequency=10.0, damping_ratio=0.4)
    y = sensor.respond(CHIRP, fs=FS, rng=3)
    found = detect_saturation(y, CHIRP)
    assert found.high.level == 0.7
    assert found.low is None
    assert np.array_equal(found.clipped, y == 0.7)


def test_noise_after_the_clip_leaves_a_broad_plateau():
    rng = np.random.default_rng(0)
    u = CHIRP / (1 + 0.3 * T)
    errors = []
    for _ in range(40):
        y = np.clip(u, -0.4, 0.5) + 0.05 * rng.standard_normal(2000)
        found = detect_saturation(y, 0.9 * u)
        assert found.noise == "after"
        errors.append(
            [(found.high.level - 0.5) / found.high.std, (found.low.level + 0.4) / found.low.std]
        )
    assert np.abs(np.mean(errors)) < 0.6
    assert 0.7 < np.std(errors) < 1.4


def test_a_soft_spring_is_not_a_clip():
    noise = 0.02 * np.random.default_rng(0).standard_normal(2000)
    for bent in (CHIRP - 0.2 * CHIRP**3, np.tanh(CHIRP)):
        assert smeared_plateaus(bent + noise, CHIRP) == (None, None)
        found = detect_saturation(bent + noise, CHIRP)
        assert (found.low, found.high) == (None, None)


def test_the_prediction_tells_a_square_wave_from_a_clipped_one():
    # Both have a plateau at 0.8; only one of the inputs goes on.
    u = np.clip(1.5 * np.sin(2 * np.pi * 0.5 * T), -0.8, 0.8)
    assert detect_saturation(u, u).high is None
    assert detect_saturation(u, 1.5 * np.sin(2 * np.pi * 0.5 * T)).high.level == pytest.approx(0.8)


def test_false_alarms_stay_below_one_percent(seeds):
    alarms = []
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        sensor = Sensor(
            natural_frequency=float(rng.uniform(3, 15)),
            damping_ratio=float(rng.uniform(0.1, 1.5)),
            noise_std=float(10 ** rng.uniform(-3, -1)),
            noise_colour=float(rng.choice([0.0, 0.9])),
        )
        y = sensor.respond(CHIRP, fs=FS, rng=rng)
        ideal = Sensor(
            natural_frequency=sensor.natural_frequency, damping_ratio=sensor.damping_ratio
        ).respond(CHIRP, fs=FS)
        alarms.append(detect_saturation(y, ideal).clipped.any())
    assert_share(alarms, at_most=0.01)


@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_two_plateaus_in_a_long_record_are_found(noise):
    """Their samples are one in a thousand, more than a part of the record would show."""
    rng = np.random.default_rng(3)
    y = np.sin(np.arange(200_000) / 100) + noise * rng.standard_normal(200_000)
    reach = 3.0 * np.exp(-(((np.arange(200_000) - 100_000) / 2000.0) ** 2))
    motion = y * (1.0 + reach)
    found = detect_saturation(np.minimum(motion, 3.0), motion)
    assert found.high.level == 3.0
    assert found.low is None
