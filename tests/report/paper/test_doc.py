"""docs/paper.md shows the table that the command makes now."""

import re
from pathlib import Path

import pytest

from hmpim.report.paper import markdown_table

PAGE = Path(__file__).parents[3] / "docs" / "paper.md"
NUMBER = re.compile(r"(?<![\w.])−?\d+(?:\.\d+)?")


def places(text):
    return len(text.partition(".")[2])


def same_within_rounding(ours, theirs):
    assert NUMBER.sub("#", ours) == NUMBER.sub("#", theirs)
    for a, b in zip(NUMBER.findall(ours), NUMBER.findall(theirs), strict=True):
        x, y = (float(text.replace("−", "-")) for text in (a, b))
        assert abs(x - y) <= max(1.01 * 10 ** -max(places(a), places(b)), 1e-3 * abs(y)), theirs


def test_table_of_the_page_is_the_table_made_now(whole_study):
    lines = PAGE.read_text(encoding="utf-8").partition("\n## The table\n")[2].splitlines()
    shown = [line for line in lines if line.startswith("| ")]
    made = markdown_table(whole_study.rows).splitlines()
    assert len(shown) == len(made)
    for ours, theirs in zip(made, shown, strict=True):
        same_within_rounding(ours, theirs)


def test_the_comparison_notices_a_change():
    with pytest.raises(AssertionError):
        same_within_rounding("| n | 0.811 |", "| n | 0.813 |")
    same_within_rounding("| n | 0.811 |", "| n | 0.812 |")
