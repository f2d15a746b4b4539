"""Nothing moves beyond a limit; what a rig does wrong is told as its own error."""

import os
import signal
import time
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmpim.errors import ArgumentError, LimitsError, RigError, UnitError
from hmpim.experiment import ManualClock, RunLog, RunOptions, Watch, run
from hmpim.record import Record
from hmpim.rigs import ChannelSpec, Layout, Samples, Sensor
from hmpim.stimulus import Limits, SampledMotion, Sine, Step, Stimulus, design
from tests_support import examples

SINE = Stimulus(waveform=Sine(amplitude=2.0, frequency=1.0, duration=2.0), fs=100.0, unit="deg")
RATE, ACCELERATION = 4 * np.pi, 8 * np.pi**2  # peaks of SINE


@dataclass
class Spy:
    """A rig that remembers what it was told, and what moved."""

    limits: Limits | None = None
    name: str = "pitch"
    axes: tuple[str, ...] = ()
    moves: bool = False
    fault: BaseException | None = None
    fails_in: str = "play"
    returns: object = None
    told: list[str] = field(default_factory=list)
    moved: list[Stimulus] = field(default_factory=list)

    def _told(self, what):
        self.told.append(what)
        if self.fails_in == what and self.fault is not None:
            raise self.fault

    def __enter__(self):
        self._told("enter")
        return self

    def __exit__(self, *_):
        self._told("exit")

    def prepare(self, stimulus):
        self._told("prepare")
        self.stimulus = stimulus

    def play(self, block):
        if block.start == 0:
            self.moved.append(self.stimulus)
        self._told("play")
        return block.position if self.returns is None else self.returns

    def stop(self):
        self._told("stop")


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        (Limits(position=1.0, unit="deg"), "peak position 2 deg is beyond the limit 1 deg of 'p"),
        (Limits(velocity=6.0, unit="deg"), "peak velocity 12.5664 deg/s is beyond the limit 6 deg"),
        (
            Limits(acceleration=7.9, unit="deg"),
            "peak acceleration 78.9568 deg/s² .* of 'pitch'; scale the stimulus by 0.1,",
        ),
        (Limits(position=0.02, unit="rad"), "peak position 0.0349066 rad is beyond the limit 0.02"),
        (Limits(position=1.9, velocity=2.0, unit="deg"), "peak velocity"),  # the worst of the two
    ],
)
def test_a_limit_is_checked_before_anything_moves(limits, words):
    spy = Spy(limits=limits)
    with pytest.raises(LimitsError, match=words):
        run(spy, SINE)
    assert spy.moved == []


def test_a_jerk_limit_is_checked_where_there_is_one():
    wide = Limits(position=1.0, velocity=20.0, acceleration=200.0, unit="deg")
    gentle = design(band=(0.5, 5.0), duration=2.0, fs=200.0, limits=wide)
    jerk = gentle.peaks.jerk
    assert np.isfinite(jerk)
    run(Spy(limits=Limits(jerk=1.001 * jerk, unit="deg")), gentle)
    spy = Spy(limits=Limits(jerk=0.5 * jerk, unit="deg"))
    with pytest.raises(LimitsError, match=r"peak jerk .* deg/s³ is beyond .* scale .* by 0\.5,"):
        run(spy, gentle)
    with pytest.raises(LimitsError, match=r"peak jerk inf deg/s³ .*; it jumps, so take one that"):
        run(spy, SINE)
    assert spy.moved == []


@examples(20)
@given(
    share=st.floats(0.5, 2.0).filter(lambda s: abs(s - 1) > 1e-6),
    which=st.sampled_from(["position", "velocity", "acceleration"]),
    unit=st.sampled_from(["deg", "rad", "mrad"]),
)
def test_played_if_and_only_if_every_limit_is_kept_in_any_unit(share, which, unit):
    peaks = {"position": 2.0, "velocity": RATE, "acceleration": ACCELERATION}
    spy = Spy(limits=Limits(**{which: share * peaks[which]}, unit="deg").to(unit))
    if share < 1:
        with pytest.raises(LimitsError, match=f"peak {which}"):
            run(spy, SINE)
    else:
        run(spy, SINE)
    assert len(spy.moved) == (share > 1)


