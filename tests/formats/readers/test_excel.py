"""Excel workbooks: the same numbers as a table of text, and what is refused."""

import datetime as dt
import zipfile

import numpy as np
import openpyxl
import pytest

from hmpim.errors import FormatError, MissingExtraError
from hmpim.formats import read
from hmpim.formats.readers import Layout, excel, reader_for

N = 120


@pytest.fixture
def book(tmp_path):
    """Save a workbook; give its path."""

    def save(sheets, name="run.xlsx"):
        book = openpyxl.Workbook()
        book.remove(book.active)
        for title, rows in sheets.items():
            sheet = book.create_sheet(title)
            for row in rows:
                sheet.append(row)
        book.save(tmp_path / name)
        return tmp_path / name

    return save


def bench(*, missing=()):
    head = [["bench 2"], [], ["Time", "Command", "Response", "Note"], ["ms", "deg", "V", None]]
    rows = [
        [5 * k, k / 8, None if k in missing else -k / 4, "here" if k == 3 else None]
        for k in range(N)
    ]
    return head + rows


def test_a_sheet_with_units_in_a_second_line(book):
    path = book({"run 7": bench(missing=(7, 8)), "empty": []}, name="run.dat")
    record = read(path, outputs=["Response"])
    (u,), (y,) = record.inputs, record.outputs
    assert (u.name, u.unit, y.unit, record.fs) == ("Command", "deg", "V", 200.0)
    assert np.array_equal(u.values, np.arange(N) / 8)
    assert np.array_equal(y.time, np.delete(np.arange(N) * 5 / 1000, [7, 8]))
    assert [f.code for f in record.findings] == ["missing_samples", "assumed_roles"]


def test_dates_are_time(book):
    start = dt.datetime(2026, 11, 21, 23, 59, 59, 500_000)
    rows = [[start + dt.timedelta(milliseconds=10 * k), k, -k] for k in range(N)]
    record = read(book({"run": [["when", "u", "y"], *rows]}))
    # Excel keeps days in a float, and so a date to about a microsecond.
    assert np.abs(np.diff(record.inputs[0].time) - 0.01).max() < 3e-6


def test_several_sheets_are_asked_for(book):
    path = book({"a": bench(), "b": bench()})
    with pytest.raises(FormatError, match=r"several sheets \(a, b\); say which .*--sheet"):
        read(path, outputs=["Response"])
    reader = reader_for(path)
    (series,) = reader.read(path, ["Response"], Layout(sheet="b"))
    assert series.values.size == N
    with pytest.raises(FormatError, match="has no sheet 'c'; its sheets are a, b"):
        reader.channels(path, Layout(sheet="c"))
    with pytest.raises(FormatError, match="holds no rows"):
        read(book({"a": []}))


def test_a_workbook_that_expands_too_far_is_stopped(book, monkeypatch):
    path = book({"a": bench()})
    monkeypatch.setattr(excel, "MAX_EXPANDED", 4000)
    with pytest.raises(FormatError, match=r"expands to .* GiB, more than the limit"):
        excel.channels(path, Layout())  # in this process, where the limit is changed


def test_a_damaged_workbook_is_said_to_be_one(book, tmp_path):
    path = book({"a": bench()})
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(FormatError, match="damaged workbook"):
        read(path)
    with zipfile.ZipFile(tmp_path / "b.xlsx", "w") as archive:
        archive.writestr("xl/workbook.xml", "<workbook>")
    with pytest.raises(FormatError, match="damaged workbook"):
        read(tmp_path / "b.xlsx")


def test_another_archive_is_no_workbook(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.xlsx", "w") as archive:
        archive.writestr("time.csv", "time,u,y\n0,1,2\n")
    with pytest.raises(FormatError, match=r"recognises\. The readers cover .*Excel, "):
        read(tmp_path / "a.xlsx")


def test_without_openpyxl_the_extra_is_named(book, monkeypatch):
    path = book({"a": bench()})
    monkeypatch.setitem(__import__("sys").modules, "openpyxl", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'hmpim\[excel\]'"):
        excel.channels(path, Layout())  # in this process
