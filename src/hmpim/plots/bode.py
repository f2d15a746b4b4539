"""Bode plots: the measured response in its error band, the fitted model over it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import ArgumentError
from hmpim.plots.candidates import INTERSAMPLE_WORDS
from hmpim.plots.curves import BodeCurve, deviation_curve, measured_curve, model_curve
from hmpim.plots.style import (
    COLOURS,
    Colour,
    degree_ticks,
    draw_legend,
    draw_line,
    draw_mark,
    finish_axes,
    new_figure,
    plain,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from hmpim.identify import PairIdentification

__all__ = ["Mark", "bode", "draw_bode", "pair_bode", "pair_deviation"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Mark:
    """A frequency worth naming, in Hz, the words for it, and the axes it belongs to."""

    frequency: float
    label: str
    axes: Literal["magnitude", "phase"] = "phase"


def bode(
    curves: Sequence[tuple[str, Colour, BodeCurve]],
    *,
    marks: Sequence[Mark] = (),
    magnitude_unit: str = "",
    band: tuple[float, float] | None = None,
    phase_level: float | None = None,
) -> "Figure":
    """Draw magnitude and phase of some curves (Figs 15 to 17, 19 to 21).

    Parameters
    ----------
    curves : sequence of (label, colour, BodeCurve)
        Drawn in this order; a curve that has a band is drawn with it.
    marks : sequence of Mark
        Frequencies to name.
    magnitude_unit : str
        Output unit per input unit, that 0 dB stands for; empty if they are the same.
    band : tuple of float, optional
        Frequencies to show, in Hz.
    phase_level : float, optional
        Phase in degrees at which a thin line is drawn, such as -90.

    Examples
    --------
    >>> f = np.geomspace(0.1, 10.0, 50)
    >>> curve = BodeCurve(frequency=f, magnitude_db=0.0 * f, phase=-54.0 * f)
    >>> figure = bode([("delay of 150 ms", "model", curve)])
    >>> [axes.get_ylabel() for axes in figure.axes]
    ['Magnitude (dB)', 'Phase (deg)']
    """
    figure, (magnitude, phase) = new_figure(2, height=2.5)
    for label, colour, curve in curves:
        draw_bode(magnitude, phase, curve, label=label, colour=colour)
    shown = band or _whole_band([curve for _, _, curve in curves])
    if shown is not None:
        magnitude.set_xlim(*shown)
        _fit_heights(magnitude, phase, [curve for _, _, curve in curves], shown)
    degree_ticks(phase)
    reference = f"dB re 1 {plain(magnitude_unit)}" if magnitude_unit else "dB"
    finish_axes(magnitude, y=f"Magnitude ({reference})", log_x=True)
    finish_axes(phase, x="Frequency (Hz)", y="Phase (deg)", log_x=True)
    if phase_level is not None:
        phase.axhline(phase_level, color=COLOURS["muted"], linewidth=0.8, linestyle=(0, (1, 2)))
    height = {"magnitude": 0.1, "phase": 0.1}  # below the curves of all that lags
    for mark in marks:
        if shown is None or shown[0] <= mark.frequency <= shown[1]:
            axes = phase if mark.axes == "phase" else magnitude
            draw_mark(axes, mark.frequency, label=mark.label, text_at=height[mark.axes])
            height[mark.axes] += 0.11
    draw_legend(magnitude)
    figure.align_ylabels([magnitude, phase])
    return figure


def draw_bode(
    magnitude: "Axes",
    phase: "Axes",
    curve: BodeCurve,
    *,
    label: str = "",
    colour: Colour = "model",
) -> None:
    """Draw one curve, with its band if it has one, on axes that are there already.

    Parameters
    ----------
    magnitude, phase : matplotlib.axes.Axes
        Where.
    curve : BodeCurve
        What.
    label : str
        For the legend.
    colour : str
        A name of `COLOURS`.

    Examples
    --------
    >>> figure, (magnitude, phase) = new_figure(2)
    >>> f = np.geomspace(0.1, 10.0, 50)
    >>> curve = BodeCurve(frequency=f, magnitude_db=0.0 * f, phase=-54.0 * f)
    >>> draw_bode(magnitude, phase, curve, label="delay")
    >>> len(magnitude.lines), len(phase.lines)
    (1, 1)
    """
    panels = (
        (magnitude, curve.magnitude_db, curve.magnitude_low, curve.magnitude_high),
        (phase, curve.phase, curve.phase_low, curve.phase_high),
    )
    for axes, middle, low, high in panels:
        measured = low is not None and high is not None
        if low is not None and high is not None:
            floor = np.where(np.isfinite(low), low, middle - 60.0)
            axes.fill_between(
                curve.frequency,
                floor,
                high,
                color=COLOURS[colour],
                alpha=0.22,
                linewidth=0,
                label="95 % band" if axes is magnitude else None,
            )
        draw_line(
            axes,
            curve.frequency,
            middle,
            colour=colour,
            label=label if axes is magnitude else "",  # one legend serves both
            dashes="-" if measured else "--",
            width=1.0 if measured else 1.5,
            spacing="log",
        )


def pair_bode(
    pair: "PairIdentification",
    *,
    input_unit: str = "",
    output_unit: str = "",
    fs: float | None = None,
) -> "Figure":
    """Draw all that is known of a pair's frequency response.

    The measured response with its 95 % band, the fitted model over it, the model's phase
    without its delay, and marks at the -90° and -3 dB bandwidths and the natural frequency.

    Parameters
    ----------
    pair : PairIdentification
        What was found.
    input_unit, output_unit : str
        Units of the two channels.
    fs : float, optional
        Sampling rate in Hz; with it, the model is seen through the samples as the measurement
        is, an input that is held between them included.

    Examples
    --------
    >>> from hmpim.identify import FrequencyResponse, PairIdentification
    >>> from hmpim.identify import PaperEstimates, Parameters
    >>> f = np.geomspace(0.1, 10.0, 50)
    >>> response = FrequencyResponse(frequency=f, response=1 / (1 + 1j * f), std=0.1 + 0 * f)
    >>> pair = PairIdentification(
    ...     input="u", output="y", structure="static", intersample="zoh", fit_percent=0.0,
    ...     parameters=Parameters(), paper=PaperEstimates(), frequency_response=response,
    ...     numerator=(), denominator=(), candidates=(), verdict="doubtful", warnings=())
    >>> figure = pair_bode(pair)
    >>> len(figure.axes)
    2
    """
    response = pair.frequency_response
    positive = response.frequency[response.frequency > 0]
    curves: list[tuple[str, Colour, BodeCurve]] = []
    grid = np.geomspace(0.1, 10.0, 400)
    if positive.size:
        near = model_curve(pair, positive, fs=fs)
        curves.append(("measured", "input", measured_curve(response, near=near)))
        grid = np.geomspace(positive[0], positive[-1], 400)
    whole = model_curve(pair, grid, fs=fs)
    if whole is not None:
        held = fs is not None and pair.intersample != "bandlimited"
        word = f"model, input {INTERSAMPLE_WORDS[pair.intersample]}" if held else "model"
        curves.append((word, "model", whole))
    ratio = "" if input_unit == output_unit else f"{output_unit or '1'}/{input_unit or '1'}"
    scale = pair.parameters.scale_factor
    level = -90.0 if scale is None or scale.value > 0.0 else -270.0  # 90° later than at DC
    figure = bode(curves, marks=_marks(pair), magnitude_unit=ratio, phase_level=level)
    bare = model_curve(pair, grid, with_delay=False)
    if bare is not None and pair.parameters.delay is not None:
        phase = figure.axes[1]
        draw_line(phase, grid, bare.phase, colour="other", label="model without delay", dashes="-.")
        draw_legend(phase)
    return figure


def pair_deviation(pair: "PairIdentification", *, fs: float | None = None) -> "Figure":
    """Draw the measured response over the model's, where the 95 % band can be seen.

    Parameters
    ----------
    pair : PairIdentification
        What was found; it must have a model and a measured response.
    fs : float, optional
        Sampling rate in Hz, as in `pair_bode`.

    Raises
    ------
    ArgumentError
        If there is no model to compare with.

    Examples
    --------
    >>> from hmpim.identify import Estimate, FrequencyResponse, PairIdentification
    >>> from hmpim.identify import PaperEstimates, Parameters
    >>> f = np.geomspace(0.1, 10.0, 50)
    >>> one = Estimate(value=1.0, std=0.0, ci95=(1.0, 1.0))
    >>> response = FrequencyResponse(frequency=f, response=1.02 + 0j * f, std=0.1 + 0 * f)
    >>> pair = PairIdentification(
    ...     input="u", output="y", structure="static", intersample="zoh", fit_percent=0.0,
    ...     parameters=Parameters(scale_factor=one), paper=PaperEstimates(), candidates=(),
    ...     frequency_response=response, numerator=(1.0,), denominator=(1.0,), verdict="ok",
    ...     warnings=())
    >>> [axes.get_ylabel() for axes in pair_deviation(pair).axes]
    ['Magnitude (dB)', 'Phase (deg)']
    """
    response = pair.frequency_response
    positive = response.frequency[response.frequency > 0]
    model = model_curve(pair, positive, fs=fs)
    if model is None or not positive.size:
        raise ArgumentError(
            f"pair {pair.input!r} → {pair.output!r} has no model or no measured response to compare"
        )
    curve = deviation_curve(measured_curve(response, near=model), model)
    figure, (magnitude, phase) = new_figure(2, height=1.7)
    draw_bode(magnitude, phase, curve, label="measured over model", colour="input")
    for axes, low, high in (
        (magnitude, curve.magnitude_low, curve.magnitude_high),
        (phase, curve.phase_low, curve.phase_high),
    ):
        axes.axhline(0.0, color=COLOURS["model"], linewidth=1.2, linestyle="--")
        if low is not None and high is not None:
            reach = _common_reach(low, high)
            axes.set_ylim(-reach, reach)
    if positive.size > 1:
        magnitude.set_xlim(float(positive[0]), float(positive[-1]))
    finish_axes(magnitude, y="Magnitude (dB)", log_x=True)
    finish_axes(phase, x="Frequency (Hz)", y="Phase (deg)", log_x=True)
    draw_legend(magnitude)
    figure.align_ylabels([magnitude, phase])
    return figure


def _common_reach(low: NDArray[np.float64], high: NDArray[np.float64]) -> float:
    """How far a band reaches from 0, but for the tenth of it that is widest."""
    ends = np.maximum(np.abs(low), np.abs(high))
    ends = ends[np.isfinite(ends)]
    if not ends.size:
        return 20.0
    return max(1.3 * float(np.quantile(ends, 0.9, method="lower")), 1e-3)


def _marks(pair: "PairIdentification") -> list[Mark]:
    found = pair.parameters
    marks = []
    if found.bandwidth_phase90 is not None:
        f = found.bandwidth_phase90.value
        marks.append(Mark(frequency=f, label=f"−90° at {f:.3g} Hz"))
    if found.bandwidth_phase90_without_delay is not None:
        f = found.bandwidth_phase90_without_delay.value
        marks.append(Mark(frequency=f, label=f"−90° at {f:.3g} Hz without delay"))
    if found.bandwidth_3db is not None:
        f = found.bandwidth_3db.value
        marks.append(Mark(frequency=f, label=f"−3 dB at {f:.3g} Hz", axes="magnitude"))
    if found.natural_frequency is not None:
        f = found.natural_frequency.value
        marks.append(Mark(frequency=f, label=f"natural frequency {f:.3g} Hz", axes="magnitude"))
    return marks


def _whole_band(curves: Sequence[BodeCurve]) -> tuple[float, float] | None:
    filled = [curve.frequency for curve in curves if curve.frequency.size > 1]
    if not filled:
        return None
    return min(float(f[0]) for f in filled), max(float(f[-1]) for f in filled)


def _fit_heights(
    magnitude: "Axes", phase: "Axes", curves: Sequence[BodeCurve], band: tuple[float, float]
) -> None:
    """Fit both heights to the curves themselves: a band that reaches -inf must not set them."""
    for axes, values_of in ((magnitude, "magnitude_db"), (phase, "phase")):
        seen = []
        for curve in curves:
            values = getattr(curve, values_of)
            inside = (curve.frequency >= band[0]) & (curve.frequency <= band[1])
            seen.append(values[inside & np.isfinite(values)])
        joined = np.concatenate(seen) if seen else np.empty(0)
        if joined.size:
            low, high = float(joined.min()), float(joined.max())
            room = max(0.08 * (high - low), 1.0)
            axes.set_ylim(low - room, high + 2.5 * room)