@examples(20)
@given(limit=st.floats(1e-6, 78.0))
def test_the_advice_of_the_message_does(limit):
    spy = Spy(limits=Limits(acceleration=limit, unit="deg"))
    with pytest.raises(LimitsError, match="scale the stimulus by") as caught:
        run(spy, SINE)
    scale = float(str(caught.value).split("scale the stimulus by ")[1].split(",")[0])
    assert scale == pytest.approx(limit / ACCELERATION, rel=2e-3)
    waveform = Sine(amplitude=2.0 * scale, frequency=1.0, duration=2.0)
    run(spy, Stimulus(waveform=waveform, fs=100.0, unit="deg"))
    assert len(spy.moved) == 1


def test_peaks_between_samples_count():
    # Sampled at its zero crossings, the sine looks like rest.
    waveform = Sine(amplitude=2.0, frequency=1.0, duration=2.0)
    blind = Stimulus(waveform=waveform, fs=2.0, unit="deg")
    assert np.abs(blind.position).max() < 1e-12
    with pytest.raises(LimitsError, match="peak position 2 deg"):
        run(Spy(limits=Limits(position=1.0, unit="deg")), blind)


@pytest.mark.parametrize("start", [0.0, 0.503])
def test_a_jump_is_beyond_any_limit_of_velocity_or_acceleration(start):
    step = Stimulus(waveform=Step(duration=1.0, start=start), fs=100.0, unit="deg")
    with pytest.raises(LimitsError, match="peak velocity 100 deg/s"):
        run(Spy(limits=Limits(velocity=99.0, unit="deg")), step)
    spy = Spy(limits=Limits(position=1.0, unit="deg"))
    run(spy, step)  # nothing bounds the velocity
    assert len(spy.moved) == 1


@pytest.mark.parametrize("lead", [0.0, "auto"])
@pytest.mark.parametrize("extinction", [0.0, 0.3, 0.83, 1.1])
@pytest.mark.parametrize("fs", [100.0, 5000.0])
def test_what_is_designed_inside_limits_never_counts_as_a_jump(lead, extinction, fs):
    limits = Limits(position=10, velocity=300, acceleration=5000, unit="deg")
    stimulus = design(
        band=(0.1, 20), duration=4, fs=fs, limits=limits, lead=lead, extinction=extinction
    )
    spy = Spy(limits=limits)
    run(spy, stimulus)
    assert len(spy.moved) == 1


def test_what_moves_does_not_start_with_a_velocity_step_beyond_its_acceleration():
    """The printed sweep, without a lead, is for simulations."""
    limits = Limits(position=10, velocity=1000, acceleration=4000, unit="deg")
    printed = design(band=(0.1, 10), duration=4, fs=500, limits=limits, lead=0)
    simulated, real = Spy(limits=limits), Spy(limits=limits, moves=True)
    run(simulated, printed)
    said = (
        r"starts in motion: its first commands take \d+.* beyond the limit 4000 deg/s² of 'pitch'"
    )
    with pytest.raises(LimitsError, match=said):
        run(real, printed)
    assert real.moved == []
    run(real, design(band=(0.1, 10), duration=4, fs=500, limits=limits))


def test_a_stimulus_designed_onto_the_limits_of_a_rig_is_played_by_it():
    limits = Limits(position=10, velocity=500, acceleration=8000, unit="deg")
    stimulus = design(band=(0.1, 20), duration=5, fs=200, limits=limits)
    for unit in ("deg", "rad", "arcsec"):
        spy = Spy(limits=limits.to(unit))
        run(spy, stimulus)
        assert len(spy.moved) == 1


