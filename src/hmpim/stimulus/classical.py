"""The classical test waveforms of Fig. 5: step, ramp, sine, sum of sines, plain chirp."""

import math
from dataclasses import dataclass, replace

import numpy as np

from hmpim.arguments import checked
from hmpim.errors import ArgumentError
from hmpim.stimulus.motion import FloatArray, Motion, at_rest_outside, scaled_motion
from hmpim.stimulus.sweep import Sweep, check_band, check_positive

__all__ = ["Chirp", "Ramp", "Sine", "Step", "SumOfSines"]


def _check_size(name: str, value: float) -> None:
    if isinstance(value, str) or not math.isfinite(value) or value == 0:
        raise ArgumentError(f"{name} = {value!r} moves nothing; give a finite number other than 0")


def _check_start(start: float, duration: float) -> None:
    if not 0.0 <= start < duration:
        raise ArgumentError(f"start = {start!r} s must lie in the waveform's {duration:g} s")


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """A jump by `amplitude` at time `start`; velocity and acceleration have no finite value there.

    Parameters
    ----------
    amplitude : float
        Size of the jump.
    duration : float
        Length in seconds.
    start : float
        Time of the jump in seconds; from it on, the position is `amplitude`.

    Examples
    --------
    >>> import numpy as np
    >>> Step(amplitude=2.0, duration=3.0, start=1.0).motion(np.arange(3.0)).position.tolist()
    [0.0, 2.0, 2.0]
    """

    amplitude: float = 1.0
    duration: float
    start: float = 0.0

    def __post_init__(self) -> None:
        _check_size("amplitude", self.amplitude)
        check_positive("duration", self.duration, "s")
        _check_start(self.start, self.duration)

    @property
    def band(self) -> tuple[float, float] | None:
        """None: a step excites all frequencies, ever more weakly."""
        return None

    @property
    def breaks(self) -> tuple[float, ...]:
        """Time in seconds of the jump."""
        return (self.start,)

    def scaled(self, factor: float) -> "Step":
        """Return the same step, `factor` times as large."""
        return replace(self, amplitude=self.amplitude * factor)

    def motion(self, time: FloatArray) -> Motion:
        """Position at `time` (s, shape (n,)); the derivatives are 0 except at the jump."""
        t = np.asarray(time, dtype=np.float64)
        still = np.zeros_like(t)
        position = np.where(t >= self.start, self.amplitude, 0.0)
        return Motion(
            time=t,
            position=position,
            velocity=still,
            acceleration=still.copy(),
            jerk=still.copy(),
        )


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class Ramp:
    """A constant velocity from `start` to the end.

    Parameters
    ----------
    rate : float
        Velocity, unit per second.
    duration : float
        Length in seconds.
    start : float
        Time in seconds at which it starts to move.

    Examples
    --------
    >>> import numpy as np
    >>> Ramp(rate=2.0, duration=3.0, start=1.0).motion(np.arange(4.0)).position.tolist()
    [0.0, 0.0, 2.0, 4.0]
    """

    rate: float = 1.0
    duration: float
    start: float = 0.0

    def __post_init__(self) -> None:
        _check_size("rate", self.rate)
        check_positive("duration", self.duration, "s")
        _check_start(self.start, self.duration)

    @property
    def band(self) -> tuple[float, float] | None:
        """None: a ramp excites all frequencies, ever more weakly."""
        return None

    @property
    def breaks(self) -> tuple[float, ...]:
        """Time in seconds at which the velocity jumps."""
        return (self.start,)

    def scaled(self, factor: float) -> "Ramp":
        """Return the same ramp, `factor` times as fast."""
        return replace(self, rate=self.rate * factor)

    def motion(self, time: FloatArray) -> Motion:
        """Position, velocity and acceleration at `time` (s, shape (n,))."""

        def inside(t: FloatArray) -> Motion:
            moving = t >= self.start
            return Motion(
                time=t,
                position=self.rate * np.where(moving, t - self.start, 0.0),
                velocity=np.where(moving, self.rate, 0.0),
                acceleration=np.zeros_like(t),
                jerk=np.zeros_like(t),
            )

        return at_rest_outside(time, self.duration, inside)


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class SumOfSines:
    """A sum of sinusoids, sum of A_k sin(2πf_k t + φ_k).

    Parameters
    ----------
    amplitudes, frequencies : tuple of float
        As many of each; frequencies in Hz, positive and rising.
    phases : tuple of float
        Radians; none for all zero.
    duration : float
        Length in seconds.

    Examples
    --------
    >>> import numpy as np
    >>> both = SumOfSines(amplitudes=(1.0, 0.5), frequencies=(1.0, 2.0), duration=4.0)
    >>> both.motion(np.array([0.25])).position.round(9).tolist()
    [1.0]
    """

    amplitudes: tuple[float, ...]
    frequencies: tuple[float, ...]
    phases: tuple[float, ...] = ()
    duration: float

    def __post_init__(self) -> None:
        check_positive("duration", self.duration, "s")
        count = len(self.frequencies)
        if count == 0 or len(self.amplitudes) != count or len(self.phases) not in (0, count):
            raise ArgumentError(
                f"{len(self.amplitudes)} amplitudes, {count} frequencies and {len(self.phases)} "
                "phases do not match; give as many of each"
            )
        for amplitude in self.amplitudes:
            _check_size("amplitude", amplitude)
        for frequency in self.frequencies:
            check_positive("frequency", frequency, "Hz")
        for phase in self.phases:
            if not math.isfinite(phase):
                raise ArgumentError(f"phase = {phase!r} rad must be a finite number")
        if any(b <= a for a, b in zip(self.frequencies, self.frequencies[1:], strict=False)):
            raise ArgumentError(f"frequencies = {self.frequencies!r} Hz do not rise; sort them")

    @property
    def band(self) -> tuple[float, float] | None:
        """Lowest and highest frequency, Hz."""
        return self.frequencies[0], self.frequencies[-1]

    def scaled(self, factor: float) -> "SumOfSines":
        """Return the same sum, `factor` times as large."""
        return replace(self, amplitudes=tuple(factor * A for A in self.amplitudes))

    def motion(self, time: FloatArray) -> Motion:
        """Position, velocity and acceleration at `time` (s, shape (n,))."""
        phases = self.phases or (0.0,) * len(self.frequencies)

        def inside(t: FloatArray) -> Motion:
            position, velocity, acceleration, jerk = np.zeros((4, *t.shape))
            for A, f, phi in zip(self.amplitudes, self.frequencies, phases, strict=True):
                omega = 2.0 * math.pi * f
                sine, cosine = np.sin(omega * t + phi), np.cos(omega * t + phi)
                position += A * sine
                velocity += A * omega * cosine
                acceleration -= A * omega * omega * sine
                jerk -= A * omega * omega * omega * cosine
            return Motion(
                time=t,
                position=position,
                velocity=velocity,
                acceleration=acceleration,
                jerk=jerk,
            )

        return at_rest_outside(time, self.duration, inside)


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class Sine:
    """One sinusoid, amplitude · sin(2πft).

    Parameters
    ----------
    amplitude : float
        Peak.
    frequency : float
        Hz.
    duration : float
        Length in seconds.

    Examples
    --------
    >>> import numpy as np
    >>> Sine(frequency=1.0, duration=4.0).motion(np.array([0.25])).position.tolist()
    [1.0]
    """

    amplitude: float = 1.0
    frequency: float
    duration: float

    def __post_init__(self) -> None:
        _check_size("amplitude", self.amplitude)
        check_positive("frequency", self.frequency, "Hz")
        check_positive("duration", self.duration, "s")

    @property
    def band(self) -> tuple[float, float] | None:
        """The one frequency, twice, in Hz."""
        return self.frequency, self.frequency

    def scaled(self, factor: float) -> "Sine":
        """Return the same sine, `factor` times as large."""
        return replace(self, amplitude=self.amplitude * factor)

    def motion(self, time: FloatArray) -> Motion:
        """Position, velocity and acceleration at `time` (s, shape (n,))."""
        one = SumOfSines(
            amplitudes=(self.amplitude,), frequencies=(self.frequency,), duration=self.duration
        )
        return one.motion(time)


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class Chirp:
    """The plain chirp, eqs (1) to (3), of a stated amplitude.

    Equation (1) has the amplitude 1/σ₂ with σ₂ = b + a/2; `amplitude` replaces it.

    Parameters
    ----------
    amplitude : float
        Peak.
    band : tuple of float
        First and last frequency in Hz, rising.
    duration : float
        Length in seconds.

    Examples
    --------
    >>> import numpy as np
    >>> chirp = Chirp(band=(1.0, 3.0), duration=2.0)
    >>> chirp.motion(np.array([0.5])).position.round(6).tolist()
    [-0.707107]
    """

    amplitude: float = 1.0
    band: tuple[float, float]
    duration: float

    def __post_init__(self) -> None:
        _check_size("amplitude", self.amplitude)
        object.__setattr__(self, "band", check_band(self.band))
        check_positive("duration", self.duration, "s")

    def scaled(self, factor: float) -> "Chirp":
        """Return the same chirp, `factor` times as large."""
        return replace(self, amplitude=self.amplitude * factor)

    def motion(self, time: FloatArray) -> Motion:
        """Position (1), velocity (2) and acceleration (3) at `time` (s, shape (n,)), scaled."""
        unit = Sweep(band=self.band, duration=self.duration, gain=1.0, extinction=0.0)
        scale = self.amplitude * (unit.start_omega + 0.5 * unit.sweep_rate)
        return scaled_motion(unit.motion(time), scale)
