"""A rig over an unkind network: what is found is the rig's, and what went wrong is said."""

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest

from hmpim.errors import ArgumentError, LimitsError, RigError, UnitError
from hmpim.experiment import RunLog, RunOptions, run
from hmpim.identify import identify
from hmpim.rigs import ManualClock, Rig
from hmpim.rigs.wire import (
    Datagram,
    FarEnd,
    Hello,
    Kind,
    State,
    WireRig,
    expected_hello,
    pack,
    unpack,
)
from hmpim.stimulus import Limits, Stimulus, design
from wire_support import LIMITS, Lag, Network, hello

SWEEP = design(
    band=(0.2, 20), duration=6, fs=500, axis="roll",
    limits=Limits(position=5, velocity=150, acceleration=3500, unit="deg"),
)  # fmt: skip
LATE, TIME_CONSTANT = 10, 0.02  # 20 ms and 20 ms


def play(stimulus=SWEEP, *, log=None, expected=None, **kwargs):
    clock = ManualClock()
    plant = Lag(2, 500.0, late=LATE, time_constant=TIME_CONSTANT, noise_std=0.002)
    network = Network(clock, plant=plant, **kwargs)
    rig = WireRig(transport=network, clock=clock, expected=expected)
    return run(rig, stimulus, options=RunOptions(clock=clock), log=log), network


def test_it_is_a_rig():
    assert isinstance(WireRig(transport=Network(ManualClock())), Rig)


@pytest.mark.parametrize(
    "network",
    [
        {"offset": 3.2, "drift": 5e-5},
        {"offset": -7e4, "drift": -5e-5, "there": lambda _n: 5e-3},
        {"offset": 3.2, "drift": 5e-5, "back": lambda _n: 5e-3},
    ],
)
def test_the_delay_found_is_the_rigs_and_not_the_networks(network):
    """Seconds of offset, 50 ppm of drift, and 5 ms one way or the other."""
    record, far = play(**network)
    pair = identify(record)["roll.position", "roll.command"]
    for name, truth in (("delay", LATE / 500.0), ("time_constant", TIME_CONSTANT)):
        found = getattr(pair.parameters, name)
        assert abs(found.value - truth) < max(4 * found.spread, 2e-5)
    (clocks,) = [f for f in record.findings if f.code == "clocks"]
    ppm = 1e6 * network["drift"]
    assert float(clocks.message.split("gains ")[1].split(" ppm")[0]) == pytest.approx(ppm, abs=0.5)
    one_way = [network.get(way, lambda _n: 2e-4)(0) for way in ("there", "back")]
    untold = float(clocks.message.split("wrong by ±")[1].split(" ms")[0])
    assert untold == pytest.approx(500 * sum(one_way), rel=0.05)
    # In the run's own time: sample k stands within that of when its command was due.
    command, sent = record.inputs[0], SWEEP
    k = int(np.argmax(np.abs(command.values)))
    due = sent.time[np.argmin(np.abs(sent.position - command.values[k]))]
    waited = (far.farend._latency + 1.5) / 500.0
    assert abs(command.time[k] - due - waited) < 1e-3 * untold + sum(one_way) + 2e-3
    assert np.diff(command.time).mean() == pytest.approx(1 / 500.0 / (1 + network["drift"]), 1e-7)


def test_lost_late_doubled_and_swapped_are_counted_and_put_right():
    rng = np.random.default_rng(4)

    def unkind(number):
        what = rng.random()
        if number < 20:
            return 2e-4
        if what < 0.01:
            return None
        if what < 0.02:
            return [2e-4, 9e-4]
        if what < 0.04:
            return 4.5e-3  # after the next two
        return 2e-4 + 2e-4 * rng.random()

    clean, _ = play()
    record, network = play(there=unkind, back=unkind)
    said = {f.code: f.message for f in record.findings}
    assert "commands came too late or not at all" in said["datagrams"]
    assert "were lost on the way back, and are gaps" in said["datagrams"]
    assert "samples put back in order: " in said["datagrams"]
    assert "datagrams" not in {f.code for f in clean.findings}
    counts = network.farend.counts
    assert counts.lost > 10
    assert counts.doubled > 10
    assert counts.swapped > 20
    reckoned = int(said["datagrams"].split(" of ")[0])
    assert reckoned == network.farend.reckoned
    # What was recorded is what was in force and read, at every sample that arrived.
    command, position = record.inputs[0], record.outputs[0]
    assert np.all(np.diff(command.time) > 0)
    gaps = np.rint(np.diff(command.time) * 500).astype(int) - 1
    assert gaps.sum() > 10
    pair = identify(record)["roll.position", "roll.command"]
    for name, truth in (("delay", LATE / 500.0), ("time_constant", TIME_CONSTANT)):
        found = getattr(pair.parameters, name)
        assert abs(found.value - truth) < max(4 * found.spread, 5e-5)
    assert position.values.size == command.values.size


