"""A study's page on paper, printed by a browser: what stands on how many sheets."""

import re
import shutil
import subprocess

import numpy as np
import pytest

from hmpim.plots.curves import BodeCurve
from hmpim.plots.overlay import overlaid_bode
from hmpim.report.figures import Picture
from hmpim.report.study import Grid, Section, StudyPage, render_study
from tests_support import missing

AXES = Grid(caption="Axes", columns=("Axis", "−90°"), rows=tuple((f"{k}", "9") for k in range(5)))
MANY = tuple((f"case {k}", "9.4 ± 0.1") for k in range(120))  # more than one sheet holds


def picture():
    f = np.geomspace(0.1, 20.0, 40)
    curve = BodeCurve(frequency=f, magnitude_db=-f, phase=-9 * f)
    figure = overlaid_bode([("one", curve)], bandwidths=[None])
    return Picture(key="one", title="One", caption="One.", description="One.", figure=figure)


def page(*, every=(), cases=()):
    section = Section(
        title="Fig. 18: stimuli of the outer axes",
        observed="The level is above 30 dB up to 10 Hz, and 1000 Hz adds 6 dB.",
        found=("azimuth: 31.3 dB at 500 Hz, 37.3 dB at 1000 Hz. " * 2,) * 2,
        grids=tuple(cases),
        pictures=(picture(),),
    )
    return StudyPage(
        title="Section V",
        description="The paper's study of its flight motion simulator, repeated. " * 2,
        headline="All 35 checks are met. 47 of 50 rows have doubtful figures. " * 2,
        met=True,
        grids=(AXES, *every),
        sections=(section,),
        facts=(),
    )


@pytest.fixture
def sheets(tmp_path):
    chromium = shutil.which("chromium") or missing("chromium", "the browser Chromium")

    def count(shown):
        source, target = tmp_path / "study.html", tmp_path / "study.pdf"
        source.write_text(render_study(shown), encoding="utf-8")
        options = ("--headless", "--no-sandbox", "--disable-gpu", "--no-pdf-header-footer")
        subprocess.run(
            [chromium, *options, f"--user-data-dir={tmp_path / 'profile'}",
             f"--print-to-pdf={target}", source.as_uri()],
            check=True, capture_output=True, timeout=120,
        )  # fmt: skip
        return len(re.findall(rb"/Type\s*/Page\b", target.read_bytes()))

    return count


def test_the_first_figure_stands_on_the_first_sheet_and_each_case_once_behind_all(sheets):
    assert sheets(page()) == 1
    on_screen = Grid(caption="Cases", columns=("Case", "−90°"), rows=MANY, on_screen=True)
    assert sheets(page(cases=[on_screen])) == 1
    every = Grid(caption="All", columns=("Case", "−90°"), rows=MANY, folded=True, at_end=True)
    assert sheets(page(every=[every])) > 2
