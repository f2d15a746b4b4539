r"""The HMPIM waveform: a linear sweep with gain and extinction, eqs (1) to (7).

With a = 2π(f_f - f_i)/T, b = 2πf_i, σ₁ = at²/2 + bt and σ₂ = b + atⁿ/2 the position is
G sin σ₁ / σ₂ (5). Velocity (6) and acceleration (7) are its derivatives. The third term
of (7) is printed with a minus; differentiating (6) gives plus, and plus is used here:

    + a²n²t^(2n-2) sin σ₁ / (2σ₂³)

With n = 0 the equations are the plain chirp's, (1) to (3), times G.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from hmpim.arguments import check_size, checked
from hmpim.errors import ArgumentError
from hmpim.stimulus.motion import FloatArray, Motion, at_rest_outside

__all__ = ["Sweep", "check_band", "check_extinction", "check_positive"]

LARGEST_EXTINCTION = 10.0
_INSTANT = 1e-30  # seconds; earlier is time 0, and t^(n-2) cannot overflow


def check_positive(name: str, value: float, unit: str) -> float:
    """Return `value` as a float if it is positive and finite.

    Raises
    ------
    ArgumentError
        If it is not.

    Examples
    --------
    >>> check_positive("duration", 10, "s")
    10.0
    """
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not (math.isfinite(number) and number > 0) or isinstance(value, (str, bool)):
        shown = f"{value!r} {unit}".rstrip()
        raise ArgumentError(f"{name} = {shown} must be a positive, finite number")
    return number


def check_band(band: tuple[float, float]) -> tuple[float, float]:
    """Return `band` as two floats if 0 < f_i < f_f.

    Raises
    ------
    ArgumentError
        If it is not two positive, finite, increasing frequencies.

    Examples
    --------
    >>> check_band((0.1, 20))
    (0.1, 20.0)
    """
    try:
        first, last = band
    except (TypeError, ValueError):
        raise ArgumentError(f"band = {band!r} is not two frequencies; write it as (0.1, 20)") from (
            None
        )
    if first == 0:
        raise ArgumentError(
            f"band = ({first}, {last}) Hz starts at 0 Hz, where a sweep has no cycle; "
            "start a little above, at 0.1 Hz for instance"
        )
    low = check_positive("start of the band", first, "Hz")
    high = check_positive("end of the band", last, "Hz")
    check_size("start of the band", low, "Hz")
    check_size("end of the band", high, "Hz")
    if low >= high:
        raise ArgumentError(
            f"band = ({first}, {last}) Hz does not rise; give the lower frequency first"
        )
    return low, high


def check_extinction(extinction: float) -> float:
    """Return the extinction of a sweep, linear or exponential, as a float.

    Raises
    ------
    ArgumentError
        If it does not lie between 0 and 10.

    Examples
    --------
    >>> check_extinction(1)
    1.0
    """
    if isinstance(extinction, (str, bool)) or not 0 <= extinction <= LARGEST_EXTINCTION:
        raise ArgumentError(
            f"extinction = {extinction!r} must lie between 0 (none) and "
            f"{LARGEST_EXTINCTION:g}; 2 already holds the acceleration level"
        )
    return float(extinction)


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """HMPIM waveform, eqs (1) to (7) of the paper.

    Parameters
    ----------
    band : tuple of float
        Frequencies f_i at time 0 and f_f at time T, in Hz, rising.
    duration : float
        T in seconds.
    gain : float
        G, in the position's unit per second (σ₂ is a rate, so G/σ₂ is a position).
    extinction : float
        n; 0 for none. The amplitude falls as 1/(b + a tⁿ/2).

    Raises
    ------
    ArgumentError
        For a band that does not rise, or a duration, gain or extinction out of range.

    Notes
    -----
    At t = 0 the velocity is G, or Gb/(b + a/2) with n = 0. For 0 < n < 1 the acceleration
    grows without bound as t → 0, as t^(n-1); at t = 0 itself the finite part, Ga/b, is
    returned, as of the jerk, which for 0 < n < 2 is unbounded there but for n = 1.

    Examples
    --------
    >>> import numpy as np
    >>> sweep = Sweep(band=(0.1, 10.0), duration=10.0, gain=37.3, extinction=0.0)
    >>> sweep.motion(np.array([0.0])).velocity.round(3).tolist()
    [6.269]
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
    def sweep_rate(self) -> float:
        """The paper's a = 2π(f_f - f_i)/T, in rad/s²."""
        return 2.0 * math.pi * (self.band[1] - self.band[0]) / self.duration

    @property
    def start_omega(self) -> float:
        """The paper's b = 2πf_i, in rad/s."""
        return 2.0 * math.pi * self.band[0]

    @property
    def cycles(self) -> float:
        """Number of cycles from start to end."""
        return 0.5 * (self.band[0] + self.band[1]) * self.duration

    def time_of_phase(self, phase: float) -> float:
        """Time in seconds at which σ₁ reaches `phase` (rad).

        Examples
        --------
        >>> sweep = Sweep(band=(1.0, 3.0), duration=5.0)
        >>> round(sweep.time_of_phase(2 * 3.141592653589793 * sweep.cycles), 9)
        5.0
        """
        a, b = self.sweep_rate, self.start_omega
        return 2.0 * phase / (b + math.sqrt(b * b + 2.0 * a * phase))

    def scaled(self, factor: float) -> "Sweep":
        """Return the same sweep, its gain times `factor`."""
        return replace(self, gain=self.gain * factor)

    def motion(self, time: FloatArray) -> Motion:
        """Position (5), velocity (6), acceleration (7) and its derivative at `time`.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Seconds from the start of the sweep; at rest outside [0, T].

        Returns
        -------
        Motion
            In the position's unit, per second, per second squared.

        Examples
        --------
        >>> import numpy as np
        >>> sweep = Sweep(band=(0.1, 10.0), duration=10.0, gain=1.0, extinction=1.0)
        >>> sweep.motion(np.array([-1.0, 0.0])).velocity.tolist()
        [0.0, 1.0]
        """
        return at_rest_outside(time, self.duration, self._inside)

    def without_jerk(self, time: FloatArray) -> Motion:
        """As `motion`, to the last bit, but without the jerk, in about half the time.

        Examples
        --------
        >>> import numpy as np
        >>> sweep = Sweep(band=(0.1, 10.0), duration=10.0, gain=1.0, extinction=1.0)
        >>> sweep.without_jerk(np.array([0.0])).velocity.tolist()
        [1.0]
        """
        return at_rest_outside(time, self.duration, lambda t: self._inside(t, jerk=False))

    def _inside(self, t: FloatArray, *, jerk: bool = True) -> Motion:
        a, b, n, gain = self.sweep_rate, self.start_omega, self.extinction, self.gain
        omega = b + a * t
        phase = t * (b + 0.5 * a * t)
        sine, cosine = np.sin(phase), np.cos(phase)
        # at time 0 powers of t may be infinite: they are put at 1 here and replaced below
        started = t > _INSTANT
        safe = np.where(started, t, 1.0)
        power = safe**n
        sigma = b + 0.5 * a * np.where(started, power, 1.0 if n == 0.0 else 0.0)
        slope = 0.5 * a * n * power / safe  # dσ₂/dt
        curve = slope * (n - 1.0) / safe  # d²σ₂/dt²
        position = sine / sigma
        velocity = (omega * cosine - slope * position) / sigma
        acceleration = (
            a * cosine
            - omega * omega * sine
            - 2.0 * omega * slope * cosine / sigma
            - curve * position
            + 2.0 * slope * slope * position / sigma
        ) / sigma
        at_zero = b + (0.5 * a if n == 0.0 else 0.0)
        late = bool(np.all(started))
        if not late:
            velocity = np.where(started, velocity, b / at_zero)
            acceleration = np.where(started, acceleration, 0.0 if n == 1.0 else a / at_zero)
        third_derivative = None
        if jerk:
            # 1/σ₂ and its derivatives against those of sin σ₁, by Leibniz
            first = -slope / sigma
            second = (2.0 * slope * slope / sigma - curve) / sigma
            third = (
                6.0 * slope * curve / sigma
                - 6.0 * slope * slope * slope / sigma / sigma
                - curve * (n - 2.0) / safe
            ) / sigma
            third_derivative = (
                -omega * (3.0 * a * sine + omega * omega * cosine)
                + 3.0 * (a * cosine - omega * omega * sine) * first
                + 3.0 * omega * cosine * second
                + sine * third
            ) / sigma
            if not late:
                first_0 = -0.5 * a / at_zero if n == 1.0 else 0.0
                second_0 = 2.0 * first_0 * first_0 - (a / at_zero if n == 2.0 else 0.0)
                jerk_0 = (-(b**3) + 3.0 * a * first_0 + 3.0 * b * second_0) / at_zero
                third_derivative = np.where(started, third_derivative, jerk_0)
        return Motion(
            time=t,
            position=gain * position,
            velocity=gain * velocity,
            acceleration=gain * acceleration,
            jerk=None if third_derivative is None else gain * third_derivative,
        )
