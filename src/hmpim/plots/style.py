"""One look for every picture: colours, fonts, grid, axes that always state their unit.

Pictures are made of `matplotlib.figure.Figure` objects and nothing global: no pyplot, no
settings changed. matplotlib is imported when the first picture is drawn, not before.
"""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Literal
from unicodedata import category

import numpy as np
from numpy.typing import NDArray

from hmpim.plots.envelope import Spacing, envelope

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "COLOURS",
    "WIDTH",
    "Colour",
    "axis_label",
    "degree_ticks",
    "draw_legend",
    "draw_level",
    "draw_line",
    "draw_mark",
    "finish_axes",
    "new_figure",
    "plain",
    "printable",
]

Colour = Literal["paper", "ink", "muted", "grid", "input", "output", "model", "limit", "other"]

# After Okabe and Ito (2008): told apart with every common colour blindness, and in grey.
COLOURS: dict[Colour, str] = {
    "paper": "#ffffff",
    "ink": "#1f2328",
    "muted": "#5b636b",
    "grid": "#d5d9de",
    "input": "#0072b2",
    "output": "#d55e00",
    "model": "#111827",
    "limit": "#b0417f",
    "other": "#009e73",
}
WIDTH = 7.6  # inches; a page column
FONT_SIZE = 9.0
LONGEST_NAME = 40


def plain(text: str) -> str:
    r"""Make a foreign name safe to draw: printable, not too long, never read as a formula.

    Examples
    --------
    >>> plain("cost in $")
    'cost in \\$'
    >>> plain("a\x00b")
    'a�b'
    """
    shown = printable(text)
    if len(shown) > LONGEST_NAME:
        shown = shown[: LONGEST_NAME - 1] + "…"
    return shown.replace("$", r"\$")


def printable(text: str) -> str:
    r"""Replace what no page or picture may hold: controls, direction marks, half characters.

    Examples
    --------
    >>> printable("a\x1b[31m\u202eb")
    'a�[31m�b'
    """
    return "".join(
        "\N{REPLACEMENT CHARACTER}" if category(c) in ("Cc", "Cf", "Cs") else c for c in text
    )


def axis_label(quantity: str, unit: str) -> str:
    """Name of an axis with its unit, a dash where there is none.

    Examples
    --------
    >>> axis_label("Position", "deg"), axis_label("u", "")
    ('Position (deg)', 'u (–)')
    """
    return f"{plain(quantity)} ({plain(unit) or '–'})"


