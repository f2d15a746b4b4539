"""A record that grows as samples come: nothing that was appended is lost, whatever happens."""

import os
import sys

import h5py
import numpy as np
import pytest

import hmpim
from hmpim.errors import ArgumentError, RecordError
from hmpim.formats.recording import RecordWriter, read_recording
from hmpim.record import Record
from hmpim.rigs import ChannelSpec, Layout, Samples
from hmpim.stimulus import Limits, Sine, Stimulus

LAYOUT = Layout(
    channels=(
        ChannelSpec(name="u", role="input", unit="deg"),
        ChannelSpec(name="y", role="output", unit="V"),
        ChannelSpec(name="r", role="reference", unit="deg"),
        ChannelSpec(name="heat", role="auxiliary", unit="degC"),
    ),
    intersample="zoh",
    source="bench 2",
)
FS = 100.0


def part(first, last):
    """Samples of all channels; the temperature comes at a hundredth of the rate."""
    k = np.arange(first, last)
    slow = k[k % 100 == 0]
    return {
        "u": Samples(time=k / FS, values=np.sin(0.1 * k)),
        "y": Samples(time=k / FS + 1e-3, values=np.cos(0.1 * k)),
        "r": Samples(time=k / FS, values=k / 3),
        "heat": Samples(time=slow / FS, values=20.0 + slow),
    }


def whole(n):
    given = part(0, n)
    channels = {
        name: hmpim.Channel(
            name=name,
            time=given[name].time,
            values=given[name].values,
            unit=next(c.unit for c in LAYOUT.channels if c.name == name),
        )
        for name in given
    }
    return Record(
        inputs=(channels["u"],),
        outputs=(channels["y"],),
        references=(channels["r"],),
        auxiliary=(channels["heat"],),
        fs=FS,
        intersample="zoh",
        source="bench 2",
    )


def played(writer, n, *, steps):
    """Append n samples in parts of the sizes of `steps`, over and over."""
    first, turn = 0, 0
    while first < n:
        last = min(n, first + steps[turn % len(steps)])
        writer.append(part(first, last))
        first, turn = last, turn + 1


@pytest.mark.parametrize("steps", [(1,), (7, 0, 30), (400,), (1000,)])
@pytest.mark.parametrize("expected", [1000, 10])
def test_it_is_the_record_however_the_samples_came(tmp_path, steps, expected):
    """Sample by sample or all at once, in the room expected or in a file that had to grow."""
    path = tmp_path / "run.h5"
    with RecordWriter(path, LAYOUT, fs=FS, samples=expected) as writer:
        played(writer, 1000, steps=steps)
        assert writer.samples == 1000
    assert hmpim.load(path) == whole(1000)
    assert os.listdir(tmp_path) == ["run.h5"]
    saved = tmp_path / "saved.h5"
    hmpim.save(whole(1000), saved)
    with h5py.File(path) as grown, h5py.File(saved) as other:
        np.testing.assert_array_equal(grown["outputs/y/blocks"][()], other["outputs/y/blocks"][()])
        assert grown.attrs["sha256"] == other.attrs["sha256"]


def test_at_every_moment_all_that_was_appended_can_be_read(tmp_path):
    path = tmp_path / "run.h5"
    writer = RecordWriter(path, LAYOUT, fs=FS, samples=150)
    for first, last in ((0, 200), (200, 201), (201, 350), (350, 720)):
        writer.append(part(first, last))
        found = hmpim.load(path)  # as a process sees it that opens the file after a kill -9
        assert [f.code for f in found.findings] == ["incomplete"]
        message = found.findings[0].message
        assert "'run.h5' was never closed" in message
        assert f"to {last} samples of each channel, up to {(last - 1) / FS + 1e-3:.6g} s" in message
        expected = whole(last)
        assert found.channels == expected.channels
        assert not read_recording(path).complete
    writer.close()
    assert hmpim.load(path) == whole(720)


