"""Spikes and standstill: found where they are, left out, and nowhere else."""

import numpy as np
import pytest

import hmpim
from hmpim.identify.effects.lost_samples import find_frozen, find_repeated, find_spikes, find_stuck
from tests_support import in_studies

FS = 200.0
T = np.arange(2000) / FS
STIMULUS = hmpim.Stimulus(waveform=hmpim.Chirp(band=(0.1, 20.0), duration=10.0), fs=FS)
CHIRP = np.sin(2 * np.pi * (0.1 * T + 19.9 / 20 * T * T))


LOST = np.array([100, 400, 700, 900, 1100, 1302, 1501])


def noisy(seed=0, std=0.05):
    return CHIRP + std * np.random.default_rng(seed).standard_normal(T.size)


def test_every_spike_and_no_other_sample_is_found():
    y, where = noisy(), np.array([5, 300, 301, 1500, 1990])
    y[where] += [2.0, -3.0, -2.5, 2.0, 4.0]
    # The stimulus moves fast at the end, where a spike must be larger.
    assert np.flatnonzero(find_spikes(y, CHIRP)).tolist() == where.tolist()


def test_a_spike_beside_fast_motion_stands_out_of_samples_as_fast():
    fast, small = np.sin(0.45 * np.pi * np.arange(2000)), noisy(std=0.005) - CHIRP
    y, where = fast + small, np.array([400, 1203])
    y[where] += [2.2, -2.6]
    y[700] = fast[701]  # late, which is no spike
    assert np.flatnonzero(find_spikes(y, fast)).tolist() == where.tolist()


def test_what_lasts_longer_is_no_spike():
    y = noisy()
    y[300:310] += 5.0
    assert find_spikes(y, CHIRP) is None


def test_a_misfit_that_grows_with_frequency_is_no_spike():
    assert find_spikes(noisy(std=0.005), CHIRP * (1 - 0.03 * T)) is None


def test_an_edge_that_comes_a_sample_late_is_no_spike():
    square = np.sign(np.sin(2 * np.pi * 0.7 * T + 0.1))
    late = np.concatenate([square[:1], square[:-1]])
    assert find_spikes(0.9 * square, late) is None


def test_clipped_samples_are_not_looked_at():
    y = np.minimum(noisy(std=0.01), 0.3)
    assert find_spikes(y, CHIRP, clipped=y == 0.3) is None


def test_standstill_is_found_from_its_second_sample_on():
    y = noisy()
    y[400:900] = y[400]
    frozen = find_frozen(y, CHIRP)
    assert np.flatnonzero(frozen).tolist() == list(range(401, 900))


def test_a_plateau_at_the_extreme_is_clipping_and_no_standstill():
    y = np.minimum(noisy(), 0.5)
    assert find_frozen(y, CHIRP) is None


def test_an_output_whose_input_rests_does_not_stand_still():
    y = noisy()
    y[:600] = 0.0
    assert find_frozen(y, np.where(np.arange(T.size) < 600, 0.0, CHIRP)) is None


@pytest.mark.parametrize("step", [0.02, 0.1])
def test_a_rounded_output_does_not_stand_still(step):
    y = step * np.rint(noisy() / step)
    assert find_frozen(y, CHIRP, step=step) is None


def test_an_output_that_is_stuck_to_its_end_is_found_without_a_model():
    y = noisy()
    assert find_stuck(y, [CHIRP]) is None
    y[600:] = y[600]
    assert np.flatnonzero(find_stuck(y, [CHIRP])).tolist() == list(range(601, T.size))
    resting = np.where(np.arange(T.size) < 600, CHIRP, 0.0)
    assert find_stuck(y, [resting]) is None
    assert find_stuck(np.minimum(y, y[600]), [CHIRP]) is None  # clipped


@pytest.mark.parametrize(
    ("stuck", "noise"),
    [
        (slice(600, None), 0.0),
        (slice(600, None), 0.1),
        (slice(500, 1500), 0.1),
        *in_studies((slice(500, 1500), 0.0)),
    ],
)
def test_a_stuck_sensor_is_identified_from_what_it_said_before_and_after(noise, stuck):
    sensor = hmpim.Sensor(
        delay=0.15, natural_frequency=10.0, damping_ratio=0.4, bias=0.6, noise_std=noise
    )
    record = hmpim.run(sensor, STIMULUS, rng=0)
    u, y = record.inputs[0].values, record.outputs[0].values.copy()
    y[stuck] = y[stuck.start]
    pair = hmpim.identify(hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=FS))["y", "u"]
    assert "frozen" in {finding.code for finding in pair.warnings}
    assert pair.delay.verdict == "doubtful"
    low, high = pair.delay.ci95
    slack = 0.5 * (high - low)
    assert low - slack < 0.15 < high + slack
    assert pair.natural_frequency.value == pytest.approx(10.0, rel=0.2)


def test_spikes_cost_next_to_nothing():
    sensor = hmpim.Sensor(delay=0.05, natural_frequency=10.0, damping_ratio=0.4, noise_std=0.02)
    record = hmpim.run(sensor, STIMULUS, rng=1)
    y, rng = record.outputs[0].values.copy(), np.random.default_rng(2)
    plain = hmpim.identify(record)["y", "u"]
    y[rng.choice(2000, 40, replace=False)] += rng.choice([-5.0, 5.0], 40)
    pair = hmpim.identify(
        hmpim.Record.from_arrays({"u": record.inputs[0].values}, {"y": y}, fs=FS)
    )["y", "u"]
    assert pair.verdict == "ok"
    assert "spikes" in {w.code for w in pair.warnings}
    assert pair.noise_std.value == pytest.approx(0.02, rel=0.08)
    for name in ("delay", "scale_factor", "natural_frequency", "damping_ratio"):
        estimate = getattr(pair, name)
        assert estimate.std == pytest.approx(getattr(plain, name).std, rel=0.15), name


def test_a_lost_frame_at_a_crest_is_found_beside_others():
    y = noisy(std=0.02)
    crest = int(np.argmax(y))
    lost = np.sort([*LOST, crest + 1])
    y[lost] = y[lost - 1]
    assert np.flatnonzero(find_repeated(y)).tolist() == lost.tolist()


def test_a_level_that_is_met_again_is_no_lost_frame_nor_are_two_alike_at_a_crest():
    y = noisy(std=0.02)
    y[LOST] = y[LOST - 1]
    clipped = np.minimum(y, 0.99)
    assert np.flatnonzero(find_repeated(clipped)).tolist() == LOST.tolist()
    crest = int(np.argmax(y))
    alone = noisy(std=0.02)
    alone[crest + 1] = alone[crest]
    assert find_repeated(alone) is None
