"""Several inputs at once: how well they are told apart, how much of each output they explain."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hmpim.plots.condition import condition_panel
from hmpim.plots.description import Axis, Curve, Dashes, Figure, Panel
from hmpim.plots.style import Colour, plain

if TYPE_CHECKING:
    from hmpim.identify import InputSet

__all__ = ["inputs_plot"]

_BOUND = 10.0
_TOP = 1e4
_COLOURS: tuple[Colour, ...] = ("input", "output", "model", "limit", "other")
_DASHES: tuple[Dashes, ...] = ("-", "--", ":", "-.")


def inputs_plot(inputs: "InputSet") -> Figure:
    """Describe the condition of the inputs over frequency, and each output's multiple coherence.

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
    >>> figure.panels[0].y.label
    'Condition number (–)'
    """
    shown = [c for c in inputs.coherence if c.frequency.size]
    condition = np.minimum(inputs.condition, _TOP)
    above = condition_panel(inputs.frequency, condition, inputs.usable, bound=_BOUND)
    panels = [above]
    if shown:
        below = Panel(
            x=above.x,
            y=Axis(label="Multiple coherence (–)", low=-0.02, high=1.05),
            items=tuple(
                Curve(
                    x=seen.frequency,
                    y=seen.multiple,
                    colour=_COLOURS[k % len(_COLOURS)],
                    dashes=_DASHES[k % len(_DASHES)],
                    label=plain(seen.output),
                )
                for k, seen in enumerate(shown)
            ),
            row=1,
        )
        panels = [replace(above, x=replace(above.x, label="", numbered=False)), below]
    return Figure(
        panels=tuple(panels),
        alt="Condition number of the inputs over frequency"
        + (f", and multiple coherence of {len(shown)} outputs." if shown else "."),
        heights=(2.4,) * len(panels),
    )
