"""Every way of drawing shows the same: the data, the ends, the ticks, the words."""

import json
import re
from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
import pytest

from hmpim import plots
from hmpim.identify import Estimate
from hmpim.plots import Axis, Band, Curve, Figure, Image, Panel, Points, Rule, Span, Words
from hmpim.plots.bode import pair_bode
from hmpim.plots.curves import BodeCurve
from hmpim.plots.draw import with_svg
from hmpim.plots.draw.frames import frames, ticks
from hmpim.plots.draw.layout import LINE, SIZE, places, text_width
from hmpim.plots.overlay import beside_bode, overlaid_bode
from hmpim.plots.style import COLOURS

F = np.geomspace(0.1, 100.0, 30)


def everything() -> Figure:
    """A picture with one of each."""
    items = (
        Span(low=0.2, high=20.0, label="excited band"),
        Band(x=F, low=np.full(F.size, -np.inf), high=F, label="95 % band"),
        Curve(x=F, y=F, label="a <b> $c$", dashes="-.", marker="o"),
        Points(x=F, y=F, low=F - 1.0, high=F + 2.0, label="measured", marker="s", filled=False),
        Rule(at=5.0, low=4.0, high=6.0, words="5.0 ± 0.5 Hz"),
        Rule(at=50.0, axis="y", words="level", label="limit"),
        Words(x=1.0, y=2.0, text="here"),
    )
    above = Panel(x=Axis(scale="log"), y=Axis(label="y (V)", low=0.0, high=90.0), items=items)
    image = Image(values=np.eye(3), x=(0.0, 3.0), y=(0.0, 3.0), low=0.0, high=1.0)
    below = Panel(x=Axis(label="x (m)"), y=Axis(), items=(image,), row=1)
    return Figure(panels=(above, below), alt="One of each.", heights=(2.0, 2.0), share_x=False)


def test_matplotlib_and_plotly_are_given_the_same_data_ends_and_words():
    figure = everything()
    upper = figure.to_matplotlib().axes[0]
    plotly = figure.to_plotly()
    layout = plotly["layout"]
    assert list(upper.get_ylim()) == layout["yaxis"]["range"] == [0.0, 90.0]
    np.testing.assert_allclose(np.log10(upper.get_xlim()), layout["xaxis"]["range"])
    by_name = {trace["name"]: trace for trace in plotly["data"]}
    line = next(line for line in upper.lines if line.get_label() == r"a <b> \$c\$")
    np.testing.assert_array_equal(line.get_ydata(), by_name["a &lt;b&gt; $c$"]["y"])
    assert {text.get_text() for text in upper.texts} == {
        note["text"] for note in layout["annotations"]
    }
    assert layout["meta"]["alt"] == figure.alt


def test_plotly_takes_words_by_the_logarithm_and_lines_by_the_value():
    layout = everything().to_plotly()["layout"]
    note = next(note for note in layout["annotations"] if note["text"] == "5.0 ± 0.5 Hz")
    assert note["x"] == pytest.approx(np.log10(5.0))
    assert [s["x0"] for s in layout["shapes"] if s["type"] == "line" and s["xref"] == "x"] == [5.0]


def test_plotly_is_given_arrays_and_all_else_is_plain_json():
    plotly = everything().to_plotly()
    assert all(isinstance(t["x"], np.ndarray) for t in plotly["data"])

    def arrays(value: object) -> object:
        assert isinstance(value, np.ndarray)
        return value.tolist()

    assert json.loads(json.dumps(plotly, default=arrays))["layout"]["yaxis2"]["anchor"] == "x2"


def test_a_band_without_end_is_drawn_to_the_edge():
    trace = next(t for t in everything().to_plotly()["data"] if t.get("fill"))
    assert np.isfinite(trace["y"]).all()
    figure = everything().to_matplotlib()
    (points,) = (p.vertices for p in figure.axes[0].collections[0].get_paths())
    assert np.isfinite(points).all()


