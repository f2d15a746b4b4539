"""What every way of drawing needs to know: the ends of each axis, its ticks, its legend."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmpim.plots.description import (
    Axis,
    Band,
    Bars,
    Curve,
    Figure,
    Image,
    Item,
    Panel,
    Points,
    Rule,
    Scale,
)

__all__ = ["Frame", "frames", "legend_items", "on_left", "placed", "ticks", "unplaced"]

FloatArray = NDArray[np.float64]
_LINEAR_TO = 10.0  # of 'symlog'
_TURNS = (1.0, 2.0, 5.0, 15.0, 30.0, 45.0, 90.0, 180.0, 360.0, 720.0)
_FEW_DEGREES = 20.0  # below, a phase is numbered as anything else
_MOST_TURNS = 16  # of a phase; a quarter turn each as long as there is room
_FEWEST = 3  # numbers of an axis that say how long it is
_CLOSER = 2.25  # times as many ticks as look well do not yet overlap
_FROM_QUARTERS = 135.0  # a phase that spans more has ticks of quarter turns at least


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """Ends of a panel's axes, in data units."""

    x: tuple[float, float]
    y: tuple[float, float]


def frames(figure: Figure) -> list[Frame]:
    """Return the ends of each panel's axes: as stated, or so that the data fit.

    Parameters
    ----------
    figure : Figure
        Panels of one column have one horizontal axis if it says so.

    Examples
    --------
    >>> curve = Curve(x=np.array([0.0, 10.0]), y=np.array([-1.0, 1.0]))
    >>> panel = Panel(x=Axis(), y=Axis(low=-2.0), items=(curve,))
    >>> frames(Figure(panels=(panel,), alt=""))[0].y
    (-2.0, 1.1)
    """
    widths: list[tuple[float, float]] = []
    for panel in figure.panels:
        same = [
            other
            for other in figure.panels
            if other is panel or (figure.share_x and other.column == panel.column)
        ]
        low = next((other.x.low for other in same if other.x.low is not None), None)
        high = next((other.x.high for other in same if other.x.high is not None), None)
        seen = [values for other in same for values in _values(other, "x")]
        widths.append(_ends(low, high, seen, panel.x.scale, margin=0.01))
    return [
        Frame(
            x=width,
            y=_ends(
                panel.y.low, panel.y.high, list(_values(panel, "y")), panel.y.scale, margin=0.05
            ),
        )
        for panel, width in zip(figure.panels, widths, strict=True)
    ]


def _values(panel: Panel, axis: str) -> list[FloatArray]:
    """Return everything that has a place on an axis."""
    found: list[FloatArray] = []
    for item in panel.items:
        if isinstance(item, Curve | Points):
            found.append(item.x if axis == "x" else item.y)
        if isinstance(item, Points) and axis == "y":
            found += [ends for ends in (item.low, item.high) if ends is not None]
        elif isinstance(item, Band):
            found += [item.x] if axis == "x" else [item.low, item.high]
        elif isinstance(item, Rule) and item.axis == axis == "y":
            found.append(np.array([item.at]))
        elif isinstance(item, Bars):
            y = np.array(item.y)
            found.append(
                np.array([0.0, *item.length]) if axis == "x" else np.concatenate((y - 0.5, y + 0.5))
            )
        elif isinstance(item, Image):
            found.append(np.array(item.x if axis == "x" else item.y))
    return found


def _ends(
    low: float | None,
    high: float | None,
    values: list[FloatArray],
    scale: Scale,
    *,
    margin: float,
) -> tuple[float, float]:
    if low is not None and high is not None:
        return float(low), float(high)
    seen = np.concatenate([np.empty(0), *(np.ravel(v) for v in values)])
    seen = seen[np.isfinite(seen) & ((seen > 0.0) if scale == "log" else np.ones_like(seen, bool))]
    if not seen.size:
        seen = np.array([0.1, 1.0]) if scale == "log" else np.array([0.0, 1.0])
    first, last = (float(v) for v in placed(np.array([seen.min(), seen.max()]), scale))
    room = margin * (last - first) or max(0.05 * abs(first), 0.05)
    outer = unplaced(np.array([first - room, last + room]), scale)
    return (
        float(outer[0]) if low is None else float(low),
        float(outer[1]) if high is None else float(high),
    )


def placed(values: FloatArray, scale: Scale) -> FloatArray:
    """Return where values lie along an axis of this scale; NaN where they have no place.

    Examples
    --------
    >>> placed(np.array([0.0, 1.0, 100.0]), "log").tolist()
    [nan, 0.0, 2.0]
    >>> placed(np.array([0.0, 90.0, -90.0]), "symlog").tolist()
    [0.0, 1.0, -1.0]
    """
    values = np.asarray(values, dtype=np.float64)
    if scale == "log":
        out = np.full(values.shape, np.nan)
        np.log10(values, out=out, where=values > 0.0)
        return out
    if scale == "symlog":
        return np.asarray(np.sign(values) * np.log10(1.0 + np.abs(values) / _LINEAR_TO))
    return values


