"""What a run keeps on the disk: all of it, as it comes, whatever ends the run."""

import errno
import os
import shutil
import signal
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from hmpim.errors import ArgumentError, RecordError, RigError
from hmpim.experiment import RunLog, recorder, run
from hmpim.experiment.interrupt import AskedToEnd
from hmpim.experiment.recorder import Recorder
from hmpim.formats import load
from hmpim.formats.recording import RecordWriter, read_recording, writer
from hmpim.identify import identify
from hmpim.rigs import Samples, Sensor
from hmpim.stimulus import Limits, design

LIMITS = Limits(position=10, velocity=300, acceleration=5000, unit="deg")
SWEEP = design(band=(0.2, 20), duration=6, fs=200, limits=LIMITS)
SENSOR = Sensor(delay=0.05, natural_frequency=8.0, damping_ratio=0.5, noise_std=0.01)


class Failing:
    """The sensor, until it fails."""

    name, axes, limits, moves = "failing", (), LIMITS, True

    def __init__(self, fault=None, after=3.0, unit=SENSOR):
        self.fault, self.after, self.unit, self.told = fault, after, unit, []

    def __enter__(self):
        self.unit.__enter__()
        return self

    def __exit__(self, *_):
        self.told.append("exit")

    def seed(self, rng):
        self.unit.seed(rng)

    def prepare(self, stimulus):
        self.told.append("prepare")
        return self.unit.prepare(stimulus)

    def play(self, block):
        if self.fault is not None and block.time[0] >= self.after:
            raise self.fault
        return self.unit.play(block)

    def stop(self):
        self.told.append("stop")


def test_the_file_is_the_record_and_says_what_it_was_made_with(tmp_path):
    log = RunLog()
    record = run(SENSOR, SWEEP, path=tmp_path / "r.h5", limits=LIMITS, rng=1, log=log)
    kept = read_recording(tmp_path / "r.h5")
    assert kept.record == record
    assert kept.complete
    assert kept.stimuli == (SWEEP,)
    assert kept.rig == "sensor"
    assert kept.limits == {"": LIMITS}
    assert kept.log == tuple(" ".join(str(event).split()) for event in log.events)
    assert [line.split()[2] for line in kept.log] == ["check", "arm", "start", "done", "stop"]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["r.h5"]


def test_a_file_of_another_kind_is_written_at_the_end(tmp_path):
    record = run(SENSOR, SWEEP, path=tmp_path / "r.csv", rng=1)
    assert load(tmp_path / "r.csv").sha256 == record.sha256


def test_a_file_that_is_written_at_the_end_grows_beside_it_until_then(tmp_path):
    """What a kill leaves."""
    seen = []

    def look(played):
        if played.block.time[-1] > 3.0 and not seen:
            seen.append(read_recording(tmp_path / "r.csv.partial.h5"))

    record = run(SENSOR, SWEEP, path=tmp_path / "r.csv", rng=1, subscribers=[look])
    (kept,) = seen
    assert not kept.complete
    count = kept.record.samples
    assert count > 2.7 * SWEEP.fs
    assert np.array_equal(kept.record.outputs[0].values, record.outputs[0].values[:count])
    assert sorted(p.name for p in tmp_path.iterdir()) == ["r.csv"]


def test_a_record_that_cannot_be_written_at_the_end_is_kept_beside(tmp_path, monkeypatch):
    def full(*_, **__):
        raise ArgumentError("'r.csv' cannot be written: No space left on device")

    monkeypatch.setattr(recorder, "save", full)
    log = RunLog()
    with pytest.raises(ArgumentError, match="No space left"):
        run(SENSOR, SWEEP, path=tmp_path / "r.csv", rng=1, log=log)
    assert log.events[-1].message.endswith("r.csv.partial.h5")
    assert read_recording(tmp_path / "r.csv.partial.h5").record.samples == SWEEP.samples


@pytest.mark.skipif(sys.platform == "win32", reason="it does not replace a file that is open")
@pytest.mark.parametrize("name", ["r.h5", "r.csv"])
def test_a_second_run_onto_a_file_that_is_being_written_is_refused(tmp_path, name):
    second, said = Failing(), []

    def again(played):
        if played.block.time[-1] > 1.0 and not said:
            with pytest.raises(ArgumentError, match="is being written by another run") as refusal:
                run(second, SWEEP, path=tmp_path / name)
            said.append(str(refusal.value))

    record = run(SENSOR, SWEEP, path=tmp_path / name, rng=1, subscribers=[again])
    assert "prepare" not in second.told
    assert load(tmp_path / name).sha256 == record.sha256
    assert sorted(p.name for p in tmp_path.iterdir()) == [name]