@pytest.mark.parametrize(
    ("unit", "limits_unit", "words"),
    [
        ("", "deg", "stimulus is in no unit and the limits of 'pitch' are in 'deg'; state"),
        ("deg", "", "stimulus is in 'deg' and the limits of 'pitch' are in no unit; state"),
        ("m", "deg", "'m' cannot be turned into 'deg'"),
    ],
)
def test_limits_in_a_unit_that_cannot_be_compared_stop_the_run(unit, limits_unit, words):
    spy = Spy(limits=Limits(position=1e9, unit=limits_unit))
    with pytest.raises(UnitError, match=words):
        run(spy, Stimulus(waveform=SINE.waveform, fs=100.0, unit=unit))
    assert spy.moved == []


def test_limits_stated_without_a_unit_are_not_taken_for_radians():
    spy = Spy(limits=Limits(position=45.0, unit="deg"))
    words = "limits stated for 'pitch': limits in no unit cannot be turned into 'deg'; state their"
    with pytest.raises(UnitError, match=words):
        run(spy, SINE, limits=Limits(position=1.0))  # SINE goes to 2 deg
    assert spy.moved == []
    run(spy, SINE, limits=Limits())  # nothing bounds, so there is nothing to convert


def test_limits_stated_for_an_axis_that_is_not_there_are_refused():
    spy = Spy(axes=("roll", "yaw"), limits=Limits(position=45.0, unit="deg"))
    rol = {"rol": Limits(position=1.0, unit="deg")}
    with pytest.raises(LimitsError, match="stated for axis 'rol', and rig 'pitch' has roll, yaw"):
        run(spy, {"roll": SINE}, limits=rol)
    with pytest.raises(LimitsError, match="limits are stated for rol, and the stimulus names no a"):
        run(Spy(), SINE, limits=rol)


def test_a_failing_driver_is_told_as_the_rigs_own_error():
    fault = OSError("port closed")
    with pytest.raises(RigError, match="rig 'pitch' failed: OSError: port closed") as caught:
        run(Spy(fault=fault), SINE)
    assert caught.value.__cause__ is fault


def test_an_error_of_ours_passes_unchanged():
    stop = RigError("stopped by hand")
    with pytest.raises(RigError) as caught:
        run(Spy(fault=stop), SINE)
    assert caught.value is stop


def test_a_rig_is_connected_prepared_played_stopped_and_disconnected_in_this_order():
    spy = Spy()
    record = run(spy, SINE)
    assert spy.told[:3] == ["enter", "prepare", "play"]
    assert spy.told[-2:] == ["stop", "exit"]
    assert set(spy.told[2:-2]) == {"play"}
    assert np.array_equal(record.outputs[0].values, SINE.position)
    assert np.array_equal(record.inputs[0].time, SINE.time)
    assert (record.inputs[0].unit, record.fs, record.source) == ("deg", 100.0, "rig pitch")


@pytest.mark.parametrize(
    "fault", [OSError("port closed"), RigError("stuck"), KeyboardInterrupt(), SystemExit(3)]
)
@pytest.mark.parametrize("place", ["prepare", "play"])
def test_the_rig_is_stopped_and_disconnected_whatever_fails(fault, place):
    spy = Spy(fault=fault, fails_in=place)
    expected = RigError if isinstance(fault, Exception) else type(fault)
    with pytest.raises(expected):
        run(spy, SINE)
    assert spy.told[-2:] == ["stop", "exit"]


def test_a_rig_that_cannot_be_connected_is_not_told_to_stop():
    spy = Spy(fault=OSError("no such port"), fails_in="enter")
    with pytest.raises(RigError, match="OSError: no such port"):
        run(spy, SINE)
    assert spy.told == ["enter"]


