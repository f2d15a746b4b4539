import io
from dataclasses import replace
from types import SimpleNamespace

from rich.console import Console

from hmpim.identify.judgement import judged
from hmpim.identify.records.levels import LevelComparison, Trend
from hmpim.identify.result import Parameters
from hmpim.record import Finding
from hmpim.report import print_result
from hmpim.report.numbers import format_value
from hmpim.report.repeats_text import _trend_table
from hmpim.report.words import GLOSSARY, off_by


def printed(result, *, truth=None, width=120):
    stream = io.StringIO()
    print_result(result, Console(file=stream, width=width), truth=truth)
    return stream.getvalue()


def test_each_estimate_is_printed_with_its_error_and_the_papers_figure(found):
    pair = found.pairs[0]
    text = printed(found)
    for words in GLOSSARY:
        estimate = getattr(pair.parameters, words.name)
        if estimate is not None:
            row = next(line for line in text.splitlines() if words.label in line)
            assert format_value(estimate) in row
    assert f"{pair.paper.bias:.4g}" in text
    assert "Truth" not in text


def test_a_known_truth_stands_beside_with_the_miss_in_standard_deviations(found):
    text = printed(found, truth={"delay": 0.15})
    row = next(line for line in text.splitlines() if "Delay, pure" in line)
    assert row.split()[-2:] == [f"{off_by(found.pairs[0].delay, 0.15).split()[0]}", "std"]
    assert "0.15" in row.split()


def test_each_row_has_its_own_verdict(found):
    late = Finding(code="x", message="It slips.", severity="doubt", parameters=("delay",))
    pair = judged(replace(found.pairs[0], warnings=(late,)))
    lines = printed(replace(found, pairs=(pair,))).splitlines()

    def row(label):
        return next(line for line in lines if line.strip().startswith(label)).split()

    assert "doubtful" in row("Delay, pure")
    assert "ok" in row("Bias")
    assert not any(line.startswith("Doubt: It slips.") for line in lines)  # the sentence says it


def test_no_row_is_cut_at_80_columns(found):
    text = printed(found, truth={"delay": 0.15}, width=80)
    assert "…" not in text
    assert max(len(line) for line in text.splitlines()) <= 80


def test_markup_and_escapes_in_a_warning_are_printed_as_text(found):
    warning = Finding(
        code="x", message="[red]not markup[/red] \x1b[2J [link=a]", severity="info", parameters=()
    )
    pair = replace(found.pairs[0], warnings=(warning,))
    text = printed(replace(found, pairs=(pair,)))
    assert "[red]not markup[/red]" in text
    assert "\x1b" not in text


def test_hostile_names_do_not_reach_the_terminal(hostile):
    text = printed(hostile)
    assert "\x1b" not in text
    assert "<script>" in text


def test_a_change_of_more_than_all_is_written_in_full():
    trend = Trend(
        name="delay",
        amplitudes=(1.0, 2.0),
        values=(0.01, 0.024),
        stds=(1e-4, 1e-4),
        probability=1e-9,
        change=1.4,
    )
    compared = LevelComparison(
        amplitudes=(1.0, 2.0), trends=(trend,), linear_up_to=1.0, findings=()
    )
    pair = SimpleNamespace(structure="static", parameters=Parameters())
    table = _trend_table(compared, [pair, pair])
    assert [str(next(column.cells)) for column in table.columns][-2:] == ["+140 %", "< 0.1 %"]
