"""Does the table spoil my test? What it adds to a loop, and the phase margin it leaves (V.B)."""

from typing import TYPE_CHECKING

import numpy as np

from hmpim.model.margin import AddedPhase, Margin
from hmpim.plots.style import (
    COLOURS,
    FONT_SIZE,
    Colour,
    axis_label,
    draw_legend,
    draw_line,
    finish_axes,
    new_figure,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["added_phase"]


def added_phase(added: AddedPhase) -> "Figure":
    """Draw added gain and phase with their 95 % bands, and both crossovers with their margins.

    Parameters
    ----------
    added : AddedPhase
        From `hmpim.model.add_to_loop`.

    Examples
    --------
    >>> from hmpim.model import Model, add_to_loop
    >>> f = np.linspace(0.1, 10, 500)
    >>> table = Model(delay=0.05, scale_factor=1.0)
    >>> figure = added_phase(add_to_loop((f, 2 * np.pi / (2j * np.pi * f)), [table]))
    >>> figure.axes[1].get_ylabel()
    'Added phase (deg)'
    """
    figure, (gain, phase) = new_figure(2)
    f = added.frequency
    crossovers: tuple[tuple[Margin, Colour, str], ...] = (
        (added.crossover_without, "muted", "loop alone"),
        (added.crossover_with, "output", "with the equipment"),
    )
    for axes, values, band in (
        (gain, added.gain_db, added.gain_db_ci95),
        (phase, added.phase, added.phase_ci95),
    ):
        draw_line(axes, f, values, label="added")
        axes.fill_between(f, band[0], band[1], color=COLOURS["input"], alpha=0.25, linewidth=0)
        for crossover, colour, words in crossovers:
            axes.axvline(
                crossover.value, color=COLOURS[colour], linewidth=1.0, linestyle="--",
                label=f"crossover, {words}",
            )  # fmt: skip
        axes.set_xlim(f[0], f[-1])
    _frame(gain, added.gain_db, least=1.0)
    _frame(phase, added.phase, least=5.0)
    phase.text(
        0.02, 0.06,
        f"Phase margin: {_said(added.margin_without)} alone, "
        f"{_said(added.margin_with)} with the equipment",
        transform=phase.transAxes, fontsize=FONT_SIZE, color=COLOURS["ink"],
    )  # fmt: skip
    finish_axes(gain, y=axis_label("Added gain", "dB"), log_x=True)
    finish_axes(
        phase, x=axis_label("Frequency", "Hz"), y=axis_label("Added phase", "deg"), log_x=True
    )
    draw_legend(gain)
    return figure


def _said(margin: Margin) -> str:
    low, high = margin.ci95
    if high - low < 1e-9:
        return f"{margin.value:.1f}°"
    return f"{margin.value:.1f}° ({low:.1f} to {high:.1f})"


def _frame(axes: "Axes", values: "np.ndarray", *, least: float) -> None:
    """Room around the curve; a flat one is not stretched to noise."""
    low, high = min(float(values.min()), 0.0), max(float(values.max()), 0.0)
    room = max(0.12 * (high - low), least)
    axes.set_ylim(low - 2.0 * room, high + room)
