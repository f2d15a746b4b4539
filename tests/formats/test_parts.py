"""Parts of files and files side by side: spans, sweeps, runs, clocks."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from hmpim.errors import ArgumentError, FormatError, RecordError
from hmpim.formats import read, write_csv
from hmpim.formats.files import read_sweeps
from hmpim.formats.options import ReadOptions
from hmpim.record import Record, uniform

FS = 200.0


def sweep(t, length=6.0):
    inside = (t > 0) & (t < length)
    edge = np.clip(np.minimum(t, length - t) * 4, 0, 1)
    return np.where(inside, edge * np.sin(2 * np.pi * (0.3 * t + 0.8 * t**2)), 0.0)


def twice(t):
    return sweep(t - 2.0) + sweep(t - 11.005)


DELAY = 0.0217


def table(path, names, columns, form="{:.9f}"):
    rows = "".join(",".join(form.format(v) for v in row) + "\n" for row in zip(*columns))  # noqa: B905
    path.write_text(",".join(names) + "\n" + rows)
    return path


@pytest.fixture
def log(tmp_path):
    t = np.arange(round(20 * FS)) / FS
    return table(tmp_path / "log.csv", ["time", "u", "y"], [t, twice(t), twice(t - DELAY)])


def test_a_span_is_cut_in_the_files_own_time(log):
    record = read(log, options=ReadOptions(start=3.0, stop=5.0))
    assert record.outputs[0].time[[0, -1]].tolist() == [3.0, 4.995]
    with pytest.raises(ArgumentError, match=r"nothing of 'log.csv' lies in that part; .* 0 s to"):
        read(log, options=ReadOptions(start=30.0))
    with pytest.raises(ArgumentError, match="from 5 s to 4 s is empty"):
        read(log, options=ReadOptions(start=5.0, stop=4.0))


def test_sweeps_are_said_and_cut_out(log):
    whole = read(log)
    assert [f.code for f in whole.findings] == ["assumed_roles", "several_sweeps"]
    assert "'u' makes 2 motions (1: sweep from" in whole.findings[1].message
    second = read(log, options=ReadOptions(sweep=2))
    assert [f.code for f in second.findings] == ["assumed_roles"]
    assert 9.0 < second.inputs[0].time[0] < 11.0
    assert second.inputs[0].time[-1] > 17.5
    first, other = read_sweeps(log)
    assert first.samples == other.samples
    assert np.abs(first.inputs[0].values - other.inputs[0].values).max() < 2e-9
    assert other.inputs[0].time[0] - first.inputs[0].time[0] == pytest.approx(9.005, abs=1e-9)
    with pytest.raises(ArgumentError, match=r"there is no sweep 3: 'log\.csv' has 2 motions"):
        read(log, options=ReadOptions(sweep=3))
    with pytest.raises(RecordError, match=r"no sweep is found in 'u' of 'log\.csv': it has 1"):
        read_sweeps(log, options=ReadOptions(start=2.5, stop=3.0))


def test_a_file_of_ours_is_not_said_to_hold_sweeps(log, tmp_path):
    record = read(log, options=ReadOptions(start=0.0, stop=20.0))
    clean = Record(inputs=record.inputs, outputs=record.outputs, fs=FS)
    write_csv(clean, tmp_path / "ours.csv")
    assert read(tmp_path / "ours.csv") == clean


def test_recordings_one_after_another_are_parted(tmp_path):
    t = np.arange(round(9 * FS)) / FS
    time = np.concatenate((t, t))
    u = np.concatenate((sweep(t - 1), 0.5 * sweep(t - 1)))
    y = np.concatenate((sweep(t - 1 - DELAY), 0.5 * sweep(t - 1 - DELAY)))
    path = table(tmp_path / "two.csv", ["time", "u", "y"], [time, u, y])
    with pytest.raises(RecordError, match=r"holds 2 recordings with 2 motions \(1: .*--sweep"):
        read(path)
    second = read(path, options=ReadOptions(sweep=2))
    assert np.abs(second.inputs[0].values).max() < 0.51
    assert len(read_sweeps(path)) == 2


def delay_of(record):
    aligned = uniform(record)
    u, y, time = aligned.inputs[0].values, aligned.outputs[0].values, aligned.time
    size = np.std(y) / np.std(u)

    def misfit(shift):
        return float(np.sum((y - size * twice(time - shift)) ** 2))

    return minimize_scalar(misfit, bounds=(0.0, 2 * DELAY), options={"xatol": 1e-8}).x


@pytest.mark.parametrize("known", ["stated", "common", "by channel"])
def test_two_files_on_two_clocks(tmp_path, known):
    t = np.arange(round(20 * FS)) / FS
    pc = table(tmp_path / "pc.csv", ["time", "u", "sync"], [t, twice(t), twice(t)])
    s = np.arange(0.5, 19.0, 1 / 333.0)
    shown = s + 3.25
    scope = table(
        tmp_path / "scope.csv",
        ["Time (s)", "sync (V)", "y (V)"],
        [shown, 0.1 * twice(s) + 1, 0.2 * twice(s - DELAY)],
    )
    options = {
        "stated": ReadOptions(beside=(scope,), offsets={"scope.csv": 3.25}),
        "common": ReadOptions(beside=(scope,), common="sync"),
        "by channel": ReadOptions(beside=(scope,), offsets={"scope": 3.0, "y": 0.25}),
    }[known]
    record = read(pc, options=options)
    assert delay_of(record) == pytest.approx(DELAY, abs=0.01 / 333.0)
    (finding, *_) = [f for f in record.findings if f.code == "clock_offset"]
    assert finding.severity == "info"
    if known == "common":
        assert "is offset by 3.250000 ±" in finding.message


def test_an_unknown_offset_makes_the_delay_doubtful(tmp_path, log):
    record = read(log, options=ReadOptions(offsets={"y": None}))
    (finding,) = [f for f in record.findings if f.code == "clock_offset"]
    assert finding.severity == "doubt"
    assert "delay" in finding.parameters
    assert "cannot be distinguished from delay" in finding.message
    t = np.arange(round(20 * FS)) / FS
    other = table(tmp_path / "b.csv", ["time", "z"], [t, twice(t)])
    record = read(log, outputs=["z"], options=ReadOptions(beside=(other,)))
    assert [f.severity for f in record.findings if f.code == "clock_offset"] == ["doubt"]


def test_files_with_dates_are_brought_together_by_them(tmp_path):
    k = np.arange(400)
    form = "2026-11-21T12:00:{:06.3f}Z"
    for name, channel, late in (("a", "u", 0.0), ("b", "y", 1.5)):
        rows = "".join(f"{form.format(late + i / 100)},{i % 7}\n" for i in k)
        (tmp_path / f"{name}.csv").write_text(f"timestamp,{channel}\n{rows}")
    record = read(tmp_path / "a.csv", options=ReadOptions(beside=(tmp_path / "b.csv",)))
    assert record.inputs[0].time[0] == pytest.approx(0.0, abs=1e-9)
    assert record.outputs[0].time[0] == pytest.approx(1.5, abs=1e-9)
    (finding,) = [f for f in record.findings if f.code == "clock_offset"]
    assert "held together by their dates" in finding.message
    assert finding.severity == "doubt"


def test_names_that_two_files_have_are_preceded_by_the_file(tmp_path, log):
    other = tmp_path / "b.csv"
    other.write_text(log.read_text())
    options = ReadOptions(beside=(other,), offsets={"b": 0.0})
    with pytest.raises(FormatError, match="no column 'y'; its columns are log:u, log:y, b:u, b:y"):
        read(log, inputs=["log:u"], outputs=["y"], options=options)
    record = read(log, inputs=["log:u"], outputs=["b:y"], options=options)
    assert [c.name for c in (*record.inputs, *record.outputs)] == ["log:u", "b:y"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"offsets": {"x": 1.0}}, "offset is given for 'x', which is neither a channel"),
        ({"common": "u"}, "common channel 'u' is given with one file"),
    ],
)
def test_options_that_fit_nothing(log, options, words):
    with pytest.raises(ArgumentError, match=words):
        read(log, options=ReadOptions(**options))


def test_a_declared_unit_that_is_another_is_said(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time,u [deg],y\n0,1,2\n0.1,2,3\n0.2,3,4\n")
    record = read(path, units={"u": "rad", "y": "V"})
    finding, _ = record.findings
    assert finding.code == "unit_declared"
    assert "'u' is taken in rad, as stated, where the file says 'deg'" in finding.message
