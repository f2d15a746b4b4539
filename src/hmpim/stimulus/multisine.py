"""Multisines: sinusoids at whole multiples of one frequency, phased to keep peaks low.

All lines are multiples of 1/T, so that the sum is periodic over its duration T and its DFT
has nothing between the lines. Each line is as large in proportion as a single sine of its
frequency could be inside the limits; the whole is then scaled to the limits.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from hmpim.arguments import generator
from hmpim.errors import ArgumentError, LimitsError
from hmpim.stimulus.limits import QUANTITIES, Limits, three_digits
from hmpim.stimulus.motion import FloatArray, Motion, at_rest_outside
from hmpim.stimulus.peaks import true_peaks
from hmpim.stimulus.scale import check_limits_given, largest_sine, scale_to_limits
from hmpim.stimulus.sweep import check_band, check_positive

__all__ = [
    "Multisine",
    "interleaved_multisines",
    "random_phase_multisine",
    "schroeder_multisine",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Multisine:
    """Sum of A_k cos(2πf_k t + φ_k).

    Parameters
    ----------
    frequencies : tuple of float
        Hz, positive and rising.
    amplitudes : tuple of float
        As many, in the position's unit, not negative, not all zero.
    phases : tuple of float
        As many, radians.
    duration : float
        Length in seconds.

    Raises
    ------
    ArgumentError
        If they do not go together.

    Examples
    --------
    >>> import numpy as np
    >>> lines = Multisine(
    ...     frequencies=(1.0, 2.0), amplitudes=(1.0, 0.5), phases=(0.0, 0.0), duration=3.0
    ... )
    >>> lines.motion(np.array([0.0, 0.5])).position.round(9).tolist()
    [1.5, -0.5]
    """

    frequencies: tuple[float, ...]
    amplitudes: tuple[float, ...]
    phases: tuple[float, ...]
    duration: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "duration", check_positive("duration", self.duration, "s"))
        for name in ("frequencies", "amplitudes", "phases"):
            values = tuple(float(value) for value in getattr(self, name))
            object.__setattr__(self, name, values)
            if not all(math.isfinite(value) for value in values):
                raise ArgumentError(f"{name} = {values!r} must be finite numbers")
        count = len(self.frequencies)
        if count == 0 or len(self.amplitudes) != count or len(self.phases) != count:
            raise ArgumentError(
                f"{count} frequencies, {len(self.amplitudes)} amplitudes and {len(self.phases)} "
                "phases do not match; give as many of each"
            )
        if not np.all(np.diff((0.0, *self.frequencies)) > 0.0):
            raise ArgumentError(
                f"frequencies = {self.frequencies!r} Hz must be positive and rise; sort them"
            )
        if min(self.amplitudes) < 0.0 or max(self.amplitudes) == 0.0:
            raise ArgumentError(
                f"amplitudes = {self.amplitudes!r} must not be negative, nor all zero; "
                "turn a line over by its phase"
            )

    @property
    def band(self) -> tuple[float, float] | None:
        """Lowest and highest frequency, Hz."""
        return self.frequencies[0], self.frequencies[-1]

    def scaled(self, factor: float) -> "Multisine":
        """Return the same sum, `factor` times as large."""
        return replace(self, amplitudes=tuple(factor * A for A in self.amplitudes))

    def motion(self, time: FloatArray) -> Motion:
        """Position, velocity, acceleration and jerk at `time`.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Seconds; at rest outside [0, duration].
        """
        return at_rest_outside(time, self.duration, self._inside)

    def _inside(self, t: FloatArray) -> Motion:
        position, velocity, acceleration, jerk = np.zeros((4, *t.shape))
        step = even_step(self.frequencies)
        turn_cos, turn_sin = np.cos(2.0 * math.pi * step * t), np.sin(2.0 * math.pi * step * t)
        first = 2.0 * math.pi * self.frequencies[0] * t
        c, s = np.cos(first), np.sin(first)
        # line by line and not as one matrix product, whose sums depend on how many times are asked
        for k, f in enumerate(self.frequencies):
            omega = 2.0 * math.pi * f
            if k > 0 and step > 0.0:  # turned on by the same angle each time: no sine to compute
                c, s = c * turn_cos - s * turn_sin, s * turn_cos + c * turn_sin
            elif k > 0:
                c, s = np.cos(omega * t), np.sin(omega * t)
            real = self.amplitudes[k] * math.cos(self.phases[k])
            imaginary = self.amplitudes[k] * math.sin(self.phases[k])
            cosine, sine = real * c - imaginary * s, omega * (real * s + imaginary * c)
            position += cosine
            velocity -= sine
            acceleration -= (omega * omega) * cosine
            jerk += (omega * omega) * sine
        return Motion(
            time=t, position=position, velocity=velocity, acceleration=acceleration, jerk=jerk
        )


def even_step(frequencies: tuple[float, ...]) -> float:
    """Distance in Hz between lines that are evenly spaced, 0 where they are not."""
    steps = np.diff(frequencies)
    if steps.size < 2 or np.ptp(steps) > 1e-12 * frequencies[-1]:
        return 0.0
    return float((frequencies[-1] - frequencies[0]) / steps.size)


def schroeder_multisine(
    *,
    band: tuple[float, float],
    duration: float,
    limits: Limits,
    every: int = 1,
    offset: int = 0,
) -> Multisine:
    """Multisine with Schroeder's phases, which keep its peaks low.

    The phases follow the power of position, velocity, acceleration or jerk, whichever lets
    the whole be largest inside the limits.

    Parameters
    ----------
    band : tuple of float
        Lowest and highest frequency, Hz.
    duration : float
        One period, in seconds; lines are multiples of its reciprocal.
    limits : Limits
        At least one of them finite.
    every, offset : int
        Of the lines in the band, take those whose number divided by `every` leaves `offset`.

    Returns
    -------
    Multisine
        Reaching one of the limits.

    Raises
    ------
    LimitsError
        If no line falls into the band.

    References
    ----------
    M. R. Schroeder, "Synthesis of low-peak-factor signals and binary sequences with low
    autocorrelation", IEEE Trans. Information Theory 16 (1970) 85-89.

    Examples
    --------
    >>> lines = schroeder_multisine(band=(0.1, 5.0), duration=10.0, limits=Limits(position=2.0))
    >>> len(lines.frequencies), round(true_peaks(lines).position, 6)
    (50, 2.0)
    """
    frequency, shape = _lines(band, duration, limits, every, offset)
    candidates = []
    for order, name in enumerate(QUANTITIES):
        if math.isinf(getattr(limits, name)):
            continue
        power = (shape * frequency**order) ** 2
        power /= power.sum()
        numbers = np.arange(frequency.size)
        # phi_k = -2π sum over j < k of (k - j) p_j
        below = np.concatenate(([0.0], np.cumsum(power)[:-1]))
        phases = -2.0 * np.pi * (numbers * below - _weighted_below(power))
        candidates.append(_multisine(frequency, shape, phases, duration))
    jerk = math.isfinite(limits.jerk)
    best = min(candidates, key=lambda lines: limits.use(true_peaks(lines, jerk=jerk)))
    return scale_to_limits(best, limits)


def _weighted_below(power: FloatArray) -> FloatArray:
    weighted = np.cumsum(np.arange(power.size) * power)
    return np.concatenate(([0.0], weighted[:-1]))


def random_phase_multisine(
    *,
    band: tuple[float, float],
    duration: float,
    limits: Limits,
    rng: np.random.Generator | int,
    every: int = 1,
    offset: int = 0,
) -> Multisine:
    """Multisine with phases drawn at random, as measuring nonlinearity needs.

    Parameters
    ----------
    band, duration, limits, every, offset
        As for `schroeder_multisine`.
    rng : numpy.random.Generator or int
        Source of the phases, or its seed: one seed, one waveform.

    Raises
    ------
    LimitsError
        If no line falls into the band.

    Examples
    --------
    >>> wish = {"band": (0.1, 5.0), "duration": 10.0, "limits": Limits(velocity=2.0)}
    >>> one, same = (random_phase_multisine(**wish, rng=3) for _ in range(2))
    >>> one == same
    True
    """
    frequency, shape = _lines(band, duration, limits, every, offset)
    phases = generator(rng).uniform(-np.pi, np.pi, frequency.size)
    return scale_to_limits(_multisine(frequency, shape, phases, duration), limits)


def interleaved_multisines(
    *,
    bands: Sequence[tuple[float, float]],
    limits: Sequence[Limits],
    duration: float,
    phases: Literal["schroeder", "random"] = "schroeder",
    rng: np.random.Generator | int | None = None,
) -> tuple[Multisine, ...]:
    """Multisines for several axes at once, no two sharing a frequency.

    The lines are dealt out in turn, so over one period of `duration` seconds the multisines
    are orthogonal: what comes out at a line belongs to one axis alone.

    Parameters
    ----------
    bands : sequence of tuple of float
        For each axis, Hz.
    limits : sequence of Limits
        For each axis, as many.
    duration : float
        One period, in seconds, the same for all.
    phases : {'schroeder', 'random'}
        How they are chosen.
    rng : numpy.random.Generator, int or None
        Needed for random phases.

    Raises
    ------
    ArgumentError
        If bands and limits are not as many, or random phases have no source.
    LimitsError
        If an axis gets no line: its band is too narrow for that duration.

    Examples
    --------
    >>> roll, yaw = interleaved_multisines(
    ...     bands=[(0.1, 5.0)] * 2, limits=[Limits(position=1.0)] * 2, duration=10.0
    ... )
    >>> sorted(set(roll.frequencies) & set(yaw.frequencies))
    []
    """
    if len(bands) != len(limits) or not bands:
        raise ArgumentError(
            f"{len(bands)} bands and {len(limits)} limits do not match; give one of each "
            "for each axis"
        )
    axes = list(zip(bands, limits, strict=True))
    count = len(axes)
    if phases == "schroeder":
        return tuple(
            schroeder_multisine(band=b, duration=duration, limits=m, every=count, offset=k)
            for k, (b, m) in enumerate(axes)
        )
    if phases != "random":
        raise ArgumentError(f"phases = {phases!r} must be 'schroeder' or 'random'")
    if rng is None:
        raise ArgumentError("random phases need a source; give rng, a seed for instance")
    source = generator(rng)
    return tuple(
        random_phase_multisine(
            band=b, duration=duration, limits=m, rng=source, every=count, offset=k
        )
        for k, (b, m) in enumerate(axes)
    )


def _lines(
    band: tuple[float, float], duration: float, limits: Limits, every: int, offset: int
) -> tuple[FloatArray, FloatArray]:
    """Frequencies in the band, and the largest sine of each inside the limits."""
    low, high = check_band(band)
    period = check_positive("duration", duration, "s")
    check_limits_given(limits)
    first, last = math.ceil(low * period - 1e-9), math.floor(high * period + 1e-9)
    numbers = np.arange(max(first, 1), last + 1)
    numbers = numbers[numbers % every == offset % every]
    if numbers.size == 0:
        needed = every / (high - low)
        raise LimitsError(
            f"band = ({low:g}, {high:g}) Hz holds no line of a multisine of {period:g} s that "
            f"takes one multiple of {1.0 / period:g} Hz in {every}; a duration of "
            f"{three_digits(needed, up=True)} s is enough"
        )
    frequency = numbers / period
    return frequency, largest_sine(frequency, limits)


def _multisine(
    frequency: FloatArray, amplitude: FloatArray, phase: FloatArray, duration: float
) -> Multisine:
    wrapped = np.remainder(phase, 2.0 * np.pi)
    return Multisine(
        frequencies=tuple(frequency.tolist()),
        amplitudes=tuple(amplitude.tolist()),
        phases=tuple(wrapped.tolist()),
        duration=duration,
    )
