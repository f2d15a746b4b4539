"""A record file gives back what was saved, opens anywhere, and says what was damaged."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hmpim
from hmpim.errors import ArgumentError, FormatError
from hmpim.formats.recording import read_recording, save_recording
from hmpim.record import Channel, Finding, Record
from hmpim.stimulus import Limits, Sine, Stimulus, design
from tests_support import examples

LIMITS = Limits(position=10, velocity=1000, acceleration=40000, unit="deg")
GAPS = Finding(code="gaps", message="3 are missing: ±1 %", severity="info", parameters=("delay",))


def channel(name, n, *, unit="", fs=100.0, seed=0):
    rng = np.random.default_rng(seed)
    return Channel(
        name=name,
        time=np.cumsum(rng.uniform(0.5, 1.5, n)) / fs,
        values=rng.normal(size=n),
        unit=unit,
    )


@pytest.fixture
def record():
    u = channel("u/1", 1000, unit="deg")
    return Record(
        inputs=(u, replace(u, name="U_1", values=u.values**2)),
        outputs=(channel("y", 997, unit="deg/s²", seed=1), channel("ö [V]", 40, unit="V", seed=2)),
        fs=100.0,
        band=(0.1, 1 / 3),
        intersample="foh",
        source="bench 2, Jürgen",
        findings=(GAPS,),
        references=(replace(u, name="."),),
        auxiliary=(channel("temperature", 3, unit="degC", fs=0.01, seed=3),),
    )


NAMES = st.text(st.characters(codec="utf-8", exclude_characters="\0"), min_size=1, max_size=12)
VALUES = st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=2, max_size=9)


@examples(10)
@given(
    names=st.lists(NAMES, min_size=4, max_size=4, unique=True),
    values=st.lists(VALUES, min_size=4, max_size=4),
    seed=st.integers(0, 99),
    fs=st.floats(0.1, 1e5),
    source=st.text(st.characters(codec="utf-8", exclude_characters="\0")),
)
def test_whatever_is_saved_comes_back_equal(tmp_path_factory, names, values, seed, fs, source):
    rng = np.random.default_rng(seed)
    u, y, r, a = (
        Channel(name=name, time=np.cumsum(rng.uniform(1e-9, 1.0, len(v))) - 1.0, values=v)
        for name, v in zip(names, values, strict=True)
    )
    saved = Record(inputs=(u,), outputs=(y,), references=(r,), auxiliary=(a,), fs=fs, source=source)
    path = tmp_path_factory.mktemp("records") / "r.h5"
    hmpim.save(saved, path)
    assert hmpim.load(path) == saved
    assert hmpim.read(path) == saved
    assert hmpim.load(path).sha256 == saved.sha256


def test_every_field_comes_back_and_so_does_what_it_was_made_with(record, tmp_path):
    stimuli = (
        design(band=(0.1, 20), duration=2, fs=200, limits=LIMITS, axis="roll"),
        design(band=(0.1, 20), duration=3, fs=200, limits=LIMITS, axis="yaw"),
    )
    limits = {"roll": LIMITS, "yaw": Limits(velocity=3.0, unit="rad")}
    log = ("armed: 5 axes", "a line\nof two " + 300 * "ä")
    path = tmp_path / "r.h5"
    save_recording(record, path, stimuli=stimuli, rig="täble", limits=limits, log=log)
    found = read_recording(path)
    assert found.record == record == hmpim.load(path)
    assert found.stimuli == stimuli
    assert found.limits == limits
    assert found.rig == "täble"
    assert found.complete
    assert found.log[0] == log[0]
    assert found.log[1].startswith("a line of two ää")
    # One rig, one axis: its limits need no name.
    save_recording(record, path, limits=LIMITS)
    assert read_recording(path).limits == {"": LIMITS}


def test_a_waveform_of_ones_own_is_no_hindrance(record, tmp_path):
    class Mine(Sine):
        pass

    played = Stimulus(waveform=Mine(frequency=1.0, duration=2.0), fs=10.0)
    save_recording(record, tmp_path / "r.h5", stimuli=[played])
    assert read_recording(tmp_path / "r.h5").record == record
    assert read_recording(tmp_path / "r.h5").stimuli == ()


def test_it_is_plain_hdf5(record, tmp_path):
    """Datasets and attributes that h5py, MATLAB and HDFView show as they are."""
    path = tmp_path / "r.h5"
    hmpim.save(record, path)
    with h5py.File(path) as file:
        assert not file.swmr_mode
        assert file["inputs/u_1/values"].dtype == np.dtype("<f8")
        assert file["inputs/u_1/values"].chunks is None
        np.testing.assert_array_equal(file["inputs/u_1/values"][:], record.inputs[0].values)
        assert file["inputs/u_1"].attrs["name"].decode() == "u/1"
        assert file["inputs/u_1/values"].attrs["unit"].decode() == "deg"
        assert file["inputs/u_1/time"].attrs["unit"].decode() == "s"
        assert set(file["inputs"]) == {"u_1", "U_1_2"}
        # Channels that share stamps share a dataset.
        assert (
            file["inputs/u_1/time"] == file["inputs/U_1_2/time"] == file["references/channel/time"]
        )
        assert file["outputs/y/time"] != file["inputs/u_1/time"]
        assert file.attrs["fs"] == 100.0
        assert file.attrs["complete"] == 1
        assert file.attrs["sha256"].decode() == record.sha256
    assert path.read_bytes()[8] == 2  # the superblock of HDF5 1.8, which has a checksum


@pytest.mark.parametrize("what", ["values", "time", "row"])
def test_a_damaged_block_is_said_and_left_out(record, tmp_path, what):
    path = tmp_path / "r.h5"
    hmpim.save(record, path)
    with h5py.File(path, "r+") as file:
        group = file["outputs/y"]
        if what == "row":
            group["blocks"][7, 1] = 3
        else:
            group[what][180] += 1e-12
    found = hmpim.load(path)
    kept = np.r_[0:175, 200:997]
    np.testing.assert_array_equal(found.outputs[0].values, record.outputs[0].values[kept])
    np.testing.assert_array_equal(found.outputs[0].time, record.outputs[0].time[kept])
    assert found.inputs == record.inputs
    assert found.findings[0] == GAPS
    assert found.findings[1].code == "damaged_blocks"
    assert "25 samples of 'y', in one place from sample 175 on" in found.findings[1].message
    assert hmpim.read(path) == found


def test_the_last_block_is_missed_too(record, tmp_path):
    path = tmp_path / "r.h5"
    hmpim.save(record, path)
    with h5py.File(path, "r+") as file:
        file["outputs/y/blocks"][-1] = 0
    found = hmpim.load(path)
    assert found.outputs[0].values.size == 975
    assert "22 samples of 'y'" in found.findings[1].message


def test_an_edited_name_or_unit_is_noticed(record, tmp_path):
    path = tmp_path / "r.h5"
    hmpim.save(record, path)
    with h5py.File(path, "r+") as file:
        file["outputs/y"].attrs["unit"] = "rad"
    found = hmpim.load(path)
    assert found.outputs[0].unit == "rad"
    assert [f.code for f in found.findings] == ["gaps", "digest"]


def test_a_slow_channel_with_too_little_is_left_out_or_refused(record, tmp_path):
    path = tmp_path / "r.h5"
    hmpim.save(record, path)
    with h5py.File(path, "r+") as file:
        file["auxiliary/temperature/blocks"][...] = 0
    found = hmpim.load(path)
    assert found.auxiliary == ()
    assert [f.code for f in found.findings][1:] == ["damaged_blocks", "channel_missing"]
    with h5py.File(path, "r+") as file:
        file["outputs/y/blocks"][...] = 0
    with pytest.raises(FormatError, match=r"'r.h5' holds 0 samples of 'y'; at least 2"):
        hmpim.load(path)


def foreign(path):
    with h5py.File(path, "w") as file:
        file["force"] = np.arange(5.0)


def later(path):
    hmpim.save(Record.from_arrays({"u": [0, 1]}, {"y": [0, 1]}, fs=1.0), path)
    with h5py.File(path, "r+") as file:
        file.attrs["format"] = np.bytes_(b"hmpim/record/9")


def cut(path):
    record = Record.from_arrays({"u": np.zeros(5000)}, {"y": np.ones(5000)}, fs=1.0)
    hmpim.save(record, path)
    path.write_bytes(path.read_bytes()[:20_000])


def without_channels(path):
    hmpim.save(Record.from_arrays({"u": [0, 1]}, {"y": [0, 1]}, fs=1.0), path)
    with h5py.File(path, "r+") as file:
        del file["inputs"], file["outputs"]


def unequal(path):
    hmpim.save(Record.from_arrays({"u": [0, 1]}, {"y": [0, 1]}, fs=1.0), path)
    with h5py.File(path, "r+") as file:
        del file["outputs/y/values"]
        file["outputs/y/values"] = np.zeros((2, 2))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (foreign, "holds nothing that hmpim.save writes; a record that other programs wrote"),
        (later, "format is 'hmpim/record/9', and this version reads 'hmpim/record/2'"),
        (cut, "is cut short: 20000 of its .* bytes are there; copy it again"),
        (without_channels, "it has no channels"),
        (unequal, r"times of shape \(2,\), values of shape \(2, 2\)"),
    ],
)
def test_what_is_no_record_file_is_refused(tmp_path, make, words):
    path = tmp_path / "r.h5"
    make(path)
    with pytest.raises(FormatError, match=words):
        hmpim.load(path)


def test_a_folder_or_nothing_at_all_is_refused(record, tmp_path):
    with pytest.raises(FormatError, match="there is no file"):
        hmpim.load(tmp_path / "r.h5")
    with pytest.raises(FormatError, match="is a folder"):
        hmpim.load(tmp_path)
    with pytest.raises(ArgumentError, match="does not exist; make it first"):
        hmpim.save(record, tmp_path / "no" / "r.h5")


def damaged_anywhere(tmp_path, trials, seed):
    """Flip a few bytes of a record file; return how many still load, and how many are refused."""
    record = Record.from_arrays(
        {"u": np.arange(300.0)}, {"y": np.arange(300.0) ** 2}, fs=100.0, band=(0.1, 20.0)
    )
    path = tmp_path / "r.h5"
    hmpim.save(record, path)
    whole = path.read_bytes()
    rng = np.random.default_rng(seed)
    outcomes = {"equal": 0, "said": 0, "refused": 0}
    for _ in range(trials):
        spoilt = bytearray(whole)
        for place in rng.integers(0, len(whole), size=rng.integers(1, 4)):
            spoilt[place] = rng.integers(0, 256)
        path.write_bytes(spoilt)
        try:
            found = hmpim.load(path)
        except hmpim.HmpimError:
            outcomes["refused"] += 1
            continue
        same = replace(found, findings=()) == record
        assert same or found.findings
        outcomes["equal" if same else "said"] += 1
    return outcomes


def test_no_flipped_byte_changes_a_sample_unsaid(tmp_path):
    outcomes = damaged_anywhere(tmp_path, 150, seed=1)
    assert outcomes["said"] > 30


@pytest.mark.study
def test_no_flipped_byte_changes_a_sample_unsaid_study(tmp_path):
    outcomes = damaged_anywhere(tmp_path, 4000, seed=2)
    assert outcomes["said"] > 800
