r"""The exponential sweep: equal time for each octave, with an extinction of its own.

With k = ln(f_f/f_i)/T the frequency is ω = 2πf_i exp(kt), the phase (ω - 2πf_i)/k, and

    x = G exp(-nkt) sin(phase), that is, G (ω/2πf_i)⁻ⁿ sin(phase).

So n = 0 holds the amplitude, n = 1 the velocity and n = 2 the acceleration level, and
nothing is singular at t = 0, whatever n is.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from hmpim.stimulus.motion import FloatArray, Motion, at_rest_outside
from hmpim.stimulus.sweep import check_band, check_extinction, check_positive

__all__ = ["ExponentialSweep"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ExponentialSweep:
    """Sweep whose frequency rises by the same factor in each second.

    Parameters
    ----------
    band : tuple of float
        Frequencies at time 0 and at `duration`, in Hz, rising.
    duration : float
        T in seconds.
    gain : float
        Amplitude of the position at time 0, in its unit.
    extinction : float
        n; the amplitude falls as frequency to the power -n.

    Raises
    ------
    ArgumentError
        For a band that does not rise, or a duration, gain or extinction out of range.

    Examples
    --------
    >>> import numpy as np
    >>> sweep = ExponentialSweep(band=(1.0, 4.0), duration=2.0, gain=3.0)
    >>> at = sweep.motion(np.array([0.0]))
    >>> at.position.tolist(), (at.velocity / (2 * np.pi)).round(9).tolist()
    ([0.0], [3.0])
    """

    band: tuple[float, float]
    duration: float
    gain: float = 1.0
    extinction: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "band", check_band(self.band))
        object.__setattr__(self, "duration", check_positive("duration", self.duration, "s"))
        object.__setattr__(self, "gain", check_positive("gain", self.gain, ""))
        object.__setattr__(self, "extinction", check_extinction(self.extinction))

    @property
    def growth(self) -> float:
        """K = ln(f_f/f_i)/T, in 1/s."""
        return math.log(self.band[1] / self.band[0]) / self.duration

    @property
    def cycles(self) -> float:
        """Number of cycles from start to end."""
        return (self.band[1] - self.band[0]) / self.growth

    def scaled(self, factor: float) -> "ExponentialSweep":
        """Return the same sweep, its gain times `factor`."""
        return replace(self, gain=self.gain * factor)

    def motion(self, time: FloatArray) -> Motion:
        """Position, velocity, acceleration and jerk at `time`.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Seconds from the start of the sweep; at rest outside [0, T].

        Examples
        --------
        >>> import numpy as np
        >>> sweep = ExponentialSweep(band=(1.0, 4.0), duration=2.0, extinction=1.0)
        >>> sweep.motion(np.array([-1.0, 0.0])).velocity.round(6).tolist()
        [0.0, 6.283185]
        """
        return at_rest_outside(time, self.duration, self._inside)

    def _inside(self, t: FloatArray) -> Motion:
        k = self.growth
        fall = -self.extinction * k
        start = 2.0 * math.pi * self.band[0]
        omega = start * np.exp(k * t)
        phase = start / k * np.expm1(k * t)
        size = self.gain * np.exp(fall * t)
        sine, cosine = size * np.sin(phase), size * np.cos(phase)
        square = omega * omega
        return Motion(
            time=t,
            position=sine,
            velocity=fall * sine + omega * cosine,
            acceleration=(fall * fall - square) * sine + (2.0 * fall + k) * omega * cosine,
            jerk=(fall**3 - 3.0 * (fall + k) * square) * sine
            + (3.0 * fall * (fall + k) + k * k - square) * omega * cosine,
        )
