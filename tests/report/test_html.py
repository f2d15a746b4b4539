"""The page: well formed, self-contained, readable by all, and not to be broken by a name."""

import csv
import importlib
import io
import re
from dataclasses import replace
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import hmpim
from hmpim.identify import (
    Estimate,
    HarmonicCurve,
    Identification,
    InputSet,
    Nonlinearity,
    Parameters,
)
from hmpim.identify.identify import identify
from hmpim.identify.result.inputs import OutputCoherence
from hmpim.plots import Figure
from hmpim.plots.draw.frames import legend_items
from hmpim.plots.draw.layout import text_width
from hmpim.record import Finding, Record
from hmpim.report import About, render, report, sheet, write_figures
from hmpim.report.advice import said_and_done
from hmpim.report.figures import pair_pictures
from hmpim.report.study import StudyPage, render_study
from hmpim.report.svg import PHONE
from hmpim.stimulus import Limits, design

VOID = {"meta", "link", "br", "hr", "img", "input"}
PICTURES = (
    "bode",
    "deviation",
    "signals",
    "correlation",
    "error",
    "spectra",
    "model",
    "residual",
    "candidates",
)


class Page(HTMLParser):
    """Elements of a page, checked for nesting as they come."""

    def __init__(self, text):
        super().__init__()
        self.open, self.elements, self.text = [], [], {}
        self.feed(text)
        self.close()
        assert self.open == [], "elements left open"

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        assert len(dict(attrs)) == len(attrs), f"an attribute of <{tag}> is given twice"
        if tag not in VOID:
            self.open.append((tag, dict(attrs).get("id")))

    def handle_startendtag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open, f"</{tag}> closes nothing"
        assert self.open[-1][0] == tag, f"</{tag}> closes <{self.open[-1][0]}>"
        self.open.pop()

    def handle_data(self, data):
        if self.open:
            place = self.open[-1]
            self.text[place] = self.text.get(place, "") + data

    def all(self, tag):
        return [attrs for name, attrs in self.elements if name == tag]

    @property
    def pictures(self):
        """Each once, as a wide page shows it."""
        return [svg for svg in self.all("svg") if "wide" in svg["class"].split()]

    @property
    def ids(self):
        return [attrs["id"] for _, attrs in self.elements if "id" in attrs]


@pytest.fixture(scope="module")
def page_text(found):
    return render(found)


@pytest.fixture(scope="module")
def page(page_text):
    return Page(page_text)


def check_sound(text):
    """What holds for every page, whatever it shows."""
    page = Page(text)
    assert len(page.ids) == len(set(page.ids)), "an id is used twice"
    for _, attrs in page.elements:
        for name in ("href", "clip-path", "style", "aria-labelledby"):
            for target in re.findall(r"url\(#([^)]*)\)", attrs.get(name) or ""):
                assert target in page.ids
        if (attrs.get("href") or "").startswith("#"):
            assert attrs["href"][1:] in page.ids
    for svg in page.all("svg"):
        assert svg["role"] == "img"
        title, description = svg["aria-labelledby"].split()
        assert page.text["title", title].strip()
        assert len(page.text["desc", description]) > 20
    return page


def test_the_page_is_sound_and_has_every_picture(page_text):
    page = check_sound(page_text)
    keys = [svg["aria-labelledby"].split()[0] for svg in page.pictures]
    assert keys == [f"pair-1-{key}-title" for key in PICTURES]


def test_the_page_needs_nothing_from_anywhere(page_text, page):
    assert "://" not in page_text
    assert "@import" not in page_text
    for tag, attrs in page.elements:
        assert tag not in ("script", "link", "iframe", "object", "embed", "base", "image")
        assert "src" not in attrs
        assert (attrs.get("href") or "#").startswith("#")


def test_headings_step_down_by_one(page):
    levels = [int(tag[1]) for tag, _ in page.elements if re.fullmatch("h[1-6]", tag)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after - before <= 1 for before, after in pairwise(levels))


