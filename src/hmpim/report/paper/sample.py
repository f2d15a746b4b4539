"""Figs 16 and 17: the sample system by the paper's steps, by the joint fit, and at best."""

from typing import TYPE_CHECKING

import numpy as np

from hmpim.experiment import run
from hmpim.identify import identify, paper_analysis
from hmpim.identify.response import delay_phase
from hmpim.plots import draw_spectrum, model_curve
from hmpim.plots.style import (
    COLOURS,
    FONT_SIZE,
    draw_legend,
    draw_line,
    draw_mark,
    finish_axes,
    new_figure,
)
from hmpim.report.figures import Picture
from hmpim.report.numbers import format_number
from hmpim.report.paper.bound import cramer_rao
from hmpim.report.paper.chapter import Chapter
from hmpim.report.paper.panels import grid_figure, response_axes
from hmpim.report.paper.sample_rows import Sample, sample_rows
from hmpim.rigs import Sensor
from hmpim.stimulus import Limits, Stimulus, design

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["SEED", "SYSTEM", "sample_chapter"]

SEED = 7
CLEAR = 16.0  # Hz; beyond, the windowed output sinks into the noise
SYSTEM = Sensor(
    delay=0.15,
    natural_frequency=10.0,
    damping_ratio=0.4,
    bias=0.6,
    noise_std=0.1,
    name="sample system",
)


def sample_chapter() -> Chapter:
    """Make Figs 16 and 17.

    Examples
    --------
    >>> chapter = sample_chapter()
    >>> [row.ours for row in chapter.rows if row.quantity == "Delay, by the paper's steps"]
    ['170 ms']
    """
    sample = _sample(_stimulus())
    pictures = {16: _picture_16(sample), 17: _picture_17(sample)}
    return Chapter(pictures=pictures, rows=sample_rows(sample))


def _stimulus() -> Stimulus:
    """The paper's sweep, as printed; it prints no amplitude, and 10 deg is Fig. 12's."""
    return design(
        band=(0.1, 20.0),
        duration=10.0,
        fs=200.0,
        limits=Limits(position=10.0, unit="deg"),
        extinction=1.0,
        lead=0,
    )


def _sample(stimulus: Stimulus) -> Sample:
    record = run(SYSTEM, stimulus, rng=SEED)
    u, y = record.inputs[0].values, record.outputs[0].values
    return Sample(
        system=SYSTEM,
        stimulus=stimulus,
        record=record,
        analysis=paper_analysis(u, y, stimulus.fs, band=stimulus.band),
        pair=identify(record)["y", "u"],
        bound=cramer_rao(SYSTEM, stimulus),
    )


def _picture_16(sample: Sample) -> Picture:
    analysis, delay = sample.analysis, sample.pure_delay
    hump, natural = analysis.estimates.peak_gain_db, sample.natural_by_pure_delay
    figure, (magnitude, phase) = new_figure(2, height=2.6)
    response_axes(figure, magnitude, phase, analysis, log_x=False)
    magnitude.set_ylim(-15.0, 6.0)
    for axes in (magnitude, phase):
        axes.set_xlim(analysis.band[0], CLEAR)
    if hump is not None:
        top = float(analysis.band_frequency[int(np.argmax(analysis.magnitude))])
        draw_mark(magnitude, top, label=f"hump, {hump:.2f} dB above DC", text_at=0.35)
    phase.set_ylim(-1100.0, 50.0)
    f = analysis.band_frequency
    lag = delay_phase(f, delay)
    draw_line(phase, f, lag, label=f"lag of the delay, {1e3 * delay:.1f} ms", colour="other")
    draw_line(phase, f, lag - 90.0, label="90° below it", colour="output", dashes="--")
    if natural is not None:
        draw_mark(phase, natural, label=f"natural frequency {natural:.2f} Hz", text_at=0.97)
    draw_legend(phase)
    words = f"{format_number(natural)} Hz"
    return Picture(
        key="fig16",
        title="HMPIM analyses of Bode plot",
        caption="The delay's lag (25), and the frequency at which the phase lies 90° below it: "
        f"the natural frequency of a quadratic lag, {words}. The delay is the joint fit's pure "
        "delay; the damping follows from the hump. Beyond "
        f"{CLEAR:g} Hz the output sinks into the noise.",
        description=f"Magnitude with a hump of {format_number(hump)} dB; phase, with the lag of "
        f"the delay and a line 90° below it, which the phase crosses at {words}.",
        figure=figure,
    )


