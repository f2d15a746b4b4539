"""What every stimulus is made of: position and its derivatives in closed form."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Brief",
    "FloatArray",
    "Motion",
    "Peaks",
    "Piecewise",
    "Scalable",
    "Waveform",
    "at_rest_outside",
    "scaled_motion",
]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Motion:
    """Position and its derivatives at given times.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds.
    position, velocity, acceleration : ndarray, shape (n,)
        In the stimulus's unit, that unit per second, and per second squared.
    jerk : ndarray, shape (n,), or None
        The third derivative, unit per second cubed; None where the waveform does not give it.
    """

    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    jerk: FloatArray | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Peaks:
    """Largest magnitudes of position and its derivatives, between samples too.

    Infinite after a jump: the velocity of a step, the jerk where the acceleration jumps. The
    jerk is infinite also where a waveform does not give it.
    """

    position: float
    velocity: float
    acceleration: float
    jerk: float = math.inf


@runtime_checkable
class Waveform(Protocol):
    """A motion in closed form, known at any time, so that a simulated rig may ask anywhere.

    Before 0 it is at rest at its start position, after `duration` at rest at its final one.
    `band` is the excited band in Hz, None where the waveform has none.
    """

    @property
    def duration(self) -> float:
        """Length in seconds."""
        ...

    @property
    def band(self) -> tuple[float, float] | None:
        """Excited band in Hz, or None."""
        ...

    def motion(self, time: FloatArray) -> Motion:
        """Position, velocity and acceleration at `time` (s, shape (n,))."""
        ...


@runtime_checkable
class Piecewise(Protocol):
    """A waveform put together of pieces: the times at which they meet (s)."""

    @property
    def breaks(self) -> tuple[float, ...]:
        """Times in seconds at which one piece hands over to the next."""
        ...


@runtime_checkable
class Brief(Protocol):
    """A waveform that can leave out its jerk, which takes it longer than all the rest."""

    def without_jerk(self, time: FloatArray) -> Motion:
        """Position, velocity and acceleration at `time`, the very same numbers."""
        ...


@runtime_checkable
class Scalable(Protocol):
    """A waveform that can be made larger or smaller, all derivatives with it."""

    def scaled(self, factor: float) -> Self:
        """Return the same waveform, `factor` times as large."""
        ...


def scaled_motion(motion: Motion, factor: float) -> Motion:
    """Return a motion `factor` times as large.

    Examples
    --------
    >>> import numpy as np
    >>> one = np.ones(1)
    >>> moved = Motion(time=one, position=one, velocity=one, acceleration=one)
    >>> scaled_motion(moved, 3.0).velocity.tolist()
    [3.0]
    """
    return Motion(
        time=motion.time,
        position=factor * motion.position,
        velocity=factor * motion.velocity,
        acceleration=factor * motion.acceleration,
        jerk=None if motion.jerk is None else factor * motion.jerk,
    )


def at_rest_outside(
    time: FloatArray, duration: float, formula: Callable[[FloatArray], Motion]
) -> Motion:
    """Apply `formula` on [0, duration] and stand still at its end values outside.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds; any real number.
    duration : float
        Where the formula ends, in seconds.
    formula : callable
        Motion at times inside [0, duration].

    Examples
    --------
    >>> import numpy as np
    >>> ramp = lambda t: Motion(time=t, position=t, velocity=t**0, acceleration=0 * t)
    >>> moved = at_rest_outside(np.array([-1.0, 1.0, 3.0]), 2.0, ramp)
    >>> moved.position.tolist(), moved.velocity.tolist()
    ([0.0, 1.0, 2.0], [0.0, 1.0, 0.0])
    """
    t = np.asarray(time, dtype=np.float64)
    inside = (t >= 0.0) & (t <= duration)
    at = formula(np.clip(t, 0.0, duration))
    return Motion(
        time=t,
        position=at.position,
        velocity=np.where(inside, at.velocity, 0.0),
        acceleration=np.where(inside, at.acceleration, 0.0),
        jerk=None if at.jerk is None else np.where(inside, at.jerk, 0.0),
    )
