"""The table as a rig: records, determinism, friction, pace, and what identification finds."""

import numpy as np
import pytest

from hmpim.experiment import ManualClock, RunOptions, run
from hmpim.identify import identify
from hmpim.record import Record
from hmpim.rigs import MotionTable, Rig, commands_of
from hmpim.rigs.table import AXES, FIG_4, TablePosition, exact_bandwidth, linear_response
from hmpim.rigs.table.linear import phase_crossing
from hmpim.stimulus import Limits, Sine, Stimulus, design
from tests_support import few_of, in_studies

pytest.importorskip("mujoco")

MODES = ("P", "PV", "PVA")


def sweep(axis, *, upto, duration=10.0, fs=1000.0, share=0.7, travel=None, table=None):
    table = MotionTable() if table is None else table
    travel = 0.05 * FIG_4[AXES.index(axis)].limits.position if travel is None else travel
    limits = table.limits_of(axis, travel=travel, share=share)
    return design(band=(0.1, upto), duration=duration, fs=fs, limits=limits, axis=axis)


def pick(record, axis):
    """The record of one axis out of that of several."""
    return Record(
        inputs=(record.channel(f"{axis}.command"),),
        outputs=(record.channel(f"{axis}.position"),),
        fs=record.fs,
        band=record.band,
        intersample=record.intersample,
    )


def identified(record, axis, **options):
    return identify(record, **options)[f"{axis}.position", f"{axis}.command"]


def crossing(pair):
    """-90° frequency of the measured response: a parabola through the phase around it."""
    found = pair.frequency_response
    first = phase_crossing(found.frequency, found.response)
    near = np.abs(found.frequency / first - 1.0) < 0.15
    f = found.frequency[near] / first
    phase = np.unwrap(np.angle(found.response))[near] + np.pi / 2
    weight = np.abs(found.response[near]) / found.std[near]
    bend, slope, level = np.polyfit(f - 1.0, phase, 2, w=weight)
    roots = np.roots([bend, slope, level])
    return first * (1.0 + roots[np.argmin(np.abs(roots))].real)


def test_it_is_a_rig_and_run_plays_it():
    table = MotionTable()
    assert isinstance(table, Rig)
    stimulus = sweep("pitch", upto=20.0, duration=0.5)
    assert run(table, stimulus, rng=3).sha256 == run(table, stimulus, rng=3).sha256
    assert run(table, stimulus, rng=3).sha256 != run(table, stimulus, rng=4).sha256


def test_record_of_several_axes():
    start = TablePosition(roll=10.002, yaw=-5.001)
    table = MotionTable(start=start, observe=("yaw", "elevation"))
    yaw = Stimulus(waveform=Sine(amplitude=0.02, frequency=2.0, duration=2.0), fs=500.0, unit="rad")
    roll = sweep("roll", upto=30.0, duration=1.0, fs=500.0)
    record = run(table, {"yaw": yaw, "roll": roll}, rng=1)
    assert [c.name for c in record.inputs] == ["roll.command", "yaw.command"]
    assert [(c.name, c.unit) for c in record.outputs] == [
        ("yaw.position", "rad"),
        ("elevation.position", "deg"),
    ]
    assert record.band == (0.1, 30.0)
    assert record.fs == 500.0
    assert np.allclose(record.channel("yaw.command").values, yaw.position[: record.samples])
    # The shorter stimulus waits at rest, and its whole course is in the record.
    commanded = record.channel("roll.command").values
    assert np.allclose(commanded[: roll.samples], roll.position, atol=1e-12)
    assert np.all(commanded[roll.samples :] == commanded[-1])
    steps = record.channel("elevation.position").values / 0.003
    assert np.abs(steps - np.rint(steps)).max() < 1e-6
    assert abs(record.channel("yaw.position").values[0]) < 1e-4


def test_encoders_read_the_truth_to_their_resolution():
    table = MotionTable(encoder_noise_std=0.0)
    history = table.simulate(sweep("yaw", upto=20.0, duration=2.0), rng=np.random.default_rng(0))
    gap = history.encoder - history.position
    assert np.abs(gap).max() <= 0.0015 * (1 + 1e-9)
    assert gap[:, 1].std() == pytest.approx(0.003 / np.sqrt(12), rel=0.1)


