"""What the pictures say: units on every axis, limits and marks where they belong."""

import subprocess
import sys
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from hmpim import plots
from hmpim.identify import Candidate, Estimate, HarmonicCurve
from hmpim.plots.draw.frames import frames
from hmpim.plots.envelope import MOST_POINTS
from hmpim.plots.style import COLOURS, axis_label, plain, with_error
from hmpim.report import format_value
from hmpim.stimulus import Limits, design

T = np.arange(2000) / 200.0
F = np.geomspace(0.1, 100.0, 300)


def every_figure():
    noise = np.random.default_rng(1).standard_normal(T.size)
    stimulus = design(band=(0.1, 20), duration=5, fs=200, limits=Limits(position=10, unit="deg"))
    curve = plots.BodeCurve(frequency=F, magnitude_db=-F, phase=-54.0 * F)
    return {
        "time_histories": plots.time_histories(stimulus),
        "input_output": plots.input_output(T, np.sin(T), noise, input_unit="V", output_unit="m"),
        "one_unit": plots.input_output(T, np.sin(T), noise, input_unit="V", output_unit="V"),
        "model": plots.model_over_measurement(T, noise, np.sin(T), unit="deg"),
        "residuals": plots.residuals(T, noise, unit="deg"),
        "cross_correlation": plots.cross_correlation(T, noise, peak=0.17, delay=0.15, unit="deg²"),
        "error": plots.error_autocorrelation(T, noise, bias=0.6, duration=10.0, unit="deg"),
        "spectra": plots.spectra(F, input_plain=-F, input_windowed=-F, band=(0.1, 20.0)),
        "bode": plots.bode([("a", "model", curve)]),
    }


@pytest.fixture(scope="module")
def figures():
    return every_figure()


def test_every_axis_has_a_unit(figures):
    for name, figure in figures.items():
        for panel in figure.panels:
            assert panel.y.label.endswith(")"), name
        assert figure.alt.endswith("."), name
        assert figure.panels[-1].x.label in (
            "Time (s)",
            "Lag (s)",
            "Lag of the output (s)",
            "Frequency (Hz)",
        ), name


def test_both_signs_of_each_limit_are_drawn_and_the_signal_is_between():
    limits = Limits(position=10, velocity=70, acceleration=8500, unit="deg")
    stimulus = design(band=(0.1, 20), duration=10, fs=200, limits=limits)
    figure = plots.time_histories(stimulus)
    for panel, limit in zip(figure.panels, (10, 70, 8500), strict=True):
        assert sorted(rule.at for rule in panel.of(plots.Rule)) == [-limit, limit]
        (curve,) = panel.of(plots.Curve)
        assert np.abs(curve.y).max() <= limit


def test_without_limits_none_are_drawn(figures):
    assert not figures["time_histories"].panels[1].of(plots.Rule)


def test_a_long_record_is_drawn_with_few_points_and_keeps_its_peak():
    n = 300_000
    y = np.zeros(n)
    y[123_456] = 7.0
    figure = plots.input_output(np.arange(n) / 1000.0, y, y, input_unit="V", output_unit="deg")
    line = figure.to_matplotlib().axes[1].lines[0]
    assert len(line.get_xdata()) <= MOST_POINTS
    peak = int(np.argmax(line.get_ydata()))
    assert line.get_ydata()[peak] == 7.0
    assert line.get_xdata()[peak] == pytest.approx(123.456)


def test_the_close_up_is_where_the_output_moves_most():
    moving = np.where((T > 6.0) & (T < 6.5), np.sin(100 * T), 0.0)
    figure = plots.model_over_measurement(T, moving, moving)
    shown = figure.panels[1].of(plots.Curve)[0].x
    assert shown[0] <= 6.0
    assert shown[-1] >= 6.49
    assert len(shown) == T.size // 10


def share_inside_bounds(residual):
    panel = plots.residuals(np.arange(residual.size) / 200.0, residual).panels[1]
    (bound,) = {abs(rule.at) for rule in panel.of(plots.Rule)} - {0.0}
    assert bound == pytest.approx(1.96 / np.sqrt(residual.size))
    (stems,) = panel.of(plots.Curve)
    return np.mean(np.abs(stems.y[1::3]) < bound)


def test_the_residual_of_white_noise_stays_inside_its_bounds():
    noise = np.random.default_rng(3).standard_normal(2000)
    assert share_inside_bounds(noise) >= 0.88  # of 100 lags; three standard errors below 0.95
    assert share_inside_bounds(np.convolve(noise, np.ones(20), mode="same")) < 0.6


def test_marks_stand_at_their_frequencies_and_only_inside_the_band():
    curve = plots.BodeCurve(frequency=F, magnitude_db=-F, phase=-F)
    marks = (
        plots.Mark(frequency=1.5, label="in"),
        plots.Mark(frequency=500.0, label="out"),
        plots.Mark(frequency=3.0, label="other axes", axes="magnitude"),
    )
    figure = plots.bode([("a", "model", curve)], marks=marks)
    magnitude, phase = (panel.of(plots.Rule) for panel in figure.panels)
    assert [(rule.at, rule.words) for rule in phase] == [(1.5, "in")]
    assert [(rule.at, rule.words) for rule in magnitude] == [(3.0, "other axes")]


