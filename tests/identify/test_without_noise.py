"""A simulation without noise, as a first try of the tool often is: right, and not accused."""

from dataclasses import fields, replace

import numpy as np
import pytest
from scipy import signal

import hmpim
from hmpim.identify.result import Parameters
from tests_support import in_studies

FS = 200.0
POSSIBLE = [field.name for field in fields(Parameters)]


@pytest.mark.parametrize("end", [20.0, 90.0])
def test_a_simulation_without_noise_is_not_doubted(end):
    """Interpolation is all that is left, and follows the input's future; the start is a rest.

    At 90 of 100 Hz it is off by more at the end, where that future is missing.
    """
    chirp = hmpim.Stimulus(waveform=hmpim.Chirp(band=(0.1, end), duration=10.0), fs=FS)
    sensor = hmpim.Sensor(delay=0.15, natural_frequency=10.0, damping_ratio=0.4)
    record = hmpim.run(sensor, chirp, rng=0)
    u, y = record.inputs[0].values, record.outputs[0].values
    (pair,) = hmpim.identify(hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=FS))
    found = {name: getattr(pair, name) for name in ("delay", "natural_frequency", "damping_ratio")}
    assert {name: e.value for name, e in found.items()} == pytest.approx(
        {"delay": 0.15, "natural_frequency": 10.0, "damping_ratio": 0.4}, rel=1e-7
    )
    assert {n for n in POSSIBLE if (e := getattr(pair, n)) and e.verdict != "ok"} == set()
    assert not {"feedback", "frozen", "spikes"} & {w.code for w in pair.warnings}
    assert pair.noise_std.ci95[0] == 0.0


@pytest.mark.parametrize(
    ("samples", "seed"),
    [
        *((1000, 0), (10_000, 1), (1000, 2)),
        *in_studies((10_000, 0), (1000, 1), (10_000, 2)),
    ],
)
def test_statistics_without_noise_say_no_more_than_sums_of_squares_hold(samples, seed):
    """Half of the digits are lost where sums are subtracted; a window may be two fifths of a run.

    The runs do not begin at rest at their first input.
    """
    u = signal.lfilter([0.2], [1.0, -0.8], np.random.default_rng(seed).standard_normal(samples))
    frequency = 5.0 * (seed + 1)
    turns = 2 * np.pi * frequency
    record = held_record(u, [turns**-2, 1.0 / turns, 1.0], late=7)
    (pair,) = hmpim.identify(hmpim.compress(record, lags=400))
    assert pair.structure == "second_order"
    for name, truth in {"delay": 7 / FS, "natural_frequency": frequency, "noise_std": 0.0}.items():
        low, high = getattr(pair, name).ci95
        assert low <= truth <= high, name
        assert high - low < 1e-6 * max(truth, 1.0), name


def test_one_sine_is_told_once_that_it_shows_gain_and_phase():
    """Of figures that are not given, no remark says that their intervals cover something."""
    time = np.arange(2000) / FS
    y = np.sin(4 * np.pi * (time - 0.027)) + 0.01 * np.random.default_rng(1).standard_normal(2000)
    record = hmpim.Record.from_arrays({"u": np.sin(4 * np.pi * time)}, {"y": y}, fs=FS)
    (pair,) = hmpim.identify(record)
    assert {w.code for w in pair.warnings} == {"initial_transient", "few_lines"}


HELD = {
    "a step": np.repeat([0.0, 1.0], [100, 1900]),
    "PRBS": np.repeat(np.random.default_rng(0).integers(0, 2, 200) * 2.0 - 1.0, 10),
    "a walk": np.cumsum(np.random.default_rng(0).standard_normal(2000)) * 0.1,
}


def held_record(u, denominator, late):
    """Samples of a system behind a held input, to the last digit."""
    top, below, _ = signal.cont2discrete(([1.0], denominator), 1 / FS, method="zoh")
    y = signal.lfilter(top.ravel(), below, np.concatenate([np.zeros(late), u])[: u.size])
    return hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=FS)


@pytest.mark.parametrize(
    ("kind", "late"),
    [
        *(("a step", 7), ("PRBS", 7), ("a walk", 0)),
        *in_studies(("a step", 0), ("PRBS", 0), ("a walk", 7)),
    ],
)
def test_a_simulation_behind_a_held_input_is_right_without_a_doubt(kind, late):
    """Rounding is neither a misfit nor a colour, and moves no output before its input."""
    omega = 2 * np.pi * 5.0
    (pair,) = hmpim.identify(held_record(HELD[kind], [omega**-2, 0.8 / omega, 1.0], late))
    assert (pair.structure, pair.intersample, pair.verdict) == ("second_order", "zoh", "ok")
    assert pair.delay.value == pytest.approx(late / FS, abs=1e-9)
    assert pair.natural_frequency.value == pytest.approx(5.0, rel=1e-9)
    assert not {w.code for w in pair.warnings} - {"initial_transient"}


def test_a_lag_behind_a_held_input_is_found_where_that_is_stated():
    """Without it the same samples are software's, one pole and a sample more of delay."""
    record = held_record(HELD["PRBS"], [0.05, 1.0], 7)
    (pair,) = hmpim.identify(record)
    assert (pair.intersample, pair.delay.value) == ("sampled", 8 / FS)
    (stated,) = hmpim.identify(record, intersample="zoh")
    assert stated.time_constant.value == pytest.approx(0.05, rel=1e-9)
    assert stated.delay.value == pytest.approx(0.035, abs=1e-9)
    assert stated.verdict == "ok"


@pytest.mark.parametrize("late", [0, 7])
def test_compressed_records_without_noise_are_identified_too(late):
    """Of sums less exact than what is left of them no colour is read."""
    omega = 2 * np.pi * 5.0
    record = held_record(HELD["PRBS"], [omega**-2, 0.8 / omega, 1.0], late)
    (pair,) = hmpim.identify(hmpim.compress(replace(record, intersample="zoh"), lags=1000))
    assert (pair.structure, pair.verdict) == ("second_order", "ok")
    assert pair.delay.value == pytest.approx(late / FS, abs=1e-6)
    assert pair.natural_frequency.value == pytest.approx(5.0, rel=1e-4)
    assert pair.noise_std.ci95[0] == 0.0
