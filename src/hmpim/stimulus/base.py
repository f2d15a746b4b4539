r"""A slow base motion under a stimulus, which keeps an axis out of stiction.

Dry friction changes its sign with the velocity: an axis that only shakes loses a torque that does
not shrink with the motion. If it moves on steadily, faster than the stimulus moves it back, the
sign stays, and what friction takes is constant (it belongs to the bias).

The base goes to and fro at a constant speed v and turns round smoothly, by a velocity of fifth
degree in time. A turn of length τ takes an acceleration of 15/4 · v/τ and a jerk of
20/√3 · v/τ². From one turn to the next it takes h; it goes vh/2 to either side of the middle.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from hmpim.arguments import checked
from hmpim.errors import ArgumentError, LimitsError
from hmpim.stimulus.limits import Limits
from hmpim.stimulus.motion import FloatArray, Motion, Piecewise, Scalable, Waveform, at_rest_outside
from hmpim.stimulus.sweep import check_positive

__all__ = ["BaseRoom", "Shuttle", "Superposed", "room_beside_base", "shuttle_for"]

_TRAVEL = 0.7  # share of the position limit that the base takes
_TURNING = 0.25  # share of the limits on acceleration and jerk that its turns take
_STEADY = 2.0  # h over τ at least: half of the time at full speed
_FASTER = 1.1  # its speed over the largest velocity of what is played on it
_ACCELERATION = 15.0 / 4.0
_JERK = 20.0 / math.sqrt(3.0)
_TURNS = 999  # at most


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class Shuttle:
    """To and fro at constant speed, from rest at the middle back to rest there.

    Parameters
    ----------
    speed : float
        Unit per second.
    duration : float
        Length in seconds.
    turns : int
        How often it turns round; odd, so that it ends where it began.
    turning : float
        Seconds that a turn takes, and each of its two ends.

    Raises
    ------
    ArgumentError
        If the turns are even, or too long for the duration.

    Examples
    --------
    >>> import numpy as np
    >>> base = Shuttle(speed=10.0, duration=6.0, turns=3, turning=0.5)
    >>> base.motion(np.array([0.0, 0.75, 2.0, 3.7, 6.0])).velocity.round(9).tolist()
    [0.0, 10.0, -10.0, 10.0, 0.0]
    """

    speed: float
    duration: float
    turns: int
    turning: float

    def __post_init__(self) -> None:
        for name, unit in (("speed", "unit/s"), ("duration", "s"), ("turning", "s")):
            check_positive(name, getattr(self, name), unit)
        if not (1 <= self.turns <= _TURNS and self.turns % 2 == 1):
            raise ArgumentError(f"turns = {self.turns!r} must be odd, from 1 to {_TURNS}")
        if self.turning > self.between * (1.0 + 1e-9):
            raise ArgumentError(
                f"turning = {self.turning:g} s is more than the {self.between:g} s from one of "
                f"{self.turns} turns to the next; turn round faster, or less often"
            )

    @property
    def band(self) -> tuple[float, float] | None:
        """None: what excites is what is played on it."""
        return None

    @property
    def between(self) -> float:
        """Seconds from one turn to the next, h."""
        return (self.duration - self.turning) / self.turns

    @property
    def _centres(self) -> tuple[FloatArray, FloatArray]:
        """Middles of start, turns and end, s, and by what each changes the velocity."""
        half = 0.5 * self.turning
        turns = half + (np.arange(self.turns) + 0.5) * self.between
        change = np.where(np.arange(self.turns) % 2 == 0, -2.0, 2.0)
        return (
            np.concatenate(([half], turns, [self.duration - half])),
            np.concatenate(([1.0], change, [1.0])),
        )

    @property
    def breaks(self) -> tuple[float, ...]:
        """Times in seconds at which it begins or ends to turn."""
        centres, _ = self._centres
        edges = np.concatenate((centres - 0.5 * self.turning, centres + 0.5 * self.turning))
        return tuple(np.unique(np.clip(edges, 0.0, self.duration)).tolist())

    def scaled(self, factor: float) -> "Shuttle":
        """Return the same motion, `factor` times as fast."""
        return replace(self, speed=self.speed * factor)

    def motion(self, time: FloatArray) -> Motion:
        """Position and its derivatives at `time` (s, shape (n,)); at rest outside."""
        return at_rest_outside(time, self.duration, self._inside)

    def _inside(self, t: FloatArray) -> Motion:
        position, velocity, acceleration, jerk = np.zeros((4, *t.shape))
        length = self.turning
        for centre, change in zip(*self._centres, strict=True):
            step = change * self.speed
            since = t - (centre - 0.5 * length)
            s = np.clip(since / length, 0.0, 1.0)
            rest = s * (1.0 - s)
            position += step * (length * s**4 * (2.5 - 3.0 * s + s * s))
            position += step * np.maximum(since - length, 0.0)
            velocity += step * s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
            acceleration += step * 30.0 * rest**2 / length
            jerk += step * 60.0 * rest * (1.0 - 2.0 * s) / length**2
        moves = (t > 0.0) & (t < self.duration)  # at either end exactly at rest at the middle
        return Motion(
            time=t,
            position=np.where(moves, position, 0.0),
            velocity=np.where(moves, velocity, 0.0),
            acceleration=np.where(moves, acceleration, 0.0),
            jerk=np.where(moves, jerk, 0.0),
        )


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class Superposed:
    """A waveform on a slow base motion.

    Parameters
    ----------
    upper : Waveform
        What excites.
    base : Shuttle
        As long.

    Examples
    --------
    >>> import numpy as np
    >>> from hmpim.stimulus.classical import Sine
    >>> base = Shuttle(speed=10.0, duration=6.0, turns=3, turning=0.5)
    >>> both = Superposed(upper=Sine(frequency=1.0, duration=6.0), base=base)
    >>> both.motion(np.array([0.75])).velocity.round(6).tolist()
    [10.0]
    """

    upper: Waveform
    base: Shuttle

    @property
    def duration(self) -> float:
        """Length in seconds."""
        return self.upper.duration

    @property
    def band(self) -> tuple[float, float] | None:
        """Excited band in Hz, of the upper waveform."""
        return self.upper.band

    @property
    def breaks(self) -> tuple[float, ...]:
        """Times in seconds at which a piece of either hands over to the next."""
        own = self.upper.breaks if isinstance(self.upper, Piecewise) else ()
        return tuple(sorted({*own, *self.base.breaks}))

    def scaled(self, factor: float) -> "Superposed":
        """Return both, `factor` times as large."""
        if not isinstance(self.upper, Scalable):
            raise ArgumentError(f"a {type(self.upper).__name__} has no scale to change")
        return Superposed(upper=self.upper.scaled(factor), base=self.base.scaled(factor))

    def motion(self, time: FloatArray) -> Motion:
        """Position and its derivatives at `time` (s, shape (n,)); at rest outside."""
        one, other = self.upper.motion(time), self.base.motion(time)
        return Motion(
            time=one.time,
            position=one.position + other.position,
            velocity=one.velocity + other.velocity,
            acceleration=one.acceleration + other.acceleration,
            jerk=None if one.jerk is None or other.jerk is None else one.jerk + other.jerk,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class BaseRoom:
    """How limits are shared between a base and what is played on it.

    Parameters
    ----------
    speed, turning, between : float
        Of the base: unit per second, and s from one turn to the next at most.
    upper : Limits
        What is left.
    """

    speed: float
    turning: float
    between: float
    upper: Limits


def room_beside_base(limits: Limits) -> BaseRoom:
    """Share limits between a base and what is played on it.

    The base takes 70 % of the travel, and a quarter of acceleration and jerk for its turns; its
    speed is the largest at which it still goes at full speed for half of the time. What is
    played on it keeps the rest, and a velocity of 1/1.1 of that speed, so that the sum never turns
    back between the turns. Peaks add up, so the sum keeps the limits whatever the phase.

    Parameters
    ----------
    limits : Limits
        Of the sum; position and acceleration must be finite.

    Raises
    ------
    LimitsError
        If they are not.

    Examples
    --------
    >>> room = room_beside_base(Limits(position=40, velocity=200, acceleration=700, unit="deg"))
    >>> round(room.speed, 1), round(room.upper.velocity, 1), round(room.upper.acceleration)
    (36.1, 32.9, 525)
    """
    if not (math.isfinite(limits.position) and math.isfinite(limits.acceleration)):
        raise LimitsError(
            "a base motion needs a finite travel and acceleration: it goes to and fro in the one "
            "and turns round with the other; state both limits"
        )
    travel = _TRAVEL * limits.position
    # v h / 2 = travel with h = _STEADY τ, τ = _ACCELERATION v / a
    turn = _TURNING * limits.acceleration
    speed = math.sqrt(2.0 * travel * turn / (_STEADY * _ACCELERATION))
    if math.isfinite(limits.velocity):
        speed = min(speed, limits.velocity * _FASTER / (1.0 + _FASTER))
    turning = _ACCELERATION * speed / turn
    if math.isfinite(limits.jerk):
        # also τ² = _JERK v / j: a slower base turns round in less jerk
        most = _TURNING * limits.jerk
        by_jerk = (travel / _STEADY * 2.0 * math.sqrt(most / _JERK)) ** (2.0 / 3.0)
        speed = min(speed, by_jerk)
        turning = max(_ACCELERATION * speed / turn, math.sqrt(_JERK * speed / most))
    return BaseRoom(
        speed=speed,
        turning=turning,
        between=2.0 * travel / speed,
        upper=Limits(
            position=(1.0 - _TRAVEL) * limits.position,
            velocity=min(limits.velocity - speed, speed / _FASTER),
            acceleration=(1.0 - _TURNING) * limits.acceleration,
            jerk=(1.0 - _TURNING) * limits.jerk,
            unit=limits.unit,
        ),
    )


def shuttle_for(room: BaseRoom, duration: float) -> Shuttle:
    """The base motion of a room, as long as what is played on it.

    Raises
    ------
    LimitsError
        If that is too short for a turn.

    Examples
    --------
    >>> room = room_beside_base(Limits(position=40, velocity=200, acceleration=700, unit="deg"))
    >>> base = shuttle_for(room, 10.0)
    >>> base.turns, bool(np.abs(base.motion(np.linspace(0, 10, 1001)).position).max() < 28.0)
    (7, True)
    """
    turns = max(math.ceil(duration / room.between - 1e-9), 1)
    turns += 1 - turns % 2
    between = duration / turns
    turning, speed = room.turning, room.speed
    if turning > between / _STEADY:  # shorter than one way: slower, with the same turns
        share = between / _STEADY / turning
        turning, speed = turning * share, speed * share * share
    if not speed > 0.0:
        raise LimitsError(f"{duration:g} s is too short for a base motion; play longer")
    return Shuttle(speed=speed, duration=duration, turns=turns, turning=turning)