def test_a_failing_subscriber_ends_the_run_with_its_own_error_and_the_rig_stops():
    spy = Spy()

    def watch(played):
        if played.block.time[-1] > 1.0:
            raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine"):
        run(spy, SINE, subscribers=[watch])
    assert spy.told[-2:] == ["stop", "exit"]
    assert 50 <= spy.told.count("play") < 60


def test_subscribers_see_every_block_once():
    seen = []
    record = run(Spy(), SINE, subscribers=[lambda played: seen.append(played.samples["y"])])
    assert np.array_equal(np.concatenate([s.values for s in seen]), record.outputs[0].values)
    assert np.array_equal(np.concatenate([s.time for s in seen]), record.outputs[0].time)


def test_a_failing_stop_is_told():
    with pytest.raises(RigError, match="rig 'pitch' failed: OSError: cable"):
        run(Spy(fault=OSError("cable"), fails_in="stop"), SINE)


def test_a_stop_that_fails_with_what_came_before_says_the_cause_first():
    class Pulled(Spy):
        def stop(self):
            raise OSError("no answer to the stop")

    pulled = Pulled(fault=RigError("nothing came for 0.5 s"), fails_in="play")
    said = "failed: nothing came for 0.5 s; then it could not be stopped: OSError: no answer"
    with pytest.raises(RigError, match=said) as failure:
        run(pulled, SINE)
    assert isinstance(failure.value.__cause__, RigError)


def test_what_fails_on_leaving_hides_no_error_and_costs_no_record():
    class Broken(Spy):
        def __exit__(self, *_):
            raise OSError("the port is closed already")

    log = RunLog()
    assert run(Broken(), SINE, log=log).samples == 200
    assert "disconnecting failed: OSError: the port is closed already" in log.text()
    with pytest.raises(RigError, match=r"cable pulled$"):
        run(Broken(fault=OSError("cable pulled")), SINE)


def test_ctrl_c_during_a_stop_waits_until_the_rig_stands():
    class Slow(Spy):
        def stop(self):
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.01)  # where a handler would run
            self.told.append("at rest")

    spy = Slow()
    with pytest.raises(KeyboardInterrupt):
        run(spy, SINE)
    assert spy.told[-2:] == ["at rest", "exit"]


def test_a_polite_kill_stops_the_rig():
    class Killed(Spy):
        def play(self, block):
            os.kill(os.getpid(), signal.SIGTERM)
            return super().play(block)

    spy = Killed()
    with pytest.raises(SystemExit) as ended:
        run(spy, SINE)
    assert ended.value.code == 128 + signal.SIGTERM
    assert spy.told[-2:] == ["stop", "exit"]
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL


@pytest.mark.parametrize(
    ("returns", "words"),
    [
        ("fast", "returned str from play; return samples by channel name"),
        (np.zeros(3), r"an array of shape \(3, 1\) for a block of 2 commands with 1 outputs"),
        ({"z": [0.0, 0.0]}, "returned channel 'z', which its layout does not have; it has u, y"),
        ({"y": [0.0]}, r"channel 'y' of rig 'pitch' has shape \(1,\) for a block of 2 commands"),
        ({"y": ["a", "b"]}, "channel 'y' of rig 'pitch' is not numeric"),
        ({}, "delivered no usable record: channel 'y' has 0 samples"),
        (np.full(2, np.nan), "delivered no usable record: channel 'y' holds 0 numbers in"),
    ],
)
def test_what_a_rig_may_not_return(returns, words):
    with pytest.raises(RigError, match=words):
        run(Spy(returns=returns), SINE)


def test_a_sample_that_is_no_number_is_a_gap_as_in_a_file():
    class Faulty(Spy):
        def play(self, block):
            read = super().play(block).copy()
            read[block.time == 1.0] = np.nan
            return read

    record = run(Faulty(), SINE)
    assert record.outputs[0].values.size == SINE.samples - 1
    assert 1.0 not in record.outputs[0].time
    (missing,) = (f for f in record.findings if f.code == "missing_samples")
    assert "1 of 200 samples of 'y' are missing" in missing.message


