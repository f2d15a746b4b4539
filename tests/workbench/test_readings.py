"""What is set by hand or specified stands beside what was found, on the page and in the report."""

from dataclasses import replace

import numpy as np
import pytest

import hmpim
from hmpim.formats import save
from hmpim.plots import Rule
from hmpim.workbench.work.record import Question, View, automatic, found, look, write_report
from hmpim.workbench.work.runs import compared
from tests_support import designed_once
from workbench_support import LIMITS, recorded


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


def test_the_estimate_so_far_has_the_outputs_unit():
    from hmpim.workbench.parts.table import look_cells

    record = recorded()
    stimulus = designed_once(band=(0.1, 20), duration=10, fs=200, limits=LIMITS)
    look = hmpim.LiveEstimator(stimulus).update(record.inputs[0].values, record.outputs[0].values)
    columns, rows = look_cells(look, passed=True, unit="deg")
    units = {row[0]: row[columns.index("Unit")] for row in rows}
    assert units["Bias"] == units["Noise"] == "deg"
    assert units["Scale factor"] == ""
    assert units["Natural frequency"] == "Hz"


def test_where_no_channel_stands_out_the_reasons_are_told(tmp_path):
    record = recorded()
    still = record.outputs[0].values * 0.0
    rows = zip(record.inputs[0].time, record.inputs[0].values, still, strict=True)
    file = tmp_path / "still.csv"
    file.write_text("time,a,b\n" + "".join(f"{t},{a},{b}\n" for t, a, b in rows))
    seen = look(str(file))
    assert (seen.inputs, seen.outputs) == ((), ())
    assert any(words.startswith("'b': always reads 0") for words in seen.reasons)


def test_a_run_of_several_axes_is_analysed_as_a_whole(tmp_path):
    u, v = np.random.default_rng(1).standard_normal((2, 400))
    record = hmpim.Record.from_arrays({"a": u, "b": v}, {"c": u, "d": v}, fs=100.0)
    save(record, tmp_path / "run.h5")
    seen = look(str(tmp_path / "run.h5"))
    assert (seen.inputs, seen.outputs) == (("a", "b"), ("c", "d"))


def test_what_is_known_of_the_input_and_the_loop_is_asked_with_it(folder, tmp_path, monkeypatch):
    path = folder / "unit1" / "run.h5"
    asked = Question(file=str(path), inputs=("u",), outputs=("y",), intersample="zoh")
    assert found(asked, View()).result.pairs[0].intersample == "zoh"
    assert asked.automatic == asked  # what is known is not set by hand
    rng = np.random.default_rng(1)
    r, u, y = np.cumsum(rng.standard_normal((3, 400)), axis=1)
    loop = tmp_path / "loop.csv"
    loop.write_text("r,u,y\n" + "".join(f"{a},{b},{c}\n" for a, b, c in zip(r, u, y, strict=True)))
    given: list[object] = []
    monkeypatch.setattr(
        "hmpim.workbench.work.record.identify",
        lambda record, **named: given.append((record, named)),
    )
    monkeypatch.setattr("hmpim.workbench.work.record._slim", lambda result: result)
    automatic(replace(asked, file=str(loop), fs=100.0, reference="r"))
    ((record, named),) = given
    assert [channel.name for channel in record.references] == ["r"]
    assert named == {"structures": None, "intersample": "zoh", "reference": "r"}


def test_a_comparison_says_whose_figures_they_are_and_which_are_doubtful(tmp_path):
    for k, band in enumerate((20.0, 3.0), start=1):
        stimulus = designed_once(band=(0.1, band), duration=10, fs=200, limits=LIMITS)
        sensor = hmpim.Sensor(delay=0.15, natural_frequency=10, damping_ratio=0.4, noise_std=0.1)
        (tmp_path / "up").mkdir(exist_ok=True)
        save(hmpim.run(sensor, stimulus, rng=k), tmp_path / "up" / f"{k}.h5")
    shown = compared(str(tmp_path), ["up/1.h5", "up/2.h5"], "delay", "")
    table = {row[0]: row[1:] for row in shown.cells}
    assert shown.columns[1:] == ("up/1.h5", "up/2.h5")
    assert table["Pair"] == ("y from u", "y from u")
    assert table["Verdict"] == ("ok", "doubtful")
    assert [cell.endswith(" (doubtful)") for cell in table["Natural frequency"]] == [False, True]


def test_a_figure_of_the_papers_steps_alone_has_its_unit():
    from hmpim.workbench.parts.table import parameter_cells

    pair = hmpim.identify(recorded()).pairs[0]
    found = replace(pair, parameters=replace(pair.parameters, peak_gain_db=None))
    rows = {row[0]: row for row in parameter_cells(found, {})[1]}
    assert rows["Peak gain"][1:3] == ("–", "dB")


def test_a_specification_is_a_line_in_the_trend(folder):
    names = ["unit1/run.h5", "unit2/run.h5"]
    shown = compared(folder, names, "delay", "", "delay < 130ms, bandwidth_phase90 > 1 Hz")
    (rule,) = shown.trend.panels[0].of(Rule)
    assert (rule.at, rule.words) == (pytest.approx(0.13), "specified < 130ms")
    assert "specified < 130ms" in shown.trend.alt
    with pytest.raises(hmpim.HmpimError, match="which no run has"):
        compared(folder, names, "delay", "", "speed < 3")
