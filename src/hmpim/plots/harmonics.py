"""Harmonics of a sweep against its frequency: where a system is not linear, and how."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hmpim.plots.style import COLOURS, Colour, draw_legend, finish_axes, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hmpim.identify import HarmonicCurve

__all__ = ["harmonics"]

LOOKS: dict[int, tuple[Colour, str]] = {
    2: ("input", "--"),
    3: ("output", "-"),
    4: ("other", ":"),
    5: ("limit", "-."),
}
LOWEST = 1e-3  # per cent; less is drawn at the edge


def harmonics(curves: "Sequence[HarmonicCurve]") -> "Figure":
    """Draw each harmonic's amplitude as a share of the output's own, in per cent.

    Parameters
    ----------
    curves : sequence of HarmonicCurve
        Order 1, the output's own amplitude, and at least one other.

    Examples
    --------
    >>> from hmpim.identify import HarmonicCurve
    >>> own = HarmonicCurve(order=1, frequency=(1.0, 10.0), amplitude=(1.0, 2.0), std=(0.0, 0.0))
    >>> third = HarmonicCurve(
    ...     order=3, frequency=(1.0, 10.0), amplitude=(0.1, 0.1), std=(0.01, 0.01))
    >>> line = harmonics([own, third]).axes[0].lines[0]
    >>> [round(float(value), 2) for value in line.get_ydata()]
    [10.0, 5.0]
    """
    own = next(curve for curve in curves if curve.order == 1)
    figure, (axes,) = new_figure(1, height=2.6)
    for curve in curves:
        if curve.order == 1 or not curve.frequency:
            continue
        colour, dashes = LOOKS[curve.order]
        frequency = np.array(curve.frequency)
        turn = np.argsort(frequency)
        level = np.interp(frequency, *_rising(own))
        share = 100.0 * np.array(curve.amplitude) / level
        spread = 100.0 * np.array(curve.std) / level
        axes.plot(
            frequency[turn],
            np.maximum(share, LOWEST)[turn],
            color=COLOURS[colour],
            linestyle=dashes,
            marker="o",
            markersize=2.5,
            linewidth=1.2,
            label=f"{curve.order} × the sweep's frequency",
        )
        axes.fill_between(
            frequency[turn],
            np.maximum(share - 2.0 * spread, LOWEST)[turn],
            np.maximum(share + 2.0 * spread, LOWEST)[turn],
            color=COLOURS[colour],
            alpha=0.12,
            linewidth=0.0,
        )
    axes.set_yscale("log")
    finish_axes(axes, x="Frequency of the sweep (Hz)", y="Share of the output (%)", log_x=True)
    draw_legend(axes)
    return figure


def _rising(curve: "HarmonicCurve") -> "tuple[Sequence[float], Sequence[float]]":
    """Frequencies and amplitudes by rising frequency."""
    pairs = sorted(zip(curve.frequency, curve.amplitude, strict=True))
    return [f for f, _ in pairs], [a for _, a in pairs]
