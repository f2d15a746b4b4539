"""What is set by hand or specified stands beside what was found, on the page and in the report."""

from dataclasses import replace

import pytest

import hmpim
from hmpim.formats import save
from hmpim.plots import Rule
from hmpim.workbench.work.record import Question, View, automatic, found, write_report
from hmpim.workbench.work.runs import compared
from workbench_support import recorded


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two runs of one sensor."""
    place = tmp_path_factory.mktemp("runs")
    for k in (1, 2):
        (place / f"unit{k}").mkdir()
        save(recorded(rng=k), place / f"unit{k}" / "run.h5")
    return place


def test_structure_and_interval_by_hand_stand_beside_the_automatic(folder):
    from hmpim.workbench.parts.table import parameter_cells

    path = folder / "unit1" / "run.h5"
    asked = Question(file=str(path), inputs=("u",), outputs=("y",))
    hand = replace(asked, structure="first_order", stop=8.0)
    assert (asked.set_by_hand, hand.set_by_hand) == ("", "first order, the beginning to 8 s")
    assert hand.automatic == asked
    whole, fitted = automatic(hand).pairs[0], found(hand, View()).result.pairs[0]
    assert (whole.structure, fitted.structure) == ("second_order", "first_order")
    columns, rows = parameter_cells(
        whole, {"bandwidth_phase90": 1.6}, fitted=fitted, set_by_hand=hand.set_by_hand
    )
    by_hand = columns.index("✎ first order, the beginning to 8 s, by hand")
    table = {row[0]: row for row in rows}
    assert columns[:3] == ("Parameter", "Automatic", "Unit")
    assert float(table["Natural frequency"][1].split()[0]) == pytest.approx(10.0, abs=0.05)
    assert table["Natural frequency"][by_hand] == "–"
    assert table["Time constant"][1] == "–"
    assert table["Time constant"][by_hand].startswith("✎ ")
    assert table["Time constant"][2] == "s"
    assert table["Bandwidth, −90°"][columns.index("By hand")] == "✎ 1.6, by hand"
    notes = write_report(hand, str(folder / "by hand.html"), 0, {"delay": 0.16}, whole)
    assert "by hand: first order, the beginning to 8 s; automatic: second order" in notes[0]
    assert "automatic 0.1499" in notes[1]  # of the whole record, not of what was set by hand
    assert "first order, the beginning to 8 s" in (folder / "by hand.html").read_text()


def test_a_specification_is_a_line_in_the_trend(folder):
    names = ["unit1/run.h5", "unit2/run.h5"]
    shown = compared(folder, names, "delay", "", "delay < 130ms, bandwidth_phase90 > 1 Hz")
    (rule,) = shown.trend.panels[0].of(Rule)
    assert (rule.at, rule.words) == (pytest.approx(0.13), "specified < 130ms")
    assert "specified < 130ms" in shown.trend.alt
    with pytest.raises(hmpim.HmpimError, match="which no run has"):
        compared(folder, names, "delay", "", "speed < 3")
