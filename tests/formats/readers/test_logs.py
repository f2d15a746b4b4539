"""Every format: recognised by content, the known delay found again, what is lost said."""

import re

import numpy as np
import pytest

import sample_logs as samples
from hmpim.errors import FormatError
from hmpim.formats import read
from hmpim.formats.options import ReadOptions
from hmpim.formats.readers import Layout, reader_for

BOUND = 0.01 / samples.FS  # 1 % of a sample
FORMATS = {
    "parquet": "Parquet",
    "lerobot": "Parquet",
    "mat5": "MATLAB 5.0",
    "mat73": "MATLAB 7.3",
    "hdf5": "HDF5",
    "mdf": "MDF 4.10",
    "tdms": "TDMS",
    "ulog": "ULog",
    "ardupilot": "ArduPilot",
    "blackbox": "blackbox Betaflight 4.5.1",
    "mcap": "ROS 2 bag",
    "db3": "ROS 2 bag",
    "rosbag": "ROS 2 bag",
    "ros1": "ROS 1 bag",
    "wpilog": "WPILOG",
    "klipper": "text",
    "wav": "WAV",
    "uff58": "UFF58",
    "uff58-text": "UFF58",
}
UNITS = {
    "parquet": ("V", ""),
    "hdf5": ("V", "deg/s"),
    "mdf": ("V", "deg/s"),
    "tdms": ("V", "V"),
    "ardupilot": ("deg/s", "rad/s"),
    "blackbox": ("deg/s", "deg/s"),
    "ros1": ("", "rad/s"),
    "wpilog": ("V", ""),
    "uff58": ("V", "rad/s"),
    "uff58-text": ("V", "rad/s"),
}


def record_of(kind, path, **options):
    _, u, y = samples.KINDS[kind]
    return read(path, inputs=[u], outputs=[y], options=ReadOptions(**options))


def contents_of(path, **layout):
    wanted = Layout(**layout)
    return reader_for(path).channels(path, wanted)


@pytest.mark.parametrize("kind", samples.KINDS)
def test_the_known_delay_is_found_again(kind, tmp_path):
    path = samples.make(kind, tmp_path)
    assert contents_of(path).format == FORMATS[kind]
    record = record_of(kind, path)
    u, y = record.inputs[0], record.outputs[0]
    assert (u.unit, y.unit) == UNITS.get(kind, ("", ""))
    assert u.values.size == samples.N
    assert record.fs == pytest.approx(samples.FS)
    assert samples.delay_between(u, y) == pytest.approx(samples.DELAY, abs=BOUND)
    assert np.ptp(u.time) == pytest.approx((samples.N - 1) / samples.FS, abs=1e-6)
    scale = {"blackbox": 1000, "wav": 30_000 / 32_768}.get(kind, 1.0)
    assert np.abs(u.values) == pytest.approx(scale * np.abs(samples.U), abs=1e-3 * scale)


def test_lerobot_names_joints_and_states_the_rate(tmp_path):
    contents = contents_of(samples.make("lerobot", tmp_path))
    names = [c.name for c in contents.channels]
    assert names[:4] == [f"{a}[{j}]" for a in ("action", "observation.state") for j in JOINTS]
    assert (contents.fs, contents.time) == (200.0, "timestamp")


JOINTS = ("pan", "lift")


def test_a_matrix_opens_into_columns_and_scalars_are_no_channels(tmp_path):
    names = [c.name for c in contents_of(samples.make("mat5", tmp_path)).channels]
    assert names == ["log.u", "log.sensors.gyro(:,1)", "log.sensors.gyro(:,2)"]


