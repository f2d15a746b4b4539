"""Bode plots: the measured response in its error band, the fitted model over it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from hmpim.arguments import check_argument
from hmpim.errors import ArgumentError
from hmpim.plots.curves import (
    BodeCurve,
    deviation_curve,
    interrupted,
    is_measured,
    measured_curve,
    model_curve,
    stretches,
)
from hmpim.plots.description import Axis, Band, Curve, Figure, Item, Panel, Points, Rule
from hmpim.plots.style import Colour, plain
from hmpim.record import INTERSAMPLE_WORDS
from hmpim.units import quotient_unit

if TYPE_CHECKING:
    from hmpim.identify import Estimate, Identification, PairIdentification

__all__ = ["Mark", "bode", "bode_items", "pair_bode", "pair_deviation"]

_MARGIN = 0.012  # of the axis at either end: the first and the last mark are seen whole
MOST_POINTS = 70  # measured ones with bars of their own; more would hide the model


@dataclass(frozen=True, slots=True, kw_only=True)
class Mark:
    """A frequency worth naming, in Hz, its interval, the words for it, and where it belongs."""

    frequency: float
    label: str
    axes: Literal["magnitude", "phase"] = "phase"
    low: float | None = None
    high: float | None = None


def bode(
    what: "Identification | PairIdentification | Sequence[tuple[str, Colour, BodeCurve]]",
    *,
    marks: Sequence[Mark] = (),
    magnitude_unit: str = "",
    band: tuple[float, float] | None = None,
    phase_level: float | None = None,
) -> Figure:
    """Describe magnitude and phase over frequency (Figs 15 to 17, 19 to 21).

    Parameters
    ----------
    what : Identification, PairIdentification, or sequence of (label, colour, BodeCurve)
        A result of one pair is drawn with all that is known of it, as `pair_bode` does; of
        several pairs, their measured responses over each other. Curves are drawn in this
        order; one that has a band is drawn with it.
    marks : sequence of Mark
        Frequencies to label next to curves.
    magnitude_unit : str
        Output unit per input unit, that 0 dB stands for; empty if they are the same.
    band : tuple of float, optional
        Frequencies to show, in Hz.
    phase_level : float, optional
        Phase in degrees at which a thin line is drawn, such as -90.

    Raises
    ------
    ArgumentError
        If a result holds no response to draw, or `what` is no result and no curves.

    Examples
    --------
    >>> f = np.geomspace(0.1, 10.0, 50)
    >>> curve = BodeCurve(frequency=f, magnitude_db=0.0 * f, phase=-54.0 * f)
    >>> figure = bode([("delay of 150 ms", "model", curve)])
    >>> [panel.y.label for panel in figure.panels]
    ['Magnitude (dB)', 'Phase (deg)']
    """
    if not isinstance(what, Sequence):
        figure = _result_bode(what)
        panels = tuple(_with_marks(panel, marks, band) for panel in figure.panels)
        return replace(figure, panels=panels)
    curves = what
    shown = band or _whole_band([curve for _, _, curve in curves])
    magnitude: list[Item] = []
    phase: list[Item] = []
    if phase_level is not None:
        phase.append(Rule(at=phase_level, axis="y", colour="muted", dashes=":", width=0.8))
    for label, colour, curve in curves:
        upper, lower = bode_items(curve, label=label, colour=colour)
        magnitude += upper
        phase += lower
    heights = [_heights([c for _, _, c in curves], name, shown) for name in _QUANTITIES]
    reference = f"dB re 1 {plain(magnitude_unit)}" if magnitude_unit else "dB"
    low, high = (None, None) if shown is None else shown if band else _with_room(shown)
    x = Axis(scale="log", low=low, high=high, numbered=False)
    panels = (
        Panel(
            x=x,
            y=Axis(label=f"Magnitude ({reference})", low=heights[0][0], high=heights[0][1]),
            items=tuple(magnitude),
        ),
        Panel(
            x=replace(x, label="Frequency (Hz)", numbered=True),
            y=Axis(label="Phase (deg)", degrees=True, low=heights[1][0], high=heights[1][1]),
            items=tuple(phase),
            row=1,
        ),
    )
    names = ", ".join(label for label, _, _ in curves) or "nothing"
    words = [f"{mark.label} ({mark.axes})" for mark in marks]
    span = "" if shown is None else f" from {shown[0]:.4g} to {shown[1]:.4g} Hz"
    return Figure(
        panels=tuple(_with_marks(panel, marks, shown) for panel in panels),
        alt=". ".join([f"Bode plot{span}: {names}", *words]) + ".",
        heights=(2.3, 2.9),
    )


_QUANTITIES: tuple[Literal["magnitude_db", "phase"], ...] = ("magnitude_db", "phase")


def _result_bode(result: "Identification | PairIdentification") -> Figure:
    from hmpim.identify import Identification, PairIdentification
    from hmpim.plots.overlay import overlaid_bode

    if not isinstance(result, Identification):
        check_argument("what", result, PairIdentification)
        return pair_bode(result)
    pairs = [pair for pair in result.counted if np.any(pair.frequency_response.frequency > 0)]
    if not pairs:
        raise ArgumentError(
            "this result has no pair with a measured frequency response; there is nothing to draw"
        )
    if len(pairs) > 1:
        return overlaid_bode(
            [
                (f"{pair.input} → {pair.output}", _measured(pair, result.record.fs))
                for pair in pairs
            ],
            pairs=False,
        )
    units = ("", "")
    if result.data is not None:
        units = (
            result.data.channel(pairs[0].input).unit,
            result.data.channel(pairs[0].output).unit,
        )
    return pair_bode(pairs[0], input_unit=units[0], output_unit=units[1], fs=result.record.fs)


def _measured(pair: "PairIdentification", fs: float | None) -> BodeCurve:
    """Return a pair's measured response, its phase unwrapped beside the model's."""
    response = pair.frequency_response
    near = model_curve(pair, response.frequency[response.frequency > 0], fs=fs)
    return measured_curve(response, near=near)


def _with_marks(panel: Panel, marks: Sequence[Mark], band: tuple[float, float] | None) -> Panel:
    """Add the marks that belong to a panel, their words one under the other."""
    which = "phase" if panel.y.label.startswith("Phase") else "magnitude"
    rules: list[Rule] = []
    for mark in marks:
        if mark.axes == which and (band is None or band[0] <= mark.frequency <= band[1]):
            rules.append(
                Rule(
                    at=mark.frequency,
                    low=mark.low,
                    high=mark.high,
                    words=mark.label,
                    words_at=0.1 + 0.11 * len(rules),  # below the curves of all that lags
                )
            )
    return replace(panel, items=(*panel.items, *rules))


def bode_items(
    curve: BodeCurve, *, label: str = "", colour: Colour = "model"
) -> tuple[list[Item], list[Item]]:
    """Return what is drawn of one curve in the magnitude's panel and in the phase's.

    A measured curve, one with a band, is a line in its band, both interrupted where nothing was
    measured, and some of its points stand out with error bars of their own; a model's is a
    dashed line.

    Parameters
    ----------
    curve : BodeCurve
        What.
    label : str
        For the legend.
    colour : str
        A name of `COLOURS`.

    Examples
    --------
    >>> f = np.geomspace(0.1, 10.0, 50)
    >>> curve = BodeCurve(frequency=f, magnitude_db=0.0 * f, phase=-54.0 * f)
    >>> [len(items) for items in bode_items(curve, label="delay")]
    [1, 1]
    """
    out: tuple[list[Item], list[Item]] = ([], [])
    panels = (
        (out[0], curve.magnitude_db, curve.magnitude_low, curve.magnitude_high, label),
        (out[1], curve.phase, curve.phase_low, curve.phase_high, ""),  # one legend serves both
    )
    f = curve.frequency
    for items, middle, low, high, words in panels:
        if low is None or high is None:
            items.append(Curve(x=f, y=middle, label=words, colour=colour, dashes="--", width=1.6))
            continue
        some = _spread(f)
        items += [
            Band(
                x=f[part], low=low[part], high=high[part], colour=colour, opacity=0.28,
                label="" if part.start or not words else "95 % band",
            )
            for part in stretches(f)
        ]  # fmt: skip
        line, levels = interrupted(f, middle)
        items += [
            Curve(x=line, y=levels, colour=colour, width=0.7, opacity=0.7),
            Points(
                x=f[some], y=middle[some], low=low[some], high=high[some], label=words,
                colour=colour, size=4.6, filled=False,
            ),
        ]  # fmt: skip
    return out


def _spread(frequency: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return indices of some frequencies, evenly spread along a logarithmic axis."""
    if frequency.size <= MOST_POINTS:
        return np.arange(frequency.size)
    wanted = np.geomspace(frequency[0], frequency[-1], MOST_POINTS)
    return np.unique(np.searchsorted(frequency, wanted).clip(0, frequency.size - 1))


