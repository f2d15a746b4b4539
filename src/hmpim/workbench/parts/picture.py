"""A described picture on a page: drawn by Plotly, thinned here, refilled on zoom."""

import base64
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from nicegui import events
from nicegui.element import Element
from numpy.typing import NDArray

from hmpim.plots.description import Curve, Figure, Panel

__all__ = ["Cursor", "Picture", "packed", "zoomed"]

MOST = 2000
"""Points of a curve that are sent: more than a page has columns."""


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
    """

    def __init__(
        self,
        figure: Figure,
        *,
        cursors: Sequence[Cursor] = (),
        on_cursor: Callable[[str, float], Any] | None = None,
    ) -> None:
        super().__init__()
        self._described = figure
        self._seen: tuple[int, float, float] | None = None  # panel and ends that are zoomed
        self._set(figure, cursors)
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

        The figure goes to this picture alone: the page around it is not drawn anew.
        """
        self._described = figure
        with self._props.suspend_updates():  # else it went twice
            self._set(figure, cursors)
        self.run_method("show", *(self._props[name] for name in ("figure", "alt", "cursors")))

    def _set(self, figure: Figure, cursors: Sequence[Cursor]) -> None:
        drawn = figure.to_plotly(most_points=MOST)
        if self._seen is not None:
            drawn["data"] = zoomed(figure, *self._seen).to_plotly(most_points=MOST)["data"]
        drawn["layout"]["uirevision"] = "kept"
        self._props["figure"] = packed(drawn)
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

    def _zoom(self, event: events.GenericEventArguments) -> None:
        panel = int(event.args["panel"] or 1) - 1
        low, high = event.args["low"], event.args["high"]
        self._seen = None if low is None or high is None else (panel, low, high)
        figure = zoomed(self._described, panel, low, high)
        drawn = figure.to_plotly(most_points=MOST)["data"]
        curves = [
            {"index": k, "x": packed(trace["x"]), "y": packed(trace["y"])}
            for k, trace in enumerate(drawn)
            if trace.get("mode", "") == "lines" and "fill" not in trace
        ]
        self.run_method("refill", curves)


def zoomed(figure: Figure, panel: int, low: float | None, high: float | None) -> Figure:
    """Return a figure whose curves hold what is seen between two ends, and one sample beyond.

    Parameters
    ----------
    figure : Figure
        As it was described.
    panel : int
        Panel that was zoomed; those that share its axis follow.
    low, high : float or None
        Ends in data, as logarithms on a logarithmic axis; None for all.

    Examples
    --------
    >>> import numpy as np
    >>> from hmpim.plots.description import Axis
    >>> curve = Curve(x=np.arange(100.0), y=np.zeros(100))
    >>> whole = Figure(panels=(Panel(x=Axis(), y=Axis(), items=(curve,)),), alt="A line.")
    >>> zoomed(whole, 0, 10.2, 19.5).panels[0].items[0].x.size
    11
    """
    if low is None or high is None or panel >= len(figure.panels):
        return figure
    column = figure.panels[panel].column
    return replace(
        figure,
        panels=tuple(
            _cut(p, low, high) if k == panel or (figure.share_x and p.column == column) else p
            for k, p in enumerate(figure.panels)
        ),
    )


def _cut(panel: Panel, low: float, high: float) -> Panel:
    ends = (10.0**low, 10.0**high) if panel.x.scale == "log" else (low, high)

    def cut(curve: Curve) -> Curve:
        first = max(int(np.searchsorted(curve.x, ends[0])) - 1, 0)
        last = int(np.searchsorted(curve.x, ends[1], side="right")) + 1
        return replace(curve, x=curve.x[first:last], y=curve.y[first:last])

    items = tuple(cut(item) if isinstance(item, Curve) else item for item in panel.items)
    return replace(panel, items=items)


def packed(value: Any) -> Any:
    """Return plain values with every array as base64 of its bytes.

    Examples
    --------
    >>> import numpy as np
    >>> packed({"x": np.array([1.0])})
    {'x': {'dtype': 'f8', 'bdata': 'AAAAAAAA8D8='}}
    """
    if isinstance(value, np.ndarray):
        return _packed_array(value)
    if isinstance(value, dict):
        return {key: packed(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [packed(one) for one in value]
    return value.item() if isinstance(value, np.generic) else value


def _packed_array(array: NDArray[Any]) -> Any:
    if array.dtype.kind not in "fiu":
        return array.tolist()
    kind = "f4" if array.ndim > 1 else "f8"
    data = np.ascontiguousarray(array, dtype=f"<{kind}")
    out: dict[str, Any] = {"dtype": kind, "bdata": base64.b64encode(data.tobytes()).decode()}
    return out | ({"shape": list(array.shape)} if array.ndim > 1 else {})
