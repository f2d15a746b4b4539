"""The trade of section III: how gentle a stimulus can be, against the accuracy it buys."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hmpim.plots.style import COLOURS, FONT_SIZE, draw_legend, draw_line, finish_axes, new_figure
from hmpim.units import rate_label

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hmpim.optimal import Gentle, Gentlest, TradePoint

__all__ = ["gentle_label", "trade_plot"]

_WORDS: "dict[Gentle, str]" = {
    "peak_acceleration": "Peak acceleration",
    "rms_acceleration": "R.m.s. acceleration",
    "travel": "Distance moved",
    "duration": "Duration",
}


def gentle_label(gentle: "Gentle", unit: str) -> str:
    """Name of what is kept small, with its unit.

    Examples
    --------
    >>> gentle_label("travel", "deg"), gentle_label("peak_acceleration", "deg")
    ('Distance moved (deg)', 'Peak acceleration (deg/s²)')
    """
    orders = {"peak_acceleration": 2, "rms_acceleration": 2, "travel": 0}
    of = "s" if gentle == "duration" else rate_label(unit, orders[gentle])
    return f"{_WORDS[gentle]} ({of or '–'})"


def trade_plot(found: "Gentlest", points: "Sequence[TradePoint]") -> "Figure":
    """Draw what each accuracy costs, what was wanted, and what the other families cost.

    Parameters
    ----------
    found : Gentlest
        The result.
    points : sequence of TradePoint
        From `hmpim.optimal.trade`.

    Examples
    --------
    >>> from hmpim.optimal import Accuracy, RoughModel, gentlest, trade
    >>> from hmpim.stimulus import Limits
    >>> found = gentlest(accuracy=Accuracy(), noise_std=0.1, fs=100.0, duration=3.0,
    ...     model=RoughModel(natural_frequency=5, damping_ratio=0.5),
    ...     limits=Limits(position=10, unit="deg"), families=("multisine",))
    >>> trade_plot(found, trade(found, factors=(1.0,))).axes[0].get_ylabel()
    'Peak acceleration (deg/s²)'
    """
    figure, (axes,) = new_figure(1, height=3.2)
    met = sorted((p.factor, p.value) for p in points if p.value is not None)
    factor = np.array([f for f, _ in met])
    value = np.array([v for _, v in met])
    draw_line(axes, factor, value, label=found.family)
    axes.plot(factor, value, "o", color=COLOURS["input"], markersize=4)
    missed = [p.factor for p in points if p.value is None]
    all_factors = [p.factor for p in points] + [1.0]
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(min(all_factors) / 1.15, max(all_factors) * 1.15)
    if missed:
        axes.axvspan(
            min(all_factors) / 1.15,
            max(missed),
            color=COLOURS["limit"],
            alpha=0.10,
            linewidth=0,
            label="beyond the limits",
        )
    for candidate in found.candidates[1:]:
        if candidate.use <= 1.0:
            axes.plot(1.0, candidate.value, "s", color=COLOURS["muted"], markersize=5)
            axes.annotate(
                candidate.family,
                xy=(1.0, candidate.value),
                xytext=(6, 0),
                textcoords="offset points",
                va="center",
                fontsize=FONT_SIZE - 1,
                color=COLOURS["ink"],
            )
    axes.plot(1.0, found.value, "o", color=COLOURS["output"], markersize=7, label="wanted")
    finish_axes(
        axes,
        x="Errors allowed, in times those wanted (–)",
        y=gentle_label(found.wish.gentle, found.wish.limits.unit),
        title="Gentleness against accuracy",
    )
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda number, _: f"{number:g}"))
        axis.set_minor_formatter(NullFormatter())
    draw_legend(axes)
    return figure
