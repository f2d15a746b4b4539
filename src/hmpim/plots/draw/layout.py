"""Where the panels of a page's picture stand, in pixels, with room for all that is written."""

from dataclasses import dataclass, replace

from hmpim.plots.description import Axis, Figure, Image, Panel
from hmpim.plots.draw.frames import Frame, legend_items, ticks

__all__ = ["LINE", "SIZE", "Place", "legend_lines", "places", "stacked", "text_width"]

SIZE = 12.0  # of the letters, px
LINE = 17.0  # from one line of words to the next
_PER_INCH = 96.0
_HANDLE = 30.0  # of a legend's entry, gaps included
_UPRIGHT = 0.95  # of `text_width`, which is generous: such a label ends where its field does
_BAR = 66.0  # of an image's colours


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """The field of a panel that holds data, px from the top left, and the ticks on its edges."""

    edge: float  # left of all that is written beside it
    left: float
    top: float
    width: float
    height: float
    foot: float  # room of the words on the lower edge
    turned: bool  # whether these words stand upright, as they would overlap
    x_ticks: list[tuple[float, str]]
    y_ticks: list[tuple[float, str]]


def text_width(text: str) -> float:
    """Room that words take, px: no font is at hand, so the wide ones are allowed for.

    Examples
    --------
    >>> 25.0 < text_width("Time") < 35.0
    True
    """
    narrow = sum(c in "iljtfI.,:;'|!()[] -1" for c in text)
    return SIZE * (0.64 * (len(text) - narrow) + 0.42 * narrow)


def legend_lines(panel: Panel, width: float) -> list[list[str]]:
    """Return a legend's labels line by line, as many in each as fit.

    Examples
    --------
    >>> from hmpim.plots.description import Rule
    >>> rules = tuple(Rule(at=0.0, label=label) for label in ("one", "two", "three"))
    >>> legend_lines(Panel(x=Axis(), y=Axis(), items=rules), 140.0)
    [['one', 'two'], ['three']]
    """
    lines: list[list[str]] = []
    used = width
    for item in legend_items(panel):
        label = getattr(item, "label", "")
        needed = _HANDLE + text_width(label)
        if not lines or used + needed > width:
            lines.append([])
            used = 0.0
        lines[-1].append(label)
        used += needed + 8.0
    return lines


def places(figure: Figure, shown: list[Frame], *, width: float) -> tuple[list[Place], float]:
    """Return where each panel stands, and the height of the whole.

    Parameters
    ----------
    figure : Figure
        What to draw.
    shown : list of Frame
        From `frames`.
    width : float
        Of the whole, px.

    Examples
    --------
    >>> from hmpim.plots.draw.frames import frames
    >>> figure = Figure(panels=(Panel(x=Axis(label="Time (s)"), y=Axis()),), alt="")
    >>> (place,), height = places(figure, frames(figure), width=700.0)
    >>> place.left + place.width < 700.0 and place.top + place.height < height
    True
    """
    panels = list(zip(figure.panels, shown, strict=True))
    columns = 1 if _narrow(figure, width) else figure.columns
    rows = _rows(figure, columns)
    lefts = [0.0] * columns
    upright = max(_UPRIGHT * text_width(panel.y.label) for panel in figure.panels)
    for panel, frame in panels:  # a long label makes a row higher, which then has more ticks
        height = max(_PER_INCH * figure.heights[panel.row], upright + 8.0)
        labels = _possible_labels(panel, frame, height)
        room = max((text_width(words) for words in labels if panel.y.numbered), default=0.0)
        column = 0 if columns == 1 else panel.column
        lefts[column] = max(lefts[column], room + 12.0 + LINE * bool(panel.y.label))
    each = (width - 4.0) / columns
    tops = dict.fromkeys(set(rows), 0.0)
    bottoms = dict(tops)
    heights = dict(tops)
    inside = dict.fromkeys(tops, 70.0)  # of the field of data; its label stands beside it
    for (panel, _), row in zip(panels, rows, strict=True):
        inner = each * (1 if columns == 1 else panel.columns) - lefts[0] - 14.0
        legend = legend_lines(panel, inner)
        beside = len(legend) == 1 and panel.title and _fits(panel, legend[0], inner)
        lines = len(legend) + bool(panel.title) - bool(beside)
        tops[row] = max(tops[row], LINE * lines + 8.0)
        below = _foot(panel.x, inner) + LINE * bool(panel.x.label) + 8.0
        bottoms[row] = max(bottoms[row], below)
        inside[row] = max(inside[row], _UPRIGHT * text_width(panel.y.label))
        heights[row] = max(heights[row], _PER_INCH * figure.heights[panel.row])
    out = []
    start = {}
    at = 0.0
    for row in sorted(heights):
        start[row] = at
        at += max(heights[row], tops[row] + bottoms[row] + inside[row])
    ends = [*sorted(start.values())[1:], at]
    row_ends = dict(zip(sorted(start), ends, strict=True))
    for (panel, frame), row in zip(panels, rows, strict=True):
        column, span = (0, 1) if columns == 1 else (panel.column, panel.columns)
        bar = _BAR if any(image.label for image in panel.of(Image)) else 0.0
        left = column * each + lefts[column]
        inner = column * each + span * each - left - 14.0 - bar
        height = row_ends[row] - start[row] - tops[row] - bottoms[row]
        out.append(
            Place(
                edge=column * each,
                left=left,
                top=start[row] + tops[row],
                width=inner,
                height=height,
                foot=_foot(panel.x, inner),
                turned=_turned(panel.x, inner),
                x_ticks=ticks(
                    panel.x, frame.x, most=max(int(inner / _tick_room(panel.x, frame)), 2)
                ),
                y_ticks=_y_ticks(panel, frame, height),
            )
        )
    return out, at + 2.0