@pytest.mark.parametrize(
    ("axis", "ends", "most", "words"),
    [
        (Axis(degrees=True), (-380.0, 20.0), 7, "−360 −270 −180 −90 0"),
        (Axis(degrees=True), (-1300.0, 90.0), 7, None),
        (Axis(degrees=True), (-40.0, 5.0), 7, "−30 −15 0"),
        (Axis(degrees=True), (-14.0, 14.0), 3, "−10 −5 0 5 10"),
        (Axis(), (0.0, 10.0), 6, "0 2 4 6 8 10"),
        (Axis(), (-2e-6, 2e-6), 5, "−2e−6 −1e−6 0 1e−6 2e−6"),
        (Axis(scale="log"), (0.1, 1000.0), 5, "0.1 1 10 100 1000"),
        (Axis(scale="log"), (8.0, 9.0), 5, "8 8.2 8.4 8.6 8.8 9"),
        (Axis(scale="symlog"), (0.0, 2000.0), 7, "0 10 100 1000"),
        (Axis(ticks=((1.0, "one"), (9.0, "nine"))), (0.0, 2.0), 7, "one"),
        (Axis(ticks=()), (0.0, 2.0), 7, ""),
    ],
)
def test_ticks_are_round_inside_and_few(axis, ends, most, words):
    found = ticks(axis, ends, most=most)
    assert all(ends[0] <= at <= ends[1] for at, _ in found)
    if words is None:
        assert {b[0] - a[0] for a, b in pairwise(found)} == {90.0}
    else:
        assert " ".join(word for _, word in found) == words


def test_panels_of_a_column_share_their_horizontal_ends():
    curve = Curve(x=np.array([0.0, 5.0]), y=np.zeros(2))
    panels = (
        Panel(x=Axis(), y=Axis(), items=(curve,)),
        Panel(x=Axis(low=-1.0, high=9.0), y=Axis(), row=1),
    )
    shared = frames(Figure(panels=panels, alt="", heights=(1.0, 1.0)))
    assert shared[0].x == shared[1].x == (-1.0, 9.0)
    apart = frames(Figure(panels=panels, alt="", heights=(1.0, 1.0), share_x=False))
    assert apart[0].x == pytest.approx((-0.05, 5.05))


@pytest.mark.parametrize("reach", [0.05, 0.4, 0.6, 1.2, 60.0, 400.0])
@pytest.mark.parametrize("height", [1.2, 1.7, 2.9])
def test_numbers_of_an_axis_leave_room_for_its_label(reach, height):
    curve = Curve(x=F, y=np.linspace(-reach, reach, F.size))
    panel = Panel(x=Axis(), y=Axis(label="Magnitude (dB)", low=-reach, high=reach), items=(curve,))
    figure = Figure(panels=(panel,), alt="", heights=(height,))
    (place,), _ = places(figure, frames(figure), width=700.0)
    widest = max(text_width(words) for _, words in place.y_ticks)
    assert place.left - 7.0 - widest > place.edge + SIZE
    assert text_width("−") > text_width("-")  # a true minus is as wide as a plus


def estimate(value, std=0.1):
    return Estimate(value=value, std=std, ci95=(value - 2 * std, value + 3 * std), unit="Hz")


