"""The table against what is known of the paper."""

import re
from pathlib import Path

import numpy as np
import pytest

from hmpim.errors import ArgumentError
from hmpim.plots import Curve
from hmpim.plots.draw.frames import frames
from hmpim.report.paper import FIGURES, make_study, markdown_table

PAGE = Path(__file__).parents[3] / "docs" / "paper.md"
NUMBER = re.compile(r"(?<![\w.])−?\d+(?:\.\d+)?")


@pytest.fixture(scope="module")
def study(whole_study):
    return whole_study


@pytest.fixture(scope="module")
def value(study):
    def of(figure, words):
        rows = [r for r in study.rows if r.figure == figure and r.quantity.startswith(words)]
        assert len(rows) == 1, [r.quantity for r in rows]
        return rows[0].value

    return of


def test_every_figure_that_needs_no_motion_table_is_made(study):
    assert tuple(study.pictures) == FIGURES == (1, 2, 3, *range(5, 18), 23, 26)


def test_no_panel_is_empty_or_without_its_unit(study):
    for number, picture in study.pictures.items():
        assert picture.figure.panels, number
        ends = frames(picture.figure)
        for panel, frame in zip(picture.figure.panels, ends, strict=True):
            drawn = [curve for curve in panel.of(Curve) if np.ptp(curve.x) > 0]
            assert drawn, number
            assert panel.y.label.endswith(")") or panel.column or panel.bare, number
            lower, upper = frame.y
            assert any(np.any((curve.y > lower) & (curve.y < upper)) for curve in drawn), number


def test_equation_7_has_a_plus(study):
    (row,) = [r for r in study.rows if r.where == "Eq. (7)"]
    assert (row.paper, row.text) == ("−", "+")


def test_only_the_chirp_is_persistent(value):
    assert value(5, "Share") > 95.0


def test_steps_are_right_where_there_are_no_dynamics(value):
    assert value(8, "Delay") == 150.0
    assert value(9, "Bias") == pytest.approx(0.6, rel=0.03)
    assert value(10, "Scale") == pytest.approx(0.98, rel=0.01)
    assert value(11, "Noise") == pytest.approx(0.1, rel=0.1)


@pytest.mark.parametrize(("T", "decibels"), [("5", 50.6), ("10", 53.0)])
def test_fig_12(value, T, decibels):
    assert value(12, f"Extinction factor n, T = {T} s") == 0.0
    assert value(12, f"Level at 10 Hz with the window, T = {T} s") == pytest.approx(
        decibels, abs=0.1
    )
    assert value(12, f"Peak position, T = {T}") == pytest.approx(10.0)
    assert value(12, f"Peak velocity, T = {T}") == pytest.approx(628.0, rel=0.01)
    assert value(12, f"Peak acceleration, T = {T}") == pytest.approx(39400.0, rel=0.01)


@pytest.mark.parametrize(
    ("T", "n", "decibels"), [("5", 0.918, 19.9), ("10", 0.83, 22.7), ("12", 0.81, 23.4)]
)
def test_fig_13(value, T, n, decibels):
    found = value(13, f"Smallest extinction factor n, T = {T} s")
    assert found == pytest.approx(n, abs=0.005)
    level = value(13, f"Level at 40 Hz with the window, T = {T} s")
    assert level == pytest.approx(decibels, abs=0.2)


def test_signs_as_printed_do_not_give_what_the_paper_finds(study):
    row = {r.where: r for r in study.rows if r.where.startswith("Eq. (")}
    assert row["Eq. (8)"].value == -150.0
    # a motion that is shifted the wrong way is hardly like itself
    assert row["Eq. (9)"].value > 2.5 * row["Eq. (9)"].truth
    assert abs(row["Eq. (13)"].value) < 0.2
    assert row["Eq. (11)"].value == pytest.approx(0.6, rel=0.03)
    assert row["Eq. (11)"].truth == -0.6


def test_every_lag_divided_by_the_same_n(value):
    # R at the last lag is nothing, so that (14) gives (11); one lag apart the slope is nothing
    assert value(11, "What (14)") == pytest.approx(value(9, "Bias of"), rel=0.01)
    assert value(11, "Root of the spike") == pytest.approx(0.1, rel=0.1)


def test_the_phase_of_fig_17_has_no_false_turns(study):
    phase = study.pictures[17].figure.panels[-1].of(Curve)[0]
    high = phase.x > 18.0
    assert phase.y[high].max() < -800.0