def test_a_rig_that_moves_and_states_no_limits_is_refused():
    spy = Spy(moves=True)
    with pytest.raises(LimitsError, match="rig 'pitch' moves and states no limits; state"):
        run(spy, SINE)
    spy = Spy(moves=True, axes=("roll", "yaw"), limits={"roll": Limits(position=5, unit="deg")})
    with pytest.raises(LimitsError, match="axis 'yaw' of rig 'pitch' moves and states no limits"):
        run(spy, {"roll": SINE, "yaw": SINE})
    assert spy.told == ["enter", "exit"]  # connected, looked at, and left alone
    run(Spy(moves=True, limits=Limits()), SINE)  # stated: nothing bounds it


def test_a_channel_on_its_own_clock_keeps_its_stamps():
    class Late(Spy):
        """The last half of each block comes with the next; the rest never."""

        def prepare(self, stimulus):
            super().prepare(stimulus)
            self.waiting = []

        def play(self, block):
            self.waiting += list(zip(block.time + 0.003, block.position[:, 0], strict=True))
            now, self.waiting = self.waiting[:-1], self.waiting[-1:]
            time, values = np.array(now).reshape(-1, 2).T
            return {"y": Samples(time=time, values=values)}

    record = run(Late(), SINE)
    y = record.outputs[0]
    assert y.values.size == SINE.samples - 1
    assert np.allclose(y.time, SINE.time[:-1] + 0.003)
    assert np.array_equal(y.values, SINE.position[:-1])


def test_several_axes_by_name_or_by_their_own():
    axes = ("roll", "yaw")
    slow = Stimulus(waveform=Sine(frequency=1.0, duration=1.0), fs=100.0, axis="yaw", unit="rad")
    fast = Stimulus(waveform=Sine(frequency=2.0, duration=2.0), fs=100.0, axis="roll", unit="deg")
    by_name = run(Spy(axes=axes), {"yaw": slow, "roll": fast})
    by_own = run(Spy(axes=axes), [slow, fast])
    assert by_name.sha256 == by_own.sha256
    assert [c.name for c in by_name.inputs] == ["roll.command", "yaw.command"]
    assert [c.unit for c in by_name.outputs] == ["deg", "rad"]
    assert np.all(by_name.channel("yaw.position").values[100:] == slow.motion(np.ones(1)).position)
    with pytest.raises(ArgumentError, match="axis 'nod' is not known; use one of"):
        run(Spy(axes=axes), {"nod": slow})
    with pytest.raises(ArgumentError, match=r"axes \['yaw', 'yaw'\] must be different names"):
        run(Spy(axes=axes), [slow, slow])
    with pytest.raises(ArgumentError, match="'pitch' takes one stimulus, and 2 are given"):
        run(Spy(), [slow, fast])


def test_everything_that_happened_stands_in_the_log(tmp_path):
    path = tmp_path / "run.log"
    limits = Limits(position=3.0, velocity=20.0, unit="deg")
    with RunLog(path) as log:
        run(Spy(limits=limits), SINE, log=log)
        with pytest.raises(RigError):
            run(Spy(fault=OSError("cable"), limits=limits), SINE, log=log)
        with pytest.raises(LimitsError):
            run(Spy(limits=Limits(position=1.0, unit="deg")), SINE, log=log)
    kinds = [event.kind for event in log.events]
    whole = ["check", "arm", "start", "done", "stop"]
    assert kinds == [*whole, "check", "arm", "start", "fault", "stop", "fault"]
    words = "'pitch': position 2 of 3 deg, velocity 12.5664 of 20 deg/s; braking reaches 2"
    assert log.events[0].message == words
    seconds = [event.seconds for event in log.events]
    assert seconds == sorted(seconds)
    lines = path.read_text(encoding="utf-8").splitlines()
    assert [line.split()[2] for line in lines[1:]] == kinds
    with pytest.raises(ArgumentError, match="cannot be written"):
        RunLog(tmp_path / "no" / "run.log")


