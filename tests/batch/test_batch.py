"""A batch: every record once, whatever happens to it; the same as one at a time."""

import json
from itertools import islice

import h5py
import numpy as np
import pytest
from typer.testing import CliRunner

import hmpim
from batch_support import FS, SAMPLES, gain_record, rounded
from hmpim.batch import Request, open_table, reading
from hmpim.batch.addresses import addresses_of, find_files
from hmpim.batch.parts import parts_in
from hmpim.batch.run import Cluster
from hmpim.batch.work import Task
from hmpim.cli.main import app

HERE = Cluster(workers=0, per_task=2)


def gains(table) -> dict[str, float]:
    return rounded(table, "scale_factor")


def test_a_row_says_what_identify_says(folder_of_records, tmp_path):
    table = hmpim.batch(folder_of_records, out=tmp_path / "out", cluster=HERE)
    assert len(table) == 5
    record = hmpim.load(folder_of_records / "unit3.h5")
    alone = hmpim.identify(record)
    row = table.to_arrow().filter(_named(table, "unit3.h5")).to_pylist()[0]
    assert row["sha256"] == record.sha256
    for name in ("scale_factor", "bias", "noise_std"):
        estimate = getattr(alone["y", "u"], name)
        assert row[name] == estimate.value
        assert (row[f"{name}_low"], row[f"{name}_high"]) == estimate.ci95
    assert table.result("unit3.h5") == alone


def _named(table, end):
    import pyarrow.compute as pc

    return pc.ends_with(table.to_arrow(["record"]).column(0), end)


def test_a_file_that_breaks_in_the_middle_gives_each_record_once(rows_file, monkeypatch):
    """Those read before it broke are not said to have failed as well."""
    request = Request(fs=FS)
    (file,) = find_files([str(rows_file)])
    addresses = list(addresses_of(file, request))
    whole = reading.read_samples

    def breaking(some, request):
        yield from islice(whole(some, request), 3)
        raise OSError("the line is cut")

    monkeypatch.setattr(reading, "read_samples", breaking)
    told = list(reading.read_records(addresses, request))
    assert [read.address for read in told] == addresses
    assert [read.reason for read in told] == [""] * 3 + ["OSError: the line is cut"] * 5


def test_rows_of_one_file_are_records(rows_file, tmp_path, gain_alone):
    """Row groups end in the middle of records; how many there are is reckoned from the first."""
    totals = []
    table = hmpim.batch(
        rows_file,
        out=tmp_path / "out",
        fs=FS,
        cluster=HERE,
        progress=lambda state: totals.append(state.total),
    )
    assert (totals[0], totals[-1]) == (9, 8)  # the first 250 of 800 rows hold three
    assert gains(table) == {f"{rows_file}#unit{k}": float(k) for k in range(1, 9)}
    frame = table.to_pandas(["record", "meta_bench"])
    assert frame["meta_bench"].tolist().count("left") == 4


def test_groups_of_one_file_are_records(tmp_path, gain_alone):
    path = tmp_path / "fleet.h5"
    with h5py.File(path, "w") as file:
        for k in (1, 2):
            record = gain_record(k)
            group = file.create_group(f"runs/unit{k}")
            group["u"], group["y"] = (c.values for c in record.channels)
            group.attrs["fs"], group.attrs["serial"] = FS, f"S{k}"
    one, totals = Cluster(workers=0, per_task=1), []
    table = hmpim.batch(
        path,
        out=tmp_path / "out",
        request=Request(group="/runs"),
        cluster=one,
        progress=lambda state: totals.append(state.total),
    )
    assert set(totals) == {2}
    assert gains(table) == {f"{path}#/runs/unit{k}": float(k) for k in (1, 2)}
    assert sorted(table.to_pandas(["meta_serial"])["meta_serial"]) == ["S1", "S2"]


def test_lists_in_cells_are_records(tmp_path, gain_alone):
    import pyarrow as pa
    from pyarrow import parquet

    records = [gain_record(k) for k in (1, 2, 3)]
    path = tmp_path / "cells.parquet"
    cells = {
        "u": [r.inputs[0].values.tolist() for r in records],
        "y": [r.outputs[0].values.tolist() for r in records],
        "fs": [FS] * 3,
    }
    parquet.write_table(pa.table(cells), path)
    one, totals = Cluster(workers=0, per_task=1), []
    table = hmpim.batch(
        path,
        out=tmp_path / "out",
        cluster=one,
        progress=lambda state: totals.append(state.total),
    )
    assert gains(table) == {f"{path}#{k}": float(k + 1) for k in range(3)}
    assert set(totals) == {3}


def test_a_record_that_fails_is_a_row_with_its_reason(folder_of_records, tmp_path):
    (folder_of_records / "unit0.csv").write_text("time,u,y\n0,1,2\n1,nonsense,\n")
    (folder_of_records / "unit9.h5").write_bytes(b"\x89HDF\r\n\x1a\n damaged")
    table = hmpim.batch(folder_of_records, out=tmp_path / "out", cluster=HERE)
    frame = table.to_pandas(["record", "reason", "verdict"])
    failed = frame[frame["reason"].notna()]
    names = {name.rpartition("/")[2] for name in failed["record"]}
    assert names == {"unit0.csv", "unit9.h5"}
    assert len(gains(table)) == 5


