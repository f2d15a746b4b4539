"""Described pictures as a page takes them: thinned, zoomed, arrays as bytes and never as lists."""

import base64
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmpim.plots.description import Curve, Figure, Panel

__all__ = ["MOST", "changes", "drawn", "packed", "refilled", "zoomed"]

MOST = 2000
"""Points of a curve that are sent: more than a page has columns."""
_POINTS = ("x", "y", "z")  # of a trace: what may be long


def drawn(figure: Figure, *, seen: tuple[int, float, float] | None = None) -> dict[str, Any]:
    """Return a figure as a page takes it; a long one takes a while.

    Parameters
    ----------
    figure : Figure
        Curves may have any number of samples.
    seen : (int, float, float), optional
        Panel that is zoomed, and its ends, as `zoomed` takes them.
    """
    whole = figure.to_plotly(most_points=MOST)
    if seen is not None:
        whole["data"] = zoomed(figure, *seen).to_plotly(most_points=MOST)["data"]
    whole["layout"]["uirevision"] = "kept"
    plain: dict[str, Any] = packed(whole)
    return plain


def changes(now: dict[str, Any], before: dict[str, Any] | None) -> dict[str, Any]:
    """Return a drawn figure without what a page has already.

    Parameters
    ----------
    now, before : dict
        As `drawn` returns them; None before anything was sent.

    Returns
    -------
    dict
        ``layout`` is None where it is as it was, and each trace names in ``kept`` the points that
        are left out.

    Examples
    --------
    >>> before = {"data": [{"x": [1, 2], "y": [3, 4]}], "layout": {"height": 300}}
    >>> now = {"data": [{"x": [1, 2], "y": [5, 6]}], "layout": {"height": 300}}
    >>> changes(now, before)
    {'data': [{'y': [5, 6], 'kept': ['x']}], 'layout': None}
    """
    old = {"data": [], "layout": None} if before is None else before
    had = [*old["data"], *[{}] * len(now["data"])]
    sent = []
    for trace, other in zip(now["data"], had, strict=False):
        kept = [key for key in _POINTS if key in trace and trace[key] == other.get(key)]
        rest = {key: value for key, value in trace.items() if key not in kept}
        sent.append({**rest, "kept": kept})
    return {"data": sent, "layout": None if now["layout"] == old["layout"] else now["layout"]}


def refilled(
    figure: Figure, panel: int, low: float | None, high: float | None
) -> list[dict[str, Any]]:
    """Return the curves of a figure that was zoomed, thinned again between the ends that are seen.

    Parameters
    ----------
    figure, panel, low, high
        As for `zoomed`.
    """
    traces = zoomed(figure, panel, low, high).to_plotly(most_points=MOST)["data"]
    return [
        {"index": k, "x": packed(trace["x"]), "y": packed(trace["y"])}
        for k, trace in enumerate(traces)
        if trace.get("mode", "") == "lines" and "fill" not in trace
    ]


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