def test_commands_go_by_the_clock_of_the_run():
    class Paced(Spy):
        def play(self, block):
            for _ in block.due():
                self.sent.append(self.clock.now())
            return block.position

    spy = Paced()
    spy.sent, spy.clock = [], ManualClock(late=np.array([0.0, 0.001]))
    run(spy, SINE, options=RunOptions(clock=spy.clock))
    late = np.array(spy.sent) - SINE.time
    assert late[::2] == pytest.approx(0.0, abs=1e-12)
    assert late[1::2] == pytest.approx(0.001)


@pytest.mark.parametrize("rig", [None, abs, "sensor", Sensor])
def test_what_is_no_rig(rig):
    with pytest.raises(ArgumentError, match=r"is not a rig: .* FunctionRig\(function=\.\.\.\)"):
        run(rig, SINE)


def test_what_is_no_stimulus():
    with pytest.raises(ArgumentError, match=r"is not a Stimulus; make one with design"):
        run(Spy(), SINE.waveform)


def test_a_seed_makes_the_run_repeatable():
    rig = Sensor(noise_std=0.1)
    assert run(rig, SINE, rng=7).sha256 == run(rig, SINE, rng=7).sha256
    assert run(rig, SINE, rng=np.random.default_rng(7)).sha256 == run(rig, SINE, rng=7).sha256
    assert run(rig, SINE).sha256 != run(rig, SINE).sha256
    assert isinstance(run(rig, SINE), Record)


def test_a_motion_that_ends_where_it_could_not_stop_inside_its_limits_is_refused():
    """At 14 deg/s it takes 14²/(2 · 54) = 1.8 deg to stand; smooth motions see to that."""
    t = np.arange(80) / 100
    fast = np.minimum(t, 0.25)
    motion = SampledMotion(
        fs=100.0,
        position=0.5 * 54.0 * fast**2 + 13.5 * (t - fast),
        velocity=54.0 * fast,
        acceleration=np.where(t < 0.25, 54.0, 0.0),
    )
    stimulus = Stimulus(waveform=motion, fs=100.0)
    reach = motion.position[-1] + 13.5**2 / (2 * 54.5)
    spy = Spy(limits=Limits(position=1.01 * reach, velocity=14.0, acceleration=54.5))
    run(spy, stimulus)
    tight = Spy(limits=Limits(position=0.99 * reach, velocity=14.0, acceleration=54.5))
    with pytest.raises(LimitsError, match=r"at 0\.790 s 'pitch' could not stop inside its limits"):
        run(tight, stimulus)
    assert tight.moved == []


class Measured(Spy):
    """A real axis whose encoder is read."""

    def __init__(self, read, **kwargs):
        limits = Limits(position=3.0, velocity=20.0, acceleration=2000.0, unit="deg")
        super().__init__(moves=True, limits=limits, **kwargs)
        self.read = read

    def prepare(self, stimulus):
        super().prepare(stimulus)
        command = ChannelSpec(
            name="u", role="input", unit="deg", axis="", quantity="position", commanded=True
        )
        encoder = ChannelSpec(name="y", role="output", unit="rad", axis="", quantity="position")
        return Layout(channels=(command, replace(encoder, unit=self.unit)))

    unit = "deg"

    def play(self, block):
        super().play(block)
        return {"y": self.read(block)}


def nothing(block):
    return Samples(time=np.empty(0), values=np.empty(0))