def test_a_batch_of_which_every_record_is_refused_is_bad_input(folder_of_records, tmp_path):
    for path in sorted(folder_of_records.glob("*"))[2:]:
        path.unlink()
    asked = ["batch", str(folder_of_records), "--out", str(tmp_path / "out"), "--workers", "0"]
    told = CliRunner().invoke(app, [*asked, "--input", "nothing"])
    assert told.exit_code == 2
    (line,) = told.stderr.splitlines()
    assert line.startswith("hmpim: no record could be identified")
    assert "unit1.h5: " in line
    assert "'nothing'" in line
    assert "study.html" in line
    assert (tmp_path / "out" / "study.html").exists()
    (folder_of_records / "unit1.h5").unlink()
    (folder_of_records / "broken.h5").write_text("none")
    told = CliRunner().invoke(app, [*asked, "--fresh"])
    assert told.exit_code == 0, told.output


def test_what_is_done_is_not_done_again(folder_of_records, tmp_path, gain_alone):
    out = tmp_path / "out"
    hmpim.batch(folder_of_records, out=out, cluster=HERE)
    before = {p.name: p.stat().st_mtime_ns for p in parts_in(out)}
    assert len(before) == 3
    hmpim.save(gain_record(6), folder_of_records / "unit6.h5")
    hmpim.save(gain_record(7), folder_of_records / "unit7.h5")

    gain_alone.clear()
    table = hmpim.batch(folder_of_records, out=out, cluster=HERE)
    assert len(gain_alone) == 2
    assert sorted(gains(table).values()) == [1, 2, 3, 4, 5, 6, 7]
    assert before.items() <= {p.name: p.stat().st_mtime_ns for p in parts_in(out)}.items()


def test_a_task_given_twice_is_done_once(folder_of_records, tmp_path, gain_alone):
    """A scheduler that lost sight of a worker gives its task to another."""
    request = Request()
    files = find_files([str(folder_of_records)])
    addresses = tuple(a for file in files for a in addresses_of(file, request))
    task = Task(addresses=addresses, request=request, folder=str(tmp_path), joined={})
    task.path.parent.mkdir()
    assert (task.do().records, task.do().records) == (5, 5)
    assert len(gain_alone) == 5
    assert parts_in(tmp_path) == [task.path]


def test_a_file_that_was_changed_is_done_again(folder_of_records, tmp_path, gain_alone):
    out = tmp_path / "out"
    hmpim.batch(folder_of_records / "unit1.h5", out=out, cluster=HERE)
    hmpim.save(gain_record(2.5), folder_of_records / "unit1.h5")
    table = hmpim.batch(folder_of_records / "unit1.h5", out=out, cluster=HERE)
    assert gains(table)[str(folder_of_records / "unit1.h5")] == 2.5


def test_another_request_is_refused(folder_of_records, tmp_path, gain_alone):
    out = tmp_path / "out"
    hmpim.batch(folder_of_records / "unit1.h5", out=out, cluster=HERE)
    other = Request(intersample="zoh")
    with pytest.raises(hmpim.HmpimError, match=r"intersample = 'auto'.*'zoh'"):
        hmpim.batch(folder_of_records, out=out, request=other, cluster=HERE)
    again = hmpim.batch(folder_of_records, out=out, request=other, cluster=HERE, fresh=True)
    assert again.request == other
    assert open_table(out) == again


def test_two_runs_do_not_write_to_one_folder(folder_of_records, tmp_path, gain_alone):
    def second(state):
        with pytest.raises(hmpim.HmpimError, match="another run is writing"):
            hmpim.batch(folder_of_records, out=tmp_path / "out", cluster=HERE)

    hmpim.batch(folder_of_records / "unit1.h5", out=tmp_path / "out", cluster=HERE, progress=second)


def test_no_records_are_refused(tmp_path):
    with pytest.raises(hmpim.HmpimError, match="there are no records at"):
        hmpim.batch(tmp_path / "nothing", out=tmp_path / "out", cluster=HERE)


def test_a_full_disk_loses_nothing(folder_of_records, tmp_path, monkeypatch, gain_alone):
    """The part that does not fit is said; what was written stays, and the rest follows."""
    from pyarrow import parquet

    out, written = tmp_path / "out", parquet.write_table

    def full(table, place, **options):
        if len(parts_in(out)) == 1:
            place.write_bytes(b"half")
            raise OSError(28, "No space left on device")
        written(table, place, **options)

    monkeypatch.setattr(parquet, "write_table", full)
    with pytest.raises(hmpim.HmpimError, match="No space left"):
        hmpim.batch(folder_of_records, out=out, cluster=HERE)
    assert len(parts_in(out)) == 1
    assert not list(out.rglob(".hmpim-*"))
    monkeypatch.undo()
    table = hmpim.batch(folder_of_records, out=out, cluster=HERE)
    assert sorted(gains(table).values()) == [1, 2, 3, 4, 5]