def test_the_whole_stimulus_is_in_the_record_in_its_own_unit():
    radians = design(
        band=(0.2, 20), duration=2, fs=500, axis="yaw",
        limits=Limits(position=0.045, velocity=2, acceleration=15, unit="rad"),
    )  # fmt: skip
    record, network = play(radians)
    assert [c.name for c in (*record.inputs, *record.outputs)] == ["yaw.command", "yaw.position"]
    assert record.inputs[0].unit == record.outputs[0].unit == "rad"
    assert np.allclose(record.inputs[0].values, radians.position, atol=1e-12)
    assert record.intersample == "zoh"
    assert record.source == "a bench"
    network.receive(0.1)
    assert network.farend.state is State.IDLE  # told that the session is over
    assert np.all([o.position[0] == 0.0 for o in network.orders])  # roll was never moved


def test_limits_and_axes_come_with_the_hello():
    wide = design(
        band=(0.2, 5), duration=3, fs=500, axis="roll",
        limits=Limits(position=25, velocity=150, acceleration=3500, unit="deg"),
    )  # fmt: skip
    with pytest.raises(LimitsError, match="peak position 25 deg is beyond the limit 20 deg of rol"):
        play(wide)
    blank = Stimulus(waveform=SWEEP.waveform, fs=500, axis="roll")
    with pytest.raises(UnitError, match="is in no unit"):
        play(blank)


@pytest.mark.parametrize(
    ("expected", "words"),
    [
        (Hello(rate=1000.0), "refuses: 'bench' runs at 500 Hz, and 1000 Hz is expected"),
        (Hello(watchdog=0.02), "brakes after 0.08 s of silence, and a watchdog of 0.02 s is exp"),
        (Hello(axes=("nod",)), "'bench' has no axis 'nod', which is expected; it has roll, yaw"),
        (Hello(axes=("roll",), units=("rad",)), "says that roll is in 'deg', and 'rad' is expec"),
        (
            Hello(
                axes=("roll",), units=("deg",),
                limits={"roll": Limits(position=20, velocity=500, unit="deg")},
            ),
            "states a velocity limit of 200 for roll, and 500 is expected",
        ),
        (
            Hello(axes=("roll",), limits={"roll": Limits(position=0.3)}),
            "refuses: 'bench' and the limits expected of roll: limits in no unit cannot be turned",
        ),
        (
            Hello(axes=("roll",), limits={"roll": Limits(position=0.3, unit="m")}),
            "refuses: 'bench' and the limits expected of roll: unit 'm' cannot be turned into 'de",
        ),
    ],
)  # fmt: skip
def test_what_the_ends_do_not_agree_about_is_refused(expected, words):
    with pytest.raises(RigError, match=words):
        play(expected=expected)


@pytest.mark.parametrize("left_out", ["axes", "units", "rate"])
def test_a_far_end_that_leaves_out_what_it_must_state_is_refused(left_out):
    def forgetful(way, data):
        datagram = unpack(data)
        if datagram.kind is not Kind.WELCOME:
            return data
        said = json.loads(datagram.text)
        said[left_out] = None if left_out == "rate" else []
        said["units"] = said["units"] if said["axes"] else []
        return pack(replace(datagram, text=json.dumps(said)))

    with pytest.raises(RigError, match="the far end must state its axes, a unit for each, and its"):
        mangled_run(forgetful)


def test_what_is_narrower_than_the_rigs_limits_is_a_wish():
    limits = Limits(position=10, unit="deg")
    expected = expected_hello(axes=("roll",), unit="deg", rate=500.0, limits=limits)
    record, _ = play(expected=expected)
    assert record.samples > 2900


