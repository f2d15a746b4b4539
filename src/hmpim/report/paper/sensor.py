"""Figs 2 and 7 to 11: a sensor with no dynamics, on which the paper's steps are right."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hmpim.experiment import run
from hmpim.identify import PaperAnalysis, paper_analysis
from hmpim.identify.section_iv.static import initial_period
from hmpim.plots import cross_correlation, error_autocorrelation, input_output
from hmpim.plots.description import Axis, Curve, Figure, Item, Panel, Points, Rule
from hmpim.record import Record
from hmpim.report.figures import Picture
from hmpim.report.paper.chapter import Chapter
from hmpim.report.paper.panels import response_panels
from hmpim.report.paper.rows import Row, agreement
from hmpim.report.paper.signs import sign_rows
from hmpim.rigs import Sensor
from hmpim.stimulus import Limits, design

__all__ = ["sensor_chapter"]

SEED = 8
SENSOR = Sensor(delay=0.15, scale_factor=0.98, bias=0.6, noise_std=0.1)
SERVO = Sensor(delay=0.02, natural_frequency=8.0, damping_ratio=0.35, noise_std=0.01)


def sensor_chapter() -> Chapter:
    """Make Figs 2 and 7 to 11.

    Examples
    --------
    >>> chapter = sensor_chapter()
    >>> chapter.rows[0].quantity, chapter.rows[0].value
    ('Delay of an example, from the cross-correlation', 150.0)
    """
    record = _record(SENSOR, last=20.0, duration=10.0, amplitude=5.0)
    u, y = record.inputs[0].values, record.outputs[0].values
    fs = 200.0
    analysis = paper_analysis(u, y, fs, band=record.band)
    found = analysis.estimates
    lag = round((found.delay or 0.0) * fs)
    cycle = initial_period(u)
    unit = (
        f"a sensor with {1e3 * SENSOR.delay:g} ms delay, scale factor {SENSOR.scale_factor:g}, "
        f"bias {SENSOR.bias:g} deg, noise {SENSOR.noise_std:g} deg and no dynamics"
    )
    near = np.abs(analysis.lag) <= 1.0
    root = float(np.sqrt(analysis.error_autocorrelation[analysis.error.size - 1]))
    pictures = {
        2: _picture_2(),
        7: Picture(
            key="fig07",
            title="Example excitation with HMPIM and measured output",
            caption=f"A sweep from 0.1 to 20 Hz with n = 1, and what {unit}, makes of it.",
            description="The output follows the input, later and higher by a constant.",
            figure=_seen(
                input_output(record.inputs[0].time, u, y, input_unit="deg", output_unit="deg")
            ),
        ),
        8: Picture(
            key="fig08",
            title="Cross-correlation of HMPIM and measured output",
            caption="Equation (8). Where there are no dynamics, its peak is the pure delay.",
            description=f"A peak at {found.delay:g} s.",
            figure=cross_correlation(
                analysis.lag[near], analysis.cross_correlation[near], peak=found.delay, unit="deg²"
            ),
        ),
        9: Picture(
            key="fig09",
            title="Example of autocorrelation of measurement error",
            caption="Equation (10), of the time-corrected error (9). The root of its middle is "
            f"the paper's bias (11): {root:.4g} deg. Dashed: what the true bias alone would give; "
            "it falls off because (10) divides every lag by the same N.",
            description="A triangle, with a narrow peak in its middle that is the noise.",
            figure=_relabelled(
                error_autocorrelation(
                    analysis.error_lag,
                    analysis.error_autocorrelation,
                    bias=SENSOR.bias,
                    duration=analysis.error.size / fs,
                    unit="deg",
                )
            ),
        ),
        10: Picture(
            key="fig10",
            title="Scale factor computation example",
            caption="The first cycle of the sweep and the measurement, time-corrected: at the "
            "excitation's zero crossings stands the bias, "
            f"{_words_of(_at_crossings(u[:cycle], y[lag : lag + cycle])[1])} deg here, noise "
            "and all; at the non-zero points equation (13) gives the scale factor, "
            f"{found.scale_factor:.4g}.",
            description="Measurement over excitation: a straight line above the origin; at the "
            "excitation's zero crossings, which are marked, it shows the bias.",
            figure=_figure_10(u[:cycle], y[lag : lag + cycle], analysis, fs),
        ),
        11: Picture(
            key="fig11",
            title="Autocorrelation of measurement error (noise)",
            caption="Equation (14): R(0) is the mean square, R(∞) the square of the mean; their "
            f"difference is the noise, σ = {found.noise_std:.4g} deg. The slope on both sides is "
            "(10)'s division of every lag by the same N.",
            description="A single peak at lag 0 on a slow slope.",
            figure=_figure_11(analysis),
        ),
    }
    rows = (*_rows(analysis), *sign_rows(u, y, analysis, SENSOR))
    return Chapter(pictures=pictures, rows=rows)


def _record(rig: Sensor, *, last: float, duration: float, amplitude: float) -> Record:
    limits = Limits(position=amplitude, unit="deg")
    stimulus = design(
        band=(0.1, last), duration=duration, fs=200.0, limits=limits, extinction=1.0, lead=0
    )
    return run(rig, stimulus, rng=SEED)


def _rows(analysis: PaperAnalysis) -> tuple[Row, ...]:
    found = analysis.estimates
    delay = None if found.delay is None else 1e3 * found.delay
    return (
        Row(
            figure=8,
            where="Fig. 8",
            quantity="Delay of an example, from the cross-correlation",
            paper="~150 ms",
            value=delay,
            truth=1e3 * SENSOR.delay,
            unit="ms",
            why=agreement(delay, 150.0, within=5.0, because="no dynamics add to it here"),
        ),
        Row(
            figure=9,
            where="Fig. 9, (11)",
            quantity="Bias of the example",
            value=found.bias,
            truth=SENSOR.bias,
            unit="deg",
            why="Not printed. It is the r.m.s. error, which contains the noise and the error that "
            "the scale factor causes.",
        ),
        Row(
            figure=10,
            where="Fig. 10, (13)",
            quantity="Scale factor of the example",
            value=found.scale_factor,
            truth=SENSOR.scale_factor,
            why="Not printed.",
        ),
        Row(
            figure=11,
            where="Fig. 11, (14)",
            quantity="Noise of the example, 1σ",
            value=found.noise_std,
            truth=SENSOR.noise_std,
            unit="deg",
            why="Not printed. The error that the scale factor causes counts as noise.",
        ),
    )


def _seen(figure: Figure) -> Figure:
    (panel,) = figure.panels
    return replace(figure, panels=(replace(panel, y=Axis(label="Angle (deg)")),))


def _relabelled(figure: Figure) -> Figure:
    """Name the dashed line by what it is here, where the truth is known."""
    (panel,) = figure.panels
    measured, alone = panel.of(Curve)
    alone = replace(alone, label="what the true bias alone would give")
    return replace(figure, panels=(replace(panel, items=(measured, alone)),))


def _picture_2() -> Picture:
    record = _record(SERVO, last=20.0, duration=5.0, amplitude=10.0)
    u, y = record.inputs[0], record.outputs[0]
    analysis = paper_analysis(u.values, y.values, 200.0, band=record.band)
    time = Panel(
        x=Axis(label="Time (s)"),
        y=Axis(label="Angle (deg)"),
        items=(
            Curve(x=u.time, y=u.values, label="stimulus"),
            Curve(
                x=y.time,
                y=y.values,
                label="measured output",
                colour="output",
                dashes="--",
                width=1.0,
            ),
        ),
    )
    magnitude, phase = response_panels(analysis, row=1)
    found = analysis.estimates.bandwidth_phase90
    if found is not None:
        mark = Rule(at=found, words=f"−90° at {found:.3g} Hz", words_at=0.45, side="left")
        phase = replace(phase, items=(*phase.items, mark))
    figure = Figure(
        panels=(time, magnitude, phase),
        alt="Stimulus and output over time; magnitude and phase over frequency.",
        heights=(1.8,) * 3,
        share_x=False,
    )
    made = (
        f"a servo of {SERVO.natural_frequency:g} Hz with damping ratio {SERVO.damping_ratio:g}, "
        f"{1e3 * SERVO.delay:g} ms delay and {SERVO.noise_std:g} deg noise"
    )
    return Picture(
        key="fig02",
        title="Example of input stimulus, measured output, and resultant frequency response",
        caption=f"A sweep of 5 s, the answer of {made}, and the ratio of their windowed "
        "transforms, equation (18).",
        description=f"Stimulus and output over 5 s, magnitude and phase of {made}.",
        figure=figure,
    )


def _figure_10(
    excitation: NDArray[np.float64],
    corrected: NDArray[np.float64],
    analysis: PaperAnalysis,
    fs: float,
) -> Figure:
    found = analysis.estimates
    time = np.arange(excitation.size) / fs
    at, read = _at_crossings(excitation, corrected)
    over_time = Panel(
        x=Axis(label="Time (s)"),
        y=Axis(label="Angle (deg)"),
        items=(
            Rule(at=0.0, axis="y", colour="muted", dashes="-", width=0.8),
            Curve(x=time, y=excitation, label="excitation"),
            Curve(
                x=time,
                y=corrected,
                label="measurement, time-corrected",
                colour="output",
                dashes="--",
                width=1.0,
            ),
            Points(
                x=at / fs,
                y=read,
                label=f"at the zero crossings: {_words_of(read)} deg",
                colour="limit",
                marker="s",
                size=5.0,
            ),
        ),
    )
    items: list[Item] = [
        Points(x=excitation, y=corrected, label="samples", colour="output", size=1.6)
    ]
    if found.scale_factor is not None and found.bias is not None:
        ends = np.array([excitation.min(), excitation.max()])
        items.append(
            Curve(
                x=ends,
                y=found.scale_factor * ends + found.bias,
                colour="model",
                dashes="--",
                label=f"{found.scale_factor:.4f} × excitation + {found.bias:.3f} deg",
            )
        )
    straight = Panel(
        x=Axis(label="Excitation (deg)"),
        y=Axis(label="Measurement (deg)"),
        items=tuple(items),
        row=1,
    )
    return Figure(
        panels=(over_time, straight),
        alt="Excitation and measurement over time; measurement over excitation.",
        heights=(2.2, 2.2),
        share_x=False,
    )


def _at_crossings(
    excitation: NDArray[np.float64], corrected: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where the excitation crosses zero, in samples, and the measurement there."""
    before = np.flatnonzero(excitation[:-1] * excitation[1:] < 0.0)
    share = excitation[before] / (excitation[before] - excitation[before + 1])
    on = np.flatnonzero(excitation == 0.0)
    at = np.asarray(np.unique(np.concatenate((on, before + share))), dtype=np.float64)
    return at, np.asarray(np.interp(at, np.arange(corrected.size), corrected), dtype=np.float64)


def _words_of(values: NDArray[np.float64]) -> str:
    return " and ".join(f"{value:.2f}" for value in values)


def _figure_11(analysis: PaperAnalysis) -> Figure:
    mean_square = float(np.mean(analysis.error**2))
    squared_mean = float(np.mean(analysis.error)) ** 2
    near = np.abs(analysis.error_lag) <= 0.5
    items = (
        Curve(x=analysis.error_lag[near], y=analysis.error_autocorrelation[near], colour="output"),
        Rule(at=mean_square, axis="y", label=f"R(0) = {mean_square:.4f} deg²", colour="ink"),
        Rule(
            at=squared_mean,
            axis="y",
            label=f"R(∞) = {squared_mean:.4f} deg²",
            dashes=":",
            width=1.4,
        ),
    )
    panel = Panel(
        x=Axis(label="Lag (s)"), y=Axis(label="Autocorrelation of the error (deg²)"), items=items
    )
    return Figure(panels=(panel,), alt="Autocorrelation of the error.", heights=(2.4,))
