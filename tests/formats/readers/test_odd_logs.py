"""Columns that others' files hold beside plain numbers, and clocks that they do not fit."""

import numpy as np
import pytest
import scipy.io

import sample_logs as samples
from hmpim.errors import ArgumentError, FormatError
from hmpim.formats import read
from hmpim.formats.readers import Layout, reader_for

T, U, Y = samples.TIME, samples.U, samples.Y


def mat(path, **variables):
    scipy.io.savemat(path, variables)
    return path


def parquet(path, **columns):
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet as pq

    pq.write_table(pa.table(columns), path)
    return path


def assert_delay(record):
    delay = samples.delay_between(record.inputs[0], record.outputs[0])
    assert delay == pytest.approx(samples.DELAY, abs=0.01 / samples.FS)


def test_a_column_of_a_matrix_may_be_the_time(tmp_path):
    path = mat(tmp_path / "m.mat", data=np.c_[T, U, Y])
    record = read(path, inputs=["data(:,2)"], outputs=["data(:,3)"], time="data(:,1)")
    assert record.fs == pytest.approx(samples.FS)
    assert_delay(record)


def test_a_cell_array_does_not_spoil_the_file(tmp_path):
    cells = np.array(["bench", 1, U], dtype=object)
    assert_delay(read(mat(tmp_path / "m.mat", t=T, u=U, y=Y, notes=cells)))


@pytest.mark.parametrize("kind", ["mat", "hdf5"])
def test_complex_numbers_are_called_so(kind, tmp_path):
    h5py = pytest.importorskip("h5py")
    path, names = tmp_path / "file", ("u", "y")
    if kind == "mat":
        mat(tmp_path / "file.mat", t=T, u=U * 1j, y=Y).rename(path)
    else:
        names = ("/u", "/y")
        with h5py.File(path, "w") as file:
            file["t"], file["u"], file["y"] = T, U * 1j, Y
    with pytest.raises(FormatError, match=f"'{names[0]}' of 'file' holds complex numbers"):
        read(path, inputs=names[:1], outputs=names[1:])


def test_fields_of_a_structure_in_parquet_are_channels(tmp_path):
    pairs = [{"u": u, "in.ner": {"y": y}} for u, y in zip(U.tolist(), Y.tolist(), strict=True)]
    path = parquet(tmp_path / "p", **{"t": T, "log.1": pairs})
    assert_delay(read(path, inputs=["log.1.u"], outputs=["log.1.in.ner.y"]))


def test_a_duration_in_parquet_is_a_time(tmp_path):
    since = np.round(1e6 * T).astype("timedelta64[us]")
    record = read(parquet(tmp_path / "p", time=since, u=U, y=Y))
    assert np.array_equal(record.inputs[0].time, T)


def test_whole_numbers_beyond_those_of_float64_are_rounded(tmp_path):
    big = (2**63 + 2**50 * np.round(1000 * Y)).astype(np.uint64)
    record = read(parquet(tmp_path / "p", t=T, u=U, y=big))
    assert record.outputs[0].values == pytest.approx(big.astype(float), rel=1e-15)


def test_what_a_column_of_parquet_holds_is_said(tmp_path):
    pa = pytest.importorskip("pyarrow")
    path = parquet(tmp_path / "p", t=T, u=U, none=pa.nulls(T.size), words=["1.5"] * T.size)
    for name, holds in (("none", "holds nothing"), ("words", "holds string, no numbers")):
        with pytest.raises(FormatError, match=holds):
            read(path, inputs=["u"], outputs=[name])


@pytest.mark.parametrize("kind", ["mat", "csv", "parquet"])
def test_a_rate_that_the_file_s_time_contradicts_is_refused(kind, tmp_path):
    """Whatever the format: a delay would be wrong by the ratio of the rates."""
    path = tmp_path / "run"
    if kind == "mat":
        mat(tmp_path / "run.mat", t=T, u=U, y=Y).rename(path)
    elif kind == "csv":
        np.savetxt(path, np.c_[T, U, Y], delimiter=",", header="t,u,y", comments="")
    else:
        parquet(path, t=T, u=U, y=Y)
    with pytest.raises(
        ArgumentError, match="fs = 100 Hz is given, but by its own time stamps 'run' was"
    ):
        read(path, fs=100.0)
    assert_delay(read(path, fs=samples.FS))


def test_a_rate_stands_in_for_a_time_that_stands_still(tmp_path):
    path = tmp_path / "run.csv"
    for time in (0 * T, np.where(T.mean() > T, 0.0, 10.0)):
        np.savetxt(path, np.c_[time, U, Y], delimiter=",", header="t,u,y", comments="")
        assert_delay(read(path, fs=samples.FS))


def test_a_time_of_another_length_is_said(tmp_path):
    path = mat(tmp_path / "m.mat", t=T, u=U, y=Y[:-7])
    with pytest.raises(FormatError, match="'y' has 793 samples and no time of its own: 't' has"):
        read(path)


def test_a_name_to_copy_is_quoted_for_the_shell(tmp_path):
    path = mat(tmp_path / "m.mat", data=np.c_[U, Y])
    with pytest.raises(FormatError, match=r"--input 'data\(:,1\)'$"):
        read(path, fs=samples.FS)


@pytest.mark.parametrize("kind", ["csv", "mat"])
@pytest.mark.parametrize(
    ("name", "start", "step", "codes"),
    [
        ("time", 0.0, 5.0, ["time_unit"]),
        ("time", 46082.4, 0.005 / 86400, ["time_unit"]),
        ("time", 46082.4, 0.005, []),
        ("time", 0.0, 5e-8, []),
        ("time [ms]", 0.0, 5.0, []),
        ("time [d]", 46082.4, 0.005 / 86400, []),
    ],
)
def test_time_in_ms_or_days_that_states_no_unit_is_remarked(
    kind, name, start, step, codes, tmp_path
):
    """It had been taken for s without a word: 0.2 Hz, or 17 MHz, for 200 Hz."""
    path = tmp_path / f"a.{kind}"
    t, u = start + step * np.arange(60), np.sin(np.arange(60))
    if kind == "csv":
        np.savetxt(path, np.c_[t, u, u], delimiter=",", header="time,u,y", comments="")
    else:
        mat(path, time=t, u=u, y=u)
    record = read(path, time=name if "[" in name else None)
    assert [f.code for f in record.findings if f.code == "time_unit"] == codes


@pytest.mark.parametrize(
    ("index", "time"),
    [
        (lambda k: f"2026-03-01 10:00:{k / 200:06.3f}", None),
        (lambda k: f"{k / 200}", "column 1"),
    ],
    ids=["dates", "seconds"],
)
def test_an_index_of_pandas_without_a_name_may_be_the_time(index, time, tmp_path):
    """It was dropped without a word, as one that counts the rows still is."""
    path = tmp_path / "a.csv"
    rows = "".join(f"{index(k)},{k % 7},{k % 5}\n" for k in range(60))
    path.write_text(",u,y\n" + rows)
    assert read(path, time=time).fs == pytest.approx(200.0)
    path.write_text(",time,u,y\n" + "".join(f"{k},{k / 200},{k % 7},{k % 5}\n" for k in range(60)))
    found = reader_for(path).channels(path, Layout())
    assert (found.time, [c.name for c in found.channels]) == ("time", ["u", "y"])