def test_hdf5_follows_no_link_and_reads_no_other_file(tmp_path):
    import h5py

    path = samples.make("hdf5", tmp_path)
    samples.hdf5(tmp_path / "other.h5")
    with h5py.File(path, "a") as file:
        file["out"] = h5py.ExternalLink("other.h5", "/run 1")
        file["again"] = h5py.SoftLink("/run 1")
        shape = (samples.N,)
        secret = [(str(tmp_path / "other.h5"), 0, 8 * samples.N)]
        file.create_dataset("raw", shape=shape, dtype="f8", external=secret)
    contents = contents_of(path)
    assert {c.name.split("/")[1] for c in contents.channels} == {"run 1"}
    assert "/raw keep their numbers in other files" in contents.findings[0].message


def test_a_table_in_hdf5_has_its_fields_as_channels(tmp_path):
    import h5py

    path = tmp_path / "table"
    table = np.zeros(samples.N, dtype=[("time_ms", "i8"), ("u", "f4"), ("tag", "S4")])
    table["time_ms"], table["u"] = 5 * np.arange(samples.N), samples.U
    with h5py.File(path, "w") as file:
        file["log"] = table
    contents = contents_of(path)
    assert contents.time == "/log.time_ms"
    assert [(c.name, c.holds) for c in contents.channels] == [
        ("/log.u", ""),
        ("/log.tag", "words, no numbers"),
    ]
    (series,) = reader_for(path).read(path, ["/log.u"], Layout())
    assert series.time[1] == 0.005


def test_ros_stamps_are_a_choice(tmp_path):
    """The log's stamps lie 4 ms later for the sensor; the sender's do not."""
    path = samples.make("mcap", tmp_path)
    by_header = record_of("mcap", path)
    by_log = record_of("mcap", path, stamps="log")
    for record, more in ((by_header, 0.0), (by_log, 0.004)):
        found = samples.delay_between(record.inputs[0], record.outputs[0])
        assert found == pytest.approx(samples.DELAY + more, abs=BOUND)
        first = record.outputs[0].time[0] - record.inputs[0].time[0]
        assert first == pytest.approx(more, abs=1e-9)


def test_ulog_stamps_are_a_choice(tmp_path):
    """Samples were published 1.5 ms after they were measured."""
    path = samples.make("ulog", tmp_path)
    found = [
        samples.delay_between(r.inputs[0], r.outputs[0])
        for r in (record_of("ulog", path), record_of("ulog", path, stamps="log"))
    ]
    assert found == pytest.approx([samples.DELAY, samples.DELAY + 0.0015], abs=BOUND)


def test_a_log_of_several_flights_asks_which(tmp_path):
    path = tmp_path / "flights"
    samples.blackbox(path, flights=2)
    with pytest.raises(FormatError, match=r"holds 2 flights: 1 \(4 s\), 2 \(4 s\).*--sheet"):
        contents_of(path)
    assert contents_of(path, sheet="2").channels[0].samples == samples.N
    with pytest.raises(FormatError, match="holds no flight '3'"):
        contents_of(path, sheet="3")


def test_the_gyro_s_scale_is_shown_with_its_unit(tmp_path):
    record = record_of("blackbox", samples.make("blackbox", tmp_path))
    assert any("0.5 deg/s per count" in f.message for f in record.findings)
    record = record_of("wav", samples.make("wav", tmp_path))
    assert any("divided by 32768" in f.message for f in record.findings)


def test_the_conversion_of_an_mdf_is_applied_and_shown_with_its_unit(tmp_path):
    import asammdf

    counts = np.rint(1000 * samples.U).astype(np.int16)
    about = {"u": {"a": 0.002, "b": -0.5}, "y": {"formula": "X1*X1"}, "plain": None}
    log = asammdf.MDF(version="4.10")
    signals = [
        asammdf.Signal(counts, samples.TIME, name=name, unit="V", conversion=conversion)
        for name, conversion in about.items()
    ]
    log.append(signals)
    path = tmp_path / "scaled.mf4"
    log.save(path, overwrite=True)
    log.close()
    record = read(path, inputs=["u"], outputs=["y", "plain"])
    assert record.inputs[0].values == pytest.approx(0.002 * counts - 0.5, abs=1e-12)
    assert record.outputs[0].values == pytest.approx(counts.astype(float) ** 2)
    assert {f.message for f in record.findings if f.code == "scale"} == {
        "counts of u are read as 0.002 V each minus 0.5 V, as the file states",
        "counts of y are read through the formula or table of its conversion, in V, "
        "as the file states",
    }