def pair_bode(
    pair: "PairIdentification",
    *,
    input_unit: str = "",
    output_unit: str = "",
    fs: float | None = None,
) -> Figure:
    """Describe all that is known of a pair's frequency response.

    The measured response with its 95 % band, the fitted model over it, the model's phase
    without its delay, and marks with their 95 % intervals at the -90° and -3 dB bandwidths and
    the natural frequency. One whose interval reaches down to zero is not marked. Of compressed
    records, whose response is not measured, the model alone.

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
    >>> len(figure.panels)
    2
    """
    response = pair.frequency_response
    positive = response.frequency[response.frequency > 0]
    curves: list[tuple[str, Colour, BodeCurve]] = []
    grid = np.geomspace(0.1, 10.0, 400)
    if positive.size:
        if is_measured(pair):
            curves.append(("measured", "input", _measured(pair, fs)))
        grid = np.geomspace(positive[0], positive[-1], 400)
    whole = model_curve(pair, grid, fs=fs)
    if whole is not None:
        held = fs is not None and pair.intersample in ("zoh", "foh", "feedforward")
        word = f"model, input {INTERSAMPLE_WORDS[pair.intersample]}" if held else "model"
        period = pair.parameters.hold_period
        if fs is not None and period is not None:
            word += f", output held for {1e3 * period.value:.3g} ms"
        curves.append((word, "model", whole))
    ratio = quotient_unit(output_unit, input_unit)
    scale = pair.parameters.scale_factor
    level = -90.0 if scale is None or scale.value > 0.0 else -270.0  # 90° later than at DC
    figure = bode(curves, marks=_marks(pair), magnitude_unit=ratio, phase_level=level)
    bare = model_curve(pair, grid, with_delay=False)
    if bare is None or pair.parameters.delay is None:
        return figure
    magnitude, phase = figure.panels
    without = Curve(
        x=grid, y=bare.phase, colour="other", label="model without delay", dashes="-.", width=1.6
    )
    return replace(figure, panels=(magnitude, replace(phase, items=(*phase.items, without))))


