"""Pictures of many values: how they are distributed, in which order, and in which groups."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from hmpim.plots import Axis, Band, Curve, Figure, Panel, Points, Rule
from hmpim.plots.description import Item
from hmpim.plots.style import axis_label, plain
from hmpim.report.words import label_of

__all__ = ["FOR_A_MEDIAN", "distribution", "groups", "sequence"]

Real = NDArray[np.float64]

_MOST_POINTS = 1500
_FEW_POINTS = 200
FOR_A_MEDIAN = 60
"""Records from which on a running median is drawn: three blocks of twenty."""

_MOST_GROUPS = 24
_MARGIN = 0.02
"""Of the axis at either end."""
_FEW_NAMES = 10
_MOST_TICKS = 8
_LONGEST = 14
"""Characters of a name below an axis."""
_ROUNDING = 1e-9
"""Share of a figure, as of one found exactly."""
_STEPS = tuple(m * 10**k for k in range(10) for m in (1, 2, 5))


def distribution(values: Real, *, name: str, unit: str, bounds: tuple[float, ...] = ()) -> Figure:
    """Describe a histogram; what lies far out is counted in the outermost bars.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Finite.
    name, unit : str
        Of the quantity.
    bounds : tuple of float
        Limits to be drawn.

    Examples
    --------
    >>> figure = distribution(np.arange(10.0), name="delay", unit="s")
    >>> figure.panels[0].x.label
    'Delay, pure (s)'
    """
    values = _equalled(values)
    tail = 0.01 if values.size > 50 else 0.0
    low, high = (float(end) for end in np.quantile(values, (tail, 1.0 - tail)))
    if not high > low:
        low, high = float(values.min()), float(values.max())
    reach = (high - low) * 0.25 or max(abs(low), 1e-12) * 1e-3
    count = int(np.clip(np.sqrt(values.size), 8, 60))
    edges = np.linspace(low - reach, high + reach, count + 1)
    heights, _ = np.histogram(np.clip(values, edges[0], edges[-1]), edges)
    x, top = np.repeat(edges, 2)[1:-1], np.repeat(heights.astype(float), 2)
    items: tuple[Item, ...] = (
        Band(x=x, low=np.zeros_like(top), high=top, opacity=0.35),
        Rule(at=float(np.median(values)), words="median", colour="model", dashes="-"),
        *(Rule(at=bound, words="limit", words_at=0.8) for bound in bounds),
    )
    return Figure(
        panels=(
            Panel(
                x=Axis(label=axis_label(label_of(name), unit)),
                y=Axis(label="Records", low=0.0, whole=True),
                items=items,
            ),
        ),
        alt=f"Histogram of {name} over {values.size} records.",
    )


def sequence(
    places: Real,
    values: Real,
    *,
    name: str,
    unit: str,
    along: str,
    bounds: tuple[float, ...] = (),
    names: tuple[str, ...] = (),
) -> Figure:
    """Describe values one after the other, with their running median.

    Parameters
    ----------
    places : ndarray, shape (n,)
        Where they stand, such as days; rising.
    values : ndarray, shape (n,)
        Finite.
    name, unit, along : str
        Of the quantity, and of the places.
    bounds : tuple of float
        Limits to be drawn.
    names : tuple of str
        Of the records, where each has a place of its own: few are named, many numbered from 1.

    Examples
    --------
    >>> figure = sequence(
    ...     np.arange(2.0), np.ones(2), name="delay", unit="s", along="Record", names=("a", "b"))
    >>> figure.panels[0].x.ticks, figure.panels[0].x.low
    (((0.0, 'a'), (1.0, 'b')), -0.5)
    """
    values = _equalled(values)
    every = np.unique(np.linspace(0, values.size - 1, _MOST_POINTS).astype(int))
    far = np.argsort(np.abs(values - np.median(values)))[-50:]
    shown = np.union1d(every, far)
    size = 2.0 if values.size > _FEW_POINTS else 4.5
    items: list[Points | Curve | Rule] = [
        Points(x=places[shown], y=values[shown], size=size, colour="input")
    ]
    if values.size >= FOR_A_MEDIAN:
        blocks = np.array_split(np.arange(values.size), min(values.size // 20, 60))
        middle = np.array([np.median(places[b]) for b in blocks])
        median = np.array([np.median(values[b]) for b in blocks])
        items.append(Curve(x=middle, y=median, label="running median", colour="output", width=1.8))
    items += [Rule(at=bound, axis="y", words="limit") for bound in bounds]
    return Figure(
        panels=(
            Panel(
                x=_along(places, along, names),
                y=Axis(label=axis_label(label_of(name), unit)),
                items=tuple(items),
            ),
        ),
        alt=f"{name} of {values.size} records along {along}, with the running median.",
    )


def _equalled(values: Real) -> Real:
    """Values that differ by rounding alone as equal ones: an axis could not tell them apart."""
    if values.size and np.ptp(values) <= _ROUNDING * np.abs(values).max():
        return np.full_like(values, np.median(values))
    return values


def _along(places: Real, label: str, names: tuple[str, ...]) -> Axis:
    """Axis of the records, with room for the first and the last mark."""
    low, high = (float(places.min()), float(places.max())) if places.size else (0.0, 0.0)
    if not names:
        room = _MARGIN * (high - low) or 0.5
        return Axis(label=label, low=low - room, high=high + room)
    if len(names) <= _FEW_NAMES:
        shown = list(enumerate(_short(names)))
    else:
        step = next(s for s in _STEPS if len(names) <= _MOST_TICKS * s)
        shown = [(0, "1"), *((k - 1, str(k)) for k in range(step, len(names) + 1, step) if k > 1)]
    ticks = tuple((float(at), words) for at, words in shown)
    return Axis(label=label, low=-0.5, high=len(names) - 0.5, ticks=ticks, grid=False)


def groups(some: Mapping[str, Real], *, name: str, unit: str, by: str) -> Figure:
    """Describe medians of groups, with the range that holds nine tenths of each.

    Parameters
    ----------
    some : mapping of str to ndarray
        Values of each group, none of them empty; the first 24 are drawn.
    name, unit, by : str
        Of the quantity, and what the groups are.
    """
    shown = list(some.items())[:_MOST_GROUPS]
    low, median, high = np.array([np.quantile(v, (0.05, 0.5, 0.95)) for _, v in shown]).T
    at = np.arange(len(shown), dtype=np.float64)
    words = tuple((float(k), label) for k, label in enumerate(_short([key for key, _ in shown])))
    return Figure(
        panels=(
            Panel(
                x=Axis(label=by, ticks=words, low=-0.5, high=len(shown) - 0.5, grid=False),
                y=Axis(label=axis_label(label_of(name), unit)),
                items=(Points(x=at, y=median, low=low, high=high, size=5.0, colour="output"),),
            ),
        ),
        alt=f"Median of {name} and the range of nine tenths, by {by}, for {len(shown)} groups.",
    )


def _short(names: Sequence[str]) -> list[str]:
    """Names cut to what an axis has room for: at the end, or before it where ends differ.

    Examples
    --------
    >>> _short(["a", "acceptance, cold"]), _short(["the mass of unit 5", "the mass of unit 6"])
    (['a', 'acceptance, c…'], ['…ass of unit 5', '…ass of unit 6'])
    """
    whole = [plain(name) for name in names]
    room = _LONGEST - 1
    cut = [name if len(name) <= _LONGEST else f"{name[:room]}…" for name in whole]
    if len(set(cut)) == len(set(whole)):
        return cut
    return [name if len(name) <= _LONGEST else f"…{name[-room:]}" for name in whole]
