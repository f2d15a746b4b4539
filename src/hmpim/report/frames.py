"""The picture of what a tracker saw."""

from collections.abc import Sequence

from hmpim.plots.frames import Frame, tracked_frames
from hmpim.report.figures import Picture

__all__ = ["frames_picture"]


def frames_picture(frames: Sequence[Frame]) -> Picture:
    """Return the picture of some frames of a run, spread over it.

    Examples
    --------
    >>> import numpy as np
    >>> from hmpim.rigs.tracker import TrackedFrame
    >>> image = np.zeros((40, 60), dtype=np.uint8)
    >>> frames_picture(
    ...     [TrackedFrame(time=0.5, image=image, target=(30.0, 20.0), point=None)]
    ... ).description
    '1 frame between 0.5 and 0.5 s; the tracker had lost its target in 1.'
    """
    lost = sum(frame.point is None for frame in frames)
    count = f"{len(frames)} frame{'s' if len(frames) > 1 else ''}"
    said = f"; the tracker had lost its target in {lost}" if lost else ""
    return Picture(
        key="frames",
        title="What the tracker saw",
        caption="Frames of the run. The ring is where the target was, the cross where the tracker "
        "saw it.",
        description=f"{count} between {frames[0].time:.3g} and {frames[-1].time:.3g} s{said}.",
        figure=tracked_frames(frames),
    )
