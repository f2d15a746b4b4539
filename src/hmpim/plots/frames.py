"""Frames of a camera, with where the target was and where the tracker saw it."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from hmpim.plots.style import COLOURS, FONT_SIZE, WIDTH

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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


def tracked_frames(frames: Sequence[Frame]) -> "Figure":
    """Draw frames side by side: a ring where the target was, a cross where the tracker saw it.

    Parameters
    ----------
    frames : sequence of Frame
        At least one.

    Examples
    --------
    >>> from hmpim.rigs.tracker import TrackedFrame
    >>> image = np.zeros((40, 60), dtype=np.uint8)
    >>> frame = TrackedFrame(time=0.5, image=image, target=(30.0, 20.0), point=(30.2, 20.0))
    >>> tracked_frames([frame]).axes[0].get_title()
    '0.500 s: 0.20 pixels off'
    """
    from matplotlib.figure import Figure

    rows = -(-len(frames) // _ACROSS)
    high, wide = frames[0].image.shape
    each = WIDTH / _ACROSS
    figure = Figure(figsize=(WIDTH, rows * (each * high / wide + 0.35) + 0.3), layout="constrained")
    for place, frame in enumerate(frames):
        axes = figure.add_subplot(rows, _ACROSS, place + 1)
        axes.imshow(
            frame.image, cmap="gray", vmin=0, vmax=255, extent=(0, wide, high, 0),
            interpolation="nearest",
        )  # fmt: skip
        axes.plot(
            *frame.target, "o", color=COLOURS["input"], markersize=13, fillstyle="none",
            markeredgewidth=1.4, label="target",
        )  # fmt: skip
        text = f"{frame.time:.3f} s: lost"
        if frame.point is not None:
            axes.plot(
                *frame.point, "+", color=COLOURS["output"], markersize=11, markeredgewidth=1.4,
                label="tracked",
            )  # fmt: skip
            off = float(np.hypot(*np.subtract(frame.point, frame.target)))
            text = f"{frame.time:.3f} s: {off:.2f} pixels off"
        axes.set_title(text, fontsize=FONT_SIZE - 1)
        axes.set_xlim(0, wide)
        axes.set_ylim(high, 0)
        axes.set_xticks([])
        axes.set_yticks([])
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, frameon=False,
                  fontsize=FONT_SIZE - 1)  # fmt: skip
    return figure
