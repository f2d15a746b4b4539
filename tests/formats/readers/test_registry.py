"""Readers: chosen by content, one's own asked first, broken ones named and skipped."""

import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest

from hmpim.errors import FormatError, MissingExtraError
from hmpim.formats import read
from hmpim.formats.readers import ChannelInfo, Contents, Reader, need, reader_for, readers, registry
from hmpim.record import Series


def _listed(path, layout):
    names = (ChannelInfo(name="u", unit="V"), ChannelInfo(name="y"))
    return Contents(format="bench", channels=names, inputs=("u",), outputs=("y",), fs=10.0)


def _read(path, names, layout):
    data = np.frombuffer(path.read_bytes()[8:], dtype="<f4").astype(float).reshape(2, -1)
    units = {"u": "V", "y": ""}
    return tuple(
        Series(
            name=n, values=data["uy".index(n)], time=np.arange(data.shape[1]) / 10, unit=units[n]
        )
        for n in names
    )


BENCH = Reader(
    format="bench",
    sniff=lambda head, path: head.startswith(b"\0BENCH7\0"),
    channels=_listed,
    read=_read,
)


def _fails(head, path):
    raise ZeroDivisionError("no mercy")


SOUR = Reader(format="sour", sniff=_fails, channels=_listed, read=_read)
NOT_A_READER = 7


@pytest.fixture
def published(monkeypatch):
    """Publish objects of this module under ``hmpim.readers``."""

    def publish(**values):
        entries = [
            EntryPoint(name=name, value=value, group="hmpim.readers")
            for name, value in values.items()
        ]
        monkeypatch.setattr(registry, "entry_points", lambda group: entries)
        readers.cache_clear()

    # The name under which this module can be imported again.
    monkeypatch.setitem(sys.modules, "bench_readers", sys.modules[__name__])
    yield publish
    monkeypatch.undo()
    readers.cache_clear()


@pytest.fixture
def bench(tmp_path):
    path = tmp_path / "run7.csv"  # the name lies
    data = np.array([[1, 2, 3], [4, 5, 6]], dtype="<f4")
    path.write_bytes(b"\0BENCH7\0" + data.tobytes())
    return path


def test_a_reader_of_ones_own_is_found_by_content(published, bench):
    published(bench="bench_readers:BENCH")
    record = read(bench)
    assert record.inputs[0].values.tolist() == [1, 2, 3]
    assert (record.inputs[0].unit, record.fs, record.source) == ("V", 10.0, "run7.csv")


def test_broken_readers_are_named_and_skipped(published, bench, tmp_path):
    published(
        absent="no_such_module:X", wrong="bench_readers:NOT_A_READER", sour="bench_readers:SOUR"
    )
    good = tmp_path / "good.csv"
    good.write_text("time,u,y\n0,1,2\n1,3,4\n")
    assert read(good).samples == 2
    assert [b.name for b in readers().broken] == [
        "absent (no_such_module:X)",
        "wrong (bench_readers:NOT_A_READER)",
    ]
    assert "it is a int" in readers().broken[1].reason
    with pytest.raises(
        FormatError,
        match=r"absent \(no_such_module:X\): ModuleNotFoundError.*wrong.*sour: ZeroDivisionError",
    ):
        reader_for(bench)


def test_what_no_reader_knows_is_said_with_its_first_bytes(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes(b"\x7fELF" + bytes(200))
    with pytest.raises(FormatError, match=r"starts with the bytes 7f 45 4c 46 00.*text"):
        reader_for(path)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda p: None, "there is no file"),
        (lambda p: p.mkdir(), "is a folder"),
        (lambda p: p.write_bytes(b""), "is empty"),
    ],
)
def test_no_file_to_read(tmp_path, make, words):
    path = tmp_path / "a.csv"
    make(path)
    with pytest.raises(FormatError, match=words):
        reader_for(path)


def test_a_nul_in_the_path():
    with pytest.raises(FormatError, match="cannot be opened"):
        reader_for(Path("a\0b"))


def test_a_missing_package_names_its_extra():
    with pytest.raises(MissingExtraError, match=r"'no_such'.*pip install 'hmpim\[excel\]'"):
        need("no_such", extra="excel", what="an Excel file")


def test_a_package_that_breaks_while_imported(tmp_path, monkeypatch):
    (tmp_path / "breaks_here.py").write_text("raise RuntimeError('bad build')\n")
    (tmp_path / "needs_more.py").write_text("import not_there_either\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(MissingExtraError, match=r"cannot be imported \(RuntimeError: bad build"):
        need("breaks_here", extra="x", what="it")
    with pytest.raises(MissingExtraError, match="'needs_more', which needs 'not_there_either'"):
        need("needs_more", extra="x", what="it")