def test_a_sample_that_was_half_written_is_not_taken_for_one(tmp_path):
    """Data go first, then their checksum: between the two, the data do not count."""
    path = tmp_path / "run.h5"
    writer = RecordWriter(path, LAYOUT, fs=FS, samples=1000)
    writer.append(part(0, 500))
    with h5py.File(path) as file:
        places = {name: file[f"outputs/y/{name}"].id.get_offset() for name in ("values", "blocks")}
    with path.open("r+b") as file:  # as if killed in the midst of the next append
        file.seek(places["values"] + 8 * 500)
        file.write(np.full(10, 7.0).tobytes())
    assert hmpim.load(path).outputs == whole(500).outputs
    with path.open("r+b") as file:  # a row of the table torn apart
        file.seek(places["blocks"] + 32 * 20)
        file.write(np.array([500, 10], dtype="<u8").tobytes())
    assert hmpim.load(path).outputs == whole(500).outputs
    writer.close()


def test_what_a_killed_writer_leaves_is_identified(tmp_path):
    """Two thirds of the record, and the delay is still right."""
    limits = Limits(position=10, velocity=1000, acceleration=40000, unit="deg")
    stimulus = hmpim.design(band=(0.1, 20), duration=10, fs=200, limits=limits)
    sensor = hmpim.Sensor(delay=0.15, natural_frequency=10, damping_ratio=0.4, noise_std=0.1)
    record = hmpim.run(sensor, stimulus, rng=1)
    u, y = record.inputs[0], record.outputs[0]
    layout = Layout(
        channels=tuple(
            ChannelSpec(name=c.name, role=role, unit=c.unit)
            for c, role in ((u, "input"), (y, "output"))
        )
    )
    path = tmp_path / "run.h5"
    writer = RecordWriter(path, layout, fs=200.0, samples=2000, band=record.band)
    for k in range(0, 1400, 20):
        cut = slice(k, k + 20)
        writer.append({c.name: Samples(time=c.time[cut], values=c.values[cut]) for c in (u, y)})
    pair = hmpim.identify(hmpim.read(path), intersample="bandlimited")["y", "u"]
    assert abs(pair.delay.value - 0.15) < 4 * pair.delay.std < 0.005
    assert "incomplete" in [w.code for w in pair.warnings]
    writer.close()


def test_what_it_was_made_with_and_what_happened_are_kept(tmp_path):
    stimulus = Stimulus(waveform=Sine(frequency=1.0, duration=2.0), fs=FS, unit="deg")
    limits = Limits(position=3.0, unit="deg")
    path = tmp_path / "run.h5"
    with RecordWriter(
        path,
        LAYOUT,
        fs=FS,
        samples=200,
        band=(0.1, 2.0),
        stimuli=[stimulus],
        rig="b2",
        limits=limits,
    ) as writer:
        writer.log("armed:\n4 channels")
        for k in range(600):
            writer.log(f"line {k}")
        played(writer, 1000, steps=(50,))
    found = read_recording(path)
    assert found.stimuli == (stimulus,)
    assert (found.rig, found.limits, found.complete) == ("b2", {"": limits}, True)
    assert found.log[:2] == ("armed: 4 channels", "line 0")
    assert len(found.log) == 500
    assert found.record.band == (0.1, 2.0)


def test_a_run_that_fails_keeps_its_samples_and_says_why(tmp_path):
    path = tmp_path / "run.h5"

    def failing():
        with RecordWriter(path, LAYOUT, fs=FS, samples=1000) as writer:
            played(writer, 300, steps=(50,))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        failing()
    found = hmpim.load(path)
    assert found.channels == whole(300).channels
    assert "ended early (KeyboardInterrupt); 3 to 300 samples" in found.findings[0].message
    assert not read_recording(path).complete
    with h5py.File(path) as file:  # cut to what is there
        assert file["inputs/u/values"].shape == (300,)


def test_a_run_that_never_began_leaves_what_was_there(tmp_path):
    path = tmp_path / "run.h5"
    hmpim.save(whole(300), path)

    def failing():
        with RecordWriter(path, LAYOUT, fs=FS, samples=1000) as writer:
            writer.append({name: Samples(time=[], values=[]) for name in ("u", "y")})
            raise ValueError("not armed")

    with pytest.raises(ValueError, match="not armed"):
        failing()
    assert hmpim.load(path) == whole(300)
    with pytest.raises(RecordError, match=r"not one sample was written to 'run\.h5'"):
        RecordWriter(path, LAYOUT, fs=FS, samples=10).close()
    assert hmpim.load(path) == whole(300)
    assert os.listdir(tmp_path) == ["run.h5"]


