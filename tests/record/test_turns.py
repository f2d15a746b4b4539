"""Angles and counters that start again after a turn continue; other jumps stay as they are."""

import numpy as np
import pytest

import hmpim
from hmpim.record import Record, uniform
from hmpim.record.turns import continue_turns, turn_of

T = np.arange(2000) / 200.0
SWEEP = np.sin(2 * np.pi * (0.1 * T + 0.9 * T**2))


@pytest.mark.parametrize(
    ("turn", "unit", "amplitude"),
    [(360.0, "deg", 500.0), (360.0, "", 5.0), (2 * np.pi, "rad", 3.0), (65536.0, "", 30_000.0)],
)
def test_a_wrapped_motion_is_found_again(turn, unit, amplitude):
    motion = amplitude * SWEEP * np.exp(-T)
    motion = np.rint(motion) if turn == 65536.0 else motion
    record = Record.from_arrays(
        {"u": SWEEP}, {"y": np.mod(motion, turn)}, fs=200.0, units={"y": unit}
    )
    aligned = uniform(record)
    assert aligned.outputs[0].values == pytest.approx(motion, abs=1e-9 * turn)
    assert aligned.inputs[0].values is record.inputs[0].values
    (finding,) = aligned.findings
    assert finding.code == "wrapped"
    assert f"about {turn:.6g}" in finding.message


@pytest.mark.parametrize(
    "values",
    [
        180.0 * np.sign(SWEEP + 1e-3),  # a binary command
        360.0 * (SWEEP > 0) + 0.1 * np.sin(40 * T),  # a step response without a wrap
        179.0 * np.random.default_rng(0).uniform(-1, 1, T.size),  # white, in the range of an angle
        np.where(T == 5.0, 350.0, SWEEP),  # a spike
        np.mod(500.0 * SWEEP, 300.0),  # no turn of 300 is known
    ],
)
def test_other_jumps_stay(values):
    record = Record.from_arrays({"u": SWEEP}, {"y": values}, fs=200.0)
    assert continue_turns(record).record is record


def test_a_unit_that_is_no_angle_excludes_it():
    angle = np.mod(5.0 * SWEEP, 360.0)
    assert turn_of(angle) == 360.0
    assert turn_of(angle, "V") is None


def test_a_sawtooth_command_is_no_counter():
    sawtooth = np.mod(np.arange(5000.0), 1024.0)
    assert turn_of(sawtooth) == 1024.0
    assert turn_of(sawtooth, command=True) is None


def test_a_gimbal_around_zero_is_identified():
    unit = hmpim.Sensor(delay=0.02, natural_frequency=8.0, damping_ratio=0.5, noise_std=0.01)
    y = unit.respond(5.0 * SWEEP, fs=200.0, rng=1, intersample="bandlimited")
    u = np.mod(5.0 * SWEEP, 360.0)
    pair = hmpim.identify(Record.from_arrays({"u": u}, {"y": np.mod(y, 360.0)}, fs=200.0)).pairs[0]
    assert pair.verdict == "ok"
    assert pair.delay.value == pytest.approx(0.02, abs=2e-4)
    assert [w.code for w in pair.warnings].count("wrapped") == 2
