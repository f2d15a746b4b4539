"""A description drawn as SVG, without any library: for pages and notebooks.

A Bode plot takes some milliseconds. Words stay words, in the reader's own font; every curve is
thinned to what the width can show, its peaks kept.
"""

from collections.abc import Callable
from html import escape
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
from hmpim.plots.draw.frames import Frame, frames, legend_items, placed, ticks
from hmpim.plots.draw.layout import LINE, SIZE, Place, legend_lines, places, stacked, text_width
from hmpim.plots.draw.paths import path_of, thin_band
from hmpim.plots.draw.raster import picture_of
from hmpim.plots.envelope import envelope
from hmpim.plots.style import COLOURS, Colour

__all__ = ["draw"]

FloatArray = NDArray[np.float64]
_PER_INCH = 96.0
_POINT = 96.0 / 72.0
_FAR = 9999.0  # px; what lies beyond is not seen and must not overflow
_DASHES: dict[Dashes, str] = {"-": "", "--": "6 3", "-.": "8 3 2 3", ":": "1.5 2.5"}


def draw(
    figure: Figure,
    *,
    key: str = "figure",
    title: str = "",
    width: float | None = None,
    themed: bool = False,
) -> str:
    """Return the described picture as an ``<svg>`` element.

    Parameters
    ----------
    figure : Figure
        What to draw.
    key : str
        Beginning of every id, so that several pictures can stand in one page.
    title : str
        A short name for screen readers, before the description's own words.
    width : float, optional
        In px; the description's own by default. Letters keep their size, so that a narrow
        picture is another picture and not a smaller one.
    themed : bool
        True names colours as CSS variables (``--input``, ``--ink``, …), which a dark page can
        change, and leaves font and background to the page.

    Returns
    -------
    str

    Examples
    --------
    >>> curve = Curve(x=np.arange(3.0), y=np.zeros(3), label="nothing")
    >>> panel = Panel(x=Axis(label="Time (s)"), y=Axis(label="y (V)"), items=(curve,))
    >>> text = draw(Figure(panels=(panel,), alt="A line."), key="f1", themed=True)
    >>> text.startswith('<svg aria-labelledby="f1-title f1-desc"'), "http" in text
    (True, False)
    """
    across = _PER_INCH * figure.width if width is None else width
    figure = stacked(figure, width=across)
    shown = frames(figure)
    where, height = places(figure, shown, width=across)
    pen = _Pen(key, themed)
    parts = [
        f'<svg aria-labelledby="{key}-title {key}-desc" '
        f'viewBox="0 0 {across:.0f} {height:.0f}" class="plot" role="img" font-size="{SIZE:g}"'
    ]
    if not themed:
        parts[0] += (
            f' xmlns="http://www.w3.org/2000/svg" width="{across:.0f}" height="{height:.0f}"'
            ' font-family="DejaVu Sans, Verdana, Arial, sans-serif"'
        )
    parts[0] += (
        f'><title id="{key}-title">{escape(title or figure.alt.split(":")[0], quote=False)}</title>'
        f'<desc id="{key}-desc">{escape(figure.alt, quote=False)}</desc>'
    )
    if not themed:
        parts.append(f'<rect width="100%" height="100%" fill="{COLOURS["paper"]}"/>')
    for number, (panel, frame, place) in enumerate(zip(figure.panels, shown, where, strict=True)):
        parts += _panel(pen, number, panel, frame, place)
    return "".join([*parts, "</svg>"])


class _Pen:
    """Colours as the page wants them, and the key of its ids."""

    def __init__(self, key: str, themed: bool) -> None:
        self.key = key
        self.themed = themed

    def colour(self, name: Colour) -> str:
        return f"var(--{name})" if self.themed else COLOURS[name]

    def words(
        self,
        x: float,
        y: float,
        text: str,
        *,
        anchor: str = "start",
        colour: Colour = "ink",
        more: str = "",
    ) -> str:
        return (
            f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" '
            f'fill="{self.colour(colour)}"{more}>{escape(text, quote=False)}</text>'
        )

    def boxed(self, x: float, y: float, text: str, *, anchor: str, colour: Colour) -> str:
        """Words on a plate of paper, so that they can be read over lines."""
        width = text_width(text) + 2.0
        left = x - 1.0 - {"start": 0.0, "middle": 0.5, "end": 1.0}[anchor] * (width - 2.0)
        box = f'x="{left:.1f}" y="{y - SIZE:.1f}" width="{width:.1f}" height="{1.3 * SIZE:.1f}"'
        plate = f'<rect {box} fill="{self.colour("paper")}" fill-opacity="0.85"/>'
        return plate + self.words(x, y, text, anchor=anchor, colour=colour)