def test_what_cannot_be_written_is_refused_before_anything_is(tmp_path):
    with pytest.raises(ArgumentError, match="does not exist; make it first"):
        RecordWriter(tmp_path / "no" / "run.h5", LAYOUT, fs=FS, samples=10)
    with pytest.raises(ArgumentError, match=r"'run\.csv' is to be a record file; let it"):
        RecordWriter("run.csv", LAYOUT, fs=FS, samples=10)
    with pytest.raises(ArgumentError, match="make room, or name another folder"):
        RecordWriter(tmp_path / "run.h5", LAYOUT, fs=FS, samples=10**14)
    with pytest.raises(ArgumentError, match="cannot be written"):
        RecordWriter("/proc/run.h5", LAYOUT, fs=FS, samples=10)
    assert os.listdir(tmp_path) == []
    with RecordWriter(tmp_path / "run.h5", LAYOUT, fs=FS, samples=10) as writer:
        with pytest.raises(ArgumentError, match="'z' is not in this record; it has u, y, r, heat"):
            writer.append({"z": Samples(time=[0.0], values=[0.0])})
        played(writer, 300, steps=(300,))
    with pytest.raises(ArgumentError, match=r"'run\.h5' is closed"):
        writer.append(part(0, 1))
    writer.close()  # once more does no harm


def test_a_full_disk_loses_nothing_of_what_was_there(tmp_path, monkeypatch):
    """Room for what was expected is taken up front; it can be missing only where more comes."""
    path = tmp_path / "run.h5"
    writer = RecordWriter(path, LAYOUT, fs=FS, samples=300)
    played(writer, 300, steps=(50,))

    def full(*given, **named):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("hmpim.formats.recording.writer.new_file", full)
    with pytest.raises(ArgumentError, match=r"cannot be written: .*No space left"):
        writer.append(part(300, 2000))
    monkeypatch.undo()
    assert hmpim.load(path).channels == whole(300).channels
    # Closing needs room too; without it the file stays as it grew.
    monkeypatch.setattr("hmpim.formats.recording.recording.new_file", full)
    with pytest.raises(ArgumentError, match="No space left"):
        writer.close()
    monkeypatch.undo()
    assert hmpim.load(path).channels == whole(300).channels
    assert os.listdir(tmp_path) == ["run.h5"]


def test_the_room_expected_is_taken_at_once(tmp_path):
    """A disk that fills up during the run does not matter any more."""
    path = tmp_path / "run.h5"
    with RecordWriter(path, LAYOUT, fs=1000.0, samples=50_000) as writer:
        writer.append({"u": Samples(time=[0.0, 1.0], values=[0.0, 1.0])})
        taken = path.stat().st_blocks * 512
        assert taken > 4 * 16 * 50_000
        played(writer, 10, steps=(10,))
        assert path.stat().st_blocks * 512 == taken
        with h5py.File(path) as file:  # what is not there yet reads as no number
            assert np.isnan(file["outputs/y/values"][10:]).all()


def test_samples_that_no_record_may_hold_are_mended_when_read(tmp_path):
    path = tmp_path / "run.h5"
    late = np.array([0.0, 0.02, 0.01, 0.03])
    with RecordWriter(path, LAYOUT, fs=FS, samples=300) as writer:
        played(writer, 300, steps=(100,))
        writer.append({"y": Samples(time=3.0 + late, values=[1.0, np.nan, 2.0, 3.0])})
    found = hmpim.load(path)
    assert [f.code for f in found.findings] == ["backward_stamps", "missing_samples"]
    assert found.outputs[0].values[-3:].tolist() == [1.0, 2.0, 3.0]
    assert hmpim.read(path) == found


@pytest.mark.skipif(sys.platform == "win32", reason="there is no such limit")
def test_a_file_that_the_system_cuts_short_is_refused_with_its_reason_and_leaves_nothing(tmp_path):
    """The library says it as a RuntimeError when it closes the file."""
    import resource

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))
    try:
        with pytest.raises(ArgumentError, match=r"r\.h5' cannot be written: .*File too large"):
            RecordWriter(tmp_path / "r.h5", LAYOUT, fs=FS, samples=100_000)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert not any(tmp_path.iterdir())
