"""An error bar that closes in on what was asked, while a test goes on."""

from collections.abc import Sequence

import numpy as np

from hmpim.plots.description import Axis, Curve, Figure, Panel, Rule

__all__ = ["closing_bars"]


def closing_bars(
    times: Sequence[float], errors: Sequence[float], *, wanted: float, name: str
) -> Figure:
    """Describe how an error bar shrinks with the time of a test.

    Parameters
    ----------
    times : sequence of float
        When was looked, in s.
    errors : sequence of float
        Half of the 95 % interval at each look, positive, in % of the value.
    wanted : float
        What is asked, in the same measure.
    name : str
        Of the parameter.

    Examples
    --------
    >>> figure = closing_bars([2.0, 4.0], [9.0, 3.0], wanted=5.0, name="Natural frequency")
    >>> figure.panels[0].y.label, figure.panels[0].items[1].at
    ('Natural frequency, ± %', 5.0)
    """
    x, y = np.asarray(times, dtype=np.float64), np.asarray(errors, dtype=np.float64)
    last = f"{y[-1]:.3g}" if y.size else "unknown"
    return Figure(
        panels=(
            Panel(
                x=Axis(label="Time (s)", low=0.0),
                y=Axis(label=f"{name}, ± %", scale="log"),
                items=(
                    Curve(x=x, y=y, marker="o", label="95 % interval so far"),
                    Rule(at=wanted, axis="y", label="wanted"),
                ),
            ),
        ),
        alt=f"{name}: the 95 % interval is ± {last} % now; ± {wanted:g} % is wanted.",
        heights=(2.0,),
    )
