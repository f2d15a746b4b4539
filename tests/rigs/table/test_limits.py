"""Limits are law: refused before anything moves, and kept by servo, torque and stops."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hmpim.errors import ArgumentError, LimitsError, RigError, UnitError
from hmpim.experiment import run
from hmpim.rigs.table import AXES, FIG_4, MotionTable, TablePosition
from hmpim.rigs.table import table as room
from hmpim.rigs.table.servo import RESERVE, Gains
from hmpim.rigs.table.simulate import Motion
from hmpim.stimulus import Limits, Ramp, Sine, Step, Stimulus, design
from tests_support import in_studies

pytest.importorskip("mujoco")

RNG = np.random.default_rng(0)


def sine(amplitude, frequency, duration=1.0, fs=500.0, unit="deg"):
    waveform = Sine(amplitude=amplitude, frequency=frequency, duration=duration)
    return Stimulus(waveform=waveform, fs=fs, unit=unit)


@pytest.fixture
def unmoved(monkeypatch):
    """Whatever is simulated although it should not be fails the test."""

    def move(*_args, **_kwargs):
        pytest.fail("the table moved")

    monkeypatch.setattr(room, "Motion", move)


@pytest.mark.parametrize(
    ("axis", "stimulus", "words"),
    [
        ("yaw", sine(56.0, 0.5), "peak position 56 deg is beyond the limit 55 deg of yaw"),
        (
            "pitch",
            sine(-121.0, 0.2, duration=2.0),
            "peak position 121 deg .* limit 120 deg of pitch",
        ),
        ("roll", sine(65.0, 2.0), "peak velocity 816.8.. deg/s .* limit 800 deg/s of roll"),
        ("azimuth", sine(7.2, 2.0), "peak acceleration 1136.98 deg/s² .* 1000 .* azimuth"),
        ("elevation", sine(1.0, 5.0), "peak acceleration 986.96 deg/s² .* 900 deg/s² of elevation"),
        ("roll", sine(1.2, 2.0, unit="rad"), "peak velocity 864 deg/s .* 800 deg/s of roll"),
        (
            "pitch",
            Stimulus(waveform=Step(amplitude=1.0, duration=1.0), fs=500.0, unit="deg"),
            "peak (velocity|acceleration) .* is beyond the limit .* of pitch; ",
        ),
    ],
)
def test_each_limit_of_fig_4_is_checked_before_anything_moves(unmoved, axis, stimulus, words):
    with pytest.raises(LimitsError, match=rf"{words}"):
        run(MotionTable(), {axis: stimulus}, rng=RNG)


def test_travel_counts_from_where_the_axis_starts(unmoved):
    table = MotionTable(start=TablePosition(yaw=-30.0))
    with pytest.raises(LimitsError, match="peak position 26 deg is beyond the limit 25 deg of yaw"):
        run(table, {"yaw": sine(26.0, 0.5)}, rng=RNG)
    with pytest.raises(
        LimitsError, match=r"leaves 25 deg of travel .* less than the 30 deg wanted"
    ):
        table.limits_of("yaw", travel=30.0)
    with pytest.raises(LimitsError, match="start of yaw = 55 deg leaves 0 deg of travel"):
        MotionTable(start=TablePosition(yaw=55.0))


def test_a_sweep_that_stops_short_while_others_go_on_is_refused(unmoved):
    short = Stimulus(waveform=Ramp(rate=100.0, duration=0.5), fs=500.0, unit="deg")
    table = MotionTable()
    table.check({"roll": short})
    with pytest.raises(LimitsError, match=r"peak acceleration 50000 deg/s² .* of roll"):
        run(table, {"roll": short, "pitch": sine(1.0, 1.0, duration=2.0)}, rng=RNG)


def test_axes_that_keep_their_limits_alone_may_not_together(unmoved):
    """At yaw 40°, sin 40° of pitch's acceleration is roll's to carry, on top of its own."""
    table = MotionTable(start=TablePosition(yaw=40.0))
    roll = sine(0.99 * 33_000 / (40 * math.pi) ** 2, 20.0)
    pitch = sine(0.99 * 14_000 / (40 * math.pi) ** 2, 20.0)
    for axis, stimulus in (("roll", roll), ("pitch", pitch)):
        alone = np.abs(table.check({axis: stimulus})).max(axis=0)
        assert np.all(alone < [spec.torque_limit for spec in FIG_4])
    with pytest.raises(LimitsError, match=r"at 0\.\d+ s the motion of all axes .* of roll, beyond"):
        run(table, {"roll": roll, "pitch": pitch}, rng=RNG)


def test_a_jerk_limit_of_an_axis_is_checked_too(unmoved):
    table = MotionTable()
    limits = table.limits_of("pitch", travel=2.0, share=0.5)
    gentle = design(band=(0.5, 15.0), duration=2.0, fs=500.0, limits=limits, axis="pitch")
    table.check(gentle)
    stiff = replace(FIG_4[2], limits=replace(FIG_4[2].limits, jerk=0.5 * gentle.peaks.jerk))
    careful = MotionTable(specs=(*FIG_4[:2], stiff, *FIG_4[3:]))
    with pytest.raises(LimitsError, match=r"peak jerk .* deg/s³ of pitch; scale the stimulus by 0"):
        run(careful, gentle, rng=RNG)
    # and a stimulus designed in the axis's limits keeps it
    within = careful.limits_of("pitch", travel=2.0, share=0.5)
    assert within.jerk == 0.25 * gentle.peaks.jerk
    calm = design(band=(0.5, 15.0), duration=2.0, fs=500.0, limits=within, axis="pitch")
    careful.check(calm)


def test_five_axes_near_their_limits_with_the_projector_are_refused_with_a_number(unmoved):
    """Each keeps Fig. 4; what the outer axes carry is heavier than what Fig. 4 was found with."""
    table = MotionTable(uut_load="bracket", target_load="projector")

    def at(share):
        made = {}
        for spec in FIG_4:
            limits = table.limits_of(spec.name, travel=1.0, share=share)
            made[spec.name] = design(
                band=(0.5, 15.0), duration=3.0, fs=500.0, limits=limits, axis=spec.name
            )
        return made

    words = r"at \d\.\d+ s the motion of all axes together takes \S+ N·m of azimuth, beyond its"
    with pytest.raises(LimitsError, match=words) as refused:
        run(table, at(0.99), rng=RNG)
    advised = float(str(refused.value).split("scale the stimuli by ")[1].split(" ")[0])
    # Torque over inertia has fallen to 760/1040 of what it was, and a quarter was in hand.
    assert advised == pytest.approx(1.25 * 760 / 1040 / 0.99, rel=0.04)
    peak = np.abs(table.check(at(0.96 * 0.99 * advised))).max(axis=0)
    assert np.all(peak < [spec.torque_limit for spec in FIG_4])
    assert peak[3] > 0.9 * FIG_4[3].torque_limit


def test_predicted_torque_is_what_the_actuators_give():
    """With all commands sent and a slow motion, the servo gives what inverse dynamics says."""
    table = MotionTable(
        mode="PVA", start=TablePosition(yaw=20.0), uut_load="bracket", encoder_noise_std=0.0
    )
    # Commanded at each tick: else the torque also follows the stairs of the held commands.
    shake = {"duration": 2.0, "fs": 2000.0}
    stimuli = {
        axis.name: sine(0.3 * axis.limits.acceleration / (4 * math.pi) ** 2, 2.0, **shake)
        for axis in FIG_4
    }
    stimuli["roll"] = sine(50.0, 2.0, **shake)
    stimuli["pitch"] = sine(12.0, 2.0, **shake)
    stimuli["yaw"] = sine(20.0, 2.0, **shake)
    predicted = table.check(stimuli)
    given = table.simulate(stimuli, rng=RNG).torque
    late = 3  # ticks: transport, and the actuator
    for i in range(5):
        gap = given[2000 + late :, i] - predicted[2000:-late, i]
        assert np.sqrt(np.mean(gap**2)) < 0.04 * np.sqrt(np.mean(predicted[2000:, i] ** 2))


def thrown(axis, angle, seconds=1.0):
    """The table after a position command that no check would let pass."""
    table = MotionTable()
    i = AXES.index(axis)
    n = round(seconds * 500)
    position, still = np.zeros((n, 5)), np.zeros((n, 5))
    position[1:, i] = math.radians(angle)
    motion = replace(table, encoder_noise_std=0.0).motion(500.0, rng=RNG)
    assert isinstance(motion, Motion)
    history = motion.advance(position, still, still)
    return history, FIG_4[i]


@pytest.mark.parametrize("axis", AXES)
def test_servo_keeps_rate_and_torque_on_a_jump(axis):
    history, spec = thrown(axis, 0.8 * 45.0)
    rate = np.abs(history.of(axis, "velocity")).max()
    assert rate < 1.05 * RESERVE * spec.limits.velocity
    torque = np.abs(history.of(axis, "torque")).max()
    assert torque <= spec.torque_limit
    assert torque > 0.9 * spec.torque_limit
    assert abs(history.of(axis)[-1] - 36.0) < 0.5


@pytest.mark.parametrize("axis", ["yaw", "elevation"])
def test_stops_hold_an_axis_that_is_driven_into_them(axis):
    history, spec = thrown(axis, 200.0, seconds=1.5)
    stop = spec.limits.position + spec.stop_margin
    assert history.of(axis).max() > stop - 0.2
    assert history.of(axis).max() < stop + 0.5
    assert abs(history.of(axis)[-1] - stop) < 0.2


def test_interlock_opens_when_an_axis_runs_away(monkeypatch):
    table = MotionTable()
    wild = Gains(position=table.gains.position, rate=-table.gains.rate, inertia=table.gains.inertia)
    monkeypatch.setattr(room, "tune", lambda *_args, **_kwargs: wild)
    with pytest.raises(RigError, match=r"interlock opened at \d\.\d+ s: \w+ turned at"):
        run(table, {"roll": sine(1.0, 2.0)}, rng=RNG)


@pytest.mark.parametrize("axis", ["pitch", *in_studies(*(a for a in AXES if a != "pitch"))])
def test_a_sweep_designed_in_an_axis_is_played(axis):
    table = MotionTable()
    limits = table.limits_of(axis, travel=2.0)
    sweep = design(band=(0.5, 15.0), duration=3.0, fs=500.0, limits=limits, axis=axis)
    record = run(table, sweep, rng=RNG)
    assert np.ptp(record.outputs[0].values) > 1.0


@pytest.mark.parametrize(
    ("stimuli", "error", "words"),
    [
        ({}, ArgumentError, "no stimulus is given"),
        ({"nod": sine(1.0, 1.0)}, ArgumentError, "axis 'nod' is not known"),
        (sine(1.0, 1.0), ArgumentError, "axis '' is not known; use one of|names no axis"),
        (
            {"roll": sine(1.0, 1.0, unit="")},
            UnitError,
            "is in no unit and the limits of roll are in 'deg'",
        ),
        ({"roll": sine(1.0, 1.0, unit="m")}, UnitError, "cannot be turned into"),
        ({"roll": sine(1.0, 1.0, fs=300.0)}, ArgumentError, "fs = 300 Hz does not divide"),
        (
            {"roll": sine(1.0, 1.0), "yaw": sine(1.0, 1.0, fs=1000.0)},
            ArgumentError,
            "stimuli have different rates",
        ),
    ],
)
def test_what_cannot_be_played_is_refused(unmoved, stimuli, error, words):
    with pytest.raises(error, match=words):
        run(MotionTable(), stimuli, rng=RNG)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"specs": FIG_4[:4]}, "give the five of"),
        ({"mode": "VP"}, "mode = 'VP' is not known"),
        ({"delay": -1.0}, "delay = -1.0 must be 0 or positive"),
        ({"controller_rate": 0.0}, "controller_rate = 0.0 must be positive"),
        ({"uut_load": "projector"}, "the uut gimbal carries no load 'projector'"),
    ],
)
def test_what_is_no_table_is_refused(wrong, words):
    with pytest.raises(ArgumentError, match=words):
        MotionTable(**wrong)


def test_an_axis_needs_all_its_limits():
    with pytest.raises(ArgumentError, match=r"limits of roll are .* a table needs all three"):
        replace(FIG_4[0], limits=Limits(position=1.0, unit="deg"))
    with pytest.raises(ArgumentError, match="bandwidth = -1"):
        replace(FIG_4[0], bandwidth=-1)
    with pytest.raises(ArgumentError, match=r"share = 1\.5 must be"):
        MotionTable().limits_of("roll", share=1.5)