class _Field:
    """Data to pixels, for one panel."""

    def __init__(self, panel: Panel, frame: Frame, place: Place) -> None:
        self.place = place
        self.x = self._scale(panel.x, frame.x, place.left, place.width)
        self.y = self._scale(panel.y, frame.y, place.top + place.height, -place.height)

    @staticmethod
    def _scale(
        axis: Axis, ends: tuple[float, float], start: float, length: float
    ) -> Callable[[Any], FloatArray]:
        low, high = (float(v) for v in placed(np.array(ends), axis.scale))
        per = length / ((high - low) or 1.0)

        def to_pixels(values: Any) -> FloatArray:
            places = placed(np.asarray(values, dtype=np.float64), axis.scale)
            if axis.scale == "log":
                places = np.where(np.asarray(values) <= 0.0, -np.inf, places)
            return np.clip(start + (places - low) * per, -_FAR, _FAR)

        return to_pixels


def _panel(pen: _Pen, number: int, panel: Panel, frame: Frame, place: Place) -> list[str]:
    field = _Field(panel, frame, place)
    clip = f"{pen.key}-c{number}"
    box = f'x="{place.left:.1f}" y="{place.top:.1f}" width="{place.width:.1f}"'
    parts = [
        f'<clipPath id="{clip}"><rect {box} height="{place.height:.1f}"/></clipPath>',
        *_axes(pen, panel, field, place),
        f'<g clip-path="url(#{clip})">',
    ]
    notes: list[str] = []
    for item in panel.items:
        drawn, words = _item(pen, item, panel, field, place)
        parts += drawn
        notes += words
    parts += ["</g>", *notes, *_heading(pen, panel, place)]
    for image in panel.of(Image):
        if image.label:
            parts += _colour_bar(pen, image, place)
    return parts


def _axes(pen: _Pen, panel: Panel, field: _Field, place: Place) -> list[str]:
    left, right = place.left, place.left + place.width
    top, bottom = place.top, place.top + place.height
    parts = []
    xs = field.x([at for at, _ in place.x_ticks])
    ys = field.y([at for at, _ in place.y_ticks])
    lines = ""
    if panel.x.grid:
        lines += "".join(f"M{x:.1f} {top:.1f}V{bottom:.1f}" for x in xs)
    if panel.y.grid:
        lines += "".join(f"M{left:.1f} {y:.1f}H{right:.1f}" for y in ys)
    if lines:
        parts.append(
            f'<path d="{lines}" fill="none" stroke="{pen.colour("grid")}" stroke-width=".8"/>'
        )
    edge = f"M{left:.1f} {top:.1f}V{bottom:.1f}H{right:.1f}"
    edge += "".join(f"M{x:.1f} {bottom:.1f}v4" for x in xs)
    edge += "".join(f"M{left:.1f} {y:.1f}h-4" for y in ys)
    if not panel.bare:
        parts.append(f'<path d="{edge}" fill="none" stroke="{pen.colour("muted")}"/>')
    if panel.x.numbered:
        parts += [
            _under(pen, x, bottom, words, right=right, turned=place.turned)
            for x, (_, words) in zip(xs, place.x_ticks, strict=True)
        ]
    if panel.y.numbered:
        parts += [
            pen.words(left - 7.0, y + 0.35 * SIZE, words, anchor="end")
            for y, (_, words) in zip(ys, place.y_ticks, strict=True)
        ]
    if panel.x.label:
        down = bottom + place.foot + LINE + 2.0
        half = 0.5 * text_width(panel.x.label)  # kept inside of the picture
        middle = max(min((left + right) / 2, right + 10.0 - half), place.edge + half)
        parts.append(pen.words(middle, down, panel.x.label, anchor="middle"))
    if panel.y.label:
        x, y = place.edge + SIZE, (top + bottom) / 2
        turned = f' transform="rotate(-90 {x:.1f} {y:.1f})"'
        parts.append(pen.words(x, y, panel.y.label, anchor="middle", more=turned))
    return parts


