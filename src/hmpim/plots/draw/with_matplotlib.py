"""A description drawn by matplotlib: for papers, documents and pictures made of dots.

Figures are `matplotlib.figure.Figure` objects and nothing global: no pyplot, no settings
changed. matplotlib is imported when the first picture is drawn, not before.
"""

import warnings
from functools import partial
from os import PathLike
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from hmpim.errors import ArgumentError
from hmpim.plots.description import (
    Band,
    Bars,
    Curve,
    Figure,
    Image,
    Item,
    Panel,
    Points,
    Rule,
    Span,
    Words,
)
from hmpim.plots.draw.frames import Frame, frames, legend_items, on_left, placed, ticks, unplaced
from hmpim.plots.envelope import envelope
from hmpim.plots.style import COLOURS, FONT_SIZE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as MatplotlibFigure

__all__ = ["draw", "save"]

_SMALL = FONT_SIZE - 1
_DASHES: dict[str, Any] = {"-": "-", "--": (0, (5, 2)), "-.": (0, (6, 2, 1, 2)), ":": (0, (1, 1.6))}


def save(
    figure: Figure,
    path: str | PathLike[str] | IO[bytes],
    *,
    dpi: float = 150.0,
    format: str | None = None,  # noqa: A002
) -> None:
    """Write a picture to a file, the same bytes each time.

    Parameters
    ----------
    figure : Figure
        What to draw.
    path : path-like
        The file to write.
    format : str, optional
        Such as "png"; taken from the file's ending by default.
    dpi : float
        Dots per inch, where the format has dots.

    Raises
    ------
    ArgumentError
        If the ending is no format that matplotlib writes.

    Examples
    --------
    >>> from hmpim.plots.description import Axis
    >>> save(Figure(panels=(Panel(x=Axis(), y=Axis()),), alt=""), "a.docx")
    Traceback (most recent call last):
    hmpim.errors.ArgumentError: 'a.docx' is not a picture; name it .svg, .png or .pdf
    """
    import matplotlib as mpl

    name = str(path) if isinstance(path, str | PathLike) else ""
    kind = format or Path(name).suffix.lower().removeprefix(".") or "png"
    drawn = draw(figure)
    if kind not in drawn.canvas.get_supported_filetypes():
        raise ArgumentError(f"{name!r} is not a picture; name it .svg, .png or .pdf")
    settings: dict[Any, Any] = {"svg.hashsalt": Path(name).name}
    stamp = {"svg": {"Date": None}, "png": {"Software": None}, "pdf": {"CreationDate": None}}
    with mpl.rc_context(settings), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        drawn.savefig(path, format=kind, dpi=dpi, metadata=stamp.get(kind))


def draw(figure: Figure) -> "MatplotlibFigure":
    """Return the described picture as a matplotlib figure.

    Parameters
    ----------
    figure : Figure
        What to draw.

    Examples
    --------
    >>> from hmpim.plots.description import Axis
    >>> curve = Curve(x=np.arange(3.0), y=np.zeros(3), label="nothing")
    >>> panel = Panel(x=Axis(label="Time (s)"), y=Axis(label="y (V)"), items=(curve,))
    >>> drawn = draw(Figure(panels=(panel,), alt="A line."))
    >>> len(drawn.axes[0].lines), drawn.axes[0].get_ylabel()
    (1, 'y (V)')
    """
    from matplotlib.figure import Figure as MatplotlibFigure

    drawn = MatplotlibFigure(
        figsize=(figure.width, sum(figure.heights) + 0.4), layout="constrained"
    )
    grid = drawn.add_gridspec(len(figure.heights), figure.columns, height_ratios=figure.heights)
    for panel, frame in zip(figure.panels, frames(figure), strict=True):
        place = grid[panel.row, panel.column : panel.column + panel.columns]
        axes = drawn.add_subplot(place)
        _scale(axes, panel, frame)
        for item in panel.items:
            _draw_item(axes, item, panel, frame)
        _finish(axes, panel)
    drawn.align_ylabels()
    return drawn


