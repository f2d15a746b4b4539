"""A camera and its tracker in time: frames at a rate of their own, answers that come late."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmpim.arguments import checked
from hmpim.errors import ArgumentError, RigError
from hmpim.rigs.tracker.scene import Backdrop, Image
from hmpim.rigs.tracker.trackers import Tracker

__all__ = ["Camera", "Shot", "Watching"]


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class Camera:
    """When frames are taken, which are lost, and when the tracker's answer is there.

    Parameters
    ----------
    frame_rate : float
        Frames per second, Hz.
    latency : float
        Time in s from a frame to the tracker's answer: exposure, read-out, processing.
    dropped, repeated : float
        Chance that a frame is lost, and that the frame before is delivered once more.

    Raises
    ------
    ArgumentError
        If a value is out of range.

    Examples
    --------
    >>> Camera(frame_rate=50.0).frame_rate
    50.0
    """

    frame_rate: float = 60.0
    latency: float = 0.03
    dropped: float = 0.0
    repeated: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.frame_rate) and self.frame_rate > 0.0):
            raise ArgumentError(f"frame_rate = {self.frame_rate!r} Hz must be positive")
        if not (math.isfinite(self.latency) and self.latency >= 0.0):
            raise ArgumentError(f"latency = {self.latency!r} s must be 0 or positive")
        for name in ("dropped", "repeated"):
            if not 0.0 <= getattr(self, name) < 1.0:
                raise ArgumentError(f"{name} = {getattr(self, name)!r} must be from 0 to below 1")
        if self.dropped + self.repeated >= 1.0:
            raise ArgumentError("dropped and repeated together must leave some frames: below 1")

    def times(self, end: float) -> NDArray[np.float64]:
        """When frames are taken from 0 to `end` (s), that included."""
        return np.arange(math.floor(end * self.frame_rate + 1e-9) + 1) / self.frame_rate

    def newest(self, instants: NDArray[np.float64]) -> NDArray[np.intp]:
        """Newest frame whose answer is there at each instant (s); below 0: none yet.

        Examples
        --------
        >>> Camera(frame_rate=50.0, latency=0.03).newest(np.array([0.0, 0.03, 0.06])).tolist()
        [-2, 0, 1]
        """
        frames = np.floor((instants - self.latency) * self.frame_rate + 1e-9)
        return frames.astype(np.intp)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Shot:
    """A frame as the tracker got it.

    Parameters
    ----------
    image : ndarray of uint8, shape (height, width)
        What was delivered.
    point : (float, float) or None
        Where the tracker saw the target, pixels; None where it had lost it.
    """

    image: Image
    point: tuple[float, float] | None


class Watching:
    """A camera that looks at a scene and asks a tracker, frame by frame.

    Parameters
    ----------
    camera : Camera
        What may go wrong.
    backdrop : Backdrop
        What is behind the target.
    tracker : callable
        A function of a frame.
    rng : numpy.random.Generator
        Source of noise, and of lost and repeated frames.
    """

    def __init__(
        self, camera: Camera, backdrop: Backdrop, tracker: Tracker, rng: np.random.Generator
    ) -> None:
        self._camera, self._backdrop, self._tracker, self._rng = camera, backdrop, tracker, rng
        self._last: Image | None = None
        self.counts = {"frames": 0, "dropped": 0, "repeated": 0, "lost": 0}

    def take(self, x: float, y: float = 0.0) -> Shot | None:
        """Take a frame with the target at these angles, deg; None if it was dropped.

        Raises
        ------
        RigError
            If the tracker raises, or returns something else than two finite numbers.
        """
        number = self.counts["frames"]
        self.counts["frames"] += 1
        fate = self._rng.random() if number else 1.0  # the first frame is there, to acquire
        if fate < self._camera.dropped:
            self.counts["dropped"] += 1
            return None
        if fate < self._camera.dropped + self._camera.repeated and self._last is not None:
            self.counts["repeated"] += 1
        else:
            self._last = self._backdrop.seen(x, y, self._rng)
        assert self._last is not None
        shot = Shot(image=self._last, point=self._asked(self._last, number))
        if shot.point is None:
            self.counts["lost"] += 1
        return shot

    def _asked(self, image: Image, number: int) -> tuple[float, float] | None:
        try:
            said = self._tracker(image.copy())
        except Exception as error:  # whatever the tracker under test raises
            raise RigError(
                f"the tracker failed at frame {number}: {type(error).__name__}: {error}"
            ) from error
        if said is None:
            return None
        try:
            x, y = (float(value) for value in said)
        except (TypeError, ValueError):
            x = y = math.nan
        if not (math.isfinite(x) and math.isfinite(y)):
            raise RigError(
                f"the tracker returned {said!r} at frame {number}; it must return x and y in "
                "pixels, or None where it has lost the target"
            )
        return x, y
