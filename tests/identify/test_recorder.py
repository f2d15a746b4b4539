"""Samples that the recorder lost do not count; what the unit did receive stays."""

import numpy as np
import pytest

import hmpim
from hmpim.identify.recorder import find_pulses, find_standstills

FS = 200.0
T = np.arange(2000) / FS
U = np.sin(2 * np.pi * (0.1 * T + 0.9 * T**2))
UNIT = hmpim.Sensor(delay=0.02, natural_frequency=8.0, damping_ratio=0.5, noise_std=0.01)


def answered(u, intersample="bandlimited"):
    return UNIT.respond(u, fs=FS, rng=1, intersample=intersample)


def identified(u, y):
    return hmpim.identify(hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=FS)).pairs[0]


def codes(pair):
    return {warning.code for warning in pair.warnings}


def glitch(u):
    u[900] += 30.0


def copies(u):
    for k in np.arange(40, 2000, 47):
        u[k] = u[k - 1]


def standstill(u):
    u[501:560] = u[500]


@pytest.mark.parametrize(
    ("spoil", "code"),
    [(glitch, "input_spikes"), (copies, "input_repeated"), (standstill, "input_frozen")],
)
def test_what_the_recorder_of_the_input_lost_does_not_count(spoil, code):
    u = U.copy()
    spoil(u)
    pair = identified(u, answered(U))
    assert code in codes(pair)
    assert pair.verdict == "ok"
    assert pair.delay.value == pytest.approx(0.02, abs=3e-4)
    assert pair.natural_frequency.value == pytest.approx(8.0, rel=0.01)
    assert pair.noise_std.value == pytest.approx(0.01, rel=0.1)


@pytest.mark.parametrize("spoil", [glitch, copies, standstill])
def test_what_the_unit_received_stays(spoil):
    u = U.copy()
    spoil(u)
    pair = identified(u, answered(u, "zoh"))
    assert not codes(pair) & {"input_spikes", "input_repeated", "input_frozen"}
    assert pair.delay.value == pytest.approx(0.02, abs=3e-4)


def test_a_word_for_no_value_is_left_out():
    y = answered(U)
    y[700:712] = y[1300:1306] = -9999.0
    pair = identified(U, y)
    assert "fixed_word" in codes(pair)
    assert pair.verdict == "ok"
    assert pair.noise_std.value == pytest.approx(0.01, rel=0.1)


def test_an_input_recorded_by_a_slower_clock_is_interpolated():
    pair = identified(U[np.arange(U.size) // 4 * 4], answered(U))
    (finding,) = (w for w in pair.warnings if w.code == "input_slow")
    assert finding.severity == "info"
    assert pair.delay.value == pytest.approx(0.02, abs=1e-3)


@pytest.mark.parametrize("is_held", [False, True])
def test_an_input_that_may_be_held_or_recorded_slowly_has_intervals_for_both(is_held):
    smooth = np.sin(2 * np.pi * (0.1 * T + 0.1 * T**2))
    u = smooth[np.arange(U.size) // 4 * 4]
    noise = 0.1 * np.random.default_rng(0).standard_normal(U.size)
    pair = identified(u, noise + (answered(u, "zoh") if is_held else answered(smooth)))
    (finding,) = (w for w in pair.warnings if w.code == "input_slow")
    assert finding.severity == "doubt"
    low, high = pair.delay_low_frequency.ci95
    assert low < 0.02 + 2.0 * 0.5 / (2 * np.pi * 8.0) < high
    assert high - low == pytest.approx(0.5 / 50.0 + 2 * 1e-3, abs=1e-3)  # and the noise


def test_a_converter_slower_than_the_record_stays_held():
    u = U[np.arange(U.size) // 4 * 4]
    pair = identified(u, answered(u, "zoh"))
    assert "input_slow" not in codes(pair)
    assert pair.intersample == "zoh"
    assert pair.delay.value == pytest.approx(0.02, abs=3e-4)


def test_two_inputs_are_each_mended():
    rng = np.random.default_rng(3)
    v = np.convolve(rng.standard_normal(1007), np.ones(8) / 8, "valid")
    y = answered(U)[:1000] + 0.5 * hmpim.Sensor(delay=0.01, time_constant=0.05).respond(
        v, fs=FS, rng=2, intersample="bandlimited"
    )
    u, w = U[:1000].copy(), v.copy()
    u[500] += 30.0
    w[700] -= 20.0
    result = hmpim.identify(
        hmpim.Record.from_arrays({"u": u, "v": w}, {"y": y}, fs=FS),
        structures=["first_order", "second_order"],
    )
    assert [warning.code for warning in result["y", "u"].warnings].count("input_spikes") == 2
    assert result["y", "u"].delay.value == pytest.approx(0.02, abs=5e-4)
    assert result["y", "v"].delay.value == pytest.approx(0.01, abs=2e-3)


@pytest.mark.parametrize("seed", range(5))
def test_ordinary_inputs_have_no_pulses(seed):
    rng = np.random.default_rng(seed)
    valid = np.ones(T.size, dtype=bool)
    for u in (U, rng.standard_normal(T.size), np.sign(rng.standard_normal(500)).repeat(4)):
        assert find_pulses(u, valid) is None
        assert find_standstills(u) is None
