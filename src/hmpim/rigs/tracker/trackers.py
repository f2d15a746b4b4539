"""Trackers: a function of a frame that returns where the target is, in pixels.

Pixel k covers [k, k + 1]: the middle of the first one is at 0.5. A tracker that has lost its
target returns None.
"""

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import ArgumentError, MissingExtraError, RigError

__all__ = ["TRACKERS", "Tracker", "TrackerName", "make_tracker"]

Image = NDArray[np.uint8]
Point = tuple[float, float]
Tracker = Callable[[Image], Point | None]
"""Takes frames of shape (height, width), one after the other; returns x and y in pixels."""

TrackerName = Literal["centroid", "template", "csrt"]
TRACKERS: tuple[TrackerName, ...] = ("centroid", "template", "csrt")
"""Trackers made of OpenCV."""


def make_tracker(name: TrackerName, *, at: Point, size: Point) -> Tracker:
    """Make one of OpenCV's trackers.

    Parameters
    ----------
    name : {'centroid', 'template', 'csrt'}
        Centre of brightness; best match of the first view; discriminative correlation filter.
    at : (float, float)
        Where the target is in the first frame, pixels.
    size : (float, float)
        Width and height of the target, pixels.

    Raises
    ------
    ArgumentError
        If there is no such tracker.
    MissingExtraError
        If OpenCV is not installed.

    Examples
    --------
    >>> from hmpim.rigs.tracker.scene import Scene
    >>> scene, rng = Scene(), np.random.default_rng(1)
    >>> backdrop = scene.backdrop(rng)
    >>> follow = make_tracker("centroid", at=scene.middle, size=(11.0, 9.0))
    >>> x, y = follow(backdrop.seen(0.123, 0.0, rng))
    >>> abs(scene.pixel * (x - scene.middle[0]) - 0.123) < 0.02
    True
    """
    makers: dict[str, Callable[..., Tracker]] = {
        "centroid": _Centroid,
        "template": _Template,
        "csrt": _Csrt,
    }
    if name not in makers:
        raise ArgumentError(f"tracker = {name!r} is not known; use one of {TRACKERS}")
    return makers[name](_opencv(), at, size)


def _opencv() -> Any:
    try:
        import cv2
    except ImportError:
        raise MissingExtraError(
            "a tracker needs OpenCV; install the extra: pip install 'hmpim[tracker]'"
        ) from None
    return cv2


class _Centroid:
    """Centre of what is clearly brighter than the background, in a gate around the last place."""

    def __init__(self, cv2: Any, at: Point, size: Point) -> None:
        self._cv2, self._at = cv2, at
        self._half = (round(size[0] / 2 + 18), round(size[1] / 2 + 18))

    def __call__(self, frame: Image) -> Point | None:
        left, top, gate = _cut(frame, self._at, self._half)
        if gate.size == 0:
            return None
        grey = self._cv2.GaussianBlur(gate.astype(np.float32), (3, 3), 0)
        border = np.concatenate([grey[0], grey[-1], grey[:, 0], grey[:, -1]])
        above = grey - np.median(border)
        peak = float(np.percentile(above, 98))
        if peak < 5.0 * max(float(border.std()), 1.0):
            return None
        # Weights that rise from the threshold: a sharp cut would jump by whole pixels.
        weights = np.clip(above - 0.35 * peak, 0.0, 0.6 * peak)
        found = self._cv2.moments(weights)
        if found["m00"] <= 0.0:
            return None
        x = left + found["m10"] / found["m00"] + 0.5
        y = top + found["m01"] / found["m00"] + 0.5
        self._at = (x, y)
        return self._at


class _Template:
    """Best normalised correlation with the first view, refined by a parabola."""

    def __init__(self, cv2: Any, at: Point, size: Point) -> None:
        self._cv2, self._at = cv2, at
        self._half = (round(size[0] / 2 + 4), round(size[1] / 2 + 4))
        self._search = (self._half[0] + 16, self._half[1] + 16)
        self._view: Image | None = None
        self._inside: Point = (0.0, 0.0)

    def __call__(self, frame: Image) -> Point | None:
        if self._view is None:
            left, top, self._view = _cut(frame, self._at, self._half)
            self._inside = (self._at[0] - left, self._at[1] - top)
            return self._at
        left, top, where = _cut(frame, self._at, self._search)
        if where.shape[0] < self._view.shape[0] or where.shape[1] < self._view.shape[1]:
            return None
        score = self._cv2.matchTemplate(where, self._view, self._cv2.TM_CCOEFF_NORMED)
        _, best, _, (i, j) = self._cv2.minMaxLoc(score)
        if best < 0.75:  # clutter alone reaches 0.6
            return None
        x = left + i + _summit(score[j, max(i - 1, 0) : i + 2]) + self._inside[0]
        y = top + j + _summit(score[max(j - 1, 0) : j + 2, i]) + self._inside[1]
        self._at = (x, y)
        return self._at


class _Csrt:
    """OpenCV's CSRT. It answers in whole pixels where OpenCV has no other."""

    def __init__(self, cv2: Any, at: Point, size: Point) -> None:
        old = getattr(cv2, "legacy", None)
        make = getattr(old, "TrackerCSRT_create", None) or getattr(cv2, "TrackerCSRT_create", None)
        if make is None:
            raise RigError(
                "this OpenCV has no CSRT; install the extra, which brings the one that has: "
                "pip install 'hmpim[tracker]'"
            )
        cv2.setNumThreads(1)
        cv2.setRNGSeed(1)
        self._cv2, self._tracker = cv2, make()
        wide, high = size[0] + 4, size[1] + 4
        box = (at[0] - wide / 2, at[1] - high / 2, wide, high)
        self._box = tuple(round(edge) for edge in box)
        self._offset = (
            at[0] - self._box[0] - self._box[2] / 2,
            at[1] - self._box[1] - self._box[3] / 2,
        )
        self._begun = False

    def __call__(self, frame: Image) -> Point | None:
        coloured = self._cv2.cvtColor(frame, self._cv2.COLOR_GRAY2BGR)
        if not self._begun:
            self._tracker.init(coloured, self._box)
            self._begun = True
            box: tuple[float, ...] = self._box
        else:
            good, box = self._tracker.update(coloured)
            if not good:
                return None
        return (
            float(box[0] + box[2] / 2 + self._offset[0]),
            float(box[1] + box[3] / 2 + self._offset[1]),
        )


def _cut(frame: Image, at: Point, half: tuple[int, int]) -> tuple[int, int, Image]:
    """Left and top edge of a window around a point, and the window as far as it is in the frame."""
    i, j = int(np.floor(at[0])), int(np.floor(at[1]))
    left, top = max(i - half[0], 0), max(j - half[1], 0)
    right, bottom = min(i + half[0] + 1, frame.shape[1]), min(j + half[1] + 1, frame.shape[0])
    return left, top, frame[top : max(bottom, top), left : max(right, left)]


def _summit(three: NDArray[np.float32]) -> float:
    """Where a parabola through three neighbours has its summit, from the middle one."""
    if three.size != 3:
        return 0.0
    a, b, c = (float(v) for v in three)
    bend = a - 2.0 * b + c
    return 0.5 * (a - c) / bend if bend < 0.0 else 0.0