def test_colours_follow_the_page_so_that_it_can_be_dark(page_text):
    pictures = page_text[page_text.index("<svg") :]
    assert "var(--input)" in pictures
    left = set(re.findall('(?:fill|stroke)="(#[0-9a-f]{3,6})', pictures))
    assert left == set()


def test_estimates_and_the_papers_figures_stand_beside_each_other(found, page_text):
    pair = found["y", "u"]
    assert f"{pair.delay.value:.6f}"[:6] in page_text
    assert "the peak of the cross-correlation (8) is the delay plus what the dynamics add" in (
        page_text
    )
    assert found.record.sha256 in page_text


def test_every_warning_is_shown(found):
    warned = replace(
        found.pairs[0],
        warnings=(
            Finding(
                code="jitter",
                message="Stamps stray by 4 %.",
                severity="info",
                parameters=(),
            ),
        ),
    )
    text = render(replace(found, pairs=(warned,)))
    assert "Stamps stray by 4 %." in text
    assert "jitter" in text


def test_hostile_names_are_shown_as_text(hostile):
    text = render(hostile)
    page = check_sound(text)
    assert page.all("script") == []
    assert "&lt;script&gt;alert(" in text
    assert "{{ 7*7 }}" in text
    assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f\ud800-\udfff]", text)


def test_a_result_read_back_has_its_tables_and_bode_plot_and_says_so(found):
    read_back = Identification.from_dict(found.to_dict())
    text = render(read_back)
    page = check_sound(text)
    assert len(page.pictures) == 3  # Bode, against the model, candidates
    assert "does not contain the record" in text
    assert "The record itself" not in render(found)


def test_the_stimulus_is_shown_in_its_limits(found):
    limits = Limits(position=10, velocity=70, acceleration=8500, unit="deg")
    text = render(found, stimulus=design(band=(0.1, 20), duration=10, fs=200, limits=limits))
    assert check_sound(text).pictures[-1]["aria-labelledby"].startswith("stimulus-title")
    assert "Peaks: 10 deg" in text


def test_several_pairs_each_have_their_section_and_a_dead_one_its_reason(found):
    u, y = found.data.inputs[0].values, found.data.outputs[0].values
    record = Record.from_arrays({"u": u}, {"y": y, "dead": np.full(y.size, 3.0)}, fs=200.0)
    text = render(identify(record, intersample="bandlimited"))
    page = check_sound(text)
    assert {"pair-1", "pair-2"} <= set(page.ids)
    assert "1 of 2 pairs can be used" in text
    assert "is constant at 3" in text


def test_pairs_that_are_not_coupled_are_folded_and_do_not_lead(found):
    pair = found.pairs[0]
    unrelated = replace(doubt("unrelated"), message="Does not follow.")
    apart = replace(
        pair,
        input="v",
        verdict="not_identifiable",
        parameters=Parameters(),
        warnings=(unrelated,),
    )
    warned = replace(pair, warnings=(doubt("drift"),))
    line = np.array([1.0, 2.0])
    inputs = InputSet(
        names=("u", "v"), bands=((0.1, 20.0),) * 2, frequency=line, condition=line,
        coherence=(OutputCoherence(output="y", frequency=line, multiple=line / 2),),
    )  # fmt: skip
    text = render(replace(found, pairs=(warned, apart), inputs=inputs, data=None))
    check_sound(text)
    above = text[text.index('<ol class="findings">') : text.index("</ol>")]
    assert re.findall(r"About (\w+)\.|Does not", above) == ["drift"]
    folded = text.index("1 pair is not coupled")
    assert text.index('id="pair-1" class="on-paper" open') < folded < text.index('id="pair-2"')


def test_a_finding_of_one_pair_of_several_names_it(found):
    pair = found.pairs[0]
    both = (replace(pair, warnings=(doubt("drift"),)), replace(pair, input="v", warnings=()))
    assert "<strong>u → y:</strong> About drift." in render(replace(found, pairs=both, data=None))


