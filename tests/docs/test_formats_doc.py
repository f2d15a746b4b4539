"""docs/formats.md lists the readers there are, with their extras and licences."""

import re
import tomllib
from pathlib import Path

import licences
import pytest

from hmpim.formats.readers.registry import BUILT_IN
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
    assert f"may take {MEMORY:g} GiB" in PAGE
    assert f"and {TIME:g} s and 5 s more for each MiB" in PAGE
