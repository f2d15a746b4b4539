"""What a notebook shows of a value: a short line, a plain table, nothing of a file that acts."""

from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

import hmpim
from hmpim import plots
from hmpim.record import Channel, Finding, Record
from hmpim.tables import html_table

LIMITS = hmpim.Limits(position=10, velocity=1000, acceleration=40000, unit="deg")
EVIL = "<script>alert('1')</script>"


@pytest.fixture(scope="module")
def shown():
    stimulus = hmpim.design(band=(0.5, 20), duration=4, fs=200, limits=LIMITS)
    sensor = hmpim.Sensor(delay=0.15, natural_frequency=10, damping_ratio=0.4, noise_std=0.1)
    record = hmpim.run(sensor, stimulus, rng=1)
    result = hmpim.identify(record)
    return {"stimulus": stimulus, "record": record, "result": result, "pair": result["y", "u"]}


@pytest.fixture(scope="module")
def several(shown):
    sensor = hmpim.Sensor(delay=0.15, natural_frequency=10, damping_ratio=0.4, noise_std=0.1)
    again = hmpim.run(sensor, shown["stimulus"], rng=2)
    half = hmpim.Record.from_arrays(
        {"u": again.inputs[0].values / 2}, {"y": again.outputs[0].values / 2}, fs=200.0,
        units={"u": "deg", "y": "deg"}, intersample=again.intersample,
    )  # fmt: skip
    known = {"structures": ["second_order"], "intersample": "bandlimited"}
    repeats = hmpim.identify_repeats([shown["record"], again], **known)
    levels = hmpim.identify_levels([shown["record"], half], **known)
    return {"repeats": repeats, "repeated": repeats["y", "u"],
            "levels": levels, "compared": levels["y", "u"]}  # fmt: skip


def test_several_records_are_a_short_line_and_a_plain_table(several):
    for name, value in several.items():
        assert len(repr(value)) < 200, name
        cells = parsed(value)
        assert cells.tags.count("table") == 1
        assert "natural frequency" in cells.words
    assert repr(several["repeats"]) == "Repeats(2 records: u → y)"
    assert "2 repeats, 1" in repr(several["repeated"])
    assert "2 levels, " in repr(several["levels"])
    assert any("±" in words for words in parsed(several["compared"]).words)


def test_statistics_are_one_short_line(shown):
    line = repr(hmpim.compress(shown["record"]))
    assert line.startswith("Statistics(u → y, ")
    assert len(line) < 100


class Cells(HTMLParser):
    """Tags and texts of a page, as a browser sees them."""

    def __init__(self):
        super().__init__()
        self.tags, self.words = [], []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)

    def handle_data(self, data):
        self.words.append(data)


def parsed(value):
    cells = Cells()
    cells.feed(value._repr_html_())
    return cells


def test_a_value_is_one_short_line(shown):
    for name, value in shown.items():
        line = repr(value)
        assert len(line) < 300, name
        assert "\n" not in line
        assert "array" not in line
    assert repr(shown["record"]).startswith("Record(u → y, ")
    assert "Sweep 0.5 to 20 Hz" in repr(shown["stimulus"])
    assert "delay 0.1" in repr(shown["pair"])
    assert "±" in repr(shown["result"])


def test_a_notebook_shows_a_plain_table(shown):
    for value in shown.values():
        cells = parsed(value)
        assert cells.tags.count("table") == 1
        assert set(cells.tags) <= {"table", "caption", "thead", "tbody", "tr", "th", "td", "p"}
    pair = shown["pair"]
    words = parsed(pair).words
    assert str(pair.delay) in words
    assert "natural frequency" in words
    assert f"{shown['stimulus'].peaks.velocity:.6g}" in parsed(shown["stimulus"]).words
    assert {"u", "y", "deg"} <= set(parsed(shown["record"]).words)


def test_names_from_a_file_are_words_and_nothing_else():
    t = np.arange(200) / 100.0
    u = np.sin(2 * np.pi * (0.5 * t + 2 * t**2))
    record = Record(
        inputs=(Channel(name=EVIL, time=t, values=u),),
        outputs=(Channel(name="y" * 5000, time=t, values=u),),
        fs=100.0,
        source=EVIL,
        findings=(Finding(code="x", message=EVIL, severity="info", parameters=()),),
    )
    result = hmpim.identify(record)
    for value in (record, result, *result):
        cells = parsed(value)
        assert "script" not in cells.tags
        assert "<script" not in value._repr_html_()
        assert any(EVIL in words for words in cells.words)
        assert len(repr(value)) < 600


def test_a_cell_holds_no_control_character_and_has_an_end():
    page = html_table("a\x1b[31mb", ["x"], [["y" * 10_000]])
    assert "\x1b" not in page
    assert len(page) < 500


def test_a_finding_below_a_table_is_read_to_its_end():
    words = "what to do about it " * 30
    assert words.strip() in html_table("a", ["x"], [], notes=[words])


def test_a_result_of_many_pairs_names_a_few(shown):
    pairs = tuple(
        replace(shown["pair"], input=f"u{j}", output=f"y{k}") for j in range(5) for k in range(5)
    )
    result = replace(shown["result"], pairs=pairs)
    assert "25 pairs" in repr(result)
    assert "and 21 more" in repr(result)
    assert parsed(result).words.count("natural frequency") == 25


def test_pictures_take_results_and_records_as_they_are(shown):
    record, result = shown["record"], shown["result"]
    assert len(plots.bode(result).panels) >= 2
    pair = shown["pair"]
    for draw in (plots.residuals, plots.model_over_measurement, plots.bode):
        assert draw(result).to_svg() == draw(pair).to_svg()
    whole = plots.model_over_measurement(pair).panels[0]
    assert whole.y.label == "y (deg)"
    assert np.array_equal(whole.items[0].y, pair.prediction + pair.residual)
    both = plots.input_output(record)
    assert np.array_equal(both.panels[0].items[0].y, record.inputs[0].values)
    assert "<svg" in both._repr_html_()


def test_a_picture_that_cannot_be_chosen_says_how(shown):
    pair = shown["pair"]
    several = replace(shown["result"], pairs=(pair, replace(pair, output="z")))
    with pytest.raises(hmpim.HmpimError, match=r'2 pairs; give one of them: result\["y", "u"\]'):
        plots.residuals(several)
    read_back = type(shown["result"]).from_dict(shown["result"].to_dict())
    with pytest.raises(hmpim.HmpimError, match=r"no time histories.*identify the record again"):
        plots.model_over_measurement(read_back)
    with pytest.raises(hmpim.HmpimError, match="a Record is not a PairIdentification"):
        plots.bode(shown["record"])
    with pytest.raises(hmpim.HmpimError, match="u and y are missing"):
        plots.input_output(pair.time)
    two = Record.from_arrays({"u": [0.0, 1.0], "v": [0.0, 1.0]}, {"y": [0.0, 1.0]}, fs=1.0)
    with pytest.raises(hmpim.HmpimError, match=r"several channels \(u, v, y\).*with_roles"):
        plots.input_output(two)
