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
SEEN = 3.0  # standard deviations from which an amplitude is no noise


def harmonics(curves: "Sequence[HarmonicCurve]") -> "Figure":
    """Draw each harmonic's amplitude as a share of the output's own, in per cent.

    What stands out of the noise by three standard deviations is drawn, and the level of three
    standard deviations itself.

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
    floor: dict[float, float] = {}
    lowest = np.inf
    for curve in curves:
        if curve.order == 1 or not curve.frequency:
            continue
        colour, dashes = LOOKS[curve.order]
        frequency = np.array(curve.frequency)
        level = np.interp(frequency, *_rising(own)) / 100.0
        amplitude, noise = np.array(curve.amplitude), SEEN * np.array(curve.std)
        turn = np.argsort(frequency)
        for at, value in zip(frequency, noise / level, strict=True):
            floor[float(at)] = max(floor.get(float(at), 0.0), float(value))
        seen = amplitude > noise
        if not seen.any():
            continue
        lowest = min(lowest, float(np.min((amplitude / level)[seen])))
        axes.plot(
            frequency[turn],
            np.where(seen, amplitude / level, np.nan)[turn],
            color=COLOURS[colour],
            linestyle=dashes,
            marker="o",
            markersize=3.0,
            linewidth=1.2,
            label=f"order {curve.order}",
        )
    along = sorted(floor)
    axes.fill_between(
        along,
        [floor[at] for at in along],
        color=COLOURS["muted"],
        alpha=0.15,
        linewidth=0.0,
        label="within noise",
    )
    axes.set_yscale("log")
    lowest = min([lowest, *(level for level in floor.values() if level > 0)])
    if np.isfinite(lowest):
        axes.set_ylim(bottom=0.5 * lowest)
    finish_axes(axes, x="Frequency of the sweep (Hz)", y="Share of the output (%)", log_x=True)
    draw_legend(axes)
    return figure


def _rising(curve: "HarmonicCurve") -> "tuple[Sequence[float], Sequence[float]]":
    """Frequencies and amplitudes by rising frequency."""
    pairs = sorted(zip(curve.frequency, curve.amplitude, strict=True))
    return [f for f, _ in pairs], [a for _, a in pairs]