@pytest.mark.skipif(sys.platform == "win32", reason="it does not replace a file that is open")
def test_of_two_runs_begun_at_once_the_later_one_ends_and_the_first_is_kept(tmp_path):
    layout = SENSOR.prepare(SWEEP)
    second = RecordWriter(tmp_path / "r.h5", layout, fs=200.0, samples=SWEEP.samples)

    def theirs(played):
        if played.block.start == 0:
            with pytest.raises(ArgumentError, match="is being written by another run"):
                second.append({"y": Samples(time=[0.0], values=[0.0])})

    record = run(SENSOR, SWEEP, path=tmp_path / "r.h5", rng=1, subscribers=[theirs])
    second.close(ended="refused")
    assert load(tmp_path / "r.h5").sha256 == record.sha256
    assert sorted(p.name for p in tmp_path.iterdir()) == ["r.h5"]


@pytest.mark.parametrize("step", [-1.5, -0.2, 1e6])
def test_a_clock_that_is_set_in_mid_run_ends_it_and_what_was_before_can_be_read(tmp_path, step):
    class Set(Failing):
        def play(self, block):
            time = block.time if block.time[0] < 3.0 else block.time + step
            return {name: Samples(time=time, values=np.array(block.position[:, 0]))
                    for name in ("u", "y")}  # fmt: skip

    rig = Set()
    with pytest.raises(RigError, match=r"clock of 'u' was set: a sample at 2\.995 s is followed"):
        run(rig, SWEEP, path=tmp_path / "r.h5")
    assert rig.told == ["prepare", "stop", "exit"]
    assert read_recording(tmp_path / "r.h5").record.samples == 600


def test_a_single_damaged_stamp_ends_no_run(tmp_path):
    class Damaged(Failing):
        def play(self, block):
            time = np.where(block.time == 3.0, 1e9, block.time)
            return {name: Samples(time=time, values=np.array(block.position[:, 0]))
                    for name in ("u", "y")}  # fmt: skip

    record = run(Damaged(), SWEEP, path=tmp_path / "r.h5")
    assert record.samples == SWEEP.samples - 1
    assert "stray_stamps" in {finding.code for finding in record.findings}


@pytest.mark.parametrize(
    "fault", [OSError("cable"), KeyboardInterrupt(), SystemExit(143), ZeroDivisionError()]
)
def test_whatever_ends_the_run_keeps_what_there_was_and_it_is_identified(tmp_path, fault):
    rig, log = Failing(fault), RunLog()
    with pytest.raises(BaseException) as caught:  # noqa: PT011 - each kind in turn
        run(rig, SWEEP, path=tmp_path / "r.h5", rng=1, log=log)
    assert caught.value is fault or caught.value.__cause__ is fault
    assert rig.told == ["prepare", "stop", "exit"]
    kept = read_recording(tmp_path / "r.h5")
    assert not kept.complete
    (said,) = [f for f in kept.record.findings if f.code == "incomplete"]
    name = "Ctrl-C" if isinstance(fault, KeyboardInterrupt) else type(fault).__name__
    assert f"ended early ({name}" in said.message
    whole = run(SENSOR, SWEEP, rng=1)
    assert kept.record.samples == 600
    assert np.array_equal(kept.record.outputs[0].values, whole.outputs[0].values[:600])
    assert any(" fault " in line for line in kept.log)
    assert any(" stop " in line for line in kept.log)
    pair = identify(kept.record)["y", "u"]
    for name, truth in (("delay", 0.05), ("natural_frequency", 8.0), ("damping_ratio", 0.5)):
        found = getattr(pair.parameters, name)
        assert abs(found.value - truth) < 4 * found.std


@pytest.mark.parametrize("fault", [OSError("cable"), KeyboardInterrupt(), AskedToEnd(15)])
def test_a_file_that_does_not_grow_keeps_what_there_was_too(tmp_path, fault):
    log = RunLog()
    with pytest.raises((RigError, KeyboardInterrupt, AskedToEnd)) as caught:
        run(Failing(fault), SWEEP, path=tmp_path / "r.csv", rng=1, log=log)
    assert caught.value is fault or caught.value.__cause__ is fault
    record = load(tmp_path / "r.csv")
    whole = run(SENSOR, SWEEP, rng=1)
    assert np.array_equal(record.outputs[0].values, whole.outputs[0].values[:600])
    (said,) = [f for f in record.findings if f.code == "incomplete"]
    why = {OSError: "OSError: cable", KeyboardInterrupt: "Ctrl-C", AskedToEnd: "SIGTERM"}
    assert why[type(fault)] in said.message
    assert log.events[-1].message == f"what was recorded until then is in {tmp_path / 'r.csv'}"