def test_metadata_comes_from_a_table_beside(folder_of_records, tmp_path, gain_alone):
    beside = tmp_path / "units.csv"
    beside.write_text("record,serial\nunit2.h5,B\nunit1,A\n")
    request = Request(metadata=str(beside))
    table = hmpim.batch(folder_of_records, out=tmp_path / "out", request=request, cluster=HERE)
    frame = table.to_pandas(["record", "meta_serial"]).set_index("record")["meta_serial"]
    assert frame[str(folder_of_records / "unit2.h5")] == "B"
    assert frame[str(folder_of_records / "unit1.h5")] == "A"


def test_metadata_that_cannot_be_told_are_refused(folder_of_records, tmp_path):
    """Of two rows of one record the second had been taken, without a word."""
    beside = tmp_path / "units.csv"
    for text, told in (
        ("record,serial\na,A\na,B\n", "has 2 rows of 'a'"),
        (None, "there is no file"),
    ):
        if text is None:
            beside.unlink()
        else:
            beside.write_text(text)
        request = Request(metadata=str(beside))
        with pytest.raises(hmpim.HmpimError, match=told):
            hmpim.batch(folder_of_records, out=tmp_path / "out", request=request, cluster=HERE)


def test_records_are_not_looked_for_among_the_results(folder_of_records):
    for out in (folder_of_records, folder_of_records.parent):
        with pytest.raises(hmpim.HmpimError, match=r"lies in .*, the folder of the results"):
            hmpim.batch(folder_of_records, out=out, cluster=HERE)


def test_polars_reads_it_lazily(rows_file, tmp_path, gain_alone):
    polars = pytest.importorskip("polars")
    table = hmpim.batch(rows_file, out=tmp_path / "out", fs=FS, cluster=HERE)
    lazy = table.scan()
    assert isinstance(lazy, polars.LazyFrame)
    found = lazy.group_by("meta_bench").agg(polars.col("scale_factor").mean()).collect()
    means = dict(found.iter_rows())
    assert means["left"] == pytest.approx(4.0, abs=0.01)


def test_progress_counts_what_earlier_runs_did(folder_of_records, tmp_path, gain_alone):
    told = []
    out = tmp_path / "out"
    hmpim.batch(folder_of_records / "unit1.h5", out=out, cluster=HERE)
    hmpim.batch(folder_of_records, out=out, cluster=HERE, progress=told.append)
    last = told[-1]
    assert (last.records, last.total, last.repeated, last.failures) == (5, 5, 1, 0)


def test_records_away_are_read_through_fsspec(tmp_path, gain_alone):
    import fsspec

    record = gain_record(2)
    hmpim.save(record, tmp_path / "unit.csv")
    store = fsspec.filesystem("memory")
    store.pipe("/bench/unit.csv", (tmp_path / "unit.csv").read_bytes())
    try:
        table = hmpim.batch("memory://bench/*.csv", out=tmp_path / "out", cluster=HERE)
    finally:
        store.rm("/bench", recursive=True)
    assert list(gains(table).values()) == [2.0]


def test_rows_of_a_record_in_two_places_are_refused(tmp_path, gain_alone):
    import pyarrow as pa
    from pyarrow import parquet

    path = tmp_path / "mixed.parquet"
    whole = gain_record(1)
    u, y = (np.tile(c.values, 3) for c in whole.channels)
    names = np.repeat(["a", "b", "a"], SAMPLES)
    parquet.write_table(pa.table({"record": names, "u": u, "y": y}), path)
    table = hmpim.batch(path, out=tmp_path / "out", fs=FS, cluster=HERE)
    reasons = [r for r in table.to_arrow(["reason"]).column(0).to_pylist() if r]
    assert len(reasons) == 1
    assert "sort it by its column 'record'" in reasons[0]


def test_the_stamp_is_plain(folder_of_records, tmp_path, gain_alone):
    hmpim.batch(folder_of_records / "unit1.h5", out=tmp_path / "out", cluster=HERE)
    told = json.loads((tmp_path / "out" / "batch.json").read_text())
    assert told["schema"] == "hmpim/batch/1"
    assert Request.from_dict(told["request"]) == Request()


def test_a_column_or_a_record_that_is_not_there_is_said_in_one_line(
    folder_of_records, tmp_path, gain_alone
):
    table = hmpim.batch(folder_of_records, out=tmp_path / "out", cluster=HERE)
    with pytest.raises(hmpim.HmpimError, match=r"no column 'dealy'; there is delay"):
        table.to_pandas(["dealy"])
    with pytest.raises(hmpim.HmpimError, match=r"no record is called 'nothing\.h5'"):
        table.result("nothing.h5")
    with pytest.raises(hmpim.HmpimError, match=r"names of 5 records end in '\.h5'"):
        table.result(".h5")
    assert repr(table) == f"BatchTable(5 rows in {str(tmp_path / 'out')!r})"