def test_the_scale_of_a_tdms_file_is_applied_and_shown_with_its_unit(tmp_path):
    from nptdms import ChannelObject, TdmsWriter

    counts = np.rint(1000 * samples.U).astype(np.int16)
    plain = {"wf_increment": 1 / samples.FS, "unit_string": "V"}
    scale = "NI_Scale[0]"
    about = {
        **plain,
        "NI_Number_Of_Scales": 1,
        f"{scale}_Scale_Type": "Linear",
        f"{scale}_Linear_Slope": 0.002,
        f"{scale}_Linear_Y_Intercept": 0.5,
        f"{scale}_Linear_Input_Source": 0xFFFFFFFF,
    }
    path = tmp_path / "scaled.tdms"
    with TdmsWriter(path) as writer:
        parts = [
            ChannelObject("rig", n, counts, properties=p)
            for n, p in zip("uy", (about, plain), strict=True)
        ]
        writer.write_segment(parts)
    record = read(path, inputs=["rig/u"], outputs=["rig/y"])
    assert record.inputs[0].values == pytest.approx(0.002 * counts + 0.5, abs=1e-12)
    (said,) = [f.message for f in record.findings if f.code == "scale"]
    assert said == "counts of rig/u are read as 0.002 V each plus 0.5 V, as the file states"


def test_a_channel_of_words_is_no_signal(tmp_path):
    path = samples.make("wpilog", tmp_path)
    with pytest.raises(FormatError, match="holds words"):
        read(path, inputs=["sysid-test-state"], outputs=["/gyro[0]"])


def test_time_may_be_named_with_its_unit(tmp_path):
    import h5py

    path = tmp_path / "odd"
    with h5py.File(path, "w") as file:
        file["clock"], file["u"] = 1e6 * samples.TIME, samples.U
    with pytest.raises(FormatError, match="no column time"):
        read(path, inputs=["/u"], outputs=["/clock"])
    (series,) = reader_for(path).read(path, ["/u"], Layout(time="/clock [us]"))
    assert series.time[1] == pytest.approx(1 / samples.FS)
    with pytest.raises(FormatError, match="no time channel 'tick'"):
        contents_of(path, time="tick")


@pytest.mark.parametrize("kind", ["tdms", "wav", "wpilog", "ulog", "blackbox", "ardupilot"])
def test_half_a_file_is_said_to_be_short(kind, tmp_path):
    """Formats that a killed logger leaves readable: the half that is there, and a word on it."""
    path = samples.make(kind, tmp_path)
    data = path.read_bytes()
    path.write_bytes(data[: len(data) * 6 // 10 + 1])
    record = record_of(kind, path)
    assert record.inputs[0].values.size < 0.7 * samples.N
    assert samples.delay_between(record.inputs[0], record.outputs[0]) == pytest.approx(
        samples.DELAY, abs=10 * BOUND
    )
    words = "cut short|states .* holds|no whole record"
    assert any(re.search(words, f.message) for f in record.findings)


@pytest.mark.parametrize("kind", ["mdf", "parquet", "mcap", "db3", "hdf5", "mat5", "mat73"])
def test_half_a_file_of_the_others_is_refused_in_one_line(kind, tmp_path):
    path = samples.make(kind, tmp_path)
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(FormatError, match=r"\.log' ") as caught:
        record_of(kind, path)
    assert "\n" not in str(caught.value)


def test_an_mdf_never_finished_is_said_to_be_one(tmp_path):
    path = samples.make("mdf", tmp_path)
    data = path.read_bytes()
    path.write_bytes(b"UnFinMF " + data[8:])
    said = contents_of(path).findings
    assert any("never finished" in f.message for f in said)
