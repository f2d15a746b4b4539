"""Gain and phase at chosen frequencies, measured and modelled, against the truth."""

import json

import numpy as np
import pytest

import hmpim
from hmpim.identify import gain_and_phase
from hmpim.model import RationalDelay, phase, response
from hmpim.model.dynamics import second_order_coefficients

WANTED = (1.0, 5.0, 10.0, 15.0)
TRUTH = RationalDelay(
    delay=0.15,
    numerator=np.array([1.0]),
    denominator=np.concatenate([[1.0], second_order_coefficients(10.0, 0.4)]),
)


@pytest.mark.slow
def test_intervals_hold_the_truth(field_record, seeds):
    _, u, y = field_record
    gain = 20 * np.log10(np.abs(response(TRUTH, np.array(WANTED))))
    turned = np.degrees(phase(TRUTH, np.array(WANTED)))
    inside, apart = [], []
    for seed in range(seeds):
        noise = 0.1 * np.random.default_rng(seed).standard_normal(y.size)
        result = hmpim.identify(hmpim.Record.from_arrays({"u": u}, {"y": y + noise}, fs=200.0))
        found = gain_and_phase(result["y", "u"], WANTED, fs=200.0)
        for k, at in enumerate(found):
            for value, truth in ((at.model_gain_db, gain[k]), (at.model_phase, turned[k])):
                inside.append(value.ci95[0] <= truth <= value.ci95[1])
            apart.append((at.phase.value - turned[k]) / at.phase.std)
    chance = 3 * np.sqrt(0.05 * 0.95 / len(inside) * 4)  # figures of one record go together
    assert np.mean(inside) == pytest.approx(0.95, abs=0.01 + chance)
    assert np.mean(np.abs(apart) < 2) > 0.9


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
    pair = hmpim.identify(hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=200.0))["y", "u"]
    with pytest.raises(hmpim.HmpimError, match="-1 Hz is not positive"):
        gain_and_phase(pair, [2.0, -1.0], fs=200.0)
    noise = np.random.default_rng(0).standard_normal(y.size)
    lost = hmpim.identify(hmpim.Record.from_arrays({"u": u}, {"y": noise}, fs=200.0))["y", "u"]
    with pytest.raises(hmpim.HmpimError, match="not identifiable"):
        gain_and_phase(lost, 2.0, fs=200.0)
