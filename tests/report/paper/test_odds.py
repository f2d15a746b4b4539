"""Fig. 17 over many records: what docs/paper.md says of it, on a few of them."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import paper_odds
import pytest

from hmpim.report.paper.odds import FIG_17, read_many
from hmpim.report.paper.sample import SYSTEM, sample_stimulus
from tests_support import room

PAGE = Path(__file__).parents[3] / "docs" / "paper.md"
FEW = 8


def rows(first):
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    start = next(n for n, line in enumerate(lines) if line.startswith(first))
    end = next(n for n in range(start, len(lines)) if not lines[n].startswith("|"))
    return [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines[start:end]]


def numbers(cell):
    return [float(word.replace("−", "-")) for word in re.findall(r"[+−]?\d+\.?\d*", cell)]


def alike(found, shown):
    """Without noise the same figure; a mean of few records within what chance allows."""
    assert len(found) == len(shown), (found, shown)
    if len(shown) == 2:  # mean and scatter
        mean, scatter = shown
        assert abs(found[0] - mean) <= room(FEW, scatter) + 2e-3, (found, shown)
    else:
        assert found == pytest.approx(shown, abs=6e-3)


def test_the_tables_of_the_page_are_the_tables_made_now():
    shown = rows("| Done before (18)")
    made = [
        [cell.strip() for cell in line.split("|")[1:-1]]
        for line in paper_odds.settings_table(range(FEW))
    ]
    assert [row[0] for row in made] == [row[0] for row in shown]
    for ours, theirs in zip(made[2:], shown[2:], strict=True):
        for a, b in zip(ours[1:], theirs[1:], strict=True):
            for one, other in zip(a.split(";"), b.split(";"), strict=True):
                alike(numbers(one), numbers(other))


def test_130_ms_reads_150_ms_and_150_ms_reads_170_ms():
    shown = {row[0]: row[1:] for row in rows("| Pure delay, amplitude")[2:]}
    for delay in (0.130, 0.150):
        many = read_many(replace(SYSTEM, delay=delay), sample_stimulus(3.0), range(FEW))
        bandwidth, scatter = numbers(shown[f"{1e3 * delay:g} ms, 3°"][4])
        assert many.delay == pytest.approx(delay + 0.020, abs=1e-9)
        off = float(np.mean(many.bandwidth_phase90)) - bandwidth
        assert abs(off) <= room(FEW, scatter) + 5e-4
        # Three in four of all records; none of eight has a chance of 1e-5.
        assert (FIG_17.together(many, room=2.0) > 0.0) == (delay == 0.130)


@pytest.mark.study
def test_the_odds_of_the_printed_figures():
    many = read_many(replace(SYSTEM, delay=0.130), sample_stimulus(3.0), range(1000, 1400))
    assert FIG_17.together(many) == pytest.approx(0.19, abs=0.08)
    assert FIG_17.together(many, room=2.0) == pytest.approx(0.78, abs=0.08)