def _under(pen: _Pen, x: float, bottom: float, words: str, *, right: float, turned: bool) -> str:
    """Words below the lower edge, upright where they would overlap."""
    if not turned:  # a long number at the end of the axis is kept inside of the picture
        x = min(x, right + 10.0 - 0.5 * text_width(words))
        return pen.words(x, bottom + LINE, words, anchor="middle")
    across, down = x + 0.35 * SIZE, bottom + 7.0
    more = f' transform="rotate(-90 {across:.1f} {down:.1f})"'
    return pen.words(across, down, words, anchor="end", more=more)


def _item(
    pen: _Pen, item: Item, panel: Panel, field: _Field, place: Place
) -> tuple[list[str], list[str]]:
    """What is clipped to the panel, and the words that are not."""
    if isinstance(item, Curve):
        return _curve(pen, item, panel, field, place), []
    if isinstance(item, Band):
        outline = np.concatenate((field.y(item.high), field.y(item.low)[::-1]))
        x = field.x(np.concatenate((item.x, item.x[::-1])))
        x, outline = thin_band(x, outline, place.width)
        fill = f'fill="{pen.colour(item.colour)}" fill-opacity="{item.opacity:g}"'
        return [f'<path d="{path_of(x, outline)}Z" {fill}/>'] if x.size else [], []
    if isinstance(item, Points):
        return _points(pen, item, field), []
    if isinstance(item, Rule):
        return _rule(pen, item, field, place)
    if isinstance(item, Span):
        return [_span(pen, item.axis, item.low, item.high, item.colour, item.opacity, field)], []
    if isinstance(item, Words):
        return [], [_words(pen, item, field, place, panel.bare)]
    if isinstance(item, Bars):
        return _bars(pen, item, field), []
    return [_image(item, field)], []


def _stroke(pen: _Pen, colour: Colour, width: float, dashes: Dashes = "-") -> str:
    dashed = f' stroke-dasharray="{_DASHES[dashes]}"' if _DASHES[dashes] else ""
    return f'fill="none" stroke="{pen.colour(colour)}" stroke-width="{_POINT * width:.3g}"{dashed}'


def _curve(pen: _Pen, item: Curve, panel: Panel, field: _Field, place: Place) -> list[str]:
    x, y = envelope(
        item.x, item.y, most_points=max(int(2 * place.width), 4),
        spacing="log" if panel.x.scale == "log" else "linear",
    )  # fmt: skip
    px, py = field.x(x), field.y(y)
    faint = f' opacity="{item.opacity:g}"' if item.opacity < 1.0 else ""
    look = _stroke(pen, item.colour, item.width, item.dashes)
    parts = [f'<path d="{path_of(px, py)}" {look} stroke-linejoin="round"{faint}/>']
    if item.marker:
        parts.append(_marks(pen, px, py, item.marker, item.size, item.colour, True))
    return parts


def _points(pen: _Pen, item: Points, field: _Field) -> list[str]:
    x, y = field.x(item.x), field.y(item.y)
    parts = []
    if item.low is not None and item.high is not None:
        low, high = field.y(item.low), field.y(item.high)
        bars = "".join(
            f"M{a:.1f} {b:.1f}V{c:.1f}"
            for a, b, c in zip(x.tolist(), low.tolist(), high.tolist(), strict=True)
            if np.isfinite(b + c)
        )
        parts.append(f'<path d="{bars}" {_stroke(pen, item.colour, 0.9)}/>')
    return [*parts, _marks(pen, x, y, item.marker or "o", item.size, item.colour, item.filled)]


