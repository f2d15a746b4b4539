"""One parameter over several runs, with its error bars and what it should be."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hmpim.plots.description import Axis, Figure, Panel, Points, Rule
from hmpim.plots.style import axis_label, plain

if TYPE_CHECKING:
    from hmpim.identify import Estimate

__all__ = ["trend"]


def trend(
    labels: Sequence[str],
    estimates: Sequence["Estimate | None"],
    *,
    name: str = "value",
    specified: Sequence[tuple[str, float]] = (),
    mean: "Estimate | None" = None,
) -> Figure:
    """Describe how a parameter went from run to run.

    Parameters
    ----------
    labels : sequence of str
        Of the runs, in order of time.
    estimates : sequence of Estimate or None
        As many; None leaves a gap.
    name : str
        Of the parameter, for the axis.
    specified : sequence of (str, float)
        What it should be: words such as '> 9.12 Hz', and where the line stands.
    mean : Estimate, optional
        Over all runs: a line in its 95 % interval.

    Examples
    --------
    >>> from hmpim.identify import Estimate
    >>> first = Estimate(value=0.15, std=0.01, ci95=(0.13, 0.17), unit="s")
    >>> figure = trend(["a", "b"], [first, None], name="delay")
    >>> figure.panels[0].y.label, figure.panels[0].items[0].high.tolist()
    ('delay (s)', [0.17])
    """
    told = [(k, e) for k, e in enumerate(estimates) if e is not None]
    ends = [e.ci95 or (None, None) for _, e in told]
    low = [math.nan if a is None else a for a, _ in ends]
    high = [math.nan if b is None else b for _, b in ends]
    unit = told[0][1].unit if told else ""
    points = Points(
        x=np.array([float(k) for k, _ in told]),
        y=np.array([e.value for _, e in told]),
        low=np.array(low),
        high=np.array(high),
        label="value and 95 % interval",
        size=5.0,
    )
    rules = [
        Rule(
            at=at,
            axis="y",
            words=f"specified {words}",
            words_at=0.02,
            label="" if k else "specification",
            width=1.6,
        )
        for k, (words, at) in enumerate(specified)
    ]
    if mean is not None:
        least, most = mean.ci95 or (None, None)
        line = Rule(
            at=mean.value, low=least, high=most, axis="y", label="mean", colour="other", width=1.2
        )
        rules.append(line)
    ticks = tuple((float(k), plain(label)) for k, label in enumerate(labels))
    return Figure(
        panels=(
            Panel(
                x=Axis(low=-0.5, high=len(labels) - 0.5, ticks=ticks),
                y=Axis(label=axis_label(name, unit)),
                items=(points, *rules),
            ),
        ),
        alt=f"{name} in {len(told)} runs: "
        + ", ".join(f"{e.value:.4g}" for _, e in told)
        + "".join(f"; specified {words}" for words, _ in specified)
        + ".",
        heights=(2.4,),
    )
