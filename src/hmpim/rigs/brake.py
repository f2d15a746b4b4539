"""Coming to rest: whether a smooth stop exists, and the motion that makes it.

From position x and velocity v an axis that may decelerate at `a` needs v²/(2a) to stand still.
As long as |x| + v²/(2a) is within the position limit, a smooth stop inside the limits exists.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import LimitsError
from hmpim.stimulus import Limits

__all__ = ["Brake", "check_stoppable", "stopping_reach"]

FloatArray = NDArray[np.float64]

_ROUNDING = 1e-9  # a stimulus may stand on its limit


def stopping_reach(position: FloatArray, velocity: FloatArray, limits: Limits) -> FloatArray:
    """Furthest from the middle that an axis gets if it brakes now: |x| + v²/(2a).

    Parameters
    ----------
    position, velocity : ndarray, shape (n,)
        In the limits' unit, and per second.
    limits : Limits
        For the acceleration.

    Examples
    --------
    >>> limits = Limits(position=60, acceleration=1000, unit="deg")
    >>> stopping_reach(np.array([10.0]), np.array([180.0]), limits).tolist()
    [26.2]
    """
    reach = np.abs(position)
    if math.isfinite(limits.acceleration):
        reach = reach + np.square(velocity) / (2.0 * limits.acceleration)
    return np.asarray(reach, dtype=np.float64)


def check_stoppable(
    time: FloatArray, position: FloatArray, velocity: FloatArray, limits: Limits, *, whose: str
) -> float:
    """Refuse a motion from which some instant leaves no smooth stop inside the limits.

    Parameters
    ----------
    time, position, velocity : ndarray, shape (n,)
        Every command of the motion; s, the limits' unit, and per second.
    limits : Limits
        Position and acceleration count.
    whose : str
        Whose limits they are, for the message.

    Returns
    -------
    float
        The largest |x| + v²/(2a).

    Raises
    ------
    LimitsError
        If that is beyond the position limit; the message says when.

    Examples
    --------
    >>> limits = Limits(position=20, acceleration=1000, unit="deg")
    >>> check_stoppable(np.zeros(1), np.array([10.0]), np.array([180.0]), limits, whose="azimuth")
    Traceback (most recent call last):
    hmpim.errors.LimitsError: at 0.000 s azimuth could not stop inside its limits: ...
    """
    reach = stopping_reach(position, velocity, limits)
    k = int(np.argmax(reach))
    if reach[k] > limits.position * (1.0 + _ROUNDING):
        unit = limits.unit
        raise LimitsError(
            f"at {time[k]:.3f} s {whose} could not stop inside its limits: from {position[k]:.4g} "
            f"{unit} at {velocity[k]:.4g} {unit}/s it would come to rest {reach[k]:.4g} {unit} "
            f"from the middle, beyond {limits.position:g} {unit}; scale the stimulus down, or "
            "lower the velocity limit it is designed in"
        )
    return float(reach[k])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Brake:
    """All axes brought to rest, each with its full deceleration.

    Parameters
    ----------
    position, velocity : ndarray, shape (m,)
        Where the axes are when it begins.
    acceleration : ndarray, shape (m,)
        With which each may brake; infinite stops at once.

    Examples
    --------
    >>> brake = Brake(
    ...     position=np.array([10.0]), velocity=np.array([-180.0]), acceleration=np.array([1000.0])
    ... )
    >>> round(brake.duration, 9), [round(float(x[0]), 9) for x in brake.at(0.18)]
    (0.18, [-6.2, 0.0, 0.0])
    """

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray

    @property
    def duration(self) -> float:
        """Seconds until all axes are at rest."""
        return float(np.max(self._needed(), initial=0.0))

    def at(self, seconds: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Position, velocity, acceleration some time after the brake began, each shape (m,)."""
        needed = self._needed()
        t = np.minimum(seconds, needed)
        braking = -np.sign(self.velocity) * np.where(
            np.isfinite(self.acceleration), self.acceleration, 0.0
        )
        position = self.position + self.velocity * t + 0.5 * braking * t * t
        moving = seconds < needed
        velocity = np.where(moving, self.velocity + braking * t, 0.0)
        return position, velocity, np.where(moving, braking, 0.0)

    def _needed(self) -> FloatArray:
        return np.asarray(np.abs(self.velocity) / self.acceleration, dtype=np.float64)
