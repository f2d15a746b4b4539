"""How well the stimuli of several axes can be told apart, over frequency."""

from typing import TYPE_CHECKING

import numpy as np

from hmpim.plots.style import (
    COLOURS,
    draw_legend,
    draw_level,
    draw_line,
    finish_axes,
    new_figure,
    plain,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hmpim.stimulus.axes import InputCondition

__all__ = ["input_condition_plot"]


def input_condition_plot(found: "InputCondition") -> "Figure":
    """Draw the condition number of the input spectra, its bound, and where that is passed.

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
    >>> figure.axes[0].get_ylabel()
    'Condition number (–)'
    """
    figure, (axes,) = new_figure(1, height=2.8)
    shown = np.where(np.isfinite(found.condition), found.condition, np.nan)
    top = max(2.0 * found.bound, float(np.nanmax(shown, initial=1.0)))
    shown = np.where(np.isfinite(shown), shown, top)
    axes.fill_between(
        found.frequency,
        1.0,
        top * 1.3,
        where=~found.usable,
        color=COLOURS["limit"],
        alpha=0.12,
        linewidth=0,
        step="mid",
        label=None if found.usable.all() else "not told apart",
    )
    draw_line(axes, found.frequency, shown, label="inputs", spacing="log")
    draw_level(axes, (found.bound,), label="bound")
    axes.set_yscale("log")
    axes.set_ylim(0.9, top * 1.3)
    axes.set_xlim(float(found.frequency[0]), float(found.frequency[-1]))
    finish_axes(
        axes,
        x="Frequency (Hz)",
        y="Condition number (–)",
        title=f"{', '.join(map(plain, found.names))}: {100 * found.share:.0f} % usable",
        log_x=True,
    )
    draw_legend(axes)
    return figure