def _scale(axes: "Axes", panel: Panel, frame: Frame) -> None:
    """Set scales, ends and ticks before anything is drawn: words look where the ends are."""
    for axis, described, ends, set_scale, set_ends, most in (
        (axes.xaxis, panel.x, frame.x, axes.set_xscale, axes.set_xlim, 9 // panel_share(panel)),
        (axes.yaxis, panel.y, frame.y, axes.set_yscale, axes.set_ylim, 7),
    ):
        if described.scale == "symlog":
            there = partial(placed, scale="symlog")
            back = partial(unplaced, scale="symlog")
            set_scale("function", functions=(there, back))
        else:
            set_scale(described.scale)
        set_ends(*ends)
        marks = ticks(described, ends, most=max(most, 4))
        axis.set_ticks(
            [at for at, _ in marks],
            [_safe(words) if described.numbered else "" for _, words in marks],
        )
        axis.set_ticks([], minor=True)


def panel_share(panel: Panel) -> int:
    """How many panels stand beside one another, as far as a panel itself can tell.

    Examples
    --------
    >>> from hmpim.plots.description import Axis
    >>> panel_share(Panel(x=Axis(), y=Axis()))
    1
    """
    return 2 if panel.column else 1


def _draw_item(axes: "Axes", item: Item, panel: Panel, frame: Frame) -> None:
    if isinstance(item, Curve):
        x, y = envelope(item.x, item.y, spacing="log" if panel.x.scale == "log" else "linear")
        axes.plot(
            x, y, color=COLOURS[item.colour], linestyle=_DASHES[item.dashes],
            linewidth=item.width, marker=item.marker or None, markersize=item.size,
            alpha=item.opacity, label=_label(item.label), solid_joinstyle="round",
        )  # fmt: skip
    elif isinstance(item, Band):
        low, high = (np.clip(ends, *_beyond(frame.y)) for ends in (item.low, item.high))
        axes.fill_between(
            item.x, low, high, color=COLOURS[item.colour], alpha=item.opacity, linewidth=0,
            label=_label(item.label),
        )  # fmt: skip
    elif isinstance(item, Points):
        _draw_points(axes, item, frame)
    elif isinstance(item, Rule):
        _draw_rule(axes, item, panel, frame)
    elif isinstance(item, Span):
        across = axes.axvspan if item.axis == "x" else axes.axhspan
        across(
            item.low, item.high, color=COLOURS[item.colour], alpha=item.opacity, linewidth=0,
            label=_label(item.label),
        )  # fmt: skip
    elif isinstance(item, Words):
        shift = {"left": 4, "middle": 0, "right": -4}[item.anchor] if item.at == "data" else 0
        axes.annotate(
            _safe(item.text), xy=(item.x, item.y), xytext=(shift, 0), textcoords="offset points",
            xycoords="axes fraction" if item.at == "share" else "data", fontsize=_SMALL,
            ha={"left": "left", "middle": "center", "right": "right"}[item.anchor], va="center",
            color=COLOURS[item.colour], annotation_clip=True,
        )  # fmt: skip
    elif isinstance(item, Bars):
        axes.barh(item.y, item.length, height=0.6, color=[COLOURS[c] for c in item.colours])
    else:
        _draw_image(axes, item)


def _beyond(ends: tuple[float, float]) -> tuple[float, float]:
    """Ends a little outside of the panel, so that what reaches infinity has no visible end."""
    room = abs(ends[1] - ends[0])
    low, high = min(ends), max(ends)
    return (low - room if low <= 0 else 0.5 * low), high + room


def _draw_points(axes: "Axes", item: Points, frame: Frame) -> None:
    reach = None
    if item.low is not None and item.high is not None:
        low, high = (np.clip(ends, *_beyond(frame.y)) for ends in (item.low, item.high))
        reach = np.maximum(np.stack((item.y - low, high - item.y)), 0.0)
    axes.errorbar(
        item.x, item.y, yerr=reach, fmt=item.marker or "o", markersize=item.size,
        color=COLOURS[item.colour], elinewidth=0.9, capsize=0.0,
        markerfacecolor=COLOURS[item.colour] if item.filled else "none",
        label=_label(item.label),
    )  # fmt: skip


def _draw_rule(axes: "Axes", item: Rule, panel: Panel, frame: Frame) -> None:
    upright = item.axis == "x"
    if item.low is not None and item.high is not None:
        across = axes.axvspan if upright else axes.axhspan
        across(item.low, item.high, color=COLOURS[item.colour], alpha=0.18, linewidth=0)
    line = axes.axvline if upright else axes.axhline
    line(
        item.at, color=COLOURS[item.colour], linestyle=_DASHES[item.dashes],
        linewidth=item.width, label=_label(item.label),
    )  # fmt: skip
    if not item.words:
        return
    left = upright and on_left(item, panel.x, frame.x)
    axes.annotate(
        _safe(item.words),
        xy=(item.at, item.words_at) if upright else (item.words_at, item.at),
        xycoords=axes.get_xaxis_transform() if upright else axes.get_yaxis_transform(),
        xytext=((-4 if left else 4), 0) if upright else (0, 3),
        textcoords="offset points", ha="right" if left else "left",
        va="top" if upright else "bottom", fontsize=_SMALL, color=COLOURS[item.colour],
        annotation_clip=True,
        bbox={"facecolor": COLOURS["paper"], "edgecolor": "none", "pad": 0.8, "alpha": 0.85},
    )  # fmt: skip


def _draw_image(axes: "Axes", item: Image) -> None:
    shown = axes.imshow(
        item.values, extent=(*item.x, *item.y), origin="lower", aspect="auto", vmin=item.low,
        vmax=item.high, cmap={"grey": "gray", "viridis": "viridis"}[item.palette],
        interpolation="nearest",
    )  # fmt: skip
    if item.label and axes.figure is not None:
        bar = axes.figure.colorbar(shown, ax=axes, pad=0.01)
        bar.set_label(_safe(item.label), fontsize=FONT_SIZE)
        bar.ax.tick_params(labelsize=_SMALL)


def _finish(axes: "Axes", panel: Panel) -> None:
    for which, axis in (("x", panel.x), ("y", panel.y)):
        if axis.grid:
            axes.grid(visible=True, axis=which, color=COLOURS["grid"], linewidth=0.6)  # type: ignore[arg-type]
    axes.set_axisbelow(True)
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom") and not panel.bare)
        spine.set_color(COLOURS["muted"])
        spine.set_linewidth(0.8)
    axes.tick_params(labelsize=_SMALL, colors=COLOURS["muted"], labelcolor=COLOURS["ink"])
    for words, put in ((panel.x.label, axes.set_xlabel), (panel.y.label, axes.set_ylabel)):
        if words:
            put(_safe(words), fontsize=FONT_SIZE, color=COLOURS["ink"])
    if panel.title:
        axes.set_title(_safe(panel.title), fontsize=FONT_SIZE, color=COLOURS["ink"], loc="left")
    named = len(legend_items(panel))
    if not named:
        return
    handles, labels = axes.get_legend_handles_labels()
    each = dict(zip(labels, handles, strict=True))
    axes.legend(
        list(each.values()), list(each), loc="lower right", bbox_to_anchor=(1.0, 1.0),
        ncols=min(named, 3), frameon=False, fontsize=_SMALL, labelcolor=COLOURS["ink"],
        borderaxespad=0.1, handlelength=2.2,
    )  # fmt: skip


def _label(text: str) -> str | None:
    return _safe(text) or None


def _safe(text: str) -> str:
    """Keep a foreign name from being read as a formula."""
    return text.replace("$", r"\$")