def test_columns_share_their_axes_and_each_curve_has_its_mark():
    names = ["P", "P", "PV", "PV"]
    curves = [
        (name, BodeCurve(frequency=F, magnitude_db=-k * F, phase=-(k + 1) * F))
        for k, name in enumerate(names)
    ]
    figure = beside_bode(
        curves,
        bandwidths=[estimate(30.0), estimate(29.0), None, estimate(20.0)],
        within=["500 Hz", "1000 Hz"] * 2,
    )
    assert figure.columns == 2
    assert len({(panel.x.low, panel.x.high) for panel in figure.panels}) == 1
    upright = [
        [rule.at for rule in panel.of(Rule) if rule.axis == "x"] for panel in figure.panels[1::2]
    ]
    assert upright == [[30.0, 29.0], [20.0]]
    (last,) = (rule for rule in figure.panels[3].of(Rule) if rule.axis == "x")
    assert (last.low, last.high) == (19.8, 20.3)
    assert last.words == "20.00 −0.20 +0.30 Hz"
    assert [line.label for line in figure.panels[2].of(Curve)] == ["500 Hz", "1000 Hz"]
    assert figure.panels[3].of(Rule)[-1].colour == figure.panels[3].of(Curve)[-1].colour
    phase = figure.panels[1].y  # the words of two marks stand below all curves
    lowest = min(curve.y.min() for panel in figure.panels[1::2] for curve in panel.of(Curve))
    words = max(rule.words_at for rule in figure.panels[1].of(Rule) if rule.words)
    assert (lowest - phase.low) / (phase.high - phase.low) > words + 0.1


def test_heights_are_those_of_what_is_known():
    whole = BodeCurve(frequency=F, magnitude_db=60 - 20 * np.log10(F), phase=-54 * F)
    loud = np.where(F > 30.0, -9000.0, whole.phase)
    unsure = np.where(F > 30.0, 200.0, 1.0)
    far = replace(whole, phase=loud, phase_low=loud - unsure, phase_high=loud + unsure)
    for curve, lowest in ((whole, whole.phase.min()), (far, whole.phase[F <= 30.0].min())):
        magnitude, phase = (panel.y for panel in overlaid_bode([("one", curve)]).panels)
        assert lowest - 20.0 < phase.low < lowest
        assert phase.high == 20.0
    assert magnitude.high > whole.magnitude_db.max()
    ahead = replace(whole, phase=170 - F)
    assert overlaid_bode([("one", ahead)]).panels[1].y.high > 170.0


def test_a_mark_that_may_lie_anywhere_is_not_drawn(identified):
    pair = identified["y", "u"]
    sure = pair.parameters.bandwidth_phase90
    wide = replace(sure, std=sure.value, ci95=(-sure.value, 3 * sure.value))
    unsure = replace(pair, parameters=replace(pair.parameters, bandwidth_phase90=wide))
    said = [rule.words for panel in pair_bode(unsure).panels for rule in panel.of(Rule)]
    assert not any(words.startswith("−90° at") and "without" not in words for words in said)


def test_a_result_is_drawn_with_its_marks_in_their_intervals(identified):
    figure = plots.bode(identified)
    pair = identified["y", "u"]
    magnitude, phase = figure.panels
    for panel, estimate in (
        (phase, pair.parameters.bandwidth_phase90),
        (magnitude, pair.parameters.bandwidth_3db),
    ):
        (rule,) = (r for r in panel.of(Rule) if r.axis == "x" and r.at == estimate.value)
        assert (rule.low, rule.high) == estimate.ci95
        assert estimate.text in rule.words
        assert estimate.text in figure.alt
    assert [curve.label for curve in phase.of(Curve)][-1] == "model without delay"
    assert any(r.words.startswith("−90° without delay ") for r in phase.of(Rule))
    measured = phase.of(Points)[0]
    assert (measured.low < measured.high).all()


def linear(colour: str) -> np.ndarray:
    shares = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
    return np.where(shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)


# Of linear RGB, at full strength: Machado, Oliveira and Fernandes (2009), table 1.
BLINDNESS = {
    "none": np.eye(3),
    "protanopia": [[0.152, 1.053, -0.205], [0.115, 0.786, 0.099], [-0.004, -0.048, 1.052]],
    "deuteranopia": [[0.367, 0.861, -0.228], [0.280, 0.673, 0.047], [-0.012, 0.043, 0.969]],
    "tritanopia": [[1.256, -0.077, -0.179], [-0.078, 0.931, 0.148], [0.005, 0.691, 0.304]],
}