def unplaced(places: FloatArray, scale: Scale) -> FloatArray:
    """Return the values that `placed` put there.

    Examples
    --------
    >>> unplaced(placed(np.array([-90.0, 0.5]), "symlog"), "symlog").round(9).tolist()
    [-90.0, 0.5]
    """
    places = np.asarray(places, dtype=np.float64)
    if scale == "log":
        return np.asarray(10.0**places)
    if scale == "symlog":
        return np.asarray(np.sign(places) * _LINEAR_TO * (10.0 ** np.abs(places) - 1.0))
    return places


def ticks(axis: Axis, ends: tuple[float, float], *, most: int = 7) -> list[tuple[float, str]]:
    """Return values and words of an axis's ticks, all between its ends.

    Parameters
    ----------
    axis : Axis
        Its scale, or its own ticks.
    ends : tuple of float
        From `frames`.
    most : int
        How many there may be.

    Examples
    --------
    >>> [words for _, words in ticks(Axis(degrees=True), (-290.0, 20.0))]
    ['−270', '−180', '−90', '0']
    >>> [words for _, words in ticks(Axis(scale="symlog"), (0.0, 5000.0), most=3)]
    ['0', '100']
    >>> [words for _, words in ticks(Axis(scale="log"), (0.1, 20.0), most=8)]
    ['0.1', '0.2', '0.5', '1', '2', '5', '10', '20']
    >>> [words for _, words in ticks(Axis(whole=True), (0.0, 3.2))]
    ['0', '1', '2', '3']
    """
    low, high = min(ends), max(ends)
    if axis.ticks is not None:
        return [(at, words) for at, words in axis.ticks if low <= at <= high]
    if axis.scale == "log":
        values = _log_ticks(low, high, most)
    elif axis.scale == "symlog":
        values = [0.0] * (low <= 0.0) + [10.0**k for k in range(1, 13) if low <= 10.0**k <= high]
        values = values[:: -(-len(values) // most)]
    elif axis.degrees and high - low > _FEW_DEGREES:
        span = high - low
        room = min(_MOST_TURNS, _CLOSER * most)
        steps = [s for s in _TURNS if span <= room * s]
        if span > _FROM_QUARTERS:
            steps = [s for s in steps if s >= 90.0]
        elif span <= most * 45.0:
            steps = [s for s in steps if span <= most * s]
        step = steps[0] if steps else 360.0 * np.ceil(span / 2e3)
        values = _multiples(low, high, step)
        if len(values) < _FEWEST:  # it lies about one of them
            values = _multiples(low, high, max((s for s in _TURNS if s < step), default=step))
    else:
        step = _round_step(high - low, most)
        values = _multiples(low, high, float(np.ceil(step)) if axis.whole else step)
    return list(zip(values, _words(values), strict=True))


def _multiples(low: float, high: float, step: float) -> list[float]:
    first, last = np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9)
    return [float(k * step) + 0.0 for k in np.arange(first, last + 1.0)]  # no minus nought


def _round_step(span: float, most: int) -> float:
    rough = span / max(most, 1) if span > 0 else 1.0
    power = 10.0 ** np.floor(np.log10(rough))
    return float(next(m * power for m in (1.0, 2.0, 2.5, 5.0, 10.0) if m * power >= rough * 0.999))


def _log_ticks(low: float, high: float, most: int) -> list[float]:
    if not 0.0 < low < high:
        return []
    first, last = int(np.floor(np.log10(low))), int(np.ceil(np.log10(high)))
    for parts in ((1.0, 2.0, 5.0), (1.0, 3.0), (1.0,)):
        values = [m * 10.0**k for k in range(first, last + 1) for m in parts]
        values = [v for v in values if low * (1 - 1e-9) <= v <= high * (1 + 1e-9)]
        if 2 <= len(values) <= most:
            return values
    if len(values) < 2:  # a narrow band
        return [v for v in _multiples(low, high, _round_step(high - low, most)) if v > 0]
    return values[:: -(-len(values) // most)]


def _words(values: list[float]) -> list[str]:
    """Numbers as short as they can be, a true minus before them."""
    if not values:
        return []
    size = max(abs(v) for v in values)
    if size and (size >= 1e6 or size < 1e-3):
        shown = [f"{v:.3g}".replace("e-0", "e-").replace("e+0", "e") for v in values]
        return [words.replace("-", "−") for words in shown]
    return [f"{round(v, 9):.10g}".replace("-", "−") for v in values]


def legend_items(panel: Panel) -> list[Item]:
    """Return the items that a panel's legend lists, each label once.

    Examples
    --------
    >>> rules = (Rule(at=1.0, label="limit"), Rule(at=-1.0, label="limit"), Rule(at=0.0))
    >>> len(legend_items(Panel(x=Axis(), y=Axis(), items=rules)))
    1
    """
    if not panel.legend:
        return []
    named: dict[str, Item] = {}
    for item in panel.items:
        label = "" if isinstance(item, Bars | Image) else getattr(item, "label", "")
        if label and label not in named:
            named[label] = item
    return list(named.values())


def on_left(item: Rule, axis: Axis, ends: tuple[float, float]) -> bool:
    """Whether the words of an upright line stand on its left.

    Examples
    --------
    >>> on_left(Rule(at=9.0), Axis(), (0.0, 10.0)), on_left(Rule(at=1.0), Axis(), (0.0, 10.0))
    (True, False)
    """
    if item.side != "auto":
        return item.side == "left"
    at, low, high = placed(np.array([item.at, *ends]), axis.scale)
    return bool((at - low) > 0.7 * (high - low))