@pytest.mark.parametrize(
    ("read", "watch", "words"),
    [
        (
            lambda b: 1.7 * b.position[:, 0],
            Watch(),
            r"measured position 3\.\d+ deg of y .* by more",
        ),
        (
            lambda b: b.position[:, 0] + np.nan,
            Watch(),
            r"measured position of y at 0\.000 s is nan, so the position of its axis is unknown",
        ),
        (
            lambda b: 0.7 * b.position[:, 0],
            Watch(following_error=0.5),
            r"y is 0\.5\d+ deg from its command at .* more than the following error 0\.5 deg",
        ),
        (nothing, Watch(), r"no new sample of y came for 0\.5\d* s; 'pitch' is stopped"),
        (
            lambda b: b.position[:, 0] if b.time[0] < 1.0 else nothing(b),
            Watch(stale=0.3),
            r"no new sample of y came for 0\.3\d* s",
        ),
        (  # a driver that returns the last sample again and again
            lambda b: Samples(time=[min(b.time[-1], 1.0)], values=[0.5]),
            Watch(),
            r"no new sample of y came for 0\.5\d* s",
        ),
    ],
)
def test_what_is_watched_while_it_moves(read, watch, words):
    rig = Measured(read)
    log = RunLog()
    with pytest.raises(RigError, match=words):
        run(rig, SINE, options=RunOptions(watch=watch), log=log)
    assert rig.told[-2:] == ["stop", "exit"]
    assert [event.kind for event in log.events][-2:] == ["fault", "stop"]


@pytest.mark.parametrize(
    ("read", "watch"),
    [
        (lambda b: 1.6 * b.position[:, 0], Watch()),  # 3.2 of 3.3
        (lambda b: 0.8 * b.position[:, 0], Watch(following_error=0.5)),
        (nothing, Watch(stale=None)),
    ],
)
def test_what_is_watched_and_still_allowed(read, watch):
    rig = Measured(read)
    try:
        run(rig, SINE, options=RunOptions(watch=watch))
    except RigError as error:
        assert "has 0 samples" in str(error)  # noqa: PT017
    assert rig.told.count("play") == 100


def test_a_following_error_is_in_the_unit_of_the_axis_whatever_is_measured_in():
    class InRadians(Measured):
        unit = "rad"

    rig = InRadians(lambda b: np.radians(0.7 * b.position[:, 0]))
    with pytest.raises(RigError, match=r"y is 0\.5\d+ deg from its command"):
        run(rig, SINE, options=RunOptions(watch=Watch(following_error=0.5)))
    run(InRadians(rig.read), SINE, options=RunOptions(watch=Watch(following_error=0.7)))


def test_what_cannot_be_watched_is_refused_before_anything_moves():
    class WithoutCommand(Measured):
        def prepare(self, stimulus):
            layout = super().prepare(stimulus)
            command = replace(layout.channels[0], axis=None, quantity=None, commanded=False)
            return replace(layout, channels=(command, layout.channels[1]))

    rig = WithoutCommand(lambda b: b.position[:, 0])
    with pytest.raises(RigError, match=r"records no commanded position of axis ''; state one"):
        run(rig, SINE, options=RunOptions(watch=Watch(following_error=0.5)))
    assert rig.moved == []

    class InVolts(Measured):
        unit = "V"

    rig = InVolts(lambda b: b.position[:, 0])
    with pytest.raises(UnitError, match="unit 'V' cannot be turned into 'deg'"):
        run(rig, SINE)
    assert rig.moved == []
    assert rig.told[-2:] == ["stop", "exit"]


def test_a_run_may_be_ended_early_for_a_reason():
    spy = Spy()
    record = run(spy, SINE, until=lambda p: "sure enough" if p.block.time[-1] > 0.985 else None)
    assert record.samples == 100
    assert spy.told[-2:] == ["stop", "exit"]
    (finding,) = record.findings
    assert finding.code == "ended_early"
    assert finding.message == "The run was ended after 0.99 s: sure enough."


@pytest.mark.parametrize("wrong", [{"margin": -0.1}, {"stale": True}, {"following_error": "x"}])
def test_what_cannot_be_watched(wrong):
    with pytest.raises(ArgumentError, match="must be 0 or positive"):
        Watch(**wrong)
