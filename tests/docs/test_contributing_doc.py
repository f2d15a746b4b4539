"""CONTRIBUTING.md: what it names is there, and its lists are those that the code goes by."""

import re
from pathlib import Path

import pytest

import tests_support
from hmpim.formats.readers import registry as readers

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
PLACES = sorted({p for p in re.findall(r"`([\w./-]+)`", TEXT) if p.count("/")})
ROWS = {
    row.split("|")[1].strip(): row
    for row in TEXT.partition("## Where things are added")[2].splitlines()
    if row.startswith("| a")
}


@pytest.mark.parametrize("place", PLACES)
def test_each_place_is_there(place):
    assert (ROOT / place).exists()


def test_six_things_can_be_added():
    wanted = {"structure", "effect", "check", "rig", "reader", "exporter"}
    assert {re.match(r"an? (\w+)", name)[1] for name in ROWS} == wanted


@pytest.mark.parametrize("name", ROWS)
def test_the_names_of_a_row_stand_in_the_places_of_that_row(name):
    cells = ROWS[name].split("|")[2:4]
    places = [ROOT / p for cell in cells for p in re.findall(r"`(src/[\w./-]+)`", cell)]
    files = [f for p in places for f in (p.rglob("*.py") if p.is_dir() else [p])]
    code = "\n".join(file.read_text(encoding="utf-8") for file in files)
    names = re.findall(r"`([A-Za-z_]{2,})`", " ".join(cells))
    assert names
    for each in names:
        assert re.search(rf"\b{each}\b", code), each


def test_readers_and_rigs_of_ones_own_are_entry_points():
    for row, group in (("a reader", readers.GROUP), ("a rig", "hmpim.rigs")):
        assert f"`{group}`" in ROWS[row]


def test_the_tools_of_the_tests_are_there():
    told = TEXT.partition("**Bounds.**")[2].partition("**Time.**")[0]
    named = re.findall(r"`([a-z_]+)(?:\(\w\))?`", told) + re.findall(r"`([A-Z_]{3,})`", told)
    assert len(named) >= 6
    for name in named:
        assert hasattr(tests_support, name), name
