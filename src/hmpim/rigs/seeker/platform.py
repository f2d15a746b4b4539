"""The platform of a seeker: a rate loop with a lag, commanded to a new rate now and then."""

import math
from collections import deque
from dataclasses import dataclass, field

__all__ = ["Platform"]


@dataclass(slots=True, kw_only=True)
class Platform:
    """Angle of a platform that follows its rate command with a first-order lag.

    Parameters
    ----------
    lag : float
        Time constant of the rate loop, s.

    Examples
    --------
    >>> platform = Platform(lag=0.1)
    >>> platform.command(2.0, at=1.0)
    >>> platform.angle(1.0)
    0.0
    >>> round(platform.angle(2.0), 6) == round(2.0 * (1.0 - 0.1 * (1 - math.exp(-10.0))), 6)
    True
    """

    lag: float
    _time: float = field(default=0.0, init=False)
    _angle: float = field(default=0.0, init=False)
    _rate: float = field(default=0.0, init=False)
    _wanted: float = field(default=0.0, init=False)
    _waiting: deque[tuple[float, float]] = field(default_factory=deque, init=False)

    def command(self, rate: float, *, at: float) -> None:
        """Have this rate wanted from an instant on, in order of time."""
        self._waiting.append((at, rate))

    def angle(self, time: float) -> float:
        """Angle at an instant not before the last one asked for."""
        while self._waiting and self._waiting[0][0] <= time:
            at, rate = self._waiting.popleft()
            self._go(at)
            self._wanted = rate
        self._go(time)
        return self._angle

    def _go(self, time: float) -> None:
        """Closed form of the lag under a constant command."""
        step = time - self._time
        if step <= 0.0:
            return
        gap, fading = self._rate - self._wanted, math.exp(-step / self.lag)
        self._angle += self._wanted * step + gap * self.lag * (1.0 - fading)
        self._rate = self._wanted + gap * fading
        self._time = time
