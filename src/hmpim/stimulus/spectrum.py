"""Is the spectrum strong enough? Signal-to-noise ratio at each frequency, and what is enough.

The ratio at f is that of the energy of the stimulus's DFT to that of the noise in the same
resolution r (Hz), each averaged over a sixth of an octave or a few lines:

    SNR(f) = mean |X(f)|² r / (fs σ²),    X(f) = sum of x(k) exp(-2πj f k/fs).

With r the reciprocal of the waveform's duration, its default, that is the ratio in each
line of the DFT. A longer test at the same r gathers more signal: the ratio grows with it.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from hmpim.arguments import check_size
from hmpim.errors import ArgumentError, LimitsError
from hmpim.stimulus.limits import QUANTITIES, Limits, three_digits
from hmpim.stimulus.motion import FloatArray
from hmpim.stimulus.multisine import Multisine
from hmpim.stimulus.stimulus import Stimulus
from hmpim.stimulus.sweep import check_band, check_positive
from hmpim.units import rate_label

__all__ = [
    "OverFrequency",
    "Redesign",
    "SignalToNoise",
    "check_spectrum",
    "measured_noise",
    "signal_to_noise",
]

_SHARE = 2.0 ** (1.0 / 12.0) - 1.0  # half of a sixth of an octave
_PARTS = 8  # of measured noise, in Welch's estimate
_MOST_DB = 313.0  # 20 lg of 2⁵²
_MOST = 1e3  # factor on a limit beyond which it is no advice
_LONGEST = 10.0  # factor on the duration likewise
_MORE = (1.02, 1.1, 1.25, 1.5, 2.0, 3.0)  # times what the lack alone would ask for
_EASE = 1e-9  # dB; rounding


@dataclass(frozen=True, slots=True, kw_only=True)
class OverFrequency:
    """A value that depends on frequency: the noise's density, or the ratio wanted.

    Parameters
    ----------
    frequency : tuple of float
        Hz, positive and rising.
    value : tuple of float
        As many. Between them it is linear over the logarithm of frequency; outside it
        stays at the ends' values.

    Raises
    ------
    ArgumentError
        If they do not go together.

    Examples
    --------
    >>> curve = OverFrequency(frequency=(1.0, 100.0), value=(0.0, 20.0))
    >>> curve.at(np.array([0.1, 10.0])).tolist()
    [0.0, 10.0]
    """

    frequency: tuple[float, ...]
    value: tuple[float, ...]

    def __post_init__(self) -> None:
        frequency = tuple(float(f) for f in self.frequency)
        value = tuple(float(v) for v in self.value)
        object.__setattr__(self, "frequency", frequency)
        object.__setattr__(self, "value", value)
        if not frequency or len(frequency) != len(value):
            raise ArgumentError(
                f"{len(frequency)} frequencies and {len(value)} values do not match"
            )
        if not (np.all(np.diff((0.0, *frequency)) > 0) and np.all(np.isfinite(frequency + value))):
            raise ArgumentError(
                f"frequency = {frequency!r} Hz must be positive and rise, and all be finite"
            )

    def at(self, frequency: FloatArray) -> FloatArray:
        """Values at `frequency` (Hz, shape (n,), positive)."""
        known: FloatArray = np.interp(np.log(frequency), np.log(self.frequency), self.value)
        return known


@dataclass(frozen=True, slots=True, kw_only=True)
class Redesign:
    """How a stimulus is designed again, with other limits or another duration.

    Parameters
    ----------
    duration : float
        That was asked for, in seconds.
    make : callable
        The stimulus for given limits and duration.
    """

    duration: float
    make: Callable[[Limits, float], Stimulus]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SignalToNoise:
    """Signal-to-noise ratio over frequency.

    Parameters
    ----------
    frequency : ndarray, shape (m,)
        Hz, in the band asked about.
    decibel : ndarray, shape (m,)
        Ratio of energies, 10 log10.
    resolution : float
        Hz in which signal and noise are compared.
    """

    frequency: FloatArray
    decibel: FloatArray
    resolution: float


def measured_noise(samples: FloatArray | Sequence[float], fs: float) -> OverFrequency:
    """Density of a measured noise, from a record of the sensor at rest.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        In the stimulus's unit; their mean does not matter.
    fs : float
        Hz.

    Returns
    -------
    OverFrequency
        One-sided power density, unit²/Hz (Welch's estimate over 8 parts).

    Raises
    ------
    ArgumentError
        If there are fewer than 64 samples, or one is not finite.

    Examples
    --------
    >>> noise = measured_noise(np.random.default_rng(1).normal(0.0, 0.1, 20000), fs=200.0)
    >>> round(float(np.sqrt(np.mean(noise.value) * 100.0)), 2)
    0.1
    """
    x = np.asarray(samples, dtype=np.float64)
    if x.ndim != 1 or x.size < 64 or not np.all(np.isfinite(x)):
        raise ArgumentError(
            f"noise of shape {x.shape} must be one row of at least 64 finite samples"
        )
    part = x.size // _PARTS
    frequency, density = scipy.signal.welch(
        x - x.mean(), fs=check_positive("fs", fs, "Hz"), nperseg=part
    )
    return OverFrequency(frequency=tuple(frequency[1:].tolist()), value=tuple(density[1:].tolist()))


def signal_to_noise(
    stimulus: Stimulus,
    *,
    noise: float | OverFrequency,
    band: tuple[float, float] | None = None,
    resolution: float | None = None,
) -> SignalToNoise:
    """Signal-to-noise ratio of a stimulus at each frequency of a band.

    Parameters
    ----------
    stimulus : Stimulus
        Its position is the signal.
    noise : float or OverFrequency
        Standard deviation of white noise in each sample, in the stimulus's unit, or one-sided
        power density in unit²/Hz.
    band : tuple of float, optional
        Hz; the stimulus's own by default.
    resolution : float, optional
        Hz in which signal and noise are compared; 1/(duration of the waveform) by default.

    Raises
    ------
    ArgumentError
        If noise or band are out of range, or there is no band.

    Examples
    --------
    >>> from hmpim.stimulus.kinds import design
    >>> stimulus = design(band=(0.1, 20), duration=10, fs=200, limits=Limits(position=1.0))
    >>> found = signal_to_noise(stimulus, noise=0.1)
    >>> inside = (found.frequency > 1.0) & (found.frequency < 19.0)
    >>> round(float(found.decibel[inside].mean()))  # A² fs / (4 (f_f - f_i) σ²) is 24.0 dB
    24
    """
    low, high = _band_of(stimulus, band)
    if high >= 0.5 * stimulus.fs:
        raise ArgumentError(
            f"band = ({low:g}, {high:g}) Hz reaches the Nyquist frequency {0.5 * stimulus.fs:g} Hz"
        )
    length = stimulus.sweep_duration
    r = 1.0 / length if resolution is None else check_positive("resolution", resolution, "Hz")
    frequency: FloatArray = np.fft.rfftfreq(stimulus.samples, 1.0 / stimulus.fs).astype(np.float64)
    power = np.abs(np.fft.rfft(stimulus.position)) ** 2
    seen = (frequency >= low * (1 - 1e-9)) & (frequency <= high * (1 + 1e-9)) & (frequency > 0)
    if not seen.any():  # narrower than a line
        seen[np.argmin(np.abs(frequency[1:] - 0.5 * (low + high))) + 1] = True
    frequency, power = frequency[seen], power[seen]
    if isinstance(noise, OverFrequency):
        variance = 0.5 * stimulus.fs * noise.at(frequency)
        if np.any(variance <= 0.0):
            raise ArgumentError("the noise's density must be positive at all frequencies")
    else:
        std = check_positive("noise", noise, stimulus.unit)
        check_size("noise", std, stimulus.unit)
        variance = np.full(frequency.size, std**2)
    smooth = _averaged(frequency, power, _spacing(stimulus))
    ratio = smooth * r / (stimulus.fs * variance)
    with np.errstate(divide="ignore"):
        decibel = 10.0 * np.log10(ratio)
    return SignalToNoise(frequency=frequency, decibel=decibel, resolution=r)


def _band_of(stimulus: Stimulus, band: tuple[float, float] | None) -> tuple[float, float]:
    wanted = stimulus.band if band is None else check_band(band)
    if wanted is None:
        raise ArgumentError(
            f"a {type(stimulus.core).__name__} has no band of its own; state band=(f1, f2)"
        )
    return wanted


def _spacing(stimulus: Stimulus) -> float:
    """Distance of the lines of a stimulus's spectrum in Hz."""
    core = stimulus.core
    if isinstance(core, Multisine) and len(core.frequencies) > 1:
        return float(np.max(np.diff(core.frequencies)))
    return 1.0 / core.duration


def _averaged(frequency: FloatArray, power: FloatArray, spacing: float) -> FloatArray:
    """Mean over the neighbours of each frequency, all of them in the band."""
    half = np.maximum(_SHARE * frequency, 2.0 * spacing)
    first, last = frequency[0], frequency[-1]
    low = np.clip(frequency - half, first, np.maximum(last - 2.0 * half, first))
    below = np.searchsorted(frequency, low * (1 - 1e-12), side="left")
    above = np.searchsorted(frequency, (low + 2.0 * half) * (1 + 1e-12), side="right")
    total = np.concatenate(([0.0], np.cumsum(power)))
    mean: FloatArray = (total[above] - total[below]) / (above - below)
    return mean


def check_spectrum(
    stimulus: Stimulus,
    *,
    noise: float | OverFrequency,
    snr_db: float | OverFrequency,
    band: tuple[float, float] | None = None,
    resolution: float | None = None,
    redesign: Redesign | None = None,
) -> SignalToNoise:
    """Refuse a stimulus whose spectrum is weaker than asked, at any frequency of the band.

    Parameters
    ----------
    stimulus, noise, band, resolution
        As for `signal_to_noise`.
    snr_db : float or OverFrequency
        Ratio wanted, in dB, at each frequency.
    redesign : Redesign, optional
        How it was designed, so that the refusal can name a limit and a duration that do.

    Returns
    -------
    SignalToNoise
        What there is.

    Raises
    ------
    LimitsError
        If it is below what is wanted somewhere; the message says where it is weakest, which
        limit binds there and what is enough.
    ArgumentError
        If an argument is out of range.

    Examples
    --------
    >>> from hmpim.stimulus.kinds import design
    >>> limits = Limits(position=1.0, acceleration=500.0)
    >>> stimulus = design(band=(0.1, 20), duration=10, fs=200, limits=limits)
    >>> check_spectrum(stimulus, noise=0.1, snr_db=15.0)
    Traceback (most recent call last):
    hmpim.errors.LimitsError: at ... Hz the signal-to-noise ratio is ... acceleration limit ...
    """
    found = signal_to_noise(stimulus, noise=noise, band=band, resolution=resolution)
    if isinstance(snr_db, OverFrequency):
        wanted = snr_db.at(found.frequency)
    elif isinstance(snr_db, (str, bool)) or not abs(snr_db) <= _MOST_DB:
        raise ArgumentError(
            f"wanted_snr = {snr_db!r} dB is out of range; give at most {_MOST_DB:g} dB, all that "
            "double precision tells apart"
        )
    else:
        wanted = np.full(found.frequency.size, float(snr_db))
    lack = wanted - found.decibel
    worst = int(np.argmax(lack))
    if lack[worst] <= _EASE:
        return found
    frequency = float(found.frequency[worst])
    asked = _band_of(stimulus, band)

    def does(other: Stimulus, where: tuple[float, float]) -> bool:
        r = found.resolution
        try:
            check_spectrum(other, noise=noise, snr_db=snr_db, band=where, resolution=r)
        except LimitsError:
            return False
        return True

    def level(other: Stimulus) -> float:
        again = signal_to_noise(other, noise=noise, band=asked, resolution=found.resolution)
        return float(np.interp(frequency, again.frequency, again.decibel))

    limits = stimulus.limits
    binding = None if limits is None else _binding(limits, frequency, redesign, level)
    missing = float(lack[worst])
    advice = []
    if limits is not None and binding is not None and redesign is not None:
        advice = _other_designs(
            limits, binding, redesign, missing, lambda other: does(other, asked)
        )
    if not advice:
        scale = three_digits(10.0 ** (missing / 20.0), up=True)
        what = "the stimulus" if limits is None else "all limits"
        advice = [f"{what} {scale} times as large"]
    part = _part_that_does(found, lack, asked, lambda where: does(stimulus, where))
    if part:
        advice.append(part)
    which = f"there the {binding} limit binds; " if binding is not None else ""
    raise LimitsError(
        f"at {frequency:.4g} Hz the signal-to-noise ratio is {found.decibel[worst]:.1f} dB in "
        f"{found.resolution:.3g} Hz, below the {wanted[worst]:g} dB wanted; {which}"
        f"{', or '.join(advice)} is enough"
    )


def _binding(
    limits: Limits,
    frequency: float,
    redesign: Redesign | None,
    level: Callable[[Stimulus], float],
) -> str | None:
    """The limit that holds the spectrum down at a frequency.

    With a redesign, the one that raises the level there most when it is eased by a tenth;
    without, the one that bounds a single sine of that frequency.
    """
    finite = [name for name in QUANTITIES if math.isfinite(getattr(limits, name))]
    omega = 2.0 * math.pi * frequency
    bounds = {name: getattr(limits, name) / omega ** QUANTITIES.index(name) for name in finite}
    if redesign is None:
        return min(bounds, key=lambda name: bounds[name])
    gains = {}
    for name in finite:
        eased = replace(limits, **{name: 1.1 * getattr(limits, name)})
        try:
            gains[name] = round(level(redesign.make(eased, redesign.duration)), 3)
        except LimitsError:  # no lead, for instance
            gains[name] = -math.inf
    # of two that gain nothing by themselves, the one that bounds a sine there
    return max(finite, key=lambda name: (gains[name], -bounds[name]))


def _other_designs(
    limits: Limits,
    binding: str,
    redesign: Redesign,
    lack: float,
    does: Callable[[Stimulus], bool],
) -> list[str]:
    """A larger limit that does, and a longer duration, as `lack` dB make them likely."""
    advice = []
    limit: float = getattr(limits, binding)

    def with_limit(value: float) -> bool:
        bounds = {name: getattr(limits, name) for name in QUANTITIES} | {binding: value}
        return does(redesign.make(Limits(**bounds, unit=limits.unit), redesign.duration))

    def with_duration(value: float) -> bool:
        return does(redesign.make(limits, value))

    larger = _first_that_does(limit, 10.0 ** (lack / 20.0), _MOST, with_limit)
    if larger:
        unit = rate_label(limits.unit, QUANTITIES.index(binding))
        advice.append(f"{binding} limit {larger} {unit}".rstrip())
    longer = _first_that_does(redesign.duration, 10.0 ** (lack / 10.0), _LONGEST, with_duration)
    if longer:
        advice.append(f"a duration of {longer} s (compared in the same resolution)")
    return advice


def _first_that_does(
    start: float, likely: float, most: float, does: Callable[[float], bool]
) -> str:
    """First number that does, a little above the likely one, as it is printed; or nothing."""
    for more in _MORE:
        if likely * more > most:
            break
        words = three_digits(start * likely * more, up=True)
        try:
            if does(float(words)):
                return words
        except LimitsError:
            continue
    return ""


def _part_that_does(
    found: SignalToNoise,
    lack: FloatArray,
    band: tuple[float, float],
    does: Callable[[tuple[float, float]], bool],
) -> str:
    """The widest part of the band that is strong enough, in words; empty where there is none."""
    enough = np.concatenate(([False], lack <= _EASE, [False]))
    runs = np.flatnonzero(np.diff(enough.astype(np.int8))).reshape(-1, 2)
    if runs.size == 0:
        return ""
    first, stop = runs[int(np.argmax(runs[:, 1] - runs[:, 0]))]
    low, high = float(found.frequency[first]), float(found.frequency[stop - 1])
    for _ in range(8):  # the averages change a little with the ends of the band
        lowest = f"{band[0]:g}" if first == 0 else three_digits(low, up=True)
        highest = f"{band[1]:g}" if stop == lack.size else three_digits(high, up=False)
        if float(lowest) >= float(highest):
            return ""
        if does((float(lowest), float(highest))):
            return f"the band {lowest} to {highest} Hz"
        low, high = low * 1.05, high / 1.05
    return ""
