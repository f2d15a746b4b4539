"""Several inputs at once: how well they are told apart, how much of each output they explain."""

from typing import TYPE_CHECKING, Literal

import numpy as np

from hmpim.plots.style import (
    COLOURS,
    Colour,
    draw_legend,
    draw_level,
    draw_line,
    finish_axes,
    new_figure,
    plain,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hmpim.identify import InputSet

__all__ = ["inputs_plot"]

_BOUND = 10.0
_TOP = 1e4
_COLOURS: tuple[Colour, ...] = ("input", "output", "model", "limit", "other")
_DASHES: tuple[Literal["-", "--", ":", "-."], ...] = ("-", "--", ":", "-.")


def inputs_plot(inputs: "InputSet") -> "Figure":
    """Draw the condition of the inputs over frequency, and each output's multiple coherence.

    Parameters
    ----------
    inputs : InputSet
        `Identification.inputs`.

    Examples
    --------
    >>> from hmpim.identify.coupling.inputs import input_set
    >>> t = np.arange(2000) / 200
    >>> up = np.sin(2 * np.pi * (0.1 * t + t**2))
    >>> figure = inputs_plot(input_set([up, up[::-1]], ["a", "b"], 200.0))
    >>> figure.axes[0].get_ylabel()
    'Condition number (–)'
    """
    shown = [c for c in inputs.coherence if c.frequency.size]
    figure, axes = new_figure(2 if shown else 1, height=2.4)
    condition = np.minimum(inputs.condition, _TOP)
    top = max(2.0 * _BOUND, float(condition.max())) * 1.3
    above = axes[0]
    above.fill_between(
        inputs.frequency,
        0.9,
        top,
        where=~inputs.usable,
        color=COLOURS["limit"],
        alpha=0.12,
        linewidth=0,
        step="mid",
        label=None if inputs.usable.all() else "not told apart",
    )
    draw_line(above, inputs.frequency, condition, label="inputs", spacing="log")
    draw_level(above, (_BOUND,), label="bound")
    above.set_yscale("log")
    above.set_ylim(0.9, top)
    above.set_xlim(float(inputs.frequency[0]), float(inputs.frequency[-1]))
    finish_axes(
        above,
        x="" if shown else "Frequency (Hz)",
        y="Condition number (–)",
        log_x=True,
    )
    draw_legend(above)
    if shown:
        below = axes[1]
        for k, seen in enumerate(shown):
            draw_line(
                below,
                seen.frequency,
                seen.multiple,
                colour=_COLOURS[k % len(_COLOURS)],
                dashes=_DASHES[k % len(_DASHES)],
                label=plain(seen.output),
                spacing="log",
            )
        below.set_ylim(-0.02, 1.05)
        finish_axes(below, x="Frequency (Hz)", y="Multiple coherence (–)", log_x=True)
        draw_legend(below)
    return figure
