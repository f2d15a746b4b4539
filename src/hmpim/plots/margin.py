"""Does the table spoil my test? What it adds to a loop, and the phase margin it leaves (V.B)."""

import numpy as np

from hmpim.model.margin import AddedPhase, Margin
from hmpim.plots.description import (
    Axis,
    Band,
    Curve,
    Dashes,
    Figure,
    Item,
    Panel,
    Rule,
    Words,
)
from hmpim.plots.style import Colour, axis_label

__all__ = ["added_phase"]


def added_phase(added: AddedPhase) -> Figure:
    """Describe added gain and phase with their 95 % bands, and both crossovers with their margins.

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
    >>> figure.panels[1].y.label
    'Added phase (deg)'
    """
    f = added.frequency
    crossovers: tuple[tuple[Margin, Colour, Dashes, str], ...] = (
        (added.crossover_without, "muted", ":", "loop alone"),
        (added.crossover_with, "output", "--", "with the equipment"),
    )
    margins = (
        f"Phase margin: {_said(added.margin_without)} alone, "
        f"{_said(added.margin_with)} with the equipment"
    )
    panels = []
    for row, (values, band, quantity, unit, least) in enumerate(
        (
            (added.gain_db, added.gain_db_ci95, "Added gain", "dB", 1.0),
            (added.phase, added.phase_ci95, "Added phase", "deg", 5.0),
        )
    ):
        items: list[Item] = [
            Band(x=f, low=band[0], high=band[1], opacity=0.25),
            Curve(x=f, y=values, label="" if row else "added"),
        ]
        for crossover, colour, dashes, words in crossovers:
            label = "" if row else f"crossover, {words}"
            items.append(Rule(at=crossover.value, colour=colour, dashes=dashes, label=label))
        if row:
            items.append(Words(x=0.02, y=0.06, at="share", text=margins))
        low, high = _ends(values, least=least)
        panels.append(
            Panel(
                x=Axis(
                    label=axis_label("Frequency", "Hz") if row else "",
                    scale="log",
                    low=float(f[0]),
                    high=float(f[-1]),
                    numbered=bool(row),
                ),
                y=Axis(label=axis_label(quantity, unit), low=low, high=high),
                items=tuple(items),
                row=row,
            )
        )
    return Figure(
        panels=tuple(panels),
        alt=f"Gain and phase that the equipment adds to the loop. {margins}.",
        heights=(2.2, 2.2),
    )


def _said(margin: Margin) -> str:
    low, high = margin.ci95
    if high - low < 1e-9:
        return f"{margin.value:.1f}°"
    return f"{margin.value:.1f}° ({low:.1f} to {high:.1f})"


def _ends(values: "np.ndarray", *, least: float) -> tuple[float, float]:
    """Room around the curve; a flat one is not stretched to noise."""
    low, high = min(float(values.min()), 0.0), max(float(values.max()), 0.0)
    room = max(0.12 * (high - low), least)
    return low - 2.0 * room, high + room
