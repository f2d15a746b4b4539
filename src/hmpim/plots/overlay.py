"""Several measured responses, or stimuli's levels, over each other."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from hmpim.plots.curves import BodeCurve
from hmpim.plots.style import (
    COLOURS,
    Colour,
    degree_ticks,
    draw_legend,
    draw_line,
    finish_axes,
    new_figure,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["overlaid_bode", "overlaid_levels"]

_COLOURS: tuple[Colour, ...] = ("input", "output", "other", "limit", "model", "muted")
_DASHES: tuple[Literal["-", "--", "-."], ...] = ("-", "--", "-.")


def overlaid_bode(
    curves: Sequence[tuple[str, BodeCurve]],
    *,
    phase_level: float | None = -90.0,
    pairs: bool = True,
) -> "Figure":
    """Draw magnitude and phase of several curves over each other (Figs 19 to 22).

    Parameters
    ----------
    curves : sequence of (label, BodeCurve)
        Drawn in this order, told apart by colour and then by dashes; their bands are left out.
    phase_level : float, optional
        Phase in degrees at which a thin line is drawn.
    pairs : bool
        True draws every second curve thin over a wide one: of two that are the same both show.

    Examples
    --------
    >>> f = np.geomspace(0.1, 10.0, 50)
    >>> curve = BodeCurve(frequency=f, magnitude_db=0.0 * f, phase=-54.0 * f)
    >>> figure = overlaid_bode([("first", curve), ("second", curve)])
    >>> len(figure.axes[0].lines)
    2
    """
    figure, (magnitude, phase) = new_figure(2, height=2.5)
    for i, (label, curve) in enumerate(curves):
        for axes, values in ((magnitude, curve.magnitude_db), (phase, curve.phase)):
            draw_line(
                axes,
                curve.frequency,
                values,
                colour=_COLOURS[i % len(_COLOURS)],
                label=label if axes is magnitude else "",
                dashes=_DASHES[i // len(_COLOURS) % len(_DASHES)],
                width=_width(i) if pairs else 1.2,
                spacing="log",
            )
    filled = [curve for _, curve in curves if curve.frequency.size > 1]
    if filled:
        low = min(float(c.frequency[0]) for c in filled)
        high = max(float(c.frequency[-1]) for c in filled)
        magnitude.set_xlim(low, high)
        # What noise makes of the far end must not set the heights.
        bottom = min(float(np.nanquantile(c.phase, 0.02)) for c in filled)
        phase.set_ylim(max(bottom, -400.0) - 15.0, 20.0)
        bottom = min(float(np.nanquantile(c.magnitude_db, 0.02)) for c in filled)
        top = max(float(np.nanmax(c.magnitude_db)) for c in filled)
        magnitude.set_ylim(max(bottom, -50.0) - 2.0, min(top, 20.0) + 2.0)
    if phase_level is not None:
        phase.axhline(phase_level, color=COLOURS["muted"], linewidth=0.8, linestyle=(0, (1, 2)))
    degree_ticks(phase)
    finish_axes(magnitude, y="Magnitude (dB)", log_x=True)
    finish_axes(phase, x="Frequency (Hz)", y="Phase (deg)", log_x=True)
    draw_legend(magnitude, columns=2)
    figure.align_ylabels([magnitude, phase])
    return figure


def _width(place: int) -> float:
    return 1.0 if place % 2 else 2.6


def overlaid_levels(
    levels: Sequence[tuple[str, NDArray[np.float64], NDArray[np.float64]]],
    *,
    unit: str = "",
    level: float | None = None,
) -> "Figure":
    """Draw the spectra of several stimuli over each other (Fig. 18).

    Parameters
    ----------
    levels : sequence of (label, frequency, level)
        Frequency in Hz and level in dB, each shape (m,).
    unit : str
        What 0 dB stands for one of.
    level : float, optional
        A level to mark with a thin line.

    Examples
    --------
    >>> f = np.geomspace(0.1, 10.0, 50)
    >>> len(overlaid_levels([("azimuth", f, 30.0 + 0.0 * f)]).axes[0].lines)
    1
    """
    figure, (axes,) = new_figure(1, height=2.8)
    for i, (label, frequency, values) in enumerate(levels):
        draw_line(
            axes,
            frequency,
            values,
            colour=_COLOURS[i % len(_COLOURS)],
            label=label,
            width=_width(i),
            spacing="log",
        )
    if level is not None:
        axes.axhline(level, color=COLOURS["muted"], linewidth=0.8, linestyle=(0, (1, 2)))
    reference = f"dB re 1 {unit}" if unit else "dB"
    finish_axes(axes, x="Frequency (Hz)", y=f"Level ({reference})", log_x=True)
    draw_legend(axes, columns=2)
    return figure
