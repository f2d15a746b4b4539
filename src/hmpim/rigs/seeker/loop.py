"""The loop of a seeker, stepped in time by the sample: Fig. 15 in its simplest form."""

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np
import scipy

__all__ = ["Seeker"]


@dataclass(slots=True, kw_only=True)
class Seeker:
    """A seeker on its platform, tracking a target: no frames, no pixels, the loop alone.

    The tracker sees the pointing error, line of sight minus platform angle, `delay` seconds
    late; the platform is commanded to turn at `track_gain` times that, and follows its command
    with a first-order lag. From line-of-sight rate to platform rate command that is::

        K e^(-sτ) / (s + K e^(-sτ) / (1 + sT))

    Parameters
    ----------
    track_gain : float
        K in 1/s.
    delay : float
        τ in s: exposure, read-out and processing; a whole number of steps.
    lag : float
        T in s, of the platform's rate loop.
    noise_std : float
        Of the seen error, in deg.
    step : float
        Interval of the simulation in s.
    seed : int
        Of the noise.

    Examples
    --------
    >>> seeker = Seeker()
    >>> held = [seeker(2.0) for _ in range(3000)]
    >>> abs(held[-1] - 2.0) < 0.05  # a steady line-of-sight rate is followed
    True
    """

    track_gain: float = 5.0
    delay: float = 0.04
    lag: float = 0.01
    noise_std: float = 0.002
    step: float = 1e-3
    seed: int = 15
    _random: np.random.Generator = field(init=False, repr=False)
    _seen: deque[float] = field(init=False, repr=False)
    _line_of_sight: float = field(init=False, repr=False)
    _last_rate: float = field(init=False, repr=False)
    _platform: float = field(init=False, repr=False)
    _platform_rate: float = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Return to rest, pointing at the target."""
        self._random = np.random.default_rng(self.seed)
        self._seen = deque([0.0] * (round(self.delay / self.step) + 1))
        self._line_of_sight = self._last_rate = 0.0
        self._platform = self._platform_rate = 0.0

    def __call__(self, rate: float) -> float:
        """Take the line-of-sight rate at the next instant; return the command, both deg/s."""
        h = self.step
        self._line_of_sight += 0.5 * h * (rate + self._last_rate)
        self._last_rate = rate
        self._seen.append(self._line_of_sight - self._platform)
        self._seen.popleft()
        command = self.track_gain * (
            self._seen[0] + self.noise_std * float(self._random.standard_normal())
        )
        fading = math.exp(-h / self.lag)
        mean = command + (self._platform_rate - command) * (1.0 - fading) * self.lag / h
        self._platform += h * mean
        self._platform_rate = command + (self._platform_rate - command) * fading
        return command

    def bandwidth(self) -> float:
        """Frequency in Hz at which the closed form's phase is -90°."""

        def real_part(f: float) -> float:
            s = 2j * math.pi * f
            seen = self.track_gain * np.exp(-s * self.delay)
            return float((seen / (s + seen / (1.0 + s * self.lag))).real)

        return float(scipy.optimize.brentq(real_part, 0.1, 5.0))
