"""A description as Plotly takes it: plain dicts with NumPy arrays, for the workbench.

No Plotly is needed to make them: its own figure objects, its JavaScript and NiceGUI take the
same dicts. Reference: https://plotly.com/javascript/reference/.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmpim.plots.description import (
    Axis,
    Band,
    Bars,
    Curve,
    Dashes,
    Figure,
    Image,
    Item,
    Marker,
    Panel,
    Points,
    Rule,
    Span,
    Words,
)
from hmpim.plots.draw.frames import Frame, frames, on_left, placed, ticks
from hmpim.plots.envelope import envelope
from hmpim.plots.style import COLOURS, Colour

__all__ = ["draw"]

_DASHES: dict[Dashes, str] = {"-": "solid", "--": "dash", "-.": "dashdot", ":": "dot"}
_MARKERS: dict[Marker, str] = {
    "": "circle", "o": "circle", "s": "square", "^": "triangle-up", "v": "triangle-down",
    "x": "x-thin-open", "+": "cross-thin-open",
}  # fmt: skip
_PER_INCH = 96.0
_GAP = 0.09  # between columns, as a share of the width
_CLEAR = 6  # px between an axis's numbers and its name
_ABOVE, _BELOW = 40, 52  # px beside the panels: legend; numbers and name of the axis


def draw(figure: Figure, *, most_points: int = 4000) -> dict[str, Any]:
    """Return the described picture as ``{"data": [...], "layout": {...}}``.

    Parameters
    ----------
    figure : Figure
        What to draw.
    most_points : int
        A longer curve is thinned to so many, its peaks kept.

    Returns
    -------
    dict
        Arrays stay NumPy arrays. ``layout["meta"]["alt"]`` is the text for those who cannot
        see it; every axis has the panel's own name, so that a cursor can be tied to it.

    Examples
    --------
    >>> curve = Curve(x=np.array([1.0, 10.0]), y=np.zeros(2), label="nothing")
    >>> panel = Panel(x=Axis(scale="log"), y=Axis(label="y (V)"), items=(curve,))
    >>> drawn = draw(Figure(panels=(panel,), alt="A line."))
    >>> drawn["data"][0]["name"], drawn["layout"]["xaxis"]["type"], drawn["layout"]["meta"]["alt"]
    ('nothing', 'log', 'A line.')
    """
    data: list[dict[str, Any]] = []
    layout: dict[str, Any] = {
        "meta": {"alt": figure.alt},
        "height": round(_PER_INCH * _inches(figure) + _ABOVE + _BELOW),
        "margin": {"l": 64, "r": 16, "t": _ABOVE, "b": _BELOW},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "legend": {"orientation": "h", "x": 1.0, "xanchor": "right", "y": 1.0, "yanchor": "bottom"},
        "hovermode": "x",
        "shapes": [],
        "annotations": [],
    }
    named: set[str] = set()
    first_of_column: dict[int, str] = {}
    for k, (panel, frame) in enumerate(zip(figure.panels, frames(figure), strict=True)):
        number = "" if k == 0 else str(k + 1)
        layout[f"xaxis{number}"] = {
            **_axis(panel.x, frame.x), "domain": _width(figure, panel), "anchor": f"y{number}"
        }  # fmt: skip
        layout[f"yaxis{number}"] = {
            **_axis(panel.y, frame.y), "domain": _height(figure, panel), "anchor": f"x{number}"
        }  # fmt: skip
        if figure.share_x and panel.column in first_of_column:
            layout[f"xaxis{number}"]["matches"] = first_of_column[panel.column]
        first_of_column.setdefault(panel.column, f"x{number}")
        if panel.title:
            layout["annotations"].append(
                {
                    "text": _safe(panel.title), "showarrow": False, "x": 0.0, "y": 1.0,
                    "xref": f"x{number} domain", "yref": f"y{number} domain",
                    "xanchor": "left", "yanchor": "bottom",
                }
            )  # fmt: skip
        for item in panel.items:
            traces, shapes, notes = _item(item, panel, frame, most_points)
            for trace in traces:
                trace |= {"xaxis": f"x{number}", "yaxis": f"y{number}"}
                trace["showlegend"] = bool(trace.get("showlegend")) and trace["name"] not in named
                named |= {trace["name"]} if trace["showlegend"] else set()
            data += traces
            layout["shapes"] += [_tied(shape, number) for shape in shapes]
            layout["annotations"] += [_tied(note, number) for note in notes]
    return {"data": data, "layout": layout}


def _axis(axis: Axis, ends: tuple[float, float]) -> dict[str, Any]:
    out: dict[str, Any] = {
        "title": {"text": _safe(axis.label), "standoff": _CLEAR},
        "type": "log" if axis.scale == "log" else "linear",
        "range": [float(v) for v in placed(np.array(ends), axis.scale)],
        "showgrid": axis.grid,
        "gridcolor": COLOURS["grid"],
        "linecolor": COLOURS["muted"],
        "showline": True,
        "zeroline": False,
        "showticklabels": axis.numbered,
        "automargin": True,
    }
    if axis.ticks is not None or axis.scale == "symlog":
        marks = ticks(axis, ends)
        places = np.array([at for at, _ in marks])
        if axis.scale == "symlog":
            places = placed(places, "symlog")
        out |= {"tickmode": "array", "tickvals": places, "ticktext": [w for _, w in marks]}
    elif axis.scale == "log":
        # As many ticks as 1, 2 and 5 of each decade; without a format, 2 and 5 lack their power.
        out |= {"nticks": max(4, int(abs(np.log10(ends[1] / ends[0])) / 0.31)), "tickformat": "~g"}
    elif axis.degrees:
        marks = ticks(axis, ends)
        if len(marks) > 1:
            out |= {"tick0": 0.0, "dtick": marks[1][0] - marks[0][0]}
    return out


def _width(figure: Figure, panel: Panel) -> list[float]:
    each = (1.0 - _GAP * (figure.columns - 1)) / figure.columns
    left = panel.column * (each + _GAP)
    return [left, min(left + panel.columns * each + (panel.columns - 1) * _GAP, 1.0)]


def _height(figure: Figure, panel: Panel) -> list[float]:
    """Share of the height, from below; panels that share an axis stand closer."""
    whole = _inches(figure)
    above = sum(figure.heights[: panel.row]) + _between(figure) * panel.row
    top = 1.0 - above / whole
    return [max(top - figure.heights[panel.row] / whole, 0.0), top]


def _inches(figure: Figure) -> float:
    """From the top of the first panel to the foot of the last."""
    return sum(figure.heights) + _between(figure) * (len(figure.heights) - 1)


def _between(figure: Figure) -> float:
    """Inches between two panels: room for a title, and for an axis of its own."""
    return 0.25 if figure.share_x else 0.75


_Parts = tuple[list[dict[str, Any]], list[dict[str, Any]], list[dict[str, Any]]]


def _item(item: Item, panel: Panel, frame: Frame, most_points: int) -> _Parts:
    """Traces, shapes and annotations of an item."""
    x, y = _across(panel.x), _across(panel.y)
    if isinstance(item, Curve):
        spacing = "log" if panel.x.scale == "log" else "linear"
        shown = envelope(item.x, item.y, most_points=max(most_points, 4), spacing=spacing)  # type: ignore[arg-type]
        line = {"color": COLOURS[item.colour], "width": 1.3 * item.width}
        trace = {
            "type": "scatter", "mode": "lines+markers" if item.marker else "lines",
            "x": x(shown[0]), "y": y(shown[1]), "opacity": item.opacity, "connectgaps": False,
            "line": {**line, "dash": _DASHES[item.dashes]},
            "marker": {"symbol": _MARKERS[item.marker], "size": 1.5 * item.size},
        }  # fmt: skip
        return [_named(trace, item.label)], [], []
    if isinstance(item, Band):
        return _band(item, x, y, frame), [], []
    if isinstance(item, Points):
        return [_points(item, x, y)], [], []
    if isinstance(item, Rule):
        return _rule(item, panel, frame)
    if isinstance(item, Span):
        return [], [_box(item.axis, item.low, item.high, item.colour, item.opacity)], []
    if isinstance(item, Words):
        return [], [], [_words(item, panel)]
    if isinstance(item, Bars):
        colours = [COLOURS[c] for c in item.colours]
        trace = {
            "type": "bar", "orientation": "h", "x": x(np.array(item.length)),
            "y": y(np.array(item.y)), "width": 0.6, "marker": {"color": colours},
        }  # fmt: skip
        return [_named(trace, "")], [], []
    return [_image(item)], [], []


def _across(axis: Axis) -> Any:
    """Return what moves data on an axis that Plotly does not have."""
    if axis.scale == "symlog":
        return lambda values: placed(values, "symlog")
    return lambda values: values


def _band(item: Band, x: Any, y: Any, frame: Frame) -> list[dict[str, Any]]:
    room = 10.0 * abs(frame.y[1] - frame.y[0])
    edges = []
    for values, name in ((item.low, ""), (item.high, item.label)):
        inside = np.clip(values, min(frame.y) - room, max(frame.y) + room)
        edge = {
            "type": "scatter", "mode": "lines", "x": x(item.x), "y": y(inside),
            "line": {"width": 0, "color": COLOURS[item.colour]}, "hoverinfo": "skip",
        }  # fmt: skip
        edges.append(_named(edge, name))
    edges[1] |= {"fill": "tonexty", "fillcolor": _tinted(item.colour, item.opacity)}
    return edges


def _points(item: Points, x: Any, y: Any) -> dict[str, Any]:
    colour = COLOURS[item.colour]
    symbol = _MARKERS[item.marker] + ("" if item.filled else "-open")
    trace: dict[str, Any] = {
        "type": "scatter", "mode": "markers", "x": x(item.x), "y": y(item.y),
        "marker": {"symbol": symbol, "size": 1.5 * item.size, "color": colour},
    }  # fmt: skip
    if item.low is not None and item.high is not None:
        trace["error_y"] = {
            "type": "data", "symmetric": False, "array": item.high - item.y,
            "arrayminus": item.y - item.low, "thickness": 1.0, "width": 0, "color": colour,
        }  # fmt: skip
    return _named(trace, item.label)


def _rule(item: Rule, panel: Panel, frame: Frame) -> _Parts:
    line: dict[str, Any] = {
        **_box(item.axis, item.at, item.at, item.colour, 0.0), "type": "line",
        "line": {"color": COLOURS[item.colour], "width": item.width, "dash": _DASHES[item.dashes]},
    }  # fmt: skip
    shapes = [line]
    if item.low is not None and item.high is not None:
        shapes.insert(0, _box(item.axis, item.low, item.high, item.colour, 0.18))
    if not item.words:
        return [], shapes, []
    axis = panel.x if item.axis == "x" else panel.y
    at = float(placed(np.array([item.at]), axis.scale)[0])  # annotations take the logarithm
    note = {
        "text": _safe(item.words), "showarrow": False, "font": {"color": COLOURS[item.colour]},
        "bgcolor": _tinted("paper", 0.8),
    }  # fmt: skip
    if item.axis == "x":
        left = on_left(item, panel.x, frame.x)
        note |= {
            "x": at, "xref": "x", "y": item.words_at, "yref": "y domain", "yanchor": "top",
            "xanchor": "right" if left else "left",
        }  # fmt: skip
    else:
        note |= {
            "x": item.words_at, "xref": "x domain", "y": at, "yref": "y", "yanchor": "bottom",
            "xanchor": "left",
        }  # fmt: skip
    return [], shapes, [note]


def _box(axis: str, low: float, high: float, colour: Colour, opacity: float) -> dict[str, Any]:
    """Return a field across the panel; shapes take data as they are, on every scale."""
    other = "y" if axis == "x" else "x"
    return {
        "type": "rect", f"{axis}0": low, f"{axis}1": high, f"{axis}ref": axis,
        f"{other}0": 0.0, f"{other}1": 1.0, f"{other}ref": f"{other} domain",
        "fillcolor": _tinted(colour, opacity), "line": {"width": 0}, "layer": "below",
    }  # fmt: skip


def _words(item: Words, panel: Panel) -> dict[str, Any]:
    share = item.at == "share"
    x, y = (
        value if share else float(placed(np.array([value]), axis.scale)[0])
        for value, axis in ((item.x, panel.x), (item.y, panel.y))
    )
    return {
        "text": _safe(item.text), "showarrow": False, "font": {"color": COLOURS[item.colour]},
        "x": x, "y": y, "xref": "x domain" if share else "x", "yref": "y domain" if share else "y",
        "xanchor": {"left": "left", "middle": "center", "right": "right"}[item.anchor],
        "yanchor": "middle",
    }  # fmt: skip


def _image(item: Image) -> dict[str, Any]:
    rows, columns = item.values.shape

    def middles(ends: tuple[float, float], n: int) -> NDArray[np.float64]:
        return np.asarray(ends[0] + (np.arange(n) + 0.5) * (ends[1] - ends[0]) / n)

    return {
        "type": "heatmap", "z": item.values, "x": middles(item.x, columns),
        "y": middles(item.y, rows), "zmin": item.low, "zmax": item.high, "name": item.label,
        "colorscale": {"grey": "Greys", "viridis": "Viridis"}[item.palette],
        "reversescale": item.palette == "grey", "showscale": bool(item.label),
        "colorbar": {"title": {"text": _safe(item.label), "side": "right"}},
    }  # fmt: skip


def _named(trace: dict[str, Any], label: str) -> dict[str, Any]:
    return {**trace, "name": _safe(label), "showlegend": bool(label)}


def _tied(part: dict[str, Any], number: str) -> dict[str, Any]:
    """Tie a shape or an annotation to the axes of its panel."""
    tied = dict(part)
    for key in ("xref", "yref"):
        if key in tied and len(tied[key].split()[0]) == 1:
            tied[key] = tied[key][0] + number + tied[key][1:]
    return tied


def _tinted(colour: Colour, opacity: float) -> str:
    red, green, blue = (int(COLOURS[colour][k : k + 2], 16) for k in (1, 3, 5))
    return f"rgba({red},{green},{blue},{opacity:g})"


def _safe(text: str) -> str:
    """Keep a foreign name from being read as markup."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
