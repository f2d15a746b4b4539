"""A study's page in a browser: what stands on how many sheets, and whether it fits a screen."""

import re
import shutil
import subprocess
from dataclasses import replace

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
def browse(tmp_path):
    chromium = shutil.which("chromium") or missing("chromium", "the browser Chromium")

    def browse(text, *options):
        source = tmp_path / "study.html"
        source.write_text(text, encoding="utf-8")
        options = ("--headless", "--no-sandbox", "--disable-gpu", *options)
        return subprocess.run(
            [chromium, *options, f"--user-data-dir={tmp_path / 'profile'}", source.as_uri()],
            check=True, capture_output=True, timeout=120,
        ).stdout.decode()  # fmt: skip

    return browse


@pytest.fixture
def sheets(browse, tmp_path):
    def count(shown):
        target = tmp_path / "study.pdf"
        browse(render_study(shown), "--no-pdf-header-footer", f"--print-to-pdf={target}")
        return len(re.findall(rb"/Type\s*/Page\b", target.read_bytes()))

    return count


def test_the_first_figure_stands_on_the_first_sheet_and_each_case_once_behind_all(sheets):
    assert sheets(page()) == 1
    on_screen = Grid(caption="Cases", columns=("Case", "−90°"), rows=MANY, on_screen=True)
    assert sheets(page(cases=[on_screen])) == 1
    every = Grid(caption="All", columns=("Case", "−90°"), rows=MANY, folded=True, at_end=True)
    assert sheets(page(every=[every])) > 2


def test_what_the_study_was_made_with_is_never_alone_on_a_sheet(browse, tmp_path):
    reader = shutil.which("pdftotext") or missing("pdftotext", "pdftotext of Poppler")
    target, alone = tmp_path / "study.pdf", "About this study"
    facts = tuple((f"Fact {k}", "as stated") for k in range(6))
    for count in range(1, 6):
        shown = page()
        shown = replace(shown, sections=shown.sections * count, facts=facts)
        browse(render_study(shown), "--no-pdf-header-footer", f"--print-to-pdf={target}")
        text = subprocess.run([reader, "-layout", target, "-"], check=True, capture_output=True)
        last = text.stdout.decode().rstrip("\f").split("\f")[-1]
        assert alone in last
        assert not last.lstrip().startswith(alone), count


NAMES = (
    "Axis", "Verdict", "Test", "Load", "At once", "Mode", "Rate (Hz)", "Peak acc. (deg/s²)",
    "−90° (Hz)", "fn (Hz)", "ζ", "Delay (ms)", "Noise (deg)", "Scale", "Bias (deg)",
    "−90° of the response (Hz)", "−90° exact (Hz)",
)  # fmt: skip
WIDEST = (
    "elevation", "doubtful", "acceleration-outer", "bracket+projector", "axes at once", "PVA",
    "1000", "16442", "22.245 −0.094 +0.569", "10.57 −0.65 +1.35 ?", "0.7855 −0.0030 +0.0191 ?",
    "-0.29 −2.84 +0.24 ?", "0.00288 −0.00034 +0.00045", "0.99977 −0.00033 +0.00047",
    "-0.000334 ± 0.000094 ?", "19.505 ± 0.038 ?", "115.54",
)  # fmt: skip
CASES = Grid(
    caption="Cases",
    columns=NAMES,
    rows=(WIDEST,),
    dense=True,
    beneath=("Verdict", "Load", "At once", "Rate (Hz)"),
)


def test_a_dense_table_has_errors_and_some_columns_beneath():
    heads, (line,) = CASES.heads, CASES.lines
    assert heads[:3] == [["Axis", "Verdict"], ["Test", "Load", "At once"], ["Mode", "Rate (Hz)"]]
    assert line[1] == ["acceleration-outer", "bracket+projector", "axes at once"]
    cells = dict(zip((head[0] for head in heads), line, strict=True))
    assert cells["−90° (Hz)"] == ["22.245", "−0.094 +0.569"]
    assert cells["Bias (deg)"] == ["-0.000334 ?", "± 0.000094"]
    assert cells["−90° exact (Hz)"] == ["115.54"]
    plain = replace(CASES, dense=False, beneath=())
    assert [cell for (cell,) in plain.lines[0]] == list(WIDEST)


def test_the_table_of_cases_fits_a_screen_of_1280_pixels(browse):
    measure = (
        "<script>document.title = [...document.querySelectorAll('.table')].map("
        "t => t.scrollWidth - t.clientWidth)</script>"
    )

    def beyond(cases):
        text = render_study(page(cases=[cases])) + measure
        seen = browse(text, "--window-size=1280,900", "--dump-dom")
        return max(int(part) for part in re.search("<title>([0-9,]+)", seen)[1].split(","))

    assert beyond(CASES) == 0
    assert beyond(replace(CASES, dense=False, beneath=())) > 0