def new_figure(
    rows: int = 1, *, height: float = 2.2, share_x: bool = True
) -> "tuple[Figure, list[Axes]]":
    """Return an empty figure and its axes, one under the other.

    Parameters
    ----------
    rows : int
        Number of axes.
    height : float
        Height of each in inches.
    share_x : bool
        Whether all have one horizontal axis.

    Examples
    --------
    >>> figure, axes = new_figure(2)
    >>> len(axes)
    2
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, height * rows + 0.4), layout="constrained")
    axes = [figure.add_subplot(rows, 1, 1)]
    axes += [
        figure.add_subplot(rows, 1, row + 1, sharex=axes[0] if share_x else None)
        for row in range(1, rows)
    ]
    if share_x:
        for upper in axes[:-1]:
            upper.tick_params(labelbottom=False)
    return figure, axes


def degree_ticks(axes: "Axes", *, most: int = 7) -> None:
    """Put the ticks of a phase at parts of a turn: 15, 30, 45, 90 degrees and so on.

    Call it when the heights are set.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
        With degrees upwards.
    most : int
        How many steps there may be.

    Examples
    --------
    >>> figure, (axes,) = new_figure()
    >>> _ = axes.set_ylim(-210.0, 20.0)
    >>> degree_ticks(axes)
    >>> axes.get_yticks().tolist()[-3:]
    [-45.0, 0.0, 45.0]
    """
    from matplotlib.ticker import MultipleLocator

    low, high = axes.get_ylim()
    steps = (1.0, 2.0, 5.0, 15.0, 30.0, 45.0, 90.0, 180.0, 360.0, 720.0)
    wanted = (step for step in steps if high - low <= most * step)
    axes.yaxis.set_major_locator(MultipleLocator(next(wanted, 360.0 * np.ceil((high - low) / 2e3))))


def finish_axes(
    axes: "Axes",
    *,
    x: str = "",
    y: str = "",
    title: str = "",
    log_x: bool = False,
) -> None:
    """Give axes their labels, grid and type; the last step of each picture.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
        Where.
    x, y : str
        Labels, made by `axis_label`; empty for none.
    title : str
        What is seen, in a few words.
    log_x : bool
        Logarithmic horizontal axis, with plain numbers at its ticks.

    Examples
    --------
    >>> figure, (axes,) = new_figure()
    >>> finish_axes(axes, x=axis_label("Time", "s"), y=axis_label("y", "deg"))
    >>> axes.get_xlabel()
    'Time (s)'
    """
    if log_x:
        from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

        axes.set_xscale("log")
        low, high = axes.get_xlim()
        narrow = low > 0 and np.log10(high / low) < 2.5
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if narrow else (1.0,)))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
    axes.grid(visible=True, which="major", color=COLOURS["grid"], linewidth=0.6)
    axes.set_axisbelow(True)
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color(COLOURS["muted"])
        spine.set_linewidth(0.8)
    axes.tick_params(labelsize=FONT_SIZE - 1, colors=COLOURS["muted"], labelcolor=COLOURS["ink"])
    axes.tick_params(which="minor", colors=COLOURS["muted"], width=0.5)
    if x:
        axes.set_xlabel(x, fontsize=FONT_SIZE, color=COLOURS["ink"])
    if y:
        axes.set_ylabel(y, fontsize=FONT_SIZE, color=COLOURS["ink"])
    if title:
        axes.set_title(title, fontsize=FONT_SIZE, color=COLOURS["ink"], loc="left")
    axes.margins(x=0.01)


def draw_line(
    axes: "Axes",
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    *,
    colour: Colour = "input",
    label: str = "",
    dashes: Literal["-", "--", ":", "-."] = "-",
    width: float = 1.2,
    spacing: Spacing = "linear",
) -> None:
    """Draw a curve; a long one as the band between its minima and maxima.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
        Where.
    x, y : ndarray, shape (n,)
        The curve, `x` increasing.
    colour : str
        A name of `COLOURS`.
    label : str
        For the legend; empty for none.
    dashes : str
        So that curves can be told apart without colour.
    width : float
        In points.
    spacing : {'linear', 'log'}
        How the horizontal axis will be divided.

    Examples
    --------
    >>> figure, (axes,) = new_figure()
    >>> draw_line(axes, np.arange(3.0), np.zeros(3), label="nothing")
    >>> len(axes.lines)
    1
    """
    shown_x, shown_y = envelope(x, y, spacing=spacing)
    axes.plot(
        shown_x,
        shown_y,
        color=COLOURS[colour],
        linestyle=dashes,
        linewidth=width,
        label=label or None,
        solid_joinstyle="round",
    )


def draw_level(
    axes: "Axes", levels: Iterable[float], *, label: str, colour: Colour = "limit"
) -> None:
    """Draw horizontal lines across the axes, such as both signs of a limit.

    Examples
    --------
    >>> figure, (axes,) = new_figure()
    >>> draw_level(axes, (-10.0, 10.0), label="limit")
    >>> len(axes.lines)
    2
    """
    for k, level in enumerate(levels):
        axes.axhline(
            level,
            color=COLOURS[colour],
            linestyle=(0, (5, 3)),
            linewidth=1.0,
            label=None if k else label,
        )


def draw_mark(
    axes: "Axes",
    x: float,
    *,
    label: str,
    colour: Colour = "limit",
    text_at: float = 0.97,
    side: Literal["auto", "left", "right"] = "auto",
) -> None:
    """Draw a vertical line at `x` with words beside it.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
        Where.
    x : float
        In data units.
    label : str
        The words.
    colour : str
        A name of `COLOURS`.
    text_at : float
        Height of the words as a share of the axes; they hang below it.
    side : {'auto', 'left', 'right'}
        Where the words stand; 'auto' is right, unless the line is near the right end.

    Examples
    --------
    >>> figure, (axes,) = new_figure()
    >>> draw_mark(axes, 1.53, label="−90° at 1.53 Hz")
    >>> axes.texts[0].get_text()
    '−90° at 1.53 Hz'
    """
    axes.axvline(x, color=COLOURS[colour], linestyle=(0, (2, 2)), linewidth=1.0)
    low, high = axes.get_xlim()
    if axes.get_xscale() == "log":
        late = low > 0 and x > 0 and np.log(x / low) > 0.7 * np.log(high / low)
    else:
        late = x - low > 0.7 * (high - low)
    left = late if side == "auto" else side == "left"
    axes.annotate(
        label,
        xy=(x, text_at),
        xycoords=axes.get_xaxis_transform(),
        xytext=(-4 if left else 4, 0),
        textcoords="offset points",
        ha="right" if left else "left",
        va="top",
        fontsize=FONT_SIZE - 1,
        color=COLOURS[colour],
        annotation_clip=True,
        bbox={"facecolor": COLOURS["paper"], "edgecolor": "none", "pad": 0.8, "alpha": 0.85},
    )


def draw_legend(axes: "Axes", *, columns: int = 3) -> None:
    """Put the legend above the axes, where it hides no data.

    Examples
    --------
    >>> figure, (axes,) = new_figure()
    >>> draw_line(axes, np.arange(3.0), np.zeros(3), label="nothing")
    >>> draw_legend(axes)
    >>> axes.get_legend() is not None
    True
    """
    axes.legend(
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=columns,
        frameon=False,
        fontsize=FONT_SIZE - 1,
        labelcolor=COLOURS["ink"],
        borderaxespad=0.1,
        handlelength=2.2,
    )