def pair_deviation(pair: "PairIdentification", *, fs: float | None = None) -> Figure:
    """Describe the measured response over the model's, where the 95 % band can be seen.

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
    >>> [panel.y.label for panel in pair_deviation(pair).panels]
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
    figure = bode([("measured ÷ model", "input", curve)])
    zero = Rule(at=0.0, axis="y", colour="model", width=1.2)
    panels = []
    for panel in figure.panels:
        bands = panel.of(Band)
        reach = _common_reach(*(np.concatenate([getattr(b, e) for b in bands]) for e in _ENDS))
        y = replace(panel.y, low=-reach, high=reach)
        panels.append(replace(panel, y=y, items=(*panel.items, zero)))
    return replace(
        figure,
        panels=tuple(panels),
        heights=(1.7, 1.7),
        alt="Magnitude and phase of the measured response over the model's, with the 95 % band "
        f"around them, from {positive[0]:.4g} to {positive[-1]:.4g} Hz.",
    )


_ENDS = ("low", "high")


def _common_reach(low: NDArray[np.float64], high: NDArray[np.float64]) -> float:
    """How far a band reaches from 0, but for the tenth of it that is widest."""
    ends = np.maximum(np.abs(low), np.abs(high))
    ends = ends[np.isfinite(ends)]
    if not ends.size:
        return 20.0
    return max(1.3 * float(np.quantile(ends, 0.9, method="lower")), 1e-3)


def _marks(pair: "PairIdentification") -> list[Mark]:
    found = pair.parameters
    named: tuple[tuple[Estimate | None, str, Literal["magnitude", "phase"]], ...] = (
        (found.bandwidth_phase90, "−90° at", "phase"),
        (found.bandwidth_phase90_without_delay, "−90° without delay", "phase"),
        (found.bandwidth_3db, "−3 dB at", "magnitude"),
        (found.natural_frequency, "natural frequency", "magnitude"),
    )
    marks = []
    for estimate, words, axes in named:
        if estimate is None:
            continue
        low, high = estimate.ci95 or (None, None)
        if low is not None and low <= 0.0:  # it may lie anywhere: a mark would say otherwise
            continue
        marks.append(
            Mark(
                frequency=estimate.value,
                label=f"{words} {_in_words(estimate)}",
                axes=axes,
                low=low,
                high=high,
            )
        )
    return marks


def _in_words(estimate: "Estimate") -> str:
    """An estimate with its error, four digits where it is withheld; ? marks a doubtful one."""
    doubt = "" if estimate.verdict == "ok" else " ?"
    if estimate.ci95 is not None:
        return estimate.text + doubt
    return f"{estimate.value:.4g} {estimate.unit}{doubt}"


def _whole_band(curves: Sequence[BodeCurve]) -> tuple[float, float] | None:
    filled = [curve.frequency for curve in curves if curve.frequency.size > 1]
    if not filled:
        return None
    return min(float(f[0]) for f in filled), max(float(f[-1]) for f in filled)


def _with_room(ends: tuple[float, float]) -> tuple[float, float]:
    room = (ends[1] / ends[0]) ** _MARGIN
    return ends[0] / room, ends[1] * room


def _heights(
    curves: Sequence[BodeCurve],
    quantity: Literal["magnitude_db", "phase"],
    band: tuple[float, float] | None,
) -> tuple[float | None, float | None]:
    """Ends that fit the curves themselves: a band that reaches -inf must not set them."""
    seen = [np.empty(0)]
    for curve in curves:
        values = getattr(curve, quantity)
        low, high = band or (-np.inf, np.inf)
        inside = (curve.frequency >= low) & (curve.frequency <= high)
        seen.append(values[inside & np.isfinite(values)])
    joined = np.concatenate(seen)
    if not joined.size:
        return None, None
    first, last = float(joined.min()), float(joined.max())
    room = max(0.05 * (last - first), 1.0)
    return first - room, last + room