def test_a_band_that_reaches_nothing_does_not_squash_the_picture():
    curve = plots.BodeCurve(
        frequency=F,
        magnitude_db=np.zeros(F.size),
        phase=np.zeros(F.size),
        magnitude_low=np.full(F.size, -np.inf),
        magnitude_high=np.full(F.size, 3.0),
        phase_low=np.full(F.size, -180.0),
        phase_high=np.full(F.size, 180.0),
    )
    low, high = frames(plots.bode([("a", "input", curve)]))[0].y
    assert -10 < low < high < 10


def test_candidates_stand_in_order_and_the_chosen_one_is_named():
    tried = [
        Candidate(structure="static", intersample="zoh", criterion=900.0, fit_percent=40.0),
        Candidate(
            structure="second_order",
            intersample="foh",
            criterion=-5.0,
            fit_percent=99.0,
            chosen=True,
        ),
    ]
    (panel,) = plots.candidates(tried).panels
    assert [name for _, name in panel.y.ticks] == ["second order, linear", "static, held"]
    assert panel.of(plots.Bars)[0].length == (0.0, 905.0)
    assert panel.of(plots.Words)[0].text == "fit 99.00 %, chosen"


@pytest.mark.parametrize("name", [r"$\frac{", "_hidden", "a$b$c", "\x00\x1b[2J", "x" * 500, "角度"])
def test_no_name_breaks_a_picture(name, tmp_path):
    import warnings

    figure = plots.input_output(T, np.sin(T), np.cos(T), input_name=name, output_name="y")
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph")
        figure.savefig(tmp_path / "a.png", dpi=30)
    assert len(figure.panels[0].y.label) < 100
    ET.fromstring(figure.to_svg())


def test_a_constant_signal_can_be_drawn(tmp_path):
    still = np.zeros(T.size)
    plots.residuals(T, still).savefig(tmp_path / "a.png", dpi=30)
    plots.input_output(T, still, still).savefig(tmp_path / "b.png", dpi=30)


def test_labels_state_the_unit_or_that_there_is_none():
    assert axis_label("Position", "deg") == "Position (deg)"
    assert axis_label("u", "") == "u (–)"
    assert plain("x" * 99) == "x" * 39 + "…"


def _linear(colour):
    part = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
    return np.where(part <= 0.04045, part / 12.92, ((part + 0.055) / 1.055) ** 2.4)


def test_every_colour_of_a_line_stands_out_from_the_paper():
    """Contrast of at least 3 to 1, as WCAG 2.2 asks of graphics (1.4.11)."""
    weights = np.array([0.2126, 0.7152, 0.0722])
    for name in ("ink", "muted", "input", "output", "model", "limit", "other"):
        contrast = 1.05 / (weights @ _linear(COLOURS[name]) + 0.05)
        assert contrast >= 3.0, name


def test_nothing_global_is_touched():
    code = (
        "import io, sys, matplotlib as m; before = m.rcParams.copy()\n"
        "import numpy as np\nfrom hmpim import plots\n"
        "t = np.arange(100) / 10.0\n"
        "plots.residuals(t, np.cos(t)).savefig(io.BytesIO())\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
        "assert m.rcParams.copy() == before\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_harmonics_within_their_noise_are_not_drawn():
    own = HarmonicCurve(order=1, frequency=(1.0, 5.0), amplitude=(2.0, 2.0), std=(0.0, 0.0))
    third = HarmonicCurve(order=3, frequency=(1.0, 5.0), amplitude=(0.2, 0.02), std=(0.01, 0.01))
    second = HarmonicCurve(order=2, frequency=(1.0,), amplitude=(0.01,), std=(0.01,))
    (panel,) = plots.harmonics([own, second, third]).panels
    (curve,) = panel.of(plots.Curve)
    assert curve.label == "order 3"
    np.testing.assert_allclose(curve.y, [10.0, np.nan])
    assert panel.y.label == "Share of the output (%)"
    assert panel.y.high is None


def test_noise_beyond_the_output_does_not_stretch_the_axis_of_harmonics():
    own = HarmonicCurve(order=1, frequency=(1.0, 5.0), amplitude=(2.0, 1e-6), std=(0.0, 0.0))
    third = HarmonicCurve(order=3, frequency=(1.0, 5.0), amplitude=(0.2, 0.0), std=(0.01, 0.01))
    (panel,) = plots.harmonics([own, third]).panels
    assert panel.y.high == 100.0


def test_an_exact_figure_is_marked_as_the_table_has_it():
    exact = Estimate(value=7.132537856, std=2e-14, ci95=(7.132537856, 7.132537856), unit="Hz")
    assert with_error(exact) == format_value(exact) == "7.132537856 ± 0"