@pytest.mark.parametrize("sight", BLINDNESS)
def test_no_two_colours_of_curves_look_alike(sight):
    seen = {
        name: np.clip(np.array(BLINDNESS[sight]) @ linear(COLOURS[name]), 0.0, 1.0) ** (1 / 2.4)
        for name in ("input", "output", "model", "limit", "other")
    }
    for one, other in combinations(seen, 2):
        assert np.linalg.norm(seen[one] - seen[other]) > 0.1, (one, other)  # 25 of 255 steps


def test_a_long_upright_label_has_room_beside_its_panel():
    def beside(label):
        panel = Panel(x=Axis(label="Time (s)"), y=Axis(label=label))
        figure = Figure(panels=(panel,), alt="", heights=(1.5,))
        (place,), _ = places(figure, frames(figure), width=350.0)
        return place.height

    label = "Bandwidth, −90° without delay (Hz)"
    assert beside("y") < 150.0
    assert beside(label) >= 0.9 * text_width(label)


def test_words_below_a_narrow_panel_stand_upright_and_a_level_word_stays_inside():
    names = tuple((float(k), name) for k, name in enumerate(("delay at DC", "−90° alone", "bias")))
    panel = Panel(
        x=Axis(ticks=names, low=-0.5, high=2.5, label="by bench"),
        y=Axis(),
        items=(Rule(at=1.0, axis="y", words="bound", words_at=0.99),),
    )
    figure = Figure(panels=(panel,), alt="Names below.")
    (wide,), _ = places(figure, frames(figure), width=700.0)
    (narrow,), _ = places(figure, frames(figure), width=220.0)
    assert (wide.turned, narrow.turned) == (False, True)
    assert narrow.foot > max(text_width(name) for _, name in names)
    drawn = with_svg.draw(figure, key="k", width=220.0)
    assert drawn.count("rotate(-90") == len(names)  # no label beside the panel
    x = float(drawn.partition(">bound<")[0].rpartition('<text x="')[2].partition('"')[0])
    assert x + text_width("bound") <= narrow.left + narrow.width + 0.1


@pytest.mark.parametrize(("share", "between"), [(True, 20.0), (False, 60.0)])
def test_panels_of_plotly_have_their_height_and_room_between_them(share, between):
    panel = Panel(x=Axis(label="Time (s)"), y=Axis(label="y (V)"), title="A title")
    panels = (panel, replace(panel, row=1), replace(panel, row=2))
    figure = Figure(panels=panels, heights=(1.4, 2.0, 1.1), share_x=share, alt="Nothing.")
    layout = figure.to_plotly()["layout"]
    inside = layout["height"] - layout["margin"]["t"] - layout["margin"]["b"]
    domains = [layout[f"yaxis{number}"]["domain"] for number in ("", "2", "3")]
    heights = [inside * (top - foot) for foot, top in domains]
    assert heights == pytest.approx([96 * inches for inches in figure.heights], abs=1.0)
    gaps = [inside * (above[0] - below[1]) for above, below in pairwise(domains)]
    assert min(gaps) > between


def test_a_long_number_at_the_end_of_an_axis_stays_inside_of_the_picture():
    marked = ((0.0, "0"), (1.0, "0.0472500000"))
    line = Curve(x=np.array([0.0, 1.0]), y=np.zeros(2))
    panel = Panel(x=Axis(low=0.0, high=1.0, ticks=marked), y=Axis(), items=(line,))
    text = Figure(panels=(panel,), alt="A long number.").to_svg(width=400.0)
    (x,) = re.findall(r'<text x="([\d.]+)"[^>]*>0\.0472500000<', text)
    assert float(x) + 0.5 * text_width("0.0472500000") <= 400.0


