"""What a picture is: panels with axes, and the curves, bands, marks and words on them.

A description is data. `hmpim.plots.draw` has one room for each way to draw it: SVG for pages,
matplotlib for papers, Plotly for the workbench. None of them knows what a Bode plot is.
"""

from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from hmpim.plots.style import WIDTH, Colour

if TYPE_CHECKING:
    from matplotlib.figure import Figure as MatplotlibFigure

__all__ = [
    "Axis",
    "Band",
    "Bars",
    "Curve",
    "Dashes",
    "Figure",
    "Image",
    "Item",
    "Marker",
    "Panel",
    "Points",
    "Rule",
    "Scale",
    "Span",
    "Words",
]

Scale = Literal["linear", "log", "symlog"]
"""How values lie along an axis; 'symlog' is linear about 0 and logarithmic beyond 10."""
Dashes = Literal["-", "--", "-.", ":"]
Marker = Literal["", "o", "s", "^", "v", "x", "+"]
FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """One axis of a panel.

    Parameters
    ----------
    label : str
        Quantity and unit, such as ``Time (s)``; empty for none.
    scale : {'linear', 'log', 'symlog'}
        How values lie along it.
    low, high : float, optional
        Ends; taken from the data where they are None. `low` above `high` turns it round.
    degrees : bool
        Ticks at parts of a turn: 15, 30, 45, 90 degrees and so on.
    ticks : tuple of (float, str), optional
        Ticks with their words, instead of numbers; empty for an axis without any.
    numbered : bool
        Whether its ticks have numbers; False where another panel below shows the same.
    grid : bool
        Whether its ticks have lines across the panel.
    whole : bool
        Whether it counts: its ticks are whole numbers.
    """

    label: str = ""
    scale: Scale = "linear"
    low: float | None = None
    high: float | None = None
    degrees: bool = False
    ticks: tuple[tuple[float, str], ...] | None = None
    numbered: bool = True
    grid: bool = True
    whole: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Curve:
    """A line through points; NaN interrupts it. `x` increases, so that it can be thinned."""

    x: FloatArray
    y: FloatArray
    label: str = ""
    colour: Colour = "input"
    dashes: Dashes = "-"
    width: float = 1.2
    marker: Marker = ""
    size: float = 4.0
    opacity: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Band:
    """What lies between two curves; an end at infinity reaches the edge of the panel."""

    x: FloatArray
    low: FloatArray
    high: FloatArray
    label: str = ""
    colour: Colour = "input"
    opacity: float = 0.22


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Points:
    """Marks without a line, with the ends of their error bars where they are known."""

    x: FloatArray
    y: FloatArray
    low: FloatArray | None = None
    high: FloatArray | None = None
    label: str = ""
    colour: Colour = "input"
    marker: Marker = "o"
    size: float = 4.0
    filled: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Rule:
    """A straight line across the panel at one value, with its error and words beside it.

    Parameters
    ----------
    at : float
        Value on `axis`.
    axis : {'x', 'y'}
        'x' for an upright line, 'y' for a level one.
    low, high : float, optional
        Interval of the value; shaded.
    words : str
        Beside the line.
    words_at : float
        Where the words stand along the line, as a share of the panel from below (or left).
    side : {'auto', 'left', 'right'}
        Of an upright line; 'auto' is right, unless the line is near the right end.
    label : str
        For the legend; empty for none.
    """

    at: float
    axis: Literal["x", "y"] = "x"
    low: float | None = None
    high: float | None = None
    words: str = ""
    words_at: float = 0.97
    side: Literal["auto", "left", "right"] = "auto"
    label: str = ""
    colour: Colour = "limit"
    dashes: Dashes = "--"
    width: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """A shaded part of an axis, from one edge of the panel to the other."""

    low: float
    high: float
    axis: Literal["x", "y"] = "x"
    label: str = ""
    colour: Colour = "other"
    opacity: float = 0.09


@dataclass(frozen=True, slots=True, kw_only=True)
class Words:
    """Text in a panel, at data coordinates or at shares of the panel."""

    x: float
    y: float
    text: str
    at: Literal["data", "share"] = "data"
    anchor: Literal["left", "middle", "right"] = "left"
    colour: Colour = "ink"


