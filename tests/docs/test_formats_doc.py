"""docs/formats.md lists the readers there are, and publishes one of one's own."""

import re
import tomllib
from pathlib import Path

import licences
import numpy as np
import pytest

import hmpim
from docs_following import published, snippet
from hmpim.formats.readers.registry import BUILT_IN, readers
from hmpim.formats.readers.worker import MEMORY, TIME

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "formats.md").read_text(encoding="utf-8")
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
    "optional-dependencies"
]
ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in PAGE.partition("\n## ")[0].splitlines()
    if line.startswith("| ") and not line.startswith("| ---")
][1:]


def test_every_reader_has_its_row_and_every_row_its_reader():
    assert [row[0] for row in ROWS] == [reader.format for reader in BUILT_IN]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_a_row_says_what_is_so(row):
    form, _, extra, library, licence, tested = row
    reader = next(r for r in BUILT_IN if r.format == form)
    assert extra == (f"`{reader.extra}`" if reader.extra else "–")
    if reader.extra:
        (requirement,) = EXTRAS[reader.extra]
        assert re.match(r"[\w-]+", requirement)[0] == library
    own = library == "hmpim"
    assert licence == ("BSD-3-Clause" if own else licences.licence_of(library))
    assert reader.foreign != (own or form == "hmpim record")
    assert tested


def test_the_limits_are_those_of_the_code():
    assert f"may use {MEMORY:g} GiB" in PAGE
    assert f"and {TIME:g} s plus 5 s for each MiB" in PAGE


READER = """
import numpy as np
from hmpim.formats.readers import ChannelInfo, Contents, Reader
from hmpim.record import Series

def sniff(head, path):
    return head.startswith(b"BENCH7")

def channels(path, layout):
    names = (ChannelInfo(name="u", unit="V"), ChannelInfo(name="y"))
    return Contents(format="bench 7", channels=names, inputs=("u",), outputs=("y",), fs=10.0)

def read(path, names, layout):
    values = np.frombuffer(path.read_bytes()[8:]).reshape(2, -1)
    time = np.arange(values.shape[1]) / 10.0
    return tuple(Series(name=n, values=values["uy".index(n)], time=time, unit="") for n in names)

READER = Reader(format="bench 7", sniff=sniff, channels=channels, read=read)
"""


def test_a_reader_of_ones_own_is_found_by_its_entry_point(tmp_path, monkeypatch):
    (tmp_path / "my_package").mkdir()
    (tmp_path / "my_package" / "bench7.py").write_text(READER, encoding="utf-8")
    published(tmp_path, snippet("formats.md", '[project.entry-points."hmpim.readers"]'))
    file = tmp_path / "run.b7"
    file.write_bytes(b"BENCH7\0\0" + np.arange(6.0).tobytes())
    monkeypatch.syspath_prepend(tmp_path)
    readers.cache_clear()
    try:
        record = hmpim.read(file)
    finally:
        readers.cache_clear()
    assert record.inputs[0].values.tolist() == [0.0, 1.0, 2.0]
    assert record.outputs[0].values.tolist() == [3.0, 4.0, 5.0]