EACH = [("roll", "PVA"), ("elevation", "P")]
"""The fastest axis, the slowest and each mode, pitch in PV below; the others in `make studies`."""


@pytest.mark.parametrize("seconds", [4.0, *in_studies(10.0)])
@pytest.mark.parametrize(("axis", "mode"), few_of(EACH, AXES, MODES))
def test_identified_and_exact_bandwidths_agree(axis, mode, seconds):
    """Nothing is told to the fit; what is exact is what the record's own statement means."""
    table = MotionTable(friction=False, mode=mode)
    truth = exact_bandwidth(table, axis=axis)
    # Where full feedforward ends the outer axes may move by three encoder steps only.
    weak = mode == "PVA" and axis in ("azimuth", "elevation")
    stimulus = design(
        band=(1.0 if weak else 0.1, 1.5 * exact_bandwidth(table, axis=axis, hold="included")),
        duration=30.0 if weak else seconds,
        fs=1000.0,
        limits=table.limits_of(axis, travel=0.2 if weak else 1.5, share=0.95),
        axis=axis,
    )
    pair = identified(run(table, stimulus, rng=1), axis)
    for found in (pair.bandwidth_phase90, pair.from_response.bandwidth_phase90):
        assert abs(found.value / truth - 1.0) < 0.02


@pytest.mark.parametrize("mode", ["PV", *in_studies("PVA")])
def test_behind_the_hold_slower_commands_change_nothing(mode):
    """With the hold they lower the bandwidth by more than 5 %."""
    table = MotionTable(friction=False, mode=mode)
    slow, fast = (
        exact_bandwidth(table, axis="pitch", fs=fs, hold="included") for fs in (500.0, 1000.0)
    )
    assert slow < 0.95 * fast
    truth = exact_bandwidth(table, axis="pitch", fs=500.0)
    assert truth == pytest.approx(exact_bandwidth(table, axis="pitch", fs=1000.0), rel=0.005)
    limits = table.limits_of("pitch", travel=1.5, share=0.95)
    stimulus = design(band=(0.1, 1.5 * slow), duration=5, fs=500, limits=limits, axis="pitch")
    found = identified(run(table, stimulus, rng=1), "pitch").bandwidth_phase90
    assert abs(found.value / truth - 1.0) < 0.02


def test_records_say_what_their_input_is():
    """In modes PV and PVA derivatives of the position are held too."""
    stimulus = sweep("pitch", upto=20.0, duration=0.5)
    said = {mode: run(MotionTable(mode=mode), stimulus, rng=1).intersample for mode in MODES}
    assert said == {"P": "zoh", "PV": "feedforward", "PVA": "feedforward"}


@pytest.mark.parametrize("mode", MODES)
def test_feedforward_commands_are_kept_and_never_fitted(mode):
    table = MotionTable(mode=mode)
    stimulus = sweep("roll", upto=20.0, duration=1.0, table=table)
    record = run(table, stimulus, rng=1)
    names = ["roll.velocity_command", "roll.acceleration_command"][: len(mode) - 1]
    assert [c.name for c in record.auxiliary] == names
    assert [c.unit for c in record.auxiliary] == ["deg/s", "deg/s²"][: len(names)]
    assert [c.name for c in record.inputs] == ["roll.command"]
    for channel, name in zip(record.auxiliary, ("velocity", "acceleration"), strict=False):
        np.testing.assert_array_equal(channel.values, getattr(stimulus, name))
    # How many pairs there are does not depend on what is tried.
    assert len(identify(record, structures=["static"], nonlinear="reported").pairs) == 1


@pytest.fixture(scope="module")
def all_at_once():
    table = MotionTable()
    stimuli = {
        axis.name: sweep(
            axis.name,
            upto=1.8 * axis.bandwidth,
            duration=6.0,
            share=0.3,
            fs=500.0,
            table=table,
        )
        for axis in FIG_4
    }
    return table, stimuli, run(table, stimuli, rng=2)


