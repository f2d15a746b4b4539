"""A driver that does not return is broken off: the rig is stopped, and the record is kept."""

import signal
import socket
import threading

import numpy as np
import pytest

from hmpim.errors import RigError
from hmpim.experiment import ManualClock, OutlivingRig, RunLog, RunOptions, Watch, run
from hmpim.experiment.deadline import Deadline
from hmpim.formats.recording import read_recording
from hmpim.rigs import Sensor, SystemClock
from hmpim.stimulus import Limits, Sine, Stimulus

LIMITS = Limits(position=3.0, velocity=20.0, acceleration=2000.0, unit="deg")
SINE = Stimulus(waveform=Sine(amplitude=2.0, frequency=1.0, duration=2.0), fs=100.0, unit="deg")


class Hanging:
    """A rig that moves, answers for a second, and then waits for what never comes."""

    name, axes, limits, moves = "lever", (), LIMITS, True

    def __init__(self, wait, *, clock=None, place="play"):
        self.wait, self.clock, self.place = wait, clock, place
        self.told = []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.told.append("exit")

    def prepare(self, stimulus):
        pass

    def play(self, block):
        if self.place == "play" and block.start >= 100:
            self._hang()
        return block.position

    def stop(self):
        self.told.append("stop")
        if self.place == "stop":
            self._hang()

    def _hang(self):
        if self.clock is not None:
            self.clock.advance(100.0)
        self.wait()


def socket_read():
    here, there = socket.socketpair()
    with here, there:
        here.recv(1)


def lock():
    threading.Event().wait()


def takes_every_error_for_its_own():
    while True:
        try:
            socket_read()
        except Exception:
            continue


@pytest.mark.parametrize("wait", [socket_read, lock, takes_every_error_for_its_own])
def test_a_driver_that_hangs_is_stopped_and_what_was_recorded_is_kept(tmp_path, wait):
    clock = ManualClock()
    rig = Hanging(wait, clock=clock)
    log = RunLog()
    before = signal.getsignal(signal.SIGINT)
    said = r"'lever' did not return from play within 5 s after command 101 was due, at 1\.01 s"
    with pytest.raises(RigError, match=said):
        run(rig, SINE, path=tmp_path / "r.h5", log=log, options=RunOptions(clock=clock))
    assert rig.told == ["stop", "exit"]
    assert [event.kind for event in log.events][-3:] == ["fault", "stop", "kept"]
    kept = read_recording(tmp_path / "r.h5")
    assert not kept.complete
    assert np.array_equal(kept.record.outputs[0].values, SINE.position[:100])
    assert signal.getsignal(signal.SIGINT) is before


def test_a_stop_that_hangs_does_not_keep_the_run_for_ever():
    clock = ManualClock()
    rig = Hanging(lock, clock=clock, place="stop")
    with pytest.raises(RigError, match="stop did not return within 60 s; stop 'lever' by hand"):
        run(rig, SINE, options=RunOptions(clock=clock))
    assert rig.told == ["stop", "exit"]


def test_where_nothing_can_be_broken_off_the_rig_is_stopped_from_another_thread():
    clock, released, failed = ManualClock(), threading.Event(), []
    rig = Hanging(released.wait, clock=clock)
    stop = rig.stop

    def released_by_the_stop():
        stop()
        released.set()

    rig.stop = released_by_the_stop

    def work():
        try:
            run(rig, SINE, options=RunOptions(clock=clock))
        except RigError as error:
            failed.append(str(error))

    thread = threading.Thread(target=work)  # signals do not come there
    thread.start()
    thread.join()
    assert rig.told == ["stop", "stop", "exit"]
    assert "did not return from play" in failed[0]


def test_ctrl_c_is_still_ctrl_c_while_a_call_is_timed():
    deadline = Deadline(SystemClock())
    with pytest.raises(KeyboardInterrupt), deadline, deadline.within(1000.0, "not this"):
        signal.raise_signal(signal.SIGINT)


def test_software_may_take_its_time():
    clock = ManualClock()
    rig = Hanging(lambda: None, clock=clock)
    rig.moves = False
    run(rig, SINE, options=RunOptions(clock=clock))
    assert rig.told == ["stop", "exit"]


class HangingFile(Hanging):
    """The same in another process, with a file that says what was done."""

    def __init__(self, path):
        super().__init__(socket_read)
        self.path = path

    def stop(self):
        with open(self.path, "a") as file:
            file.write("stop\n")


def test_in_a_process_of_its_own_it_is_stopped_too(tmp_path):
    rig = OutlivingRig(HangingFile, str(tmp_path / "t.txt"))
    watch = Watch(answer=0.3)
    with pytest.raises(RigError, match=r"'lever' did not return from play within 0\.3 s"):
        run(rig, SINE, path=tmp_path / "r.h5", options=RunOptions(watch=watch))
    assert (tmp_path / "t.txt").read_text().startswith("stop\n")
    assert not rig._process.is_alive()
    kept = read_recording(tmp_path / "r.h5").record
    assert kept.outputs[0].values.size >= 90


def test_commands_do_not_go_all_at_once_after_a_pause_of_the_computer():
    clock = ManualClock()
    sent = []

    class Axis(Hanging):
        def play(self, block):
            for k in block.due():
                sent.append(block.start + k)
                if sent[-1] == 80:
                    clock.advance(3.0)
            return block.position

    rig = Axis(None)
    with pytest.raises(RigError, match=r"command 81 is 2\.99 s late, and 0\.5 s are allowed"):
        run(rig, SINE, options=RunOptions(clock=clock))
    assert sent[-1] == 80
    assert rig.told == ["stop", "exit"]
    sent.clear()
    run(rig, SINE, options=RunOptions(clock=clock, watch=Watch(late=None)))
    assert len(sent) == SINE.samples


def test_a_simulation_cannot_hang_and_starts_no_thread(monkeypatch):
    started = []
    start = Deadline._start

    def counted(deadline):
        started.append(deadline)
        start(deadline)

    monkeypatch.setattr(Deadline, "_start", counted)
    before = signal.getsignal(signal.SIGINT)
    run(Sensor(delay=0.05), SINE, rng=1)
    assert not started
    rig = Hanging(lambda: None, place="nowhere")
    run(rig, SINE, options=RunOptions(clock=ManualClock()))
    assert len(started) == 2  # to play, and to stop
    assert signal.getsignal(signal.SIGINT) is before
