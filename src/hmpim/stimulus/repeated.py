r"""A short sweep up and down, again and again: all of the band is passed early, and often.

The frequency is a triangle in time with rounded corners, so that position, velocity and
acceleration are continuous; the phase is its integral, in closed form. The amplitude follows the
frequency as the limits do,

    A(ω) = A₀ [1 + (ω/ω₁)⁴ + (ω/ω₂)⁸ + (ω/ω₃)¹²]^(-1/4),

which is A₀ below the corners ω₁ (velocity), ω₂ (acceleration) and ω₃ (jerk) and falls as 1/ω,
1/ω² and 1/ω³ beyond them.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from hmpim.arguments import checked
from hmpim.errors import ArgumentError, LimitsError
from hmpim.stimulus.limits import Limits, three_digits
from hmpim.stimulus.motion import FloatArray, Motion, at_rest_outside
from hmpim.stimulus.scale import check_limits_given, largest_sine, scale_to_limits
from hmpim.stimulus.sweep import check_band, check_positive

__all__ = ["CORNER", "Repeated", "repeated_sweeps"]

CORNER = 0.1  # of a sweep, to each side of its ends, in which the frequency turns round
_SHARP = 4  # power at which the limits are blended


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class Repeated:
    """Sweeps up and down in turn, in one phase.

    Parameters
    ----------
    band : tuple of float
        Lowest and highest frequency in Hz, rising.
    duration : float
        Length of all sweeps in seconds; the last one may be cut short.
    sweep : float
        Length of one sweep, up or down, in seconds.
    amplitude : float
        A₀.
    corners : tuple of float
        Frequencies in Hz from which velocity, acceleration and jerk bound the amplitude;
        infinite for none.

    Raises
    ------
    ArgumentError
        If the band does not rise, or a length is out of range.

    Examples
    --------
    >>> import numpy as np
    >>> sweeps = Repeated(band=(0.1, 20.0), duration=6.0, sweep=0.6)
    >>> sweeps.frequency(np.array([0.0, 0.6, 1.2])).round(9).tolist()
    [0.1, 20.0, 0.1]
    """

    band: tuple[float, float]
    duration: float
    sweep: float
    amplitude: float = 1.0
    corners: tuple[float, float, float] = (math.inf, math.inf, math.inf)

    def __post_init__(self) -> None:
        low, high = check_band(self.band)
        object.__setattr__(self, "band", (low, high))
        check_positive("duration", self.duration, "s")
        check_positive("sweep", self.sweep, "s")
        check_positive("amplitude", self.amplitude, "")
        if len(self.corners) != 3 or not all(corner > 0.0 for corner in self.corners):
            raise ArgumentError(f"corners = {self.corners!r} Hz must be three positive frequencies")
        if self.sweep > self.duration * (1.0 + 1e-9):
            raise ArgumentError(
                f"sweep = {self.sweep:g} s is longer than the duration of {self.duration:g} s; "
                "give a duration of one sweep at least"
            )
        if 0.5 * (low + high) * self.sweep < 1.0 - 1e-9:
            needed = three_digits(2.0 / (low + high), up=True)
            raise ArgumentError(
                f"sweep = {self.sweep:g} s from {low:g} to {high:g} Hz makes less than one cycle; "
                f"{needed} s is enough"
            )

    @property
    def breaks(self) -> tuple[float, ...]:
        """Times in seconds at which a straight part of the frequency meets a corner."""
        turns = np.arange(math.ceil(self.duration / self.sweep) + 1)
        edges = self.sweep * np.concatenate((turns - CORNER, turns + CORNER))
        return tuple(np.sort(edges[(edges > 0.0) & (edges < self.duration)]).tolist())

    def scaled(self, factor: float) -> "Repeated":
        """Return the same sweeps, `factor` times as large."""
        return replace(self, amplitude=self.amplitude * factor)

    def frequency(self, time: FloatArray) -> FloatArray:
        """Frequency in Hz at `time` (s, shape (n,))."""
        return np.asarray(self._omega(np.asarray(time, dtype=np.float64))[0] / (2.0 * math.pi))

    def time_of_phase(self, phase: float) -> float:
        """Time in seconds at which the phase reaches `phase` (rad).

        Examples
        --------
        >>> sweeps = Repeated(band=(1.0, 9.0), duration=6.0, sweep=0.6)
        >>> round(sweeps.time_of_phase(2 * 3.141592653589793 * 5.0 * 0.6), 9)
        0.6
        """
        low, high = 0.0, self.duration
        for _ in range(60):
            middle = 0.5 * (low + high)
            before = float(self._phase(np.array([middle]))[0]) < phase
            low, high = (middle, high) if before else (low, middle)
        return high

    @property
    def end_phase(self) -> float:
        """Phase in rad at the end."""
        return float(self._phase(np.array([self.duration]))[0])

    def motion(self, time: FloatArray) -> Motion:
        """Position and its derivatives at `time` (s, shape (n,)); at rest outside."""
        return at_rest_outside(time, self.duration, self._inside)

    def _inside(self, t: FloatArray) -> Motion:
        omega, rate, bend, third = self._omega(t)
        size = self._size(omega)
        # The amplitude's derivatives by time, from those by frequency.
        a0, by1, by2, by3 = size
        a1 = by1 * rate
        a2 = by2 * rate**2 + by1 * bend
        a3 = by3 * rate**3 + 3.0 * by2 * rate * bend + by1 * third
        phase = self._phase(t)
        s0, cosine = np.sin(phase), np.cos(phase)
        s1 = omega * cosine
        s2 = rate * cosine - omega**2 * s0
        s3 = bend * cosine - 3.0 * omega * rate * s0 - omega**3 * cosine
        return Motion(
            time=t,
            position=a0 * s0,
            velocity=a1 * s0 + a0 * s1,
            acceleration=a2 * s0 + 2.0 * a1 * s1 + a0 * s2,
            jerk=a3 * s0 + 3.0 * a2 * s1 + 3.0 * a1 * s2 + a0 * s3,
        )

    @property
    def span(self) -> float:
        """What the frequency would gain in a sweep without rounded corners, rad/s."""
        return 2.0 * math.pi * (self.band[1] - self.band[0]) / (1.0 - 0.75 * CORNER)

    def _omega(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Angular frequency and its derivatives."""
        s = t / self.sweep
        turn = np.round(s)
        x = s - turn  # from the nearest end of a sweep, in sweeps
        way = np.where(turn % 2 == 0, 1.0, -1.0)  # a valley, or a peak
        near = np.abs(x) < CORNER
        z = np.where(near, x / CORNER, 0.0)
        value = np.where(near, CORNER * (0.375 + 0.75 * z**2 - 0.125 * z**4), np.abs(x))
        slope = np.where(near, 1.5 * z - 0.5 * z**3, np.sign(x))
        curve = np.where(near, 1.5 * (1.0 - z**2) / CORNER, 0.0)
        third = np.where(near, -3.0 * z / CORNER**2, 0.0)
        span, T = self.span, self.sweep
        base = 2.0 * math.pi * np.where(way > 0.0, self.band[0], self.band[1])
        above = way * span * (value - 0.375 * CORNER)
        return (
            base + above,
            way * span * slope / T,
            way * span * curve / T**2,
            way * span * third / T**3,
        )

    def _phase(self, t: FloatArray) -> FloatArray:
        """Integral of the angular frequency."""
        s = t / self.sweep
        turn = np.round(s)
        x = s - turn
        way = np.where(turn % 2 == 0, 1.0, -1.0)
        z = np.clip(x / CORNER, -1.0, 1.0)
        # Of the rounded corner up to its edge, then of the straight part.
        inner = CORNER**2 * (0.375 * z + 0.25 * z**3 - 0.025 * z**5)
        outer = 0.5 * np.sign(x) * np.maximum(x**2 - CORNER**2, 0.0)
        base = 2.0 * math.pi * np.where(way > 0.0, self.band[0], self.band[1])
        within = base * x + way * self.span * (inner + outer - 0.375 * CORNER * x)
        # Each whole sweep gains the mean of both frequencies.
        gained = math.pi * (self.band[0] + self.band[1])
        return np.asarray(self.sweep * (gained * turn + within))

    def _size(self, omega: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Amplitude and its derivatives by the angular frequency."""
        sums = [np.ones_like(omega), *(np.zeros_like(omega) for _ in range(3))]
        for order, corner in enumerate(self.corners, start=1):
            power = _SHARP * order
            term = (omega / (2.0 * math.pi * corner)) ** power
            for k in range(4):
                sums[k] = sums[k] + term
                term = term * (power - k) / omega
        s0, s1, s2, s3 = sums
        q = -1.0 / _SHARP
        a0 = self.amplitude * s0**q
        r1, r2, r3 = s1 / s0, s2 / s0, s3 / s0
        return (
            a0,
            a0 * q * r1,
            a0 * q * (r2 + (q - 1.0) * r1**2),
            a0 * q * (r3 + 3.0 * (q - 1.0) * r1 * r2 + (q - 1.0) * (q - 2.0) * r1**3),
        )


def repeated_sweeps(
    *, band: tuple[float, float], duration: float, sweep: float, limits: Limits
) -> Repeated:
    """Sweeps up and down, shaped as the limits are and as large as they allow.

    Parameters
    ----------
    band : tuple of float
        Hz.
    duration, sweep : float
        Of all together, and of one, in seconds.
    limits : Limits
        At least one finite.

    Raises
    ------
    LimitsError
        If no limit is finite.
    ArgumentError
        If a length is out of range.

    Examples
    --------
    >>> limits = Limits(position=10.0, velocity=100.0)
    >>> sweeps = repeated_sweeps(band=(0.1, 20.0), duration=6.0, sweep=0.6, limits=limits)
    >>> round(sweeps.corners[0], 3)
    1.592
    """
    check_limits_given(limits)
    low, _ = check_band(band)
    largest = float(largest_sine(np.array([low]), limits)[0])
    if not largest > 0.0:
        raise LimitsError(f"the limits leave no motion at {low:g} Hz; raise them")
    corners = tuple(
        (bound / largest) ** (1.0 / order) / (2.0 * math.pi)
        for order, bound in enumerate((limits.velocity, limits.acceleration, limits.jerk), start=1)
    )
    shape = Repeated(
        band=band,
        duration=duration,
        sweep=sweep,
        amplitude=largest,
        corners=(corners[0], corners[1], corners[2]),
    )
    return scale_to_limits(shape, limits)