def test_units_of_a_gain_are_on_the_bode_plot(field_record):
    _, u, y = field_record
    noisy = y + 0.1 * np.random.default_rng(4).standard_normal(y.size)
    record = Record.from_arrays({"u": u}, {"y": noisy}, fs=200.0, units={"u": "deg", "y": "V"})
    result = identify(record, structures=["second_order"])
    assert "Magnitude (dB re 1 V/deg)" in render(result)
    rate = Record.from_arrays({"u": u}, {"y": noisy}, fs=200.0, units={"u": "deg/s", "y": "deg"})
    result = identify(rate, structures=["second_order"])
    assert "Magnitude (dB re 1 deg/(deg/s))" in render(result)


def test_a_figure_of_the_papers_steps_alone_has_its_unit(found):
    pair = found.pairs[0]
    without = replace(pair, parameters=replace(pair.parameters, peak_gain_db=None))
    page = render(replace(found, pairs=(without,)))
    row = page[page.rindex("Peak gain", 0, page.index("What the parameters mean")) :]
    assert ">dB<" in row[: row.index("</tr>")]


def test_a_long_record_makes_a_page_of_few_megabytes(found):
    n = 50_000
    u, noise = np.random.default_rng(0).standard_normal((2, n))
    record = Record.from_arrays({"u": u}, {"y": u + noise}, fs=1000.0)
    pair = replace(found.pairs[0], time=np.arange(n) / 1000.0, prediction=u, residual=noise)
    assert len(render(replace(found, pairs=(pair,), data=record))) < 1_500_000


def test_the_file_is_replaced_whole_or_not_at_all(found, tmp_path, monkeypatch):
    path = tmp_path / "r.html"
    path.write_text("old")
    page = importlib.import_module("hmpim.report.html")
    monkeypatch.setattr(page, "_page", lambda *_: "half \ud800")
    with pytest.raises(UnicodeEncodeError):
        report(found, path)
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["r.html"]


def test_the_page_is_written_where_it_is_wanted(found, tmp_path, page_text):
    report(found, tmp_path / "r.html")
    written = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert written.startswith("<!DOCTYPE html>")
    assert len(written) == pytest.approx(len(page_text), abs=20)


def test_a_nonlinearity_has_its_section_and_a_linear_system_none(found, page_text):
    assert "<h3>Nonlinearity</h3>" not in page_text
    curves = tuple(
        HarmonicCurve(order=k, frequency=(1.0, 9.0), amplitude=(size, size), std=(0.01, 0.01))
        for k, size in ((1, 2.0), (3, 0.2))
    )
    bent = Nonlinearity(
        share=0.02, even=0.0, odd=0.02, noise=0.7, linear=0.1, nonlinear=0.2,
        kinds=("curvature",), harmonics=curves,
    )  # fmt: skip
    warned = Finding(code="nonlinear", message="Bent.", severity="info", parameters=())
    pair = replace(found.pairs[0], nonlinearity=bent, warnings=(warned,))
    text = render(replace(found, pairs=(pair,)))
    section = text[text.index("<h3>Nonlinearity</h3>") :]
    assert "<dt>Kind</dt><dd>curvature" in section
    assert "order 3" in section
    assert re.search(r"<dt>Nonlinear part</dt><dd>[\d.]+\u00a0% of the output", section)


def test_the_page_opens_with_who_tested_what_and_its_verdict(found):
    about = About(
        title="Acceptance", under_test="Gyro <12>", test="T-7", operator="M. Ohm", date="1 May"
    )
    text = render(found, about=about, notes=["Warm."], truth={"delay": 0.15, "bias": 0.5})
    check_sound(text)
    first = [
        text.index(words) for words in ("Acceptance</h1>", "Gyro &lt;12&gt;", "M. Ohm", "1 May")
    ]
    then = [text.index(words) for words in (">Results<", ">Bode plot<", ">Details<")]
    assert first == sorted(first)
    assert first[-1] < text.index('class="verdict ok"') < text.index("<p>Warm.</p>") < then[0]
    assert then == sorted(then)
    bias = found["y", "u"].bias
    assert f"{(bias.value - 0.5) / bias.std:+.1f} std" in text


