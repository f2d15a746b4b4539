"""Figures at several levels: the same words on the page and on the terminal."""

from types import SimpleNamespace

from hmpim.identify import Estimate, Parameters
from hmpim.identify.records.levels import compare_levels
from hmpim.report.repeats_text import level_cells


def at(value, structure):
    delay = Estimate(value=value, std=0.001, ci95=(value - 0.001, value + 0.004), unit="s")
    return SimpleNamespace(structure=structure, parameters=Parameters(delay=delay))


def test_a_level_s_own_figure_has_both_sides_and_one_found_again_its_error():
    each = [at(0.15, "second_order"), at(0.16, "second_order"), at(0.2, "static")]
    found = [at(0.15, "").parameters, at(0.16, "").parameters, at(0.17, "").parameters]
    (trend,) = compare_levels(found, [1.0, 2.0, 3.0]).trends
    cells = level_cells(trend, each, [1.0, 2.0, 3.0])
    assert cells == ["0.1500 −0.0010 +0.0040", "0.1600 −0.0010 +0.0040", "0.1700 ± 0.0010"]
