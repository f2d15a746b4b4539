"""Frames of a camera, with where the target was and where the tracker saw it."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hmpim.plots.description import Axis, Figure, Image, Item, Marker, Panel, Points
from hmpim.plots.style import WIDTH, Colour

__all__ = ["Frame", "tracked_frames"]

_ACROSS = 3


class Frame(Protocol):
    """What is drawn of a frame; `hmpim.rigs.tracker.TrackedFrame` is one."""

    @property
    def time(self) -> float:
        """When it was taken, s."""
        ...

    @property
    def image(self) -> NDArray[np.uint8]:
        """Grey levels, shape (height, width)."""
        ...

    @property
    def target(self) -> tuple[float, float]:
        """Where the target was, pixels from the left and upper edge."""
        ...

    @property
    def point(self) -> tuple[float, float] | None:
        """Where the tracker saw it, or None."""
        ...


def tracked_frames(frames: Sequence[Frame]) -> Figure:
    """Describe frames side by side: a ring where the target was, a cross where the tracker saw it.

    Parameters
    ----------
    frames : sequence of Frame
        At least one.

    Examples
    --------
    >>> from hmpim.rigs.tracker import TrackedFrame
    >>> image = np.zeros((40, 60), dtype=np.uint8)
    >>> frame = TrackedFrame(time=0.5, image=image, target=(30.0, 20.0), point=(30.2, 20.0))
    >>> tracked_frames([frame]).panels[0].title
    '0.500 s: 0.20 pixels off'
    """
    high, wide = frames[0].image.shape
    rows = -(-len(frames) // _ACROSS)
    panels = []
    for place, frame in enumerate(frames):
        x, y = frame.target
        items: list[Item] = [
            Image(
                values=frame.image[::-1].astype(np.float64),
                x=(0.0, float(wide)),
                y=(float(high), 0.0),
                low=0.0,
                high=255.0,
                palette="grey",
            ),
            _point(x, y, label="target", colour="input", marker="o", size=12.0),
        ]
        text = f"{frame.time:.3f} s: lost"
        if frame.point is not None:
            seen = _point(*frame.point, label="tracked", colour="output", marker="+", size=11.0)
            items.append(seen)
            off = float(np.hypot(*np.subtract(frame.point, frame.target)))
            text = f"{frame.time:.3f} s: {off:.2f} pixels off"
        panels.append(
            Panel(
                x=Axis(low=0.0, high=float(wide), ticks=()),
                y=Axis(low=float(high), high=0.0, ticks=()),
                items=tuple(items),
                title=text,
                row=place // _ACROSS,
                column=place % _ACROSS,
                legend=place == 0,
            )
        )
    words = "; ".join(panel.title for panel in panels)
    return Figure(
        panels=tuple(panels),
        alt=f"Frames of the camera, the target ringed and where it was seen crossed: {words}.",
        heights=(WIDTH / _ACROSS * high / wide + 0.5,) * rows,
        columns=min(_ACROSS, len(frames)),
        share_x=False,
    )


def _point(
    x: float, y: float, *, label: str, colour: Colour, marker: Marker, size: float
) -> Points:
    return Points(
        x=np.array([float(x)]),
        y=np.array([float(y)]),
        label=label,
        colour=colour,
        marker=marker,
        size=size,
        filled=False,
    )
