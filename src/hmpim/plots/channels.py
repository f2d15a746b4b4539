"""A picture of each channel of a file: small, whole, its gaps shown as gaps."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hmpim.plots.description import Axis, Curve, Figure, Item, Panel, Points, Span
from hmpim.plots.style import Colour, axis_label, plain

__all__ = ["braille", "channel_picture", "pieces"]

_MOST_PIECES = 200
_DOTS = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))  # of a braille sign, top to bottom


def pieces(
    time: NDArray[np.float64], values: NDArray[np.float64]
) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Cut a curve where samples are missing, so that no line is drawn across a gap.

    Parameters
    ----------
    time, values : ndarray, shape (n,)
        As they were read; NaN where a sample is missing.

    Examples
    --------
    >>> t = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 9.0, 10.0])
    >>> [x.tolist() for x, _ in pieces(t, np.array([1.0, 1.0, np.nan, 1.0, 1.0, 1.0, 1.0]))]
    [[0.0, 1.0], [3.0, 4.0], [9.0, 10.0]]
    """
    there = np.flatnonzero(np.isfinite(time) & np.isfinite(values))
    if not there.size:
        return []
    order = there[np.argsort(time[there], kind="stable")]
    t, v = time[order], values[order]
    steps = np.diff(t)
    usual = float(np.median(steps)) if steps.size else 0.0
    cuts = np.flatnonzero(steps > 1.9 * usual) + 1
    if cuts.size > _MOST_PIECES:
        return [(t, v)]
    return list(zip(np.split(t, cuts), np.split(v, cuts), strict=True))


def channel_picture(
    time: NDArray[np.float64],
    values: NDArray[np.float64],
    *,
    name: str,
    unit: str = "",
    colour: Colour = "model",
) -> Figure:
    """Describe a channel over time, small.

    Parameters
    ----------
    time, values : ndarray, shape (n,)
        As they were read; NaN where a sample is missing.
    name, unit : str
        Of the channel.
    colour : str
        A name of `COLOURS`.

    Examples
    --------
    >>> t = np.linspace(0.0, 1.0, 50)
    >>> channel_picture(t, np.sin(t), name="gyro", unit="deg/s").panels[0].y.label
    'gyro (deg/s)'
    """
    parts = pieces(time, values)
    items: list[Item] = [
        Span(low=before[-1], high=after[0], colour="grid", opacity=0.6)
        for (before, _), (after, _) in pairwise(parts)
    ]
    for t, v in parts:
        if t.size == 1:
            items.append(Points(x=t, y=v, colour=colour, size=2.0))
        else:
            items.append(Curve(x=t, y=v, colour=colour, width=0.9))
    return Figure(
        panels=(
            Panel(
                x=Axis(label="Time (s)"), y=Axis(label=axis_label(name, unit)), items=tuple(items)
            ),
        ),
        alt=f"Channel {plain(name)} over time.",
        heights=(1.15,),
    )


def braille(values: NDArray[np.float64], *, width: int = 24) -> str:
    """Draw a curve in a line of text: two columns of four dots to a sign, minimum to maximum.

    Parameters
    ----------
    values : ndarray, shape (n,)
        NaN where a sample is missing, which leaves a hole.
    width : int
        Number of signs.

    Examples
    --------
    >>> braille(np.sin(np.linspace(0, 12, 500)), width=10)
    '⠋⠉⠳⣄⣠⠞⠉⠳⣄⣀'
    """
    columns = 2 * width
    finite = values[np.isfinite(values)]
    if not finite.size:
        return " " * width
    low, span = float(finite.min()), float(np.ptp(finite)) or 1.0
    edges = np.linspace(0, values.size, columns + 1).astype(int)
    signs = [0] * width
    for k in range(columns):
        part = values[edges[k] : max(edges[k + 1], edges[k] + 1)]
        part = part[np.isfinite(part)]
        if not part.size:
            continue
        top = 3 - min(3, int(4 * (float(part.max()) - low) / span))
        bottom = 3 - min(3, int(4 * (float(part.min()) - low) / span))
        for row in range(top, bottom + 1):
            signs[k // 2] |= _DOTS[k % 2][row]
    return "".join(chr(0x2800 + sign) for sign in signs)
