"""A motion known by its samples only, as a file for a player holds it."""

from dataclasses import dataclass, replace

import numpy as np

from hmpim.equality import ByValue
from hmpim.errors import ArgumentError
from hmpim.stimulus.motion import FloatArray, Motion, Peaks
from hmpim.stimulus.quintic import coefficients_between, evaluated
from hmpim.stimulus.sweep import check_positive

__all__ = ["SampledMotion"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SampledMotion(ByValue):
    """Samples of position, velocity and acceleration, joined by polynomials of fifth order.

    At the samples it is what they say; in between position, velocity and acceleration are
    continuous. Outside it stands still at its first and last position.

    Parameters
    ----------
    fs : float
        Rate in Hz; sample k is at k/fs.
    position, velocity, acceleration : ndarray, shape (n,)
        In a unit, and per second, and per second squared.
    band : tuple of float or None
        Excited band in Hz, where known.

    Raises
    ------
    ArgumentError
        If there are fewer than two samples, one is not finite, or lengths differ.

    Examples
    --------
    >>> t = np.arange(5) / 4.0
    >>> moved = SampledMotion(fs=4.0, position=t**3, velocity=3 * t**2, acceleration=6 * t)
    >>> float(moved.motion(np.array([0.6])).position[0].round(12))
    0.216
    """

    fs: float
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    band: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        check_positive("fs", self.fs, "Hz")
        sizes = set()
        for name in ("position", "velocity", "acceleration"):
            values = np.array(getattr(self, name), dtype=np.float64)
            values.setflags(write=False)
            object.__setattr__(self, name, values)
            sizes.add(values.shape)
            if not np.all(np.isfinite(values)):
                at = int(np.flatnonzero(~np.isfinite(values))[0])
                raise ArgumentError(f"{name} holds {values[at]} at sample {at}; give finite ones")
        if len(sizes) > 1 or self.position.ndim != 1 or self.position.size < 2:
            raise ArgumentError(
                f"position, velocity and acceleration have shapes {sorted(sizes)}; give as many "
                "samples of each, at least two, shape (n,)"
            )

    @property
    def duration(self) -> float:
        """Length in seconds, to the end of the last sample's interval."""
        return self.position.size / self.fs

    @property
    def peaks(self) -> Peaks:
        """Largest magnitudes that the samples state; the jerk is that of their differences."""
        jerk = np.abs(np.diff(self.acceleration)).max() * self.fs
        still = not (self.velocity[[0, -1]].any() or self.acceleration[[0, -1]].any())
        return Peaks(
            position=float(np.abs(self.position).max()),
            velocity=float(np.abs(self.velocity).max()),
            acceleration=float(np.abs(self.acceleration).max()),
            jerk=float(jerk) if still else np.inf,
        )

    def scaled(self, factor: float) -> "SampledMotion":
        """Return the same motion, `factor` times as large."""
        return replace(
            self,
            position=factor * self.position,
            velocity=factor * self.velocity,
            acceleration=factor * self.acceleration,
        )

    def motion(self, time: FloatArray) -> Motion:
        """Position and its derivatives at `time` (s, shape (n,))."""
        t = np.asarray(time, dtype=np.float64)
        last = self.position.size - 1
        place = np.clip(t * self.fs, 0.0, last)
        near = np.rint(place)  # k/fs is a sample, whatever it is rounded to
        place = np.where(np.abs(place - near) < 1e-9 * np.maximum(near, 1.0), near, place)
        k = np.minimum(np.floor(place).astype(np.int64), last - 1)
        x, step = place - k, 1.0 / self.fs
        states = np.stack((self.position, self.velocity, self.acceleration))
        joined = coefficients_between(states[:, k], states[:, k + 1], duration=step)
        moved = evaluated(joined, x, time=t, duration=step)
        exact = (x == 0.0) | (x == 1.0)
        at = k + (x == 1.0)
        moving = (t >= 0.0) & (t * self.fs < last + 0.5 * exact)  # samples keep derivatives
        return Motion(
            time=t,
            position=np.where(exact, self.position[at], moved.position),
            velocity=np.where(moving, np.where(exact, self.velocity[at], moved.velocity), 0.0),
            acceleration=np.where(
                moving, np.where(exact, self.acceleration[at], moved.acceleration), 0.0
            ),
        )