def _picture_17(sample: Sample) -> Picture:
    found = sample.analysis.estimates
    parameters = sample.pair.parameters
    steps = (
        f"delay {1e3 * (found.delay or 0.0):.0f} ms, bias {format_number(found.bias)} deg, noise "
        f"{format_number(found.noise_std)} deg, −90° at {format_number(found.bandwidth_phase90)} Hz"
    )
    joint = ", ".join(
        f"{name} {factor * estimate.value:.5g} ± {factor * estimate.spread:.2g} {unit}".rstrip()
        for name, estimate, factor, unit in (
            ("delay", parameters.delay, 1e3, "ms"),
            ("bias", parameters.bias, 1.0, "deg"),
            ("noise", parameters.noise_std, 1.0, "deg"),
            ("natural frequency", parameters.natural_frequency, 1.0, "Hz"),
            ("damping ratio", parameters.damping_ratio, 1.0, ""),
        )
        if estimate is not None
    )
    return Picture(
        key="fig17",
        title="Sample model parameter ID using HMPIM analyses",
        caption="Quadratic lag of 10 Hz with damping ratio 0.4, delay 150 ms, bias 0.6 deg, noise "
        f"0.1 deg; seed {SEED}. The paper's steps, one after another: {steps}. The joint fit: "
        f"{joint}. At the end of the sweep the output sinks into the noise, and the phase with it.",
        description=f"The whole analysis. Paper's steps: {steps}. Joint fit: {joint}.",
        figure=_figure_17(sample),
    )


def _figure_17(sample: Sample) -> "Figure":
    analysis, pair = sample.analysis, sample.pair
    u, y = sample.record.inputs[0], sample.record.outputs[0]
    figure, ((time, correlation), (error, levels), (magnitude, phase)) = grid_figure(3, height=2.4)
    draw_line(time, u.time, u.values, colour="input", label="input", width=0.9)
    draw_line(time, y.time, y.values, colour="output", label="output", width=0.8)
    finish_axes(time, x="Time (s)", y="Angle (deg)")
    near = np.abs(analysis.lag) <= 1.0
    draw_line(correlation, analysis.lag[near], analysis.cross_correlation[near])
    finish_axes(correlation, x="Lag of the output (s)", y="Cross-correlation (deg²)")
    delay = analysis.estimates.delay
    if delay is not None:
        draw_mark(correlation, delay, label=f"peak {1e3 * delay:.0f} ms", colour="output")
    pure = f"pure delay {1e3 * sample.pure_delay:.1f} ms"
    draw_mark(correlation, sample.pure_delay, label=pure, colour="ink", side="left")
    draw_line(error, analysis.error_lag, analysis.error_autocorrelation, colour="output")
    length = analysis.error.size / analysis.fs
    alone = sample.system.bias**2 * (1.0 - np.abs(analysis.error_lag) / length)
    draw_line(error, analysis.error_lag, alone, colour="ink", dashes="--", label="true bias alone")
    finish_axes(error, x="Lag (s)", y="Error autocorr. (deg²)")
    levels.set_xlim(analysis.band[0] / 2, analysis.fs / 2)
    for label, level in (
        ("input", analysis.input_windowed_db),
        ("output", analysis.output_windowed_db),
    ):
        draw_spectrum(
            levels,
            analysis.frequency,
            level,
            label=label,
            colour="input" if label == "input" else "output",
        )
    finish_axes(levels, x="Frequency (Hz)", y="Level (dB re 1 deg)", log_x=True)
    levels.set_xlim(analysis.band[0] / 2, analysis.fs / 2)
    levels.set_ylim(-20.0, 70.0)
    response_axes(figure, magnitude, phase, analysis)
    grid = np.geomspace(*analysis.band, 400)
    model = model_curve(pair, grid)
    if model is not None:
        for axes, curve in ((magnitude, model.magnitude_db), (phase, model.phase)):
            draw_line(
                axes, grid, curve, colour="model", dashes="--", label="joint fit", spacing="log"
            )
    magnitude.set_xlabel("Frequency (Hz)", fontsize=FONT_SIZE)
    magnitude.set_ylim(-25.0, 6.0)
    phase.set_ylim(-1300.0, 60.0)
    phase.axhline(-90.0, color=COLOURS["muted"], linewidth=0.8)
    bandwidth = pair.parameters.bandwidth_phase90
    if bandwidth is not None:
        label = f"−90° at {bandwidth.value:.3f} Hz"
        draw_mark(phase, bandwidth.value, label=label, text_at=0.3, side="left")
    for axes in (time, error, levels, magnitude):
        draw_legend(axes)
    return figure