def stacked(figure: Figure, *, width: float) -> Figure:
    """Return the figure as a narrow page shows it: columns one under the other, all numbered.

    Examples
    --------
    >>> left = Panel(x=Axis(), y=Axis(label="y (V)"))
    >>> right = Panel(x=Axis(), y=Axis(numbered=False), column=1)
    >>> figure = Figure(panels=(left, right), alt="", columns=2)
    >>> [panel.y.label for panel in stacked(figure, width=300.0).panels]
    ['y (V)', 'y (V)']
    >>> stacked(figure, width=700.0) is figure
    True
    """
    if figure.columns == 1 or not _narrow(figure, width):
        return figure
    named = {panel.row: panel.y.label for panel in figure.panels if panel.y.label}
    panels = [
        panel
        if panel.bare or panel.y.numbered
        else replace(
            panel,
            y=replace(panel.y, numbered=True, label=panel.y.label or named.get(panel.row, "")),
        )
        for panel in figure.panels
    ]
    return replace(figure, panels=tuple(panels))


def _narrow(figure: Figure, width: float) -> bool:
    return width < 0.75 * _PER_INCH * figure.width


def _fits(panel: Panel, labels: list[str], width: float) -> bool:
    used = sum(_HANDLE + 8.0 + text_width(label) for label in labels)
    return used + text_width(panel.title) + 16.0 < width


def _rows(figure: Figure, columns: int) -> list[int]:
    """Rows of the panels; on a narrow page all stand one under the other."""
    if columns == figure.columns:
        return [panel.row for panel in figure.panels]
    return list(range(len(figure.panels)))


def _tick_room(axis: Axis, frame: Frame) -> float:
    longest = max((text_width(words) for _, words in ticks(axis, frame.x, most=8)), default=20.0)
    return max(longest + 14.0, 34.0)


def _turned(axis: Axis, width: float) -> bool:
    """Whether the words of a linear axis would overlap side by side."""
    longest = max((text_width(words) for _, words in axis.ticks or ()), default=0.0)
    return axis.scale == "linear" and longest * len(axis.ticks or ()) > width


def _foot(axis: Axis, width: float) -> float:
    """Room of the words below a panel."""
    if not axis.numbered:
        return 0.0
    if not _turned(axis, width):
        return LINE
    return max(text_width(words) for _, words in axis.ticks or ()) + 4.0


def _possible_labels(panel: Panel, frame: Frame, height: float) -> list[str]:
    """Words of all ticks that a panel may have whose row is so high, title and legend included."""
    least = _most_ticks(height - 6 * LINE)
    most = _most_ticks(height - 8.0)
    return [
        words
        for count in range(least, most + 1)
        for _, words in ticks(panel.y, frame.y, most=count)
    ]


def _most_ticks(height: float) -> int:
    return max(int(height / 26.0), 3)


def _y_ticks(panel: Panel, frame: Frame, height: float) -> list[tuple[float, str]]:
    return ticks(panel.y, frame.y, most=_most_ticks(height))
