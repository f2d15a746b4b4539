"""Every effect of Fig. 1 in one record, and none in a clean one."""

import numpy as np
import pytest

from hmpim.errors import RecordError
from hmpim.identify.effects import inspect_effects
from hmpim.rigs import Sensor

FS = 200.0
T = np.arange(2000) / FS
CHIRP = np.sin(2 * np.pi * (0.1 * T + 19.9 / 20 * T * T))
IDEAL = {"delay": 0.15, "natural_frequency": 10.0, "damping_ratio": 0.4, "bias": 0.6}


def test_all_at_once():
    sensor = Sensor(
        **IDEAL,
        noise_std=0.02,
        saturation_high=1.2,
        hold_period=1 / 60,
        hold_phase=0.002,
        quantization_step=0.05,
    )
    ideal = Sensor(**IDEAL).respond(CHIRP, fs=FS)
    prediction = np.concatenate([ideal[:1], ideal[:-1]])  # the hold, on average
    found = inspect_effects(
        CHIRP,
        sensor.respond(CHIRP, fs=FS, rng=2),
        FS,
        prediction=prediction,
        band=(0.1, 20),
        unit="deg",
    )
    assert found.saturation.high == pytest.approx(1.2)
    assert found.saturation.low is None
    assert found.hold.period == pytest.approx(1 / 60, abs=3 * found.hold.std)
    assert found.quantization.step == pytest.approx(0.05)
    assert {f.code for f in found.findings} >= {"saturation", "hold"}
    said = {f.code: f.message for f in found.findings}
    assert "clipped at 1.2 deg" in said["saturation"]
    assert "60 Hz" in said["hold"]


def test_rounding_is_worth_a_sentence_only_where_it_makes_the_noise():
    for noise, expected in ((0.002, True), (0.1, False)):
        sensor = Sensor(**IDEAL, noise_std=noise, quantization_step=0.05)
        prediction = Sensor(**IDEAL).respond(CHIRP, fs=FS)
        found = inspect_effects(
            CHIRP, sensor.respond(CHIRP, fs=FS, rng=1), FS, prediction=prediction, band=(0.1, 20)
        )
        assert found.quantization.step == pytest.approx(0.05)
        assert ("quantization" in {f.code for f in found.findings}) is expected


def test_drift_a_line_and_a_noisy_input():
    rng = np.random.default_rng(0)
    y = Sensor(**IDEAL).respond(CHIRP, fs=FS)
    measured = y + 0.05 * rng.standard_normal(2000) + 0.02 * T + 0.1 * np.sin(2 * np.pi * 50 * T)
    noisy = CHIRP + 0.1 * rng.standard_normal(2000)
    found = inspect_effects(noisy, measured, FS, prediction=y + 0.1, band=(0.1, 20), unit="deg")
    said = {f.code: f.message for f in found.findings}
    assert set(said) == {"drift", "noise_line", "input_noise"}
    assert "50 Hz" in said["noise_line"]
    assert found.drift.slope == pytest.approx(0.02, abs=3 * found.drift.std)
    assert "per second" in said["drift"]


@pytest.mark.slow
@pytest.mark.parametrize("colour", [0.0, 0.9])
def test_a_plain_sensor_raises_no_alarm(seeds, colour):
    prediction = Sensor(**IDEAL).respond(CHIRP, fs=FS)
    alarms = 0
    for seed in range(seeds):
        sensor = Sensor(**IDEAL, noise_std=0.1, noise_colour=colour)
        y = sensor.respond(CHIRP, fs=FS, rng=seed)
        found = inspect_effects(CHIRP, y, FS, prediction=prediction, band=(0.1, 20))
        alarms += bool(found.findings)
    assert alarms <= max(1, 0.01 * seeds)


def test_unequal_lengths_are_refused():
    with pytest.raises(RecordError, match="the prediction 4"):
        inspect_effects(CHIRP, CHIRP, FS, prediction=[0.0, 1.0, 2.0, 3.0], band=(0.1, 20))
