"""A target over clutter, seen with sensor noise; its place is exact in fractions of a pixel."""

import math
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.arguments import checked
from hmpim.errors import ArgumentError

__all__ = ["Backdrop", "Scene"]

FloatArray = NDArray[np.float64]
Image = NDArray[np.uint8]


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """What a camera looks at, in grey levels from 0 to 255.

    The target is a rectangle with soft edges. Each pixel gets the mean of the target over its
    area, in closed form, so that a motion of a thousandth of a pixel is a change of grey.

    Parameters
    ----------
    width, height : int
        Size of a frame in pixels.
    pixel : float
        Angle that one pixel sees, deg.
    target_width, target_height : float
        In pixels.
    blur : float
        Standard deviation of the optics' point spread, pixels.
    level, target_level : float
        Grey of the background, and how much brighter the target is.
    clutter_std, clutter_size : float
        Standard deviation in grey and correlation length in pixels of a background that stays.
    noise_std : float
        Of each pixel in each frame, grey.

    Raises
    ------
    ArgumentError
        If a value is out of range.

    Examples
    --------
    >>> scene = Scene(clutter_std=0.0, noise_std=0.0)
    >>> frame = scene.backdrop(np.random.default_rng(0)).seen(0.0, 0.0, np.random.default_rng(0))
    >>> frame.shape, int(frame[60, 80]), int(frame[0, 0])
    ((120, 160), 180, 60)
    """

    width: int = 160
    height: int = 120
    pixel: float = 0.1
    target_width: float = 11.0
    target_height: float = 9.0
    blur: float = 1.0
    level: float = 60.0
    target_level: float = 120.0
    clutter_std: float = 8.0
    clutter_size: float = 4.0
    noise_std: float = 3.0

    def __post_init__(self) -> None:
        for name in ("width", "height"):
            if getattr(self, name) < 32:
                raise ArgumentError(f"{name} = {getattr(self, name)!r} pixels; give at least 32")
        for name in ("pixel", "target_width", "target_height", "blur", "clutter_size"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ArgumentError(f"{name} = {value!r} must be positive and finite")
        for name in ("clutter_std", "noise_std"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ArgumentError(f"{name} = {value!r} must be 0 or positive, and finite")

    @property
    def middle(self) -> tuple[float, float]:
        """Pixel, x and y, at which a target on the optical axis is centred."""
        return self.width / 2, self.height / 2

    @property
    def reach(self) -> float:
        """Largest angle from the axis, deg, at which the whole target is in the frame."""
        return self.pixel * (self.width / 2 - self.target_width / 2 - 4.0 * self.blur)

    def backdrop(self, rng: np.random.Generator) -> "Backdrop":
        """Draw the clutter of one run."""
        rough = rng.standard_normal((self.height, self.width))
        smooth = scipy.ndimage.gaussian_filter(rough, self.clutter_size, mode="wrap")
        spread = smooth.std()
        clutter = self.clutter_std * smooth / spread if spread > 0 else 0.0 * smooth
        return Backdrop(scene=self, grey=self.level + clutter)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Backdrop:
    """A scene with its clutter drawn.

    Parameters
    ----------
    scene : Scene
        What it is of.
    grey : ndarray, shape (height, width)
        The background.
    """

    scene: Scene
    grey: FloatArray

    def seen(self, x: float, y: float, rng: np.random.Generator) -> Image:
        """Return the frame of a target at angles x (right) and y (down) from the axis, deg."""
        scene = self.scene
        middle = scene.middle
        across = _profile(scene.width, middle[0] + x / scene.pixel, scene.target_width, scene.blur)
        down = _profile(scene.height, middle[1] + y / scene.pixel, scene.target_height, scene.blur)
        grey = self.grey + scene.target_level * np.outer(down, across)
        if scene.noise_std > 0.0:
            grey = grey + scene.noise_std * rng.standard_normal(grey.shape)
        return np.clip(np.rint(grey), 0, 255).astype(np.uint8)


def _profile(size: int, centre: float, width: float, blur: float) -> FloatArray:
    """Mean over each pixel [k, k + 1] of a box of this width, blurred by a Gaussian."""
    edges: FloatArray = np.arange(size + 1, dtype=np.float64) - centre
    half = width / 2
    lower: FloatArray = _integral(edges + half, blur) - _integral(edges - half, blur)
    return np.asarray(np.diff(lower), dtype=np.float64)


def _integral(x: FloatArray, blur: float) -> FloatArray:
    """Antiderivative of the Gaussian's cumulative distribution."""
    z = x / blur
    density = np.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
    return np.asarray(blur * (z * 0.5 * (1.0 + scipy.special.erf(z / math.sqrt(2.0))) + density))