def test_each_row_of_the_parameters_has_its_verdict(found, page_text):
    given = [e for e in found["y", "u"].parameters.to_dict().values() if e is not None]
    assert page_text.count('<td class="verdict-cell ') == len(given)


def doubt(code):
    return Finding(code=code, message=f"About {code}.", severity="doubt", parameters=("delay",))


def test_at_most_three_findings_are_above_the_fold_causes_first(found):
    codes = ("lack_of_fit", "halves_disagree", "structure", "saturation", "gaps")
    warned = replace(found.pairs[0], warnings=tuple(map(doubt, codes)))
    text = render(replace(found, pairs=(warned,)))
    above = text[text.index('<ol class="findings">') : text.index("</ol>")]
    assert re.findall(r"About (\w+)\.", above) == ["gaps", "saturation", "structure"]
    assert above.count('class="todo"') == 3
    assert "All findings (5)" in text


def test_a_study_that_rests_on_doubt_does_not_look_as_if_all_were_well():
    page = StudyPage(
        title="T", description="", headline="All met.", met=True, grids=(), sections=(), facts=()
    )
    assert 'class="verdict ok"' in render_study(page)
    assert 'class="verdict doubtful"' in render_study(replace(page, doubtful=True))
    failed = render_study(replace(page, met=False, doubtful=True))
    assert 'class="verdict not_identifiable"' in failed


def test_every_doubt_that_can_be_raised_has_something_to_do():
    source = "".join(p.read_text("utf-8") for p in Path(hmpim.__file__).parent.rglob("*.py"))
    raised = re.findall(r'Finding\(\s*code="(\w+)",[^)]*?severity="doubt"', source)
    assert len(set(raised)) > 10
    assert [code for code in sorted(set(raised) - {"x"}) if not said_and_done(doubt(code))[1]] == []


@pytest.mark.parametrize(
    ("code", "message", "said", "done"),
    [
        ("saturation", "It is clipped. Lower the amplitude.", "It is clipped.", "Lower the amp"),
        ("noise_colour", "It is coloured. Look for hum.", "It is coloured.", "Look for hum."),
        ("structure", "A. Sweep higher. Lower the noise.", "A.", "Sweep higher. Lower the noise."),
        ("intersample", "May be held. State intersample=.", "May be held.", "State what the input"),
        ("saturation", "It is clipped", "It is clipped.", "Lower the level of the stimulus"),
    ],
)
def test_what_to_do_is_said_once_and_apart_from_what_was_found(found, code, message, said, done):
    warning = Finding(code=code, message=message, severity="info", parameters=())
    text = render(replace(found, pairs=(replace(found.pairs[0], warnings=(warning,)),)))
    above = text[text.index('<ol class="findings">') : text.index("</ol>")]
    assert f"<li>{said} <code" in above
    assert f'<span class="todo">{done}' in above
    assert text.count(done) == 1
    assert "All findings" not in text  # all are above


def test_the_caption_speaks_of_a_model_where_there_is_one(found):
    pair = found.pairs[0]
    assert "and the fitted model" in render(found)
    lost = replace(pair, verdict="not_identifiable", parameters=Parameters(bias=pair.bias))
    assert "and the fitted model" not in render(replace(found, pairs=(lost,)))