def test_amplitude_at_the_end_of_fig_13(value):
    # acceleration is ω² times the amplitude there, and it is the acceleration that binds
    assert value(13, "Amplitude at 40 Hz") == pytest.approx(
        40000.0 / (2 * np.pi * 40.0) ** 2, rel=0.005
    )


@pytest.mark.parametrize("figure", [12, 13])
def test_twice_the_rate_gives_6_db(value, figure):
    assert value(figure, "Level gained") == pytest.approx(20 * np.log10(2), abs=0.05)


def test_seeker_lags_a_quarter_turn_at_about_1_8_hz(value):
    assert value(15, "Bandwidth") == pytest.approx(1.8, abs=0.05)


def test_fig_17_step_by_step(value):
    assert value(17, "Delay, by") == pytest.approx(170.0, abs=1e-9)
    assert value(17, "Bias, by") == pytest.approx(0.68, abs=0.01)
    assert value(17, "Noise, 1σ, by") == pytest.approx(0.31, abs=0.02)
    assert value(17, "Natural frequency, by") is None  # fewer than half of the records have one
    assert value(17, "Hump above DC, by") == pytest.approx(2.7, abs=0.3)
    assert value(17, "Bandwidth (−90°), by") == pytest.approx(1.534, abs=0.05)


def test_fig_17_jointly(study):
    rows = {r.quantity: r for r in study.rows if r.quantity.endswith(", joint fit")}
    assert len(rows) == 8
    for row in rows.values():
        assert row.std == pytest.approx(row.bound, rel=0.1), row.quantity
        assert abs(row.value - row.truth) < 3.5 * row.bound, row.quantity
    bandwidth = rows["Bandwidth (−90°), joint fit"]
    assert bandwidth.truth == pytest.approx(1.534, abs=5e-4)
    assert bandwidth.value == pytest.approx(1.534, abs=0.01)
    assert rows["Hump above DC, joint fit"].truth == pytest.approx(2.695, abs=1e-3)


def test_a_quarter_turn_below_the_pure_delay_is_the_natural_frequency(value):
    assert value(16, "Natural frequency") == pytest.approx(10.0, abs=0.15)


def test_picket_fence(value):
    for rate in ("500 Hz", "1000 Hz"):
        assert value(23, f"Spacing of the bins, {rate}") == pytest.approx(0.2)
        assert 0.1 < value(23, f"Peak missed by the bins, {rate}") < 1.0
    # a held command is late by half a sample: half as much at twice the rate
    phases = [value(23, f"Phase at 22 Hz, commands at {rate}") for rate in ("500", "1000")]
    assert phases[1] - phases[0] == pytest.approx(180 * 22 * (1 / 500 - 1 / 1000), abs=0.3)


def test_a_part_has_its_own_rows_only():
    part = make_study([13, 12])
    assert list(part.pictures) == [12, 13]
    assert {row.figure for row in part.rows} == {12, 13}


def test_a_figure_of_the_motion_table_is_refused():
    with pytest.raises(ArgumentError, match=r"figure 24 is not made here; choose one of 1, 2, 3"):
        make_study([12, 24])


def test_each_figure_is_told():
    told = []
    make_study([6, 7], tick=told.append)
    assert told == ["Fig. 6", "Fig. 7"]


# docs/paper.md shows the table that the command makes now. Here, as one process makes the study.
def places(text):
    return len(text.partition(".")[2])


def same_within_rounding(ours, theirs):
    assert NUMBER.sub("#", ours) == NUMBER.sub("#", theirs)
    for a, b in zip(NUMBER.findall(ours), NUMBER.findall(theirs), strict=True):
        x, y = (float(text.replace("−", "-")) for text in (a, b))
        assert abs(x - y) <= max(1.01 * 10 ** -max(places(a), places(b)), 1e-3 * abs(y)), theirs


def test_table_of_the_page_is_the_table_made_now(study):
    lines = PAGE.read_text(encoding="utf-8").partition("\n## The table\n")[2].splitlines()
    shown = [line for line in lines if line.startswith("| ")]
    made = markdown_table(study.rows).splitlines()
    assert len(shown) == len(made)
    for ours, theirs in zip(made, shown, strict=True):
        same_within_rounding(ours, theirs)


def test_the_comparison_notices_a_change():
    with pytest.raises(AssertionError):
        same_within_rounding("| n | 0.811 |", "| n | 0.813 |")
    same_within_rounding("| n | 0.811 |", "| n | 0.812 |")
