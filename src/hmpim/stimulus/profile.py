"""Steps and pseudo-random binary sequences through smooth transitions.

Each transition is the minimum-jerk curve of fifth degree, at rest at both of its ends:
with share s of the rise r, position 10s³ - 15s⁴ + 6s⁵ of the distance D, so that the peaks
are velocity 15/8 D/r, acceleration 10/√3 D/r² and jerk 60 D/r³.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
import scipy

from hmpim.errors import ArgumentError
from hmpim.stimulus.limits import Limits
from hmpim.stimulus.motion import FloatArray, Motion
from hmpim.stimulus.scale import check_limits_given, scale_to_limits
from hmpim.stimulus.sweep import check_band, check_positive

__all__ = ["Prbs", "Steps", "shortest_rise", "smooth_prbs", "smooth_steps"]

PEAK_VELOCITY = 15.0 / 8.0  # of distance over rise
PEAK_ACCELERATION = 10.0 / math.sqrt(3.0)  # over rise squared
PEAK_JERK = 60.0  # over rise cubed
_HALF_POWER = 0.44  # of the clock rate: where the spectrum of a random binary signal is 3 dB down
_LARGEST_ORDER = 32


@dataclass(frozen=True, slots=True, kw_only=True)
class Steps:
    """From level to level through minimum-jerk transitions, starting and ending at rest at 0.

    Parameters
    ----------
    levels : tuple of float
        Positions to go to, in turn; the last must be 0.
    hold : float
        Seconds from the start of one transition to the start of the next.
    rise : float
        Seconds that a transition takes, at most `hold`.
    band : tuple of float, optional
        Band that it is meant to excite, Hz; from 1/duration to 1/(2 rise) by default.

    Raises
    ------
    ArgumentError
        If levels or times are out of range.

    Examples
    --------
    >>> import numpy as np
    >>> steps = Steps(levels=(2.0, 0.0), hold=1.0, rise=0.5)
    >>> steps.duration, steps.motion(np.array([0.25, 0.75, 1.5])).position.tolist()
    (1.5, [1.0, 2.0, 0.0])
    """

    levels: tuple[float, ...]
    hold: float
    rise: float
    band: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        levels = tuple(float(level) for level in self.levels)
        object.__setattr__(self, "levels", levels)
        object.__setattr__(self, "hold", check_positive("hold", self.hold, "s"))
        object.__setattr__(self, "rise", check_positive("rise", self.rise, "s"))
        if not levels or not all(math.isfinite(level) for level in levels) or not any(levels):
            raise ArgumentError(f"levels = {levels!r} go nowhere; give finite ones, not all 0")
        if levels[-1] != 0.0:
            raise ArgumentError(f"the last level, {levels[-1]!r}, must be 0, where the axis rests")
        if self.rise > self.hold:
            raise ArgumentError(
                f"rise = {self.rise!r} s does not fit into hold = {self.hold!r} s; shorten it"
            )
        band = self.band
        if band is None:
            band = (min(1.0 / self.duration, 0.25 / self.rise), 0.5 / self.rise)
        object.__setattr__(self, "band", check_band(band))

    @property
    def duration(self) -> float:
        """Length in seconds, to the end of the last transition."""
        return (len(self.levels) - 1) * self.hold + self.rise

    @property
    def breaks(self) -> tuple[float, ...]:
        """Times in seconds at which a transition starts or ends."""
        starts = [k * self.hold for k in range(len(self.levels))]
        return tuple(sorted({*starts, *(start + self.rise for start in starts)}))

    def scaled(self, factor: float) -> "Steps":
        """Return the same steps, `factor` times as large."""
        return replace(self, levels=tuple(factor * level for level in self.levels))

    def motion(self, time: FloatArray) -> Motion:
        """Position, velocity, acceleration and jerk at `time`.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Seconds; at rest at 0 before 0 and after `duration`.
        """
        return _through(np.array((0.0, *self.levels)), self.hold, self.rise, time, self.duration)


@dataclass(frozen=True, slots=True, kw_only=True)
class Prbs:
    """Maximum-length binary sequence, ±amplitude, through minimum-jerk transitions.

    It starts from rest at 0, plays `bits` bits of the sequence (from its start again after
    2^order - 1 of them) and returns to rest at 0.

    Parameters
    ----------
    amplitude : float
        Position is between plus and minus this.
    order : int
        Length of the shift register, 2 to 32.
    bit : float
        Seconds of each bit.
    bits : int
        How many are played.
    rise : float
        Seconds that a transition takes, at most `bit`.

    Raises
    ------
    ArgumentError
        If one of them is out of range.

    Examples
    --------
    >>> import numpy as np
    >>> prbs = Prbs(amplitude=2.0, order=3, bit=0.5, bits=7, rise=0.1)
    >>> prbs.motion(np.arange(7) * 0.5 + 0.3).position.tolist()
    [2.0, 2.0, 2.0, -2.0, 2.0, -2.0, -2.0]
    """

    amplitude: float = 1.0
    order: int
    bit: float
    bits: int
    rise: float

    def __post_init__(self) -> None:
        for name, unit in (("amplitude", ""), ("bit", "s"), ("rise", "s")):
            object.__setattr__(self, name, check_positive(name, getattr(self, name), unit))
        if isinstance(self.order, bool) or self.order not in range(2, _LARGEST_ORDER + 1):
            raise ArgumentError(f"order = {self.order!r} must be a whole number from 2 to 32")
        if isinstance(self.bits, bool) or self.bits != int(self.bits) or self.bits < 1:
            raise ArgumentError(f"bits = {self.bits!r} must be a whole number from 1 on")
        if self.rise > self.bit:
            raise ArgumentError(
                f"rise = {self.rise!r} s does not fit into a bit of {self.bit!r} s; shorten it"
            )

    @property
    def duration(self) -> float:
        """Length in seconds, to the end of the return to 0."""
        return self.bits * self.bit + self.rise

    @property
    def band(self) -> tuple[float, float] | None:
        """From one cycle in the sequence played to where its power is halved, Hz."""
        played = min(self.bits, 2**self.order - 1)
        return min(1.0 / played, 0.5 * _HALF_POWER) / self.bit, _HALF_POWER / self.bit

    @property
    def levels(self) -> FloatArray:
        """Positions from the rest before to the rest after, shape (bits + 2,)."""
        sequence, _ = scipy.signal.max_len_seq(self.order, length=min(self.bits, 2**self.order - 1))
        played = np.resize(2.0 * sequence.astype(np.float64) - 1.0, self.bits)
        return self.amplitude * np.concatenate(([0.0], played, [0.0]))

    @property
    def breaks(self) -> tuple[float, ...]:
        """Times in seconds at which a transition starts or ends."""
        starts = [k * self.bit for k in range(self.bits + 1)]
        return tuple(sorted({*starts, *(start + self.rise for start in starts)}))

    def scaled(self, factor: float) -> "Prbs":
        """Return the same sequence, `factor` times as large."""
        return replace(self, amplitude=self.amplitude * factor)

    def motion(self, time: FloatArray) -> Motion:
        """Position, velocity, acceleration and jerk at `time`.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Seconds; at rest at 0 before 0 and after `duration`.
        """
        return _through(self.levels, self.bit, self.rise, time, self.duration)


def _through(
    levels: FloatArray, hold: float, rise: float, time: FloatArray, duration: float
) -> Motion:
    """Motion through levels; transition k starts at k·hold and leads to level k + 1."""
    t = np.asarray(time, dtype=np.float64)
    k = np.clip(np.floor(t / hold), 0.0, levels.size - 2.0)
    k -= (k * hold > t) & (k > 0.0)  # a quotient rounded up
    number = k.astype(np.intp)
    distance = levels[number + 1] - levels[number]
    share = np.where(t < duration, (t - k * hold) / rise, 1.0)
    moving = (share > 0.0) & (share < 1.0)
    s = np.clip(share, 0.0, 1.0)
    rest = 1.0 - s
    shape = s * s * s * (10.0 + s * (6.0 * s - 15.0))
    # from the nearer level, so that each level is reached to the last bit
    position = np.where(
        s < 0.5,
        levels[number] + distance * shape,
        levels[number + 1] - distance * (rest * rest * rest * (10.0 + rest * (6.0 * rest - 15.0))),
    )
    step = np.where(moving, distance, 0.0)
    return Motion(
        time=t,
        position=position,
        velocity=step * (30.0 * s * s * rest * rest) / rise,
        acceleration=step * (60.0 * s * rest * (rest - s)) / rise**2 + 0.0,  # no negative zero
        jerk=step * (60.0 - 360.0 * s * rest) / rise**3,
    )


def shortest_rise(distance: float, limits: Limits) -> float:
    """Shortest time in seconds for a minimum-jerk move over `distance` inside the limits.

    Examples
    --------
    >>> round(shortest_rise(20.0, Limits(velocity=750.0)), 9)
    0.05
    """
    return max(
        PEAK_VELOCITY * distance / limits.velocity,
        math.sqrt(PEAK_ACCELERATION * distance / limits.acceleration),
        math.cbrt(PEAK_JERK * distance / limits.jerk),
    )


def smooth_prbs(*, band: tuple[float, float], duration: float, fs: float, limits: Limits) -> Prbs:
    """Binary sequence for a band: amplitude to the limit first, then the shortest rise.

    The bit is as long as 0.44/f_f, where the power is halved, in whole samples; the register
    is as short as the duration allows without playing its sequence twice.

    Parameters
    ----------
    band : tuple of float
        Hz; its end sets the bit.
    duration : float
        Seconds; the sequence takes up to two bits less.
    fs : float
        Sampling rate in Hz.
    limits : Limits
        At least one of them finite. Where even a rise as long as the bit is beyond them, the
        amplitude is lowered.

    Raises
    ------
    ArgumentError
        If the duration holds no three bits.

    Examples
    --------
    >>> prbs = smooth_prbs(band=(0.1, 4.0), duration=10.0, fs=100.0, limits=Limits(position=2.0))
    >>> prbs.order, round(prbs.bit, 9), round(prbs.amplitude, 6)
    (7, 0.11, 2.0)
    """
    _, high = check_band(band)
    check_limits_given(limits)
    rate = check_positive("fs", fs, "Hz")
    bit = max(math.floor(_HALF_POWER * rate / high + 1e-9), 1) / rate
    bits = math.floor((check_positive("duration", duration, "s") - bit) / bit + 1e-9)
    if bits < 2:
        raise ArgumentError(
            f"duration = {duration!r} s is too short for bits of {bit:g} s; take {3.0 * bit:g} s"
        )
    order = max(math.ceil(math.log2(bits + 1.0)), 2)
    unit = Prbs(order=min(order, _LARGEST_ORDER), bit=bit, bits=bits, rise=bit)
    return scale_to_limits(replace(unit, rise=_rise(2.0, bit, rate, limits)), limits)


def smooth_steps(*, band: tuple[float, float], duration: float, fs: float, limits: Limits) -> Steps:
    """Up, back, down and back: amplitude to the limit first, then the shortest rise.

    Parameters
    ----------
    band : tuple of float
        Hz; a transition takes no less than half a cycle of its end.
    duration : float
        Seconds from first to last.
    fs : float
        Sampling rate in Hz.
    limits : Limits
        At least one of them finite. Where even a quarter of the duration is no time for a
        transition, the amplitude is lowered.

    Examples
    --------
    >>> steps = smooth_steps(band=(0.1, 4.0), duration=8.0, fs=100.0, limits=Limits(position=2.0))
    >>> steps.hold, steps.rise, [round(level, 6) for level in steps.levels]
    (2.0, 0.125, [2.0, 0.0, -2.0, 0.0])
    """
    low, high = check_band(band)
    check_limits_given(limits)
    hold = 0.25 * check_positive("duration", duration, "s")
    rise = max(_rise(1.0, hold, check_positive("fs", fs, "Hz"), limits), min(0.5 / high, hold))
    unit = Steps(levels=(1.0, 0.0, -1.0, 0.0), hold=hold, rise=rise, band=(low, high))
    return scale_to_limits(unit, limits)


def _rise(moves: float, longest: float, fs: float, limits: Limits) -> float:
    """Rise for a move of `moves` amplitudes, the amplitude being the position limit."""
    if math.isinf(limits.position):
        return longest
    distance = moves * limits.position
    return min(max(shortest_rise(distance, limits), 2.0 / fs), longest)
