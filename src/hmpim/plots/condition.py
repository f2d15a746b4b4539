"""How well the stimuli of several axes can be told apart, over frequency."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hmpim.plots.description import Axis, Curve, Figure, Panel, Rule, Span
from hmpim.plots.style import plain

if TYPE_CHECKING:
    from hmpim.stimulus.axes import InputCondition

__all__ = ["condition_panel", "input_condition_plot"]


def input_condition_plot(found: "InputCondition") -> Figure:
    """Describe the condition number of the input spectra, its bound, and where that is passed.

    Parameters
    ----------
    found : InputCondition
        From `hmpim.stimulus.axes.input_condition`.

    Examples
    --------
    >>> from hmpim.stimulus.axes import input_condition
    >>> t = np.arange(2000) / 200
    >>> up = np.sin(2 * np.pi * (0.1 * t + t**2))
    >>> figure = input_condition_plot(input_condition([up, up[::-1]], fs=200, band=(1, 19)))
    >>> figure.panels[0].y.label
    'Condition number (–)'
    """
    shown = np.where(np.isfinite(found.condition), found.condition, np.nan)
    top = max(2.0 * found.bound, float(np.nanmax(shown, initial=1.0)))
    shown = np.where(np.isfinite(shown), shown, top)
    return Figure(
        panels=(
            condition_panel(
                found.frequency,
                shown,
                found.usable,
                bound=found.bound,
                title=f"{', '.join(map(plain, found.names))}: {100 * found.share:.0f} % usable",
            ),
        ),
        alt=f"Condition number of the spectra of {', '.join(map(plain, found.names))} over "
        f"frequency; {100 * found.share:.0f} % of the band is usable.",
        heights=(2.8,),
    )


def condition_panel(
    frequency: NDArray[np.float64],
    condition: NDArray[np.float64],
    usable: NDArray[np.bool_],
    *,
    bound: float,
    title: str = "",
) -> Panel:
    """Describe a condition number over frequency, its bound, and where that is passed.

    Parameters
    ----------
    frequency, condition : ndarray, shape (m,)
        Hz, and the condition number there, finite.
    usable : ndarray of bool, shape (m,)
        Where the inputs are told apart.
    bound : float
        Largest condition number that is good.
    title : str
        Above the panel.

    Examples
    --------
    >>> f = np.array([1.0, 2.0, 3.0])
    >>> panel = condition_panel(f, f, f < 2.5, bound=2.5)
    >>> [(span.low, span.high) for span in panel.of(Span)]
    [(2.5, 3.0)]
    """
    top = 1.3 * max(2.0 * bound, float(condition.max(initial=1.0)))
    spans = _runs(frequency, ~usable)
    return Panel(
        x=Axis(
            label="Frequency (Hz)", scale="log", low=float(frequency[0]), high=float(frequency[-1])
        ),
        y=Axis(label="Condition number (–)", scale="log", low=0.9, high=top),
        items=(
            *(
                Span(low=low, high=high, colour="limit", opacity=0.12, label="not distinguished")
                for low, high in spans
            ),
            Curve(x=frequency, y=condition, label="inputs"),
            Rule(at=bound, axis="y", label="bound"),
        ),
        title=title,
    )


def _runs(x: NDArray[np.float64], where: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Ends of the stretches where something holds, half a step to either side."""
    steps = np.diff(np.concatenate(([False], where, [False])).astype(int))
    edges = np.concatenate((x[:1], 0.5 * (x[1:] + x[:-1]), x[-1:]))
    return [
        (float(edges[a]), float(edges[b]))
        for a, b in zip(np.flatnonzero(steps == 1), np.flatnonzero(steps == -1), strict=True)
    ]