@pytest.mark.study  # small: the demo of tests/campaign/test_compare.py, which moves all axes
@pytest.mark.parametrize("axis", AXES)
def test_all_axes_at_once_give_the_bandwidths_of_each_alone(all_at_once, axis):
    """Fig. 24: there the automatic roll bandwidth came out a third too low."""
    table, stimuli, together = all_at_once
    plain = {"structures": ["second_order", "third_order"]}
    alone = identified(run(table, stimuli[axis], rng=3), axis, **plain).bandwidth_phase90
    among = identified(pick(together, axis), axis, **plain).bandwidth_phase90
    assert abs(among.value / alone.value - 1.0) < 0.03


@pytest.mark.parametrize("levels", [(1000.0, 12_000.0), *in_studies(((1000.0, 4300.0, 12_000.0),))])
def test_friction_lowers_the_apparent_bandwidth_of_small_motions(levels):
    """Fig. 22: it takes a share of the torque, the larger the less the axis is driven."""
    found = []
    for acceleration in levels:
        limits = Limits(position=2.0, velocity=200.0, acceleration=acceleration, unit="deg")
        stimulus = design(band=(0.1, 40), duration=5, fs=1000, limits=limits, axis="pitch")
        record = run(MotionTable(), stimulus, rng=1)
        # What is read is the measured response: which structure fits best does not matter.
        options = {"structures": ["second_order"], "nonlinear": "reported"}
        found.append(crossing(identified(record, "pitch", **options)))
    linear = exact_bandwidth(MotionTable(), axis="pitch", hold="included")
    assert sorted(found) == found
    assert found[0] < found[-1] < linear
    assert found[0] < 0.92 * linear
    assert found[-1] > 0.95 * linear


def test_coupling_seen_in_the_encoders_is_the_exact_one():
    """Pitch at 12 Hz with yaw at 30°: what roll does, from a record of one axis moved."""
    turned = TablePosition(yaw=30.0)
    table = MotionTable(
        friction=False, start=turned, encoder_noise_std=0.0, observe=("roll", "pitch")
    )
    frequency, seconds = 12.0, 4.0
    waveform = Sine(amplitude=1.5, frequency=frequency, duration=seconds)
    record = run(table, {"pitch": Stimulus(waveform=waveform, fs=1000.0, unit="deg")}, rng=0)
    turn = np.exp(-2j * np.pi * frequency * record.inputs[0].time[1000:])
    command = turn @ record.inputs[0].values[1000:]
    for axis in ("roll", "pitch"):
        seen = turn @ record.channel(f"{axis}.position").values[1000:] / command
        truth = linear_response(table, frequency, axis_in="pitch", axis_out=axis, hold="included")[
            0
        ]
        assert abs(seen - truth) < 5e-3 * max(abs(truth), 0.03)


def test_real_time_is_kept_by_the_clock_of_the_run():
    stimulus = sweep("pitch", upto=20.0, duration=1.0, fs=500.0)
    paced, free = ManualClock(), ManualClock()
    record = run(MotionTable(realtime=True), stimulus, rng=0, options=RunOptions(clock=paced))
    assert paced.now() == pytest.approx((stimulus.samples - 1) / stimulus.fs)
    assert (
        run(MotionTable(), stimulus, rng=0, options=RunOptions(clock=free)).sha256 == record.sha256
    )
    assert free.now() == 0.0


def test_blocks_of_any_size_move_it_alike():
    """What is in force late, and the encoders' noise, go on from block to block."""
    table = MotionTable(delay=3.4e-3, mode="PVA")
    stimulus = sweep("roll", upto=40.0, duration=0.5)
    commands = commands_of({"roll": stimulus})
    whole = table.simulate(stimulus, rng=np.random.default_rng(5))
    for size in (1, 7, 1000):
        motion = table.motion(1000.0, rng=np.random.default_rng(5))
        parts = []
        for block in commands.blocks(size):
            five = np.zeros((3, len(block), 5))
            for k, quantity in enumerate(("position", "velocity", "acceleration")):
                five[k, :, 0] = np.radians(block.of("roll", quantity))
            parts.append(motion.advance(*five))
        assert np.array_equal(np.concatenate([p.encoder for p in parts]), whole.encoder)
        assert np.allclose(np.concatenate([p.time for p in parts]), whole.time, atol=1e-12)