def test_a_page_says_how_to_read_an_interval_that_is_not_symmetric(found):
    told = "Where the interval is not symmetric"
    pair = found.pairs[0]

    def table(ends):
        delay = Estimate(value=0.15, std=0.001, ci95=ends, unit="s")
        changed = replace(pair, parameters=Parameters(delay=delay))
        page = render(replace(found, pairs=(changed,)))
        return page[page.index("<caption>") : page.index("</table>")]

    assert told not in table((0.148, 0.152))
    page = table((0.12, 0.152))
    assert told in page
    assert re.search(r'<span class="whole">[\d.]+</span> <span class="whole">−[\d.]+ \+', page)
    assert "no error bar can be stated" not in page
    assert "no error bar can be stated" in table(None)


def test_a_pdf_holds_the_same_and_a_sheet_is_one_page(found, hostile, tmp_path):
    report(hostile, tmp_path / "r.pdf", about=About(title="#panic() $x$ \\"), truth={"delay": 0.1})
    sheet(found, tmp_path / "s.pdf", about=About(operator="M. Ohm"))
    many, one = ((tmp_path / name).read_bytes() for name in ("r.pdf", "s.pdf"))
    assert many.startswith(b"%PDF-")
    assert len(re.findall(rb"/Type\s*/Page\b", one)) == 1
    assert len(re.findall(rb"/Type\s*/Page\b", many)) > 2


def test_figures_and_numbers_are_files_of_their_own(found, tmp_path, monkeypatch):
    drawn = []

    def savefig(_, path, **options):
        drawn.append((options["format"], path.write_text("")))

    monkeypatch.setattr(Figure, "savefig", savefig)
    names = {path.name for path in write_figures(found, tmp_path)}
    assert {f"1-{key}.{kind}" for key in PICTURES for kind in ("svg", "png")} < names
    assert [kind for kind, _ in drawn].count("png") == len(PICTURES)
    rows = list(csv.DictReader(io.StringIO((tmp_path / "parameters.csv").read_text("utf-8"))))
    (delay,) = [row for row in rows if row["parameter"] == "delay"]
    assert float(delay["value"]) == found["y", "u"].delay.value
    response = np.genfromtxt(tmp_path / "response-1.csv", delimiter=",", names=True)
    measured = found["y", "u"].frequency_response
    np.testing.assert_allclose(response["real"] + 1j * response["imag"], measured.response)


def test_a_page_has_true_minuses_and_says_what_to_do_once(found):
    pair = found.pairs[0]
    bias = replace(pair.parameters.bias, value=-0.6, ci95=(-0.62, -0.58))
    said = (
        "Sweep -1 higher. Lower the level of the stimulus, or widen the range.",
        "Late by 3 samples",
    )
    warned = tuple(
        Finding(code=code, message=message, severity="doubt", parameters=())
        for code, message in zip(("saturation", "rate"), said, strict=True)
    )
    changed = replace(pair, parameters=replace(pair.parameters, bias=bias), warnings=warned)
    text = render(replace(found, pairs=(changed,)))
    page = Page(text)
    shown = " ".join(page.text.values())
    assert "−0.62" in shown
    assert not re.search(
        r"(?<![\w.])-\d", re.sub(r"<svg.*?</svg>|<style.*?</style>", "", text, flags=re.S)
    )
    assert text.count("or widen the range") == 1  # all findings lead: no list repeats them
    assert "Late by 3 samples. <code" in text
    assert "<code>--fs</code>" in text
    assert "`" not in shown


def test_the_sheet_leads_with_the_verdict_alone(found, tmp_path):
    sheet(found, tmp_path / "s.html")
    text = (tmp_path / "s.html").read_text("utf-8")
    banner = text[text.index('<div class="verdict') :]
    assert re.search(r"<strong>([^<]*)</strong>", banner)[1] == "Model identified:"


def test_every_legend_fits_a_phone(found):
    pictures = pair_pictures(found, found.pairs[0])
    labels = [
        item.label
        for picture in pictures
        for panel in picture.figure.panels
        for item in legend_items(panel)
    ]
    assert len(labels) > 8
    assert [label for label in labels if text_width(label) + 60.0 > PHONE] == []