def test_a_stimulus_at_another_rate_is_refused_before_anything_moves():
    slow = design(
        band=(0.2, 20), duration=2, fs=250, axis="roll",
        limits=Limits(position=5, velocity=150, acceleration=3500, unit="deg"),
    )  # fmt: skip
    clock = ManualClock()
    network = Network(clock)
    with pytest.raises(RigError, match="runs at 500 Hz, and 250 Hz is expected; design the stim"):
        run(WireRig(transport=network, clock=clock), slow, options=RunOptions(clock=clock))
    assert State.ARMED not in network.states


def test_a_heavy_axis_is_waited_for_while_it_says_that_it_brakes():
    """From 150 deg/s with 45 deg/s² it takes more than 3 s."""
    heavy = Limits(position=900.0, velocity=200.0, acceleration=45.0, unit="deg")
    far = FarEnd(replace(hello(rate=100.0, axes=("roll",)), limits={"roll": heavy}))
    slow = design(
        band=(0.03, 0.06), duration=40, fs=100, axis="roll", extinction=0.0,
        limits=Limits(velocity=150, acceleration=44, unit="deg"),
    )  # fmt: skip
    clock = ManualClock()
    network = Network(clock, far)
    fast = float(slow.time[np.argmax(np.abs(slow.velocity))])

    def end(played):
        if played.block.time[-1] > fast:
            raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine"):
        run(
            WireRig(transport=network, clock=clock),
            slow,
            subscribers=[end],
            options=RunOptions(clock=clock),
        )
    assert network.farend.state in (State.AT_REST, State.IDLE)
    assert not network.orders[-1].velocity.any()


class Unplugged(Network):
    """A line whose port is gone after a while: sending and receiving fail."""

    sent = closed = 0

    def send(self, data):
        self.sent += 1
        if self.sent > 500:
            raise RigError("serial:x is disconnected: device disconnected")
        super().send(data)

    def close(self):
        self.closed += 1


def test_a_port_that_is_gone_is_closed_and_the_cause_is_said():
    clock, log = ManualClock(), RunLog()
    line = Unplugged(clock)
    said = "serial:x is disconnected: device disconnected; then it could not be stopped$"
    with pytest.raises(RigError, match=said):
        run(WireRig(transport=line, clock=clock), SWEEP, log=log, options=RunOptions(clock=clock))
    assert line.closed == 1
    assert "disconnecting failed: serial:x is disconnected" in log.text()


def test_nobody_answers():
    with pytest.raises(RigError, match="simulated does not answer within 2 s; is it on"):
        play(there=lambda _n: None)


@pytest.mark.parametrize("way", ["there", "back"])
def test_a_pulled_cable_is_noticed_and_the_far_end_comes_to_rest(way):
    log = RunLog()
    clock = ManualClock()
    cut = []

    def cable(_number):
        if clock.now() > 2.0:
            cut.append(clock.now())
            return None
        return 2e-4

    network = Network(clock, **{way: cable})
    if way == "back":
        network.delays = (cable, cable)
    words = {
        "there": "stopped by itself: no command came",
        "back": "was commanded to stop and did not confirm within 2 s that it stands still; its",
    }
    with pytest.raises(RigError, match=words[way]):
        run(
            WireRig(transport=network, clock=clock), SWEEP, options=RunOptions(clock=clock), log=log
        )
    faults = [event.message for event in log.events if event.kind == "fault"]
    assert (
        "stopped by itself: no command came" in faults[0] or "nothing was heard from" in faults[0]
    )
    network.receive(1.0)
    position = np.array([order.position[0] for order in network.orders])
    assert np.abs(position).max() <= LIMITS["roll"].position
    assert network.orders[-1].velocity.tolist() == [0.0, 0.0]
    last = next(k for k, s in enumerate(network.states) if s is State.BRAKING)
    assert last / 500.0 - cut[0] <= 0.1 + 0.01


def tripping(network, clock):
    """A plant whose far end trips after 2 s of the run."""

    class Tripping(Lag):
        def advance(self, order):
            assert clock.now() < 20.0, "still waiting"
            if clock.now() > 2.0:
                network.farend.trip("oil pressure low")
            return super().advance(order)

    return Tripping(2, 500.0)


def test_a_far_end_that_trips_says_why():
    clock = ManualClock()
    network = Network(clock, farend=FarEnd(hello()))

    network.plant = tripping(network, clock)
    with pytest.raises(RigError, match="'bench' stopped by itself: oil pressure low"):
        run(WireRig(transport=network, clock=clock), SWEEP, options=RunOptions(clock=clock))
    assert network.farend.state is State.FAULT


