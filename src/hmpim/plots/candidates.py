"""The structures that were tried, and how far each stands behind the best."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from hmpim.plots.description import Axis, Bars, Figure, Panel, Words
from hmpim.record import INTERSAMPLE_WORDS

if TYPE_CHECKING:
    from hmpim.identify import Candidate

__all__ = ["candidates"]

MOST_BARS = 12
_ROOM = 100.0
"""End of the axis over the longest bar: the words behind it stay clear of it on a phone."""


def candidates(tried: "Sequence[Candidate]") -> Figure:
    """Describe how much each structure's criterion is above the lowest.

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
    >>> [words for _, words in figure.panels[0].y.ticks]
    ['first order, held', 'static, held']
    """
    ranked = sorted(tried, key=lambda c: c.criterion)[:MOST_BARS]
    lead = [float(c.criterion - ranked[0].criterion) for c in ranked]
    names = [f"{c.structure.replace('_', ' ')}, {INTERSAMPLE_WORDS[c.intersample]}" for c in ranked]
    places = tuple(float(k) for k in range(len(ranked)))
    bars = Bars(
        y=places,
        length=tuple(lead),
        colours=tuple("other" if c.chosen else "muted" for c in ranked),
    )
    words = [
        Words(x=x, y=y, text=_fit(c, named=c.chosen or y == 0.0))
        for c, x, y in zip(ranked, lead, places, strict=True)
    ]
    return Figure(
        panels=(
            Panel(
                x=Axis(
                    label="Criterion above the lowest (BIC, lower is better)",
                    scale="symlog",
                    low=0.0,
                    high=max(max(lead) * _ROOM, 10.0),
                ),
                y=Axis(
                    low=len(ranked) - 0.5,
                    high=-0.5,
                    ticks=tuple(zip(places, names, strict=True)),
                    grid=False,
                ),
                items=(bars, *words),
            ),
        ),
        alt="Structures by how far their criterion is above the lowest: "
        + ", ".join(f"{name} {above:.3g}" for name, above in zip(names, lead, strict=True))
        + ".",
        heights=(0.7 + 0.26 * len(ranked),),
    )


def _fit(tried: "Candidate", *, named: bool) -> str:
    """What stands behind a bar; short, but for those that say what the number is."""
    percent = f"{tried.fit_percent:.2f} %"
    return f"fit {percent}" + (", chosen" if tried.chosen else "") if named else percent
