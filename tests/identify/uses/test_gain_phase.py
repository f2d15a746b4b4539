"""Gain and phase at chosen frequencies, measured and modelled, against the truth."""

import json

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson
from scipy.signal import freqz, lfilter

import hmpim
from hmpim.identify import gain_and_phase
from hmpim.model import RationalDelay, phase, response
from hmpim.model.dynamics import second_order_coefficients
from tests_support import assert_share, holds, in_studies

WANTED = (1.0, 5.0, 10.0, 15.0)
TRUTH = RationalDelay(
    delay=0.15,
    numerator=np.array([1.0]),
    denominator=np.concatenate([[1.0], second_order_coefficients(10.0, 0.4)]),
)


@pytest.mark.few(12)
def test_intervals_hold_the_truth(field_record, seeds):
    _, u, y = field_record
    gain = 20 * np.log10(np.abs(response(TRUTH, np.array(WANTED))))
    turned = np.degrees(phase(TRUTH, np.array(WANTED)))
    inside, apart = [], []
    for seed in range(seeds):
        noise = 0.1 * np.random.default_rng(seed).standard_normal(y.size)
        result = hmpim.identify(hmpim.Record.from_arrays({"u": u}, {"y": y + noise}, fs=200.0))
        found = gain_and_phase(result["y", "u"], WANTED, fs=200.0)
        levels = [holds(at.model_gain_db, one) for at, one in zip(found, gain, strict=True)]
        phases = [holds(at.model_phase, one) for at, one in zip(found, turned, strict=True)]
        inside.append(levels + phases)
        apart.append(
            [(at.phase.value - one) / at.phase.std for at, one in zip(found, turned, strict=True)]
        )
    assert_share(inside, at_least=0.94, at_most=0.96)
    assert_share(np.abs(apart) < 2, at_least=0.94)


def test_beyond_the_band_only_the_model_answers_and_a_file_keeps_it(field_record):
    _, u, y = field_record
    y = 3.0 - 2.0 * y + 0.01 * np.random.default_rng(0).standard_normal(y.size)
    result = hmpim.identify(hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=200.0))
    again = hmpim.Identification.from_dict(json.loads(json.dumps(result.to_dict())))
    for one in (result, again):
        inside, beyond = gain_and_phase(one["y", "u"], [10.0, 40.0], fs=200.0)
        assert (beyond.gain_db, beyond.phase) == (None, None)
        there = np.array([10.0, 40.0])
        gain = 20 * np.log10(2 * np.abs(response(TRUTH, there)))
        for reading, truth in zip((inside, beyond), gain, strict=True):
            assert abs(reading.model_gain_db.value - truth) < 4 * reading.model_gain_db.std
        # A negative scale factor is half a turn more.
        turned = np.degrees(phase(TRUTH, there[:1])[0]) + 180
        assert abs(inside.model_phase.value - turned) < 4 * inside.model_phase.std
        assert abs(inside.phase.value - turned) < 4 * inside.phase.std


def test_refusals(field_record):
    _, u, y = field_record
    noise = np.random.default_rng(0).standard_normal(y.size)
    record = hmpim.Record.from_arrays({"u": u}, {"y": y + 0.1 * noise}, fs=200.0)
    pair = hmpim.identify(record, structures=["second_order"])["y", "u"]
    with pytest.raises(hmpim.HmpimError, match="-1 Hz is not positive"):
        gain_and_phase(pair, [2.0, -1.0], fs=200.0)
    unrelated = hmpim.Record.from_arrays({"u": u}, {"y": noise}, fs=200.0)
    lost = hmpim.identify(unrelated, structures=["static", "first_order"])["y", "u"]
    with pytest.raises(hmpim.HmpimError, match="has no model with error bars"):
        gain_and_phase(lost, 2.0, fs=200.0)


@pytest.mark.parametrize("seed", [0, *in_studies(*range(1, 20))])
def test_behind_clipped_samples_the_error_of_the_model_counts(field_record, seed):
    """The model's answer stands in their place: leaving out its error, z reached 36."""
    _, u, y = field_record
    noisy = y + 0.02 * np.random.default_rng(seed).standard_normal(y.size)
    clipped = np.clip(noisy, *np.quantile(y, [0.17, 0.83]))
    record = hmpim.Record.from_arrays({"u": u}, {"y": clipped}, fs=200.0)
    pair = hmpim.identify(record, structures=["second_order"])["y", "u"]
    assert pair.saturation_low is not None
    gain = 20 * np.log10(np.abs(response(TRUTH, np.array(WANTED))))
    turned = np.degrees(phase(TRUTH, np.array(WANTED)))
    for at, one, other in zip(gain_and_phase(pair, WANTED, fs=200.0), gain, turned, strict=True):
        assert abs(at.gain_db.value - one) < 4 * at.gain_db.std
        assert abs(at.phase.value - other) < 4 * at.phase.std
        assert at.gain_db.std >= 0.99 * at.model_gain_db.std / np.sqrt(2)


@pytest.mark.parametrize("seed", [0, *in_studies(*range(1, 20))])
def test_an_integrator_starts_from_a_quarter_turn_and_ends_elsewhere(seed):
    """Where its output ends leaked into the measured response, ten standard deviations."""
    fine = np.arange(0, 10, 1 / 6400)
    moved = cumulative_simpson(np.sin(2 * np.pi * (0.1 * fine + fine**2)), x=fine, initial=0)
    t = fine[::32]
    u = np.sin(2 * np.pi * (0.1 * t + t**2))
    y = np.concatenate([np.zeros(6), moved[::32]])[: t.size]  # 0.03 s later
    y += 5e-3 * np.random.default_rng(seed).standard_normal(t.size)
    result = hmpim.identify(hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=200.0))
    assert result["y", "u"].structure == "integrator"
    for at in gain_and_phase(result["y", "u"], [0.5, 2.0, 12.0], fs=200.0):
        turned = -90 - 360 * at.frequency * 0.03
        gain = -20 * np.log10(2 * np.pi * at.frequency)
        for value, truth in (
            (at.model_phase, turned),
            (at.phase, turned),
            (at.model_gain_db, gain),
            (at.gain_db, gain),
        ):
            assert abs(value.value - truth) < 4.5 * value.std


def test_a_tracker_whose_last_coefficient_is_zero():
    """An alpha-beta tracker: fitted with two zeros, of which it has one."""
    above, below = [0.5, -0.3], [1.0, -1.3, 0.5]
    u = np.random.default_rng(0).standard_normal(400)
    record = hmpim.Record.from_arrays({"u": u}, {"y": lfilter(above, below, u)}, fs=100.0)
    pair = hmpim.identify(record, intersample="sampled")["y", "u"]
    (at,) = gain_and_phase(pair, 7.0, fs=100.0)
    truth = 20 * np.log10(abs(freqz(above, below, [7.0], fs=100.0)[1][0]))
    assert at.model_gain_db.value == pytest.approx(truth, abs=1e-9)
