"""A described picture on a page: drawn by Plotly, thinned here, refilled on zoom."""

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from nicegui import events
from nicegui.element import Element

from hmpim.plots.description import Figure
from hmpim.workbench.drawn import changes, drawn, refilled

__all__ = ["Cursor", "Picture"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Cursor:
    """A line that can be dragged.

    Parameters
    ----------
    name : str
        By which it is known when it is dropped.
    at : float
        Where it stands, in data.
    label : str
        Beside it.
    panel : int
        Which panel of the figure it stands in, from 0.
    axis : {'x', 'y'}
        'x' for an upright line.
    """

    name: str
    at: float
    label: str
    panel: int = 0
    axis: str = "x"
    colour: str = "#b0417f"


class Picture(Element, component="picture.js"):
    """A picture on a page.

    Parameters
    ----------
    figure : Figure
        What is drawn. Curves may have any number of samples.
    cursors : sequence of Cursor
        Lines that can be dragged.
    on_cursor : callable, optional
        Called with a cursor's name and where it was dropped.
    ready : dict, optional
        The figure as `hmpim.workbench.drawn.drawn` returns it, where that was done elsewhere.
    """

    def __init__(
        self,
        figure: Figure,
        *,
        cursors: Sequence[Cursor] = (),
        on_cursor: Callable[[str, float], Any] | None = None,
        ready: dict[str, Any] | None = None,
    ) -> None:
        super().__init__()
        self._described = figure
        self._seen: tuple[int, float, float] | None = None  # panel and ends that are zoomed
        self._kept = True  # whether the page holds the points that were sent last
        self._set(figure, cursors, ready)
        self.on("zoom", self._zoom)
        if on_cursor is not None:
            wanted = on_cursor

            async def dropped(event: events.GenericEventArguments) -> None:
                result = wanted(str(event.args["name"]), float(event.args["at"]))
                if result is not None:
                    await result

            self.on("cursor", dropped)

    def show(self, figure: Figure, *, cursors: Sequence[Cursor] = ()) -> None:
        """Draw another figure in its place; what is zoomed stays so.

        What of it is new goes to this picture alone: the page around it is not drawn anew.
        """
        before, self._kept = self._props["figure"] if self._kept else None, True
        self._described = figure
        with self._props.suspend_updates():  # else it went twice
            self._set(figure, cursors)
        new = changes(self._props["figure"], before)
        self.run_method("show", new, self._props["alt"], self._props["cursors"])

    def _set(
        self, figure: Figure, cursors: Sequence[Cursor], ready: dict[str, Any] | None = None
    ) -> None:
        self._props["figure"] = drawn(figure, seen=self._seen) if ready is None else ready
        self._props["alt"] = figure.alt
        self._props["cursors"] = [
            {
                "name": c.name,
                "at": c.at,
                "label": c.label,
                "panel": "" if c.panel == 0 else str(c.panel + 1),
                "axis": c.axis,
                "colour": c.colour,
            }
            for c in cursors
        ]

    async def _zoom(self, event: events.GenericEventArguments) -> None:
        panel = int(event.args["panel"] or 1) - 1
        low, high = event.args["low"], event.args["high"]
        self._seen = None if low is None or high is None else (panel, low, high)
        self._kept = False
        described = self._described
        curves = await asyncio.to_thread(refilled, described, panel, low, high)
        if not self.is_deleted and self._described is described:  # else it was drawn meanwhile
            self.run_method("refill", curves)
            self._kept = False