def test_ctrl_c_brakes_the_far_end_before_the_run_is_left():
    clock = ManualClock()
    network = Network(clock)

    def interrupted(played):
        if played.block.time[0] > 1.0:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(
            WireRig(transport=network, clock=clock),
            SWEEP,
            options=RunOptions(clock=clock),
            subscribers=[interrupted],
        )
    assert State.AT_REST in network.states
    network.receive(0.1)
    assert network.farend.state is State.IDLE
    assert network.orders[-1].velocity.tolist() == [0.0, 0.0]


def number_of(data):
    """Kind and number of a datagram."""
    return unpack(data).kind, unpack(data).number


class Mangling(Network):
    """Exchanges each datagram for what a function of the way and the datagram makes of it."""

    def __init__(self, clock, mangle, **kwargs):
        super().__init__(clock, **kwargs)
        self.mangle = mangle

    def _carry(self, way, data):
        mangled = self.mangle(way, data)
        if mangled is not None:
            super()._carry(way, mangled)


def mangled_run(mangle, **kwargs):
    clock = ManualClock()
    network = Mangling(clock, mangle, **kwargs)
    rig = WireRig(transport=network, clock=clock)
    return run(rig, SWEEP, options=RunOptions(clock=clock)), network


def test_a_run_whose_last_commands_are_lost_has_ended_and_is_kept():
    def last_two_lost(way, data):
        kind, number = number_of(data)
        return None if (kind, number >= SWEEP.samples - 2) == (Kind.COMMAND, True) else data

    record, _ = mangled_run(last_two_lost)
    said = {f.code: f.message for f in record.findings}
    assert "the samples of the last 2 never came" in said["cut_short"]
    assert record.samples >= SWEEP.samples - 2


def test_a_far_end_that_comes_to_rest_in_mid_run_is_noticed_at_once():
    """At rest in the lead, it stands without ever having braked."""
    still = design(
        band=(0.2, 20), duration=3, fs=500, axis="roll", lead=1.0,
        limits=Limits(position=5, velocity=150, acceleration=3500, unit="deg"),
    )  # fmt: skip
    clock = ManualClock()

    def stopping(way, data):
        if way == 0 and number_of(data) == (Kind.COMMAND, 9):
            network.farend.receive(stop_of(data), now=0)
        return data

    def stop_of(data):  # as from a button beside the table
        return pack(Datagram(kind=Kind.STOP, session=unpack(data).session))

    network = Mangling(clock, stopping)
    with pytest.raises(RigError, match="'bench' stopped by itself: no reason given"):
        run(WireRig(transport=network, clock=clock), still, options=RunOptions(clock=clock))
    assert len(network.states) / 500.0 < 0.5


def test_a_reason_that_is_lost_is_not_waited_for_for_ever():
    clock = ManualClock()

    def silent(way, data):
        return None if way == 1 and number_of(data)[0] is Kind.REFUSED else data

    network = Mangling(clock, silent)

    network.plant = tripping(network, clock)
    with pytest.raises(RigError, match="'bench' stopped by itself: no reason given"):
        run(WireRig(transport=network, clock=clock), SWEEP, options=RunOptions(clock=clock))


def test_garbage_ends_a_run_but_does_not_keep_it_from_being_stopped():
    clock = ManualClock()

    def garbled(way, data):
        return b"garbage" if way == 1 and clock.now() > 2.0 and next(some) % 4 else data

    some = itertools.count()
    log = RunLog()
    network = Mangling(clock, garbled)
    with pytest.raises(RigError, match="7 bytes that are no datagram of hmpim"):
        run(
            WireRig(transport=network, clock=clock), SWEEP, options=RunOptions(clock=clock), log=log
        )
    assert "stop" in [event.kind for event in log.events]
    assert network.states[-1] in (State.AT_REST, State.BRAKING)


@pytest.mark.parametrize("seconds", [0.0, -1.0, np.nan, np.inf, "x", True])
def test_a_time_that_is_none_is_refused(seconds):
    with pytest.raises(ArgumentError, match=r"answer = .* s must be a positive, finite time"):
        WireRig(transport=Network(ManualClock()), answer=seconds)
