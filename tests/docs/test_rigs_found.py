"""The table of docs/rigs.md, found against true: every kind of rig, and the quickest made again."""

import re
from pathlib import Path

import pytest
import rigs_found

from hmpim.rigs.catalogue import KINDS

DOC = (Path(__file__).parents[2] / "docs" / "rigs.md").read_text(encoding="utf-8")
TABLE = DOC.partition("<!-- found -->\n")[2].partition("<!-- end of found -->")[0]
ROWS = [[cell.strip() for cell in line.split("|")[1:-1]] for line in TABLE.splitlines()[2:] if line]
NUMBER = r"(-?[\d.]+(?:e-?\d+)?)"


def test_every_kind_of_rig_has_its_rows():
    assert {row[4].strip("`") for row in ROWS} == set(rigs_found.RIGS)
    kinds = {re.match(r"[a-z]+", kind.form)[0] for kind in KINDS}
    assert kinds <= set(rigs_found.RIGS)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row[4]} {row[1]}")
def test_what_was_found_is_what_is_true(row):
    found, true = float(re.match(NUMBER, row[2])[1]), float(row[3])
    told = re.search(rf"± {NUMBER}", row[2])
    std = float(told[1]) if told else 0.0
    near = 1e-2 if "doubtful" in row[2] else 2e-3
    assert abs(found - true) <= max(4.0 * std, near * abs(true))


@pytest.mark.parametrize("name", ["sensor", "python"])
def test_a_row_made_again_says_the_same(name):
    words, made = rigs_found.RIGS[name]
    rows = [row for row in ROWS if row[4] == f"`{name}`"]
    again = made()
    assert len(again) == len(rows)
    for row, (what, estimate, true, factor, unit) in zip(rows, again, strict=True):
        assert row[0] == words
        assert row[1] == (f"{what}, {unit}" if unit else what)
        assert float(row[3]) == pytest.approx(factor * true, rel=1e-4)
        assert float(re.match(NUMBER, row[2])[1]) == pytest.approx(
            factor * estimate.value, rel=1e-3
        )