@dataclass(frozen=True, slots=True, kw_only=True)
class Bars:
    """Level bars from 0, one unit apart, 0.6 thick."""

    y: tuple[float, ...]
    length: tuple[float, ...]
    colours: tuple[Colour, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Image:
    """Values in rows from below, drawn as colours from `low` to `high`.

    `x` and `y` are the outer edges of the field. `label` names what the colours stand for and
    asks for a bar that shows them.
    """

    values: FloatArray
    x: tuple[float, float]
    y: tuple[float, float]
    low: float
    high: float
    palette: Literal["grey", "viridis"] = "viridis"
    label: str = ""


Item = Curve | Band | Points | Rule | Span | Words | Bars | Image
_T = TypeVar("_T", Curve, Band, Points, Rule, Span, Words, Bars, Image)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Panel:
    """One pair of axes and what is on them, drawn in this order.

    Parameters
    ----------
    x, y : Axis
        Its axes.
    items : tuple of Item
        What is on it.
    title : str
        What is seen, in a few words.
    row, column, columns : int
        Where it stands in the figure, and how many columns it takes.
    legend : bool
        Whether the items' labels are listed above it.
    """

    x: Axis
    y: Axis
    items: tuple[Item, ...] = ()
    title: str = ""
    row: int = 0
    column: int = 0
    columns: int = 1
    legend: bool = True

    @property
    def bare(self) -> bool:
        """Whether neither axis has a tick or a label: a drawing, which needs no edges.

        Examples
        --------
        >>> Panel(x=Axis(ticks=()), y=Axis(ticks=())).bare, Panel(x=Axis(), y=Axis()).bare
        (True, False)
        """
        return all(axis.ticks == () and not axis.label for axis in (self.x, self.y))

    def of(self, kind: type[_T]) -> tuple[_T, ...]:
        """Return the items of one kind.

        Examples
        --------
        >>> panel = Panel(x=Axis(), y=Axis(), items=(Rule(at=1.0), Span(low=0.0, high=1.0)))
        >>> panel.of(Span)[0].high
        1.0
        """
        return tuple(item for item in self.items if isinstance(item, kind))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Figure:
    """A picture, described.

    In a notebook it shows itself; `savefig` writes it to a file; `to_matplotlib`, `to_plotly`
    and `to_svg` draw it for a paper, for the workbench and for a page.

    Parameters
    ----------
    panels : tuple of Panel
        From the top left, row by row.
    alt : str
        What is seen, in words for those who cannot see it.
    heights : tuple of float
        Of each row, in inches.
    columns : int
        Number of columns.
    width : float
        In inches.
    share_x : bool
        Whether the panels of a column have one horizontal axis.
    """

    panels: tuple[Panel, ...]
    alt: str
    heights: tuple[float, ...] = (2.2,)
    columns: int = 1
    width: float = WIDTH
    share_x: bool = True

    def savefig(
        self,
        path: str | PathLike[str] | IO[bytes],
        *,
        dpi: float = 150.0,
        format: str | None = None,  # noqa: A002
    ) -> None:
        """Write the picture to a file: .svg, .png, .pdf, or what else matplotlib writes.

        Parameters
        ----------
        path : path-like or binary file
            What to write to.
        dpi : float
            Dots per inch, where the format has dots.
        format : str, optional
            Such as "png"; taken from the file's ending by default.

        Raises
        ------
        ArgumentError
            If the name's ending is not a format of a picture.

        Examples
        --------
        >>> import tempfile
        >>> from pathlib import Path
        >>> empty = Figure(panels=(Panel(x=Axis(), y=Axis()),), alt="Empty axes.")
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     empty.savefig(Path(folder) / "empty.png")
        ...     (Path(folder) / "empty.png").read_bytes()[1:4]
        b'PNG'
        """
        from hmpim.plots.draw.with_matplotlib import save

        kind = format or str(path).rpartition(".")[2].lower()
        if kind == "svg" and isinstance(path, str | PathLike):
            Path(path).write_text(self.to_svg() + "\n", encoding="utf-8")
        else:
            save(self, path, dpi=dpi, format=format)

    def to_matplotlib(self) -> "MatplotlibFigure":
        """Draw it as a `matplotlib.figure.Figure`.

        Examples
        --------
        >>> empty = Figure(panels=(Panel(x=Axis(label="Time (s)"), y=Axis()),), alt="Empty axes.")
        >>> empty.to_matplotlib().axes[0].get_xlabel()
        'Time (s)'
        """
        from hmpim.plots.draw.with_matplotlib import draw

        return draw(self)

    def to_plotly(self, *, most_points: int = 4000) -> dict[str, Any]:
        """Return it as Plotly takes it: a dict of ``data`` and ``layout`` with NumPy arrays.

        Parameters
        ----------
        most_points : int
            A longer curve is thinned to so many, its peaks kept.

        Examples
        --------
        >>> empty = Figure(panels=(Panel(x=Axis(label="Time (s)"), y=Axis()),), alt="Empty axes.")
        >>> empty.to_plotly()["layout"]["xaxis"]["title"]["text"]
        'Time (s)'
        """
        from hmpim.plots.draw.with_plotly import draw

        return draw(self, most_points=most_points)

    def to_svg(self, *, width: float | None = None, key: str = "figure") -> str:
        """Return it as SVG text, of so many pixels across.

        Parameters
        ----------
        width : float, optional
            In px; letters keep their size.
        key : str
            Beginning of every id, unique in a page.

        Examples
        --------
        >>> empty = Figure(panels=(Panel(x=Axis(), y=Axis()),), alt="Empty axes.")
        >>> "Empty axes." in empty.to_svg(width=360.0)
        True
        """
        from hmpim.plots.draw.with_svg import draw

        return draw(self, width=width, key=key)

    def _repr_html_(self) -> str:
        return self.to_svg(key=f"figure-{id(self):x}")
