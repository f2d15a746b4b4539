"""The pictures of a report, each with a caption and words for those who cannot see it."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hmpim import plots
from hmpim.identify import Identification, Nonlinearity, PairIdentification
from hmpim.identify.section_iv.paper import PaperAnalysis, paper_analysis
from hmpim.plots.curves import is_measured
from hmpim.record import Intersample, Record, Signal, uniform
from hmpim.report.numbers import format_number

if TYPE_CHECKING:
    from hmpim.stimulus import Stimulus

__all__ = ["Picture", "pair_pictures", "stimulus_picture"]


_BETWEEN: dict[Intersample, str] = {
    "zoh": "held between",
    "foh": "joined linearly between",
    "feedforward": "and its derivatives held between",
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Picture:
    """A figure of a report: its heading, its caption, and what is seen, in words."""

    key: str
    title: str
    caption: str
    description: str
    figure: plots.Figure


def stimulus_picture(stimulus: "Stimulus") -> Picture:
    """Return the picture of a designed stimulus inside its limits.

    Examples
    --------
    >>> from hmpim.stimulus import Limits, design
    >>> limits = Limits(position=10, velocity=1000, acceleration=40000, unit="deg")
    >>> stimulus_picture(design(band=(0.1, 10), duration=5, fs=500, limits=limits)).key
    'stimulus'
    """
    peaks = stimulus.peaks
    unit = stimulus.unit
    reached = (
        f"Peaks: {peaks.position:.4g} {unit}, {peaks.velocity:.4g} {unit}/s, "
        f"{peaks.acceleration:.4g} {unit}/s²."
    )
    return Picture(
        key="stimulus",
        title="Stimulus and its limits",
        caption=f"Command sent to the unit under test, with its derivatives. {reached}",
        description=f"Position, velocity and acceleration over {stimulus.duration:g} s. {reached}",
        figure=plots.time_histories(stimulus),
    )


def pair_pictures(result: Identification, pair: PairIdentification) -> list[Picture]:
    """Return all pictures that can be drawn of a pair, in the order of section IV.

    Without the record (``result.data`` is None) that is the Bode plot and the candidates.

    Parameters
    ----------
    result : Identification
        The whole result, for its record.
    pair : PairIdentification
        One of its pairs.

    Examples
    --------
    >>> from hmpim.identify import FrequencyResponse, PaperEstimates, Parameters, RecordSummary
    >>> none = np.empty(0)
    >>> pair = PairIdentification(
    ...     input="u", output="y", structure="static", intersample="zoh", fit_percent=0.0,
    ...     parameters=Parameters(), paper=PaperEstimates(), candidates=(),
    ...     frequency_response=FrequencyResponse(frequency=none, response=none, std=none),
    ...     numerator=(), denominator=(), verdict="doubtful", warnings=())
    >>> summary = RecordSummary(fs=200.0, samples=2000, sha256="")
    >>> pair_pictures(Identification(record=summary, pairs=(pair,)), pair)
    []
    """
    pictures: list[Picture] = []
    record = result.data
    # Of a coupling that is not told, signals and the paper's steps show the other inputs only.
    untold = result.inputs is not None and pair.parameters.scale_factor is None
    if record is not None and not untold:
        pictures += _signal_pictures(record, pair)
    units = ("", "") if record is None else _units(record, pair)
    if np.any(pair.frequency_response.frequency > 0):
        seen = _response_pictures(pair, units, result.record.fs)
        pictures += seen[:1] if untold else seen
    if record is not None and pair.time is not None:
        pictures += _model_pictures(pair, units[1])
    if pair.nonlinearity is not None and pair.nonlinearity.harmonics:
        pictures.append(_harmonics_picture(pair, pair.nonlinearity))
    if pair.candidates:
        pictures.append(_candidates_picture(pair))
    return pictures


def _units(record: Record, pair: PairIdentification) -> tuple[str, str]:
    return record.channel(pair.input).unit, record.channel(pair.output).unit


def _signal_pictures(record: Record, pair: PairIdentification) -> list[Picture]:
    aligned = uniform(record)
    u, y = aligned.signal(pair.input), aligned.signal(pair.output)
    signals = Picture(
        key="signals",
        title="Stimulus and response",
        caption="Measured input and output.",
        description=(
            f"Input {pair.input} between {u.values.min():.4g} and {u.values.max():.4g} {u.unit}, "
            f"output {pair.output} between {y.values.min():.4g} and {y.values.max():.4g} "
            f"{y.unit}, over {aligned.time[0]:g} to {aligned.time[-1]:g} s."
        ),
        figure=plots.input_output(
            aligned.time,
            u.values,
            y.values,
            input_name=pair.input,
            output_name=pair.output,
            input_unit=u.unit,
            output_unit=y.unit,
        ),
    )
    if np.ptp(y.values) == 0 or np.ptp(u.values) == 0:
        return [signals]
    analysis = paper_analysis(u.values, y.values, aligned.fs, band=record.band)
    return [signals, *_paper_pictures(analysis, pair, u, y)]


def _paper_pictures(
    analysis: PaperAnalysis, pair: PairIdentification, u: Signal, y: Signal
) -> list[Picture]:
    found = pair.parameters
    peak = analysis.estimates.delay
    reach = max(10.0 * abs(peak or 0.0), 60.0 / analysis.fs)  # seconds of lag worth showing
    near = np.abs(analysis.lag) <= reach
    squared = f"{y.unit}²" if u.unit == y.unit and y.unit else f"{u.unit} {y.unit}".strip()
    root_mean_square = float(np.sqrt(np.mean(analysis.error**2)))
    low, high = analysis.band
    return [
        Picture(
            key="correlation",
            title="Cross-correlation",
            caption="Equation (8). The peak is the paper's delay: the pure delay plus what the "
            "dynamics add.",
            description=f"Cross-correlation of {pair.input} and {pair.output} over the lag, "
            f"peak at {format_number(peak)} s.",
            figure=plots.cross_correlation(
                analysis.lag[near],
                analysis.cross_correlation[near],
                peak=peak,
                delay=None if found.delay is None else found.delay.value,
                unit=squared,
            ),
        ),
        Picture(
            key="error",
            title="Autocorrelation of the error",
            caption="Equations (9) and (10): autocorrelation of the error that remains after the "
            "delay of (8) is removed. The root of its value at lag 0 is the paper's bias (11).",
            description=f"Autocorrelation of the time-corrected error, whose root mean square "
            f"is {root_mean_square:.4g} {y.unit}.",
            figure=plots.error_autocorrelation(
                analysis.error_lag,
                analysis.error_autocorrelation,
                bias=None if found.bias is None else found.bias.value,
                duration=analysis.error.size / analysis.fs,
                unit=y.unit,
            ),
        ),
        Picture(
            key="spectra",
            title="Spectra",
            caption="Equation (17), without and with the "
            f"{analysis.window.capitalize()} window, which reduces leakage and lowers the level at "
            "both ends of the sweep.",
            description=f"Spectra of {pair.input} and {pair.output} in dB, without and with "
            f"window; the excited band is {low:.4g} to {high:.4g} Hz.",
            figure=plots.spectra(
                analysis.frequency,
                input_plain=analysis.input_db,
                input_windowed=analysis.input_windowed_db,
                output_plain=analysis.output_db,
                output_windowed=analysis.output_windowed_db,
                band=analysis.band,
                input_name=pair.input,
                output_name=pair.output,
            ),
        ),
    ]


def _response_pictures(
    pair: PairIdentification, units: tuple[str, str], fs: float
) -> list[Picture]:
    seen = pair.frequency_response.frequency
    found = pair.parameters
    span = f"{seen[seen > 0].min():.4g} to {seen.max():.4g} Hz"
    named = (
        ("phase −90°", found.bandwidth_phase90),
        ("magnitude −3 dB", found.bandwidth_3db),
        ("natural frequency", found.natural_frequency),
    )
    marks = [f"{words} at {f.value:.4g} Hz" for words, f in named if f is not None]
    between = ""
    if found.scale_factor is not None and pair.intersample in _BETWEEN:
        between = (
            f" The model is drawn from sample to sample, its input {_BETWEEN[pair.intersample]} "
            "samples; the marks are those of the system itself."
        )
    measured = is_measured(pair)
    drawn = "Measured frequency response with its 95 % band at each frequency"
    drawn += "." if found.scale_factor is None else ", and the fitted model."
    if not measured:
        drawn = "The fitted model. Statistics of a record do not keep its measured response."
    marked = (*(f for _, f in named), found.bandwidth_phase90_without_delay)
    if any(f is not None and f.verdict != "ok" for f in marked):
        between += " A question mark follows a doubtful figure."
    pictures = [
        Picture(
            key="bode",
            title="Bode plot",
            caption=f"{drawn}{between}",
            description=f"Magnitude and phase of {pair.output} over {pair.input} from {span}: "
            f"{', '.join(marks) or 'no marks'}.",
            figure=plots.pair_bode(pair, input_unit=units[0], output_unit=units[1], fs=fs),
        )
    ]
    if found.scale_factor is not None and measured:
        pictures.append(
            Picture(
                key="deviation",
                title="Measured response divided by the model",
                caption="Measured response divided by the model. If the model is right, the band "
                "contains the dashed line at 19 frequencies of 20.",
                description=f"Magnitude and phase of the measured response over the model's, "
                f"from {span}, with the 95 % band around them.",
                figure=plots.pair_deviation(pair, fs=fs),
            )
        )
    return pictures


def _model_pictures(pair: PairIdentification, unit: str) -> list[Picture]:
    if pair.time is None or pair.prediction is None or pair.residual is None:
        return []
    measured = pair.prediction + pair.residual
    spread = float(np.std(pair.residual))
    return [
        Picture(
            key="model",
            title="Model and measurement",
            caption="Output of the model and measured output; the fit is "
            f"{pair.fit_percent:.2f} %.",
            description=f"Measured and modelled {pair.output} over time; the fit is "
            f"{pair.fit_percent:.2f} %.",
            figure=plots.model_over_measurement(
                pair.time, measured, pair.prediction, output_name=pair.output, unit=unit
            ),
        ),
        Picture(
            key="residual",
            title="Residual",
            caption="Residual of the model, and its autocorrelation. White noise stays inside the "
            "dashed lines at 19 lags of 20; more outside means that the model misses something.",
            description=f"Residual of {pair.output} with standard deviation {spread:.4g} {unit}, "
            "and its autocorrelation.",
            figure=plots.residuals(pair.time, pair.residual, output_name=pair.output, unit=unit),
        ),
    ]


def _harmonics_picture(pair: PairIdentification, found: Nonlinearity) -> Picture:
    orders = [curve.order for curve in found.harmonics if curve.order > 1]
    return Picture(
        key="harmonics",
        title="Harmonics",
        caption="Harmonics of the sweep in the residual of the linear model, over the frequency "
        "of the sweep, where they exceed the noise. Asymmetry causes even orders; what acts alike "
        "in both directions causes odd ones.",
        description=f"Amplitude of harmonics {', '.join(str(k) for k in orders)} of {pair.output}, "
        "in per cent of its own amplitude at the frequency of the sweep.",
        figure=plots.harmonics(found.harmonics),
    )


def _candidates_picture(pair: PairIdentification) -> Picture:
    return Picture(
        key="candidates",
        title="Structures tried",
        caption="Bayesian information criterion of each structure, relative to the best; ten or "
        "more is decisive.",
        description=f"{len(pair.candidates)} structures; "
        f"{pair.structure.replace('_', ' ')} was chosen.",
        figure=plots.candidates(pair.candidates),
    )
