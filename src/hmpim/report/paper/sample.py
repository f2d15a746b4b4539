"""Figs 16 and 17: the sample system by the paper's steps, by the joint fit, and at best."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hmpim.experiment import run
from hmpim.identify import PairIdentification, identify, paper_analysis
from hmpim.identify.section_iv.response import delay_phase
from hmpim.plots import Axis, Curve, Figure, Panel, Rule, model_curve, spectrum_curve
from hmpim.plots.description import Item
from hmpim.report.figures import Picture
from hmpim.report.numbers import format_number
from hmpim.report.paper.bound import cramer_rao
from hmpim.report.paper.chapter import Chapter
from hmpim.report.paper.odds import read_many
from hmpim.report.paper.panels import response_panels
from hmpim.report.paper.sample_rows import Sample, sample_rows
from hmpim.rigs import Sensor
from hmpim.stimulus import Limits, Stimulus, design

__all__ = ["SEED", "SYSTEM", "sample_chapter", "sample_stimulus"]

SEED = 7
RECORDS = 40  # whose readings by the paper's steps are averaged
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
    sample = _sample(sample_stimulus())
    pictures = {16: _picture_16(sample), 17: _picture_17(sample)}
    return Chapter(pictures=pictures, rows=sample_rows(sample))


def sample_stimulus(amplitude: float = 10.0) -> Stimulus:
    """Return the paper's sweep, as printed; it prints no amplitude, and 10 deg is Fig. 12's.

    Examples
    --------
    >>> round(sample_stimulus(3.0).peaks.position, 6)
    3.0
    """
    return design(
        band=(0.1, 20.0),
        duration=10.0,
        fs=200.0,
        limits=Limits(position=amplitude, unit="deg"),
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
        many=read_many(SYSTEM, stimulus, range(RECORDS)),
    )


def _picture_16(sample: Sample) -> Picture:
    analysis, delay = sample.analysis, sample.pure_delay
    hump, natural = analysis.estimates.peak_gain_db, sample.natural_by_pure_delay
    magnitude, phase = response_panels(analysis, scale="linear")
    upper: list[Item] = list(magnitude.items)
    if hump is not None:
        top = float(analysis.band_frequency[int(np.argmax(analysis.magnitude))])
        upper.append(Rule(at=top, words=f"hump, {hump:.2f} dB above DC", words_at=0.35))
    f = analysis.band_frequency
    lag = delay_phase(f, delay)
    name = f"lag of the delay, {1e3 * delay:.1f} ms"
    lower: list[Item] = [
        *phase.items,
        Curve(x=f, y=lag, label=name, colour="other", dashes="-."),
        Curve(x=f, y=lag - 90.0, label="90° below it", colour="output", dashes="--"),
    ]
    if natural is not None:
        lower.append(Rule(at=natural, words=f"natural frequency {natural:.2f} Hz"))
    low = analysis.band[0]
    figure = Figure(
        panels=(
            replace(
                magnitude,
                x=replace(magnitude.x, low=low, high=CLEAR),
                y=replace(magnitude.y, low=-15.0, high=6.0),
                items=tuple(upper),
            ),
            replace(
                phase,
                x=replace(phase.x, low=low, high=CLEAR),
                y=replace(phase.y, low=-1100.0, high=50.0),
                items=tuple(lower),
            ),
        ),
        alt="Magnitude and phase of the sample system.",
        heights=(2.6, 2.6),
    )
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
        f"{joint}. At the end of the sweep the output sinks into the noise, and the phase with "
        "it: each bin is drawn on the turn nearest the joint fit's, since followed from bin to bin "
        "the phase would jump by whole turns at 19 Hz.",
        description=f"The whole analysis. Paper's steps: {steps}. Joint fit: {joint}.",
        figure=_figure_17(sample),
    )


def _figure_17(sample: Sample) -> Figure:
    analysis = sample.analysis
    u, y = sample.record.inputs[0], sample.record.outputs[0]
    time = Panel(
        x=Axis(label="Time (s)"),
        y=Axis(label="Angle (deg)"),
        items=(
            Curve(x=u.time, y=u.values, label="input", width=0.9),
            Curve(x=y.time, y=y.values, label="output", colour="output", dashes="--", width=0.8),
        ),
    )
    near = np.abs(analysis.lag) <= 1.0
    peaks = [
        Rule(
            at=sample.pure_delay,
            colour="ink",
            dashes=":",
            side="left",
            words=f"pure delay {1e3 * sample.pure_delay:.1f} ms",
            words_at=0.85,
        )
    ]
    delay = analysis.estimates.delay
    if delay is not None:
        peaks.append(Rule(at=delay, words=f"peak {1e3 * delay:.0f} ms", colour="output"))
    correlation = Panel(
        x=Axis(label="Lag of the output (s)"),
        y=Axis(label="Cross-correlation (deg²)"),
        items=(Curve(x=analysis.lag[near], y=analysis.cross_correlation[near]), *peaks),
        column=1,
    )
    length = analysis.error.size / analysis.fs
    alone = sample.system.bias**2 * (1.0 - np.abs(analysis.error_lag) / length)
    error = Panel(
        x=Axis(label="Lag (s)"),
        y=Axis(label="Error autocorr. (deg²)"),
        items=(
            Curve(x=analysis.error_lag, y=analysis.error_autocorrelation, colour="output"),
            Curve(
                x=analysis.error_lag, y=alone, colour="ink", dashes="--", label="true bias alone"
            ),
        ),
        row=1,
    )
    levels = Panel(
        x=Axis(label="Frequency (Hz)", scale="log", low=analysis.band[0] / 2, high=analysis.fs / 2),
        y=Axis(label="Level (dB re 1 deg)", low=-20.0, high=70.0),
        items=(
            spectrum_curve(analysis.frequency, analysis.input_windowed_db, label="input"),
            replace(
                spectrum_curve(analysis.frequency, analysis.output_windowed_db, label="output"),
                colour="output",
                dashes="--",
            ),
        ),
        row=1,
        column=1,
    )
    return Figure(
        panels=(time, correlation, error, levels, *_responses_17(sample)),
        alt="The whole analysis of the sample system.",
        heights=(2.4,) * 3,
        columns=2,
        share_x=False,
    )


def _responses_17(sample: Sample) -> tuple[Panel, Panel]:
    """Magnitude and phase side by side, with the joint fit's model over them."""
    analysis, pair = sample.analysis, sample.pair
    magnitude, phase = response_panels(analysis)
    upper: list[Item] = list(magnitude.items)
    lower: list[Item] = [
        *(replace(curve, y=_nearest_turn(curve.x, curve.y, pair)) for curve in phase.of(Curve)),
        Rule(at=-90.0, axis="y", colour="muted", dashes=":", width=0.8),
    ]
    grid = np.geomspace(*analysis.band, 400)
    model = model_curve(pair, grid)
    if model is not None:
        fitted = Curve(x=grid, y=model.magnitude_db, colour="model", dashes="--", label="joint fit")
        upper.append(fitted)
        lower.append(replace(fitted, y=model.phase, label=""))
    bandwidth = pair.parameters.bandwidth_phase90
    if bandwidth is not None:
        words = f"−90° at {bandwidth.value:.3f} Hz"
        lower.append(Rule(at=bandwidth.value, words=words, words_at=0.3, side="left"))
    below = replace(magnitude.x, label="Frequency (Hz)", numbered=True)
    return (
        replace(
            magnitude,
            x=below,
            y=replace(magnitude.y, low=-25.0, high=6.0),
            items=tuple(upper),
            row=2,
        ),
        replace(
            phase,
            y=replace(phase.y, low=-1300.0, high=60.0),
            items=tuple(lower),
            row=2,
            column=1,
        ),
    )


def _nearest_turn(
    frequency: NDArray[np.float64], phase: NDArray[np.float64], pair: PairIdentification
) -> NDArray[np.float64]:
    """Put each bin's phase on the turn nearest the joint fit's.

    Followed from bin to bin, the phase jumps by whole turns at 19 Hz, where the output has sunk
    into the noise and the angle from one bin to the next is chance.
    """
    model = model_curve(pair, frequency)
    if model is None:
        return phase
    return np.asarray(phase - 360.0 * np.round((phase - model.phase) / 360.0))