@pytest.mark.parametrize("height", [70.0, 130.0, 220.0, 400.0])
def test_numbers_of_a_phase_of_many_turns_do_not_overlap(height):
    f = np.geomspace(0.1, 20.0, 50)
    line = Curve(x=f, y=np.linspace(0.0, -1300.0, 50))
    panel = Panel(x=Axis(scale="log"), y=Axis(degrees=True), items=(line,))
    figure = Figure(panels=(panel,), alt="Thirteen quarter turns.", heights=(height / 100.0,))
    text = figure.to_svg(width=350.0)
    numbers = re.findall(r'<text x="[\d.]+" y="([\d.]+)"[^>]*>−?\d*[05]<', text)
    across = sorted(float(y) for y in numbers)
    assert len(across) >= 3
    assert min(b - a for a, b in pairwise(across) if b - a > 0.5) >= 0.9 * SIZE


def test_a_long_label_does_not_meet_the_numbers_of_the_row_that_it_makes_higher():
    y = np.array([13.9975, 14.0009])
    label = "Bandwidth, −90° without delay (Hz)"
    panel = Panel(x=Axis(), y=Axis(label=label), items=(Curve(x=np.array([0.0, 24.0]), y=y),))
    figure = Figure(panels=(panel,), alt="", heights=(1.5,))
    (place,), _ = places(figure, frames(figure), width=600.0)
    longest = max(text_width(words) for _, words in place.y_ticks)
    assert place.left - 7.0 - longest > place.edge + LINE


@pytest.mark.parametrize("at", [0.2, 1.5, 10.0, 18.0])
def test_words_that_fit_on_neither_side_of_their_line_stay_inside_of_a_narrow_picture(at):
    words = "−90° without delay 10.033 −0.058 +0.084 Hz"
    axis = Axis(scale="log", label="Frequency (Hz)", low=0.1, high=20.0)
    panel = Panel(x=axis, y=Axis(label="Phase (deg)"), items=(Rule(at=at, words=words),))
    text = Figure(panels=(panel,), alt="A mark.").to_svg(width=355.0)
    x, anchor = re.search(
        rf'<text x="([\d.]+)"[^>]*?text-anchor="(\w+)"[^>]*>{re.escape(words)}', text
    ).groups()
    assert anchor == "start"
    assert 30.0 < float(x) < 80.0  # beside the axis: a curve that lags leaves room there
    short = Figure(panels=(replace(panel, items=(Rule(at=at, words="1 Hz"),)),), alt="A mark.")
    x = float(re.search(r'<text x="([\d.]+)"[^>]*>1 Hz', short.to_svg(width=355.0))[1])
    assert 40.0 < x < 350.0


def test_the_legend_says_each_curve_s_bandwidth_and_a_mean_stands_beside_its_line():
    curve = BodeCurve(frequency=F, magnitude_db=0.0 * F, phase=-10.0 * F)
    curves = [("roll", curve), ("yaw", curve)]
    each = overlaid_bode(curves, bandwidths=[estimate(9.0), None])
    labels = [c.label for c in each.panels[0].of(Curve)]
    assert labels == ["roll: −90° at 9.00 −0.20 +0.30 Hz", "yaw"]
    mean = overlaid_bode(curves, bandwidths=[estimate(9.0)])
    assert [c.label for c in mean.panels[0].of(Curve)] == ["roll", "yaw"]
    assert [r.words for r in mean.panels[1].of(Rule) if r.words] == ["−90° at 9.00 −0.20 +0.30 Hz"]


def test_a_mark_of_a_doubtful_figure_says_so(identified):
    pair = identified["y", "u"]
    vague = replace(pair.parameters.natural_frequency, verdict="doubtful")
    figure = pair_bode(replace(pair, parameters=replace(pair.parameters, natural_frequency=vague)))
    said = [r.words for panel in figure.panels for r in panel.of(Rule) if r.words]
    assert [words.split(" ")[0] for words in said if words.endswith(" Hz ?")] == ["natural"]