def _marks(
    pen: _Pen,
    x: FloatArray,
    y: FloatArray,
    marker: Marker,
    size: float,
    colour: Colour,
    filled: bool,
) -> str:
    r = 0.5 * size * _POINT
    round_ = f"a{r:.2f} {r:.2f} 0 1 0 "
    shapes: dict[str, str] = {
        "o": f"m{-r:.2f} 0{round_:s}{2 * r:.2f} 0{round_:s}{-2 * r:.2f} 0",
        "s": f"m{-r:.2f} {-r:.2f}h{2 * r:.2f}v{2 * r:.2f}h{-2 * r:.2f}z",
        "^": f"m0 {-r:.2f}l{r:.2f} {2 * r:.2f}h{-2 * r:.2f}z",
        "v": f"m0 {r:.2f}l{r:.2f} {-2 * r:.2f}h{-2 * r:.2f}z",
        "x": f"m{-r:.2f} {-r:.2f}l{2 * r:.2f} {2 * r:.2f}m0 {-2 * r:.2f}l{-2 * r:.2f} {2 * r:.2f}",
        "+": f"m{-r:.2f} 0h{2 * r:.2f}m{-r:.2f} {-r:.2f}v{2 * r:.2f}",
    }
    path = "".join(
        f"M{a:.1f} {b:.1f}{shapes[marker]}"
        for a, b in zip(x.tolist(), y.tolist(), strict=True)
        if np.isfinite(a + b)
    )
    if filled and marker not in ("x", "+"):
        return f'<path d="{path}" fill="{pen.colour(colour)}"/>'
    return f'<path d="{path}" {_stroke(pen, colour, 1.1)}/>'


def _span(
    pen: _Pen, axis: str, low: float, high: float, colour: Colour, opacity: float, field: _Field
) -> str:
    place = field.place
    fill = f'fill="{pen.colour(colour)}" fill-opacity="{opacity:g}"'
    a, b = sorted(float(v) for v in (field.x if axis == "x" else field.y)([low, high]))
    if axis == "x":
        box = f'x="{a:.1f}" y="{place.top:.1f}" width="{b - a:.1f}" height="{place.height:.1f}"'
    else:
        box = f'x="{place.left:.1f}" y="{a:.1f}" width="{place.width:.1f}" height="{b - a:.1f}"'
    return f"<rect {box} {fill}/>"


def _rule(pen: _Pen, item: Rule, field: _Field, place: Place) -> tuple[list[str], list[str]]:
    parts = []
    upright = item.axis == "x"
    if item.low is not None and item.high is not None:
        parts.append(_span(pen, item.axis, item.low, item.high, item.colour, 0.18, field))
    at = float((field.x if upright else field.y)([item.at])[0])
    path = (
        f"M{at:.1f} {place.top:.1f}v{place.height:.1f}"
        if upright
        else f"M{place.left:.1f} {at:.1f}h{place.width:.1f}"
    )
    parts.append(f'<path d="{path}" {_stroke(pen, item.colour, item.width, item.dashes)}/>')
    if not item.words:
        return parts, []
    if not upright:
        last = place.left + place.width - text_width(item.words)
        x = max(min(place.left + item.words_at * place.width, last), place.left)
        return parts, [pen.boxed(x, at - 4.0, item.words, anchor="start", colour=item.colour)]
    y = place.top + (1.0 - item.words_at) * place.height + 0.85 * SIZE
    y = min(y, place.top + place.height - 4.0)
    room = text_width(item.words) + 5.0
    right = place.left + place.width
    fits = {"left": at - room >= place.left, "right": at + room <= right}
    side = "left" if item.side == "left" else "right"
    if item.side == "auto" and at > place.left + 0.7 * place.width:
        side = "left"
    if not fits[side]:
        side = "right" if side == "left" else "left"
    anchor = "end" if side == "left" else "start"
    x = at - 5.0 if side == "left" else at + 5.0
    if not fits[side]:  # neither: from the edge at which a curve that lags leaves room
        anchor, x = "start", place.left + 3.0
    return parts, [pen.boxed(x, y, item.words, anchor=anchor, colour=item.colour)]


def _words(pen: _Pen, item: Words, field: _Field, place: Place, bare: bool) -> str:
    if item.at == "share":
        x, y = place.left + item.x * place.width, place.top + (1.0 - item.y) * place.height
    else:
        x, y = float(field.x([item.x])[0]), float(field.y([item.y])[0])
    anchor = {"left": "start", "middle": "middle", "right": "end"}[item.anchor]
    if item.anchor == "left":  # what would leave the picture is moved in
        x = max(min(x + 5.0, place.left + place.width - text_width(item.text)), place.left + 2.0)
    put = pen.words if bare else pen.boxed  # a drawing has no lines behind its words
    return put(x, y + 0.35 * SIZE, item.text, anchor=anchor, colour=item.colour)


