"""The structures that were tried, and how far each stands behind the best."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hmpim.plots.style import COLOURS, FONT_SIZE, finish_axes, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hmpim.identify import Candidate
    from hmpim.record import Intersample

__all__ = ["INTERSAMPLE_WORDS", "candidates"]

INTERSAMPLE_WORDS: "dict[Intersample, str]" = {
    "zoh": "held",
    "foh": "linear",
    "bandlimited": "band-limited",
}
"""What an input does between its samples, in words a reader knows."""

MOST_BARS = 12


def candidates(tried: "Sequence[Candidate]") -> "Figure":
    """Draw how much each structure's criterion is above the lowest.

    Parameters
    ----------
    tried : sequence of Candidate
        At least one; the best twelve are drawn, the best on top.

    Examples
    --------
    >>> from hmpim.identify import Candidate
    >>> figure = candidates([
    ...     Candidate(structure="static", intersample="zoh", criterion=90.0, fit_percent=50.0),
    ...     Candidate(structure="first_order", intersample="zoh", criterion=10.0,
    ...               fit_percent=99.0, chosen=True)])
    >>> [label.get_text() for label in figure.axes[0].get_yticklabels()]
    ['first order, held', 'static, held']
    """
    ranked = sorted(tried, key=lambda c: c.criterion)[:MOST_BARS]
    lead = np.array([c.criterion - ranked[0].criterion for c in ranked])
    places = np.arange(len(ranked))
    figure, (axes,) = new_figure(1, height=0.7 + 0.26 * len(ranked))
    colours = [COLOURS["other"] if c.chosen else COLOURS["muted"] for c in ranked]
    axes.barh(places, lead, height=0.6, color=colours)
    axes.set_xscale("symlog", linthresh=10.0)
    axes.set_xlim(0.0, max(float(lead.max()) * 6.0, 10.0))
    for place, value, tried_one in zip(places, lead, ranked, strict=True):
        words = f"fit {tried_one.fit_percent:.2f} %" + (", chosen" if tried_one.chosen else "")
        axes.annotate(
            words,
            xy=(float(value), float(place)),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            fontsize=FONT_SIZE - 1,
            color=COLOURS["ink"],
        )
    labels = [
        f"{c.structure.replace('_', ' ')}, {INTERSAMPLE_WORDS[c.intersample]}" for c in ranked
    ]
    axes.set_yticks(places, labels)
    axes.invert_yaxis()
    finish_axes(axes, x="Criterion above the lowest (BIC, lower is better)")
    axes.grid(visible=False, axis="y")
    return figure