def test_a_file_that_does_not_grow_is_left_alone_where_nothing_was_recorded(tmp_path):
    (tmp_path / "r.csv").write_text("of yesterday")
    with pytest.raises(RigError):
        run(Failing(OSError("cable"), after=0.0), SWEEP, path=tmp_path / "r.csv", rng=1)
    assert (tmp_path / "r.csv").read_text() == "of yesterday"


@pytest.mark.skipif(os.name != "posix", reason="signals to oneself")
def test_a_second_ctrl_c_does_not_hide_what_was_kept(tmp_path, monkeypatch):
    log, fail = RunLog(), Recorder.fail

    def interrupted(self, reason):
        os.kill(os.getpid(), signal.SIGINT)
        return fail(self, reason)

    monkeypatch.setattr(Recorder, "fail", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run(Failing(KeyboardInterrupt()), SWEEP, path=tmp_path / "r.h5", rng=1, log=log)
    assert [event.kind for event in log.events][-2:] == ["stop", "kept"]


def test_another_process_reads_all_but_the_last_quarter_second_while_it_runs(tmp_path):
    seen = []

    def look(played):
        now = played.block.time[-1]
        if now > 1.0 and played.block.stop % 52 == 0:
            kept = read_recording(tmp_path / "r.h5")
            assert not kept.complete
            seen.append(now - kept.record.outputs[0].time[-1])

    run(SENSOR, SWEEP, path=tmp_path / "r.h5", rng=1, subscribers=[look])
    assert len(seen) > 10
    assert 0.1 < max(seen) < 0.27  # somewhere between two writings


def test_an_unwritable_folder_is_refused_before_anything_moves(tmp_path):
    rig = Failing()
    for path, words in (
        (tmp_path / "no" / "r.h5", "does not exist"),
        (tmp_path, "is a folder"),
        ("/dev/full/r.h5", "does not exist"),
        ("/proc/r.h5", "cannot be written"),
    ):
        with pytest.raises(ArgumentError, match=words):
            run(rig, SWEEP, path=path)
    assert rig.told == ["exit"] * 4


@pytest.mark.parametrize("name", ["r.h5", "r.csv"])
def test_a_full_disk_is_refused_before_anything_moves(tmp_path, monkeypatch, name):
    rig = Failing()
    usage = SimpleNamespace(total=1 << 30, used=1 << 30, free=20_000)
    monkeypatch.setattr(shutil, "disk_usage", lambda _path: usage)
    with pytest.raises(ArgumentError, match=r"needs .* MB, but its disk has only 0\.02 MB"):
        run(rig, SWEEP, path=tmp_path / name)
    assert "prepare" not in rig.told
    assert not any(tmp_path.iterdir())


def test_a_disk_that_fails_later_stops_the_rig_and_leaves_what_was_written(tmp_path, monkeypatch):
    rig, put = Failing(), writer._put

    def failing(file, place, data):
        if ready.is_set:
            raise OSError(errno.EIO, "Input/output error")
        put(file, place, data)

    ready = SimpleNamespace(is_set=False)
    monkeypatch.setattr(writer, "_put", failing)

    def later(played):
        ready.is_set = played.block.time[-1] > 2.9

    with pytest.raises(
        RecordError, match=r"accepts no more samples .Input/output error.; what was"
    ):
        run(rig, SWEEP, path=tmp_path / "r.h5", rng=1, subscribers=[later])
    assert rig.told == ["prepare", "stop", "exit"]
    kept = read_recording(tmp_path / "r.h5")
    assert not kept.complete
    assert kept.record.outputs[0].time[-1] > 2.6


def test_a_run_that_fails_at_once_leaves_the_file_before_it_alone(tmp_path):
    run(SENSOR, SWEEP, path=tmp_path / "r.h5", rng=1)
    before = (tmp_path / "r.h5").read_bytes()
    with pytest.raises(KeyboardInterrupt):
        run(Failing(KeyboardInterrupt(), after=0.0), SWEEP, path=tmp_path / "r.h5")
    assert (tmp_path / "r.h5").read_bytes() == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["r.h5"]