def _bars(pen: _Pen, item: Bars, field: _Field) -> list[str]:
    parts = []
    for y, length, colour in zip(item.y, item.length, item.colours, strict=True):
        a, b = sorted(float(v) for v in field.x([0.0, length]))
        top, bottom = sorted(float(v) for v in field.y([y - 0.3, y + 0.3]))
        box = f'x="{a:.1f}" y="{top:.1f}" width="{b - a:.1f}" height="{bottom - top:.1f}"'
        parts.append(f'<rect {box} fill="{pen.colour(colour)}"/>')
    return parts


def _image(item: Image, field: _Field) -> str:
    left, right = sorted(float(v) for v in field.x(item.x))
    top, bottom = sorted(float(v) for v in field.y(item.y))
    values = item.values[::-1] if field.y([item.y[0]])[0] > field.y([item.y[1]])[0] else item.values
    return _picture(values, item, left, top, right - left, bottom - top)


def _picture(
    values: FloatArray, item: Image, left: float, top: float, width: float, height: float
) -> str:
    return (
        f'<image x="{left:.1f}" y="{top:.1f}" width="{width:.1f}" height="{height:.1f}" '
        f'preserveAspectRatio="none" style="image-rendering:pixelated" '
        f'href="{picture_of(values, item)}"/>'
    )


def _colour_bar(pen: _Pen, item: Image, place: Place) -> list[str]:
    left = place.left + place.width + 12.0
    shades = np.linspace(item.high, item.low, 64)[:, np.newaxis]
    parts = [_picture(shades, item, left, place.top, 12.0, place.height)]
    for at, words in ticks(Axis(), (item.low, item.high), most=6):
        share = (at - item.low) / ((item.high - item.low) or 1.0)
        parts.append(pen.words(left + 16.0, place.top + (1.0 - share) * place.height + 4.0, words))
    x, y = left + 52.0, place.top + 0.5 * place.height
    turned = f' transform="rotate(-90 {x:.1f} {y:.1f})"'
    return [*parts, pen.words(x, y, item.label, anchor="middle", more=turned)]


def _heading(pen: _Pen, panel: Panel, place: Place) -> list[str]:
    """Title and legend, above the panel, where they hide no data."""
    parts = []
    lines = legend_lines(panel, place.width)
    items = {getattr(item, "label", ""): item for item in reversed(legend_items(panel))}
    up = place.top - 8.0 - LINE * (len(lines) - 1)
    for k, labels in enumerate(lines):
        x = place.left + place.width - sum(38.0 + text_width(label) for label in labels) + 8.0
        x = max(x, place.left)
        for label in labels:
            parts += _handle(pen, items[label], x, up + LINE * k - 4.0)
            parts.append(pen.words(x + 26.0, up + LINE * k, label))
            x += 38.0 + text_width(label)
    if panel.title:
        used = sum(38.0 + text_width(label) for label in lines[0]) if len(lines) == 1 else 0.0
        beside = not lines or (used and used + text_width(panel.title) + 16.0 < place.width)
        y = place.top - 8.0 - (0.0 if beside else LINE * len(lines))
        parts.append(pen.words(place.left, y, panel.title, more=' font-weight="600"'))
    return parts


def _handle(pen: _Pen, item: Item, x: float, y: float) -> list[str]:
    if isinstance(item, Band | Span):
        opacity = max(item.opacity, 0.25)
        fill = f'fill="{pen.colour(item.colour)}" fill-opacity="{opacity:g}"'
        return [f'<rect x="{x:.1f}" y="{y - 5:.1f}" width="22" height="10" {fill}/>']
    parts = []
    if isinstance(item, Curve | Rule):
        look = _stroke(pen, item.colour, item.width, item.dashes)
        parts.append(f'<path d="M{x:.1f} {y:.1f}h22" {look}/>')
    if isinstance(item, Points) and item.low is not None:
        parts.append(f'<path d="M{x + 11:.1f} {y - 5:.1f}v10" {_stroke(pen, item.colour, 0.9)}/>')
    if isinstance(item, Curve | Points) and (item.marker or isinstance(item, Points)):
        filled = not isinstance(item, Points) or item.filled
        at = np.array([x + 11.0]), np.array([y])
        parts.append(_marks(pen, *at, item.marker or "o", item.size, item.colour, filled))
    return parts
