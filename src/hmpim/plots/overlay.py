"""Several measured responses, or stimuli's levels, over each other."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hmpim.plots.curves import BodeCurve, interrupted
from hmpim.plots.description import Axis, Curve, Dashes, Figure, Item, Panel, Rule
from hmpim.plots.style import Colour, axis_label, with_error

if TYPE_CHECKING:
    from hmpim.identify import Estimate

__all__ = ["PHASE", "beside_bode", "overlaid_bode", "overlaid_levels", "waveform_panels"]

_COLOURS: tuple[Colour, ...] = ("input", "output", "other", "limit", "model", "muted")
PHASE = "Phase (deg)"
_DASHES: tuple[Dashes, ...] = ("-", "--", "-.")

_HALF_A_TURN = 180.0  # deg: a band this wide leaves the phase unknown
_DEEPEST = 70.0  # dB below the top: what is lower would flatten the rest
_ROOM = 0.12  # of a panel's height, for a line of words


def overlaid_bode(
    curves: Sequence[tuple[str, BodeCurve]],
    *,
    bandwidths: Sequence["Estimate | None"] = (),
    phase_level: float | None = -90.0,
    pairs: bool = True,
    phase_label: str = PHASE,
) -> Figure:
    """Describe magnitude and phase of several curves over each other (Figs 19 to 22).

    Parameters
    ----------
    curves : sequence of (label, BodeCurve)
        Drawn in this order, told apart by colour and then by dashes; their bands are left out.
    bandwidths : sequence of Estimate or None
        -90° frequency of each curve in Hz: a thin line in the phase's panel, its 95 % interval
        shaded, its value in the legend. One alone is that of all curves, and said beside its line.
    phase_level : float, optional
        Phase in degrees at which a thin line is drawn.
    pairs : bool
        True draws every second curve thin over a wide one: of two that are the same both show.
    phase_label : str
        Label of the phase's axis: what the phase contains, where that is not plain.

    Examples
    --------
    >>> f = np.geomspace(0.1, 10.0, 50)
    >>> curve = BodeCurve(frequency=f, magnitude_db=0.0 * f, phase=-54.0 * f)
    >>> figure = overlaid_bode([("first", curve), ("second", curve)])
    >>> len(figure.panels[0].items)
    2
    """
    phase_items: list[Item] = []
    magnitude_items: list[Item] = []
    each = len(bandwidths) == len(curves) > 1
    for i, (label, curve) in enumerate(curves):
        found = bandwidths[i] if each else None
        f, level = interrupted(curve.frequency, curve.magnitude_db)
        look = Curve(
            x=f,
            y=level,
            label=label if found is None else f"{label}: −90° at {with_error(found)} Hz",
            colour=_COLOURS[i % len(_COLOURS)],
            dashes=_DASHES[(i + i // len(_COLOURS)) % len(_DASHES)],
            width=_width(i) if pairs else 1.2,
        )
        magnitude_items.append(look)
        phase_items.append(replace(look, y=interrupted(curve.frequency, curve.phase)[1]))
    for i, bandwidth in enumerate(bandwidths):
        if bandwidth is not None and not each:
            phase_items.append(_marked(bandwidth, place=0))
        elif bandwidth is not None:
            mark = _interval(bandwidth)
            phase_items.append(replace(mark, colour=_COLOURS[i % len(_COLOURS)], dashes=":"))
    if phase_level is not None:
        phase_items.append(Rule(at=phase_level, axis="y", colour="muted", dashes=":", width=0.8))
    x = Axis(scale="log", numbered=False)
    magnitude = Axis(label="Magnitude (dB)")
    phase = Axis(label=phase_label, degrees=True)
    filled = [curve for _, curve in curves if curve.frequency.size > 1]
    if filled:
        x = replace(
            x,
            low=min(float(c.frequency[0]) for c in filled),
            high=max(float(c.frequency[-1]) for c in filled),
        )
        bottom, top = _ends([c.phase[_known(c)] for c in filled])
        phase = replace(phase, low=bottom - 15.0, high=max(top, 0.0) + 20.0)
        bottom, top = _ends([c.magnitude_db[_known(c)] for c in filled])
        magnitude = replace(magnitude, low=max(bottom, top - _DEEPEST) - 2.0, high=top + 2.0)
    lower = replace(x, label="Frequency (Hz)", numbered=True)
    return Figure(
        panels=(
            Panel(x=x, y=magnitude, items=tuple(magnitude_items)),
            Panel(x=lower, y=phase, items=tuple(phase_items), row=1, legend=False),
        ),
        alt="Bode plots over each other: " + ", ".join(label for label, _ in curves) + ".",
        heights=(2.5, 2.5),
    )


def _known(curve: BodeCurve) -> NDArray[np.bool_]:
    """Where the phase is known: what noise makes of the rest must not set the heights."""
    some = np.isfinite(curve.phase) & np.isfinite(curve.magnitude_db)
    if curve.phase_low is not None and curve.phase_high is not None:
        sure = some & (curve.phase_high - curve.phase_low < _HALF_A_TURN)
        return sure if sure.any() else some
    return some


def _ends(values: Sequence[NDArray[np.float64]]) -> tuple[float, float]:
    joined = np.concatenate(values)
    return (float(joined.min()), float(joined.max())) if joined.size else (0.0, 0.0)


def beside_bode(
    curves: Sequence[tuple[str, BodeCurve]],
    *,
    bandwidths: Sequence["Estimate | None"],
    within: Sequence[str] = (),
    phase_label: str = PHASE,
) -> Figure:
    """Describe responses side by side, on the same axes (Figs 19 to 21, 24, 25).

    Parameters
    ----------
    curves : sequence of (label, BodeCurve)
        A column for each label.
    bandwidths : sequence of Estimate or None
        -90° frequency of each curve in Hz: marked with its 95 % interval, and said in words.
    within : sequence of str
        What tells each curve from the others of its column; nothing where each has its own.
    phase_label : str
        Label of the phase's axis: what the phase contains, where that is not plain.

    Examples
    --------
    >>> f = np.geomspace(0.1, 10.0, 50)
    >>> curve = BodeCurve(frequency=f, magnitude_db=0.0 * f, phase=-54.0 * f)
    >>> from hmpim.identify import Estimate
    >>> found = Estimate(value=1.67, std=0.01, ci95=(1.65, 1.69), unit="Hz")
    >>> figure = beside_bode([("500 Hz", curve), ("1000 Hz", curve)], bandwidths=[found] * 2)
    >>> [panel.title for panel in figure.panels[::2]], figure.panels[1].items[-1].words
    (['500 Hz', '1000 Hz'], '−90° at 1.670 ± 0.010 Hz')
    """
    together = overlaid_bode(curves, phase_label=phase_label)  # for axes that all columns share
    labels = list(dict.fromkeys(label for label, _ in curves))
    panels = []
    for column, label in enumerate(labels):
        inside = [i for i, (name, _) in enumerate(curves) if name == label]
        for panel in together.panels:
            if within and panel.row:  # narrow: the words may reach below the curves' ends
                panel = replace(panel, y=_with_room(panel.y, 0.2 + _ROOM))
            items: list[Item] = []
            if panel.row:
                items.append(Rule(at=-90.0, axis="y", colour="muted", dashes=":", width=0.8))
            for place, i in enumerate(inside):
                line = replace(panel.of(Curve)[i], label=within[i] if within else "", width=1.2)
                colour, dashes = _COLOURS[place], _DASHES[place % len(_DASHES)]
                items.append(replace(line, colour=colour, dashes=dashes))
                found = bandwidths[i]
                if found is not None:
                    mark = _marked(found, place=place) if panel.row else _interval(found)
                    if within:  # columns are narrow: the dotted line says what is marked
                        mark = replace(mark, words=mark.words.removeprefix("−90° at "))
                        mark = replace(mark, colour=colour, dashes=dashes)
                    items.append(mark)
            panels.append(
                replace(
                    panel,
                    items=tuple(items),
                    title="" if panel.row else label,
                    y=panel.y if column == 0 else replace(panel.y, label="", numbered=False),
                    column=column,
                    legend=bool(within) and not panel.row,
                )
            )
    return Figure(
        panels=tuple(panels),
        alt="Bode plots side by side: " + ", ".join(labels) + ".",
        heights=together.heights,
        columns=len(labels),
    )


def _with_room(axis: Axis, share: float) -> Axis:
    """The same axis with a share of its length free below."""
    if axis.low is None or axis.high is None:
        return axis
    return replace(axis, low=axis.high - (axis.high - axis.low) / (1.0 - share))


def _interval(found: "Estimate") -> Rule:
    """A frequency with its 95 % interval; of one that is withheld, what noise alone does."""
    half = 1.96 * found.spread
    low, high = found.ci95 or (found.value - half, found.value + half)
    return Rule(at=found.value, low=low, high=high)


def _marked(found: "Estimate", *, place: int) -> Rule:
    return replace(
        _interval(found),
        words=f"−90° at {with_error(found)} Hz",
        words_at=0.2 - _ROOM * place,
        side="left",
    )


def waveform_panels(
    waveforms: Sequence[tuple[str, NDArray[np.float64], NDArray[np.float64]]], *, unit: str = ""
) -> tuple[Panel, ...]:
    """Describe the stimuli of several axes over time, one panel under the other (Fig. 18).

    Parameters
    ----------
    waveforms : sequence of (label, time, position)
        Time in s, each shape (m,).
    unit : str
        Of the positions.

    Examples
    --------
    >>> t = np.linspace(0.0, 10.0, 100)
    >>> [panel.title for panel in waveform_panels([("azimuth", t, np.sin(t))], unit="deg")]
    ['azimuth']
    """
    return tuple(
        Panel(
            x=Axis(label="Time (s)" if row == len(waveforms) - 1 else ""),
            y=Axis(label=axis_label("Position", unit)),
            items=(Curve(x=time, y=position, width=0.9),),
            title=label,
            row=row,
        )
        for row, (label, time, position) in enumerate(waveforms)
    )


def _width(place: int) -> float:
    return 1.0 if place % 2 else 2.6


def overlaid_levels(
    levels: Sequence[tuple[str, NDArray[np.float64], NDArray[np.float64]]],
    *,
    unit: str = "",
    level: float | None = None,
    above: tuple[Panel, ...] = (),
) -> Figure:
    """Describe the spectra of several stimuli over each other (Fig. 18).

    Parameters
    ----------
    levels : sequence of (label, frequency, level)
        Frequency in Hz and level in dB, each shape (m,).
    unit : str
        What 0 dB stands for one of.
    level : float, optional
        A level to mark with a thin line.
    above : tuple of Panel
        Drawn above, as of `waveform_panels`.

    Examples
    --------
    >>> f = np.geomspace(0.1, 10.0, 50)
    >>> len(overlaid_levels([("azimuth", f, 30.0 + 0.0 * f)]).panels[0].items)
    1
    """
    items: list[Item] = [
        Curve(
            x=frequency,
            y=values,
            colour=_COLOURS[i % len(_COLOURS)],
            dashes=_DASHES[(i + i // len(_COLOURS)) % len(_DASHES)],
            label=label,
            width=_width(i),
        )
        for i, (label, frequency, values) in enumerate(levels)
    ]
    if level is not None:
        items.append(Rule(at=level, axis="y", colour="muted", dashes=":", width=0.8))
    reference = f"dB re 1 {unit}" if unit else "dB"
    return Figure(
        panels=(
            *above,
            Panel(
                x=Axis(label="Frequency (Hz)", scale="log"),
                y=Axis(label=f"Level ({reference})"),
                items=tuple(items),
                row=len(above),
            ),
        ),
        alt=("Waveforms, and spectra" if above else "Spectra")
        + " over each other: "
        + ", ".join(label for label, _, _ in levels)
        + ".",
        heights=((1.4,) * len(above)) + (2.8,),
        share_x=False,
    )
