"""Noise on the input itself, if the stimulus was measured and not just commanded.

A fit assumes that the input is exact. Measurement noise on it drives the model too, and every gain
is then underestimated by the share of the noise in the input's power.
"""

from dataclasses import dataclass

import numpy as np

from hmpim.identify.arrays import Real, every_of, median
from hmpim.identify.chance import BULK
from hmpim.identify.kept import kept
from hmpim.identify.noise.spectra import windowed_power
from hmpim.identify.worth import NEARLY, PART, PAST, TWICE

__all__ = ["InputNoise", "input_noise"]


@dataclass(frozen=True, slots=True, kw_only=True)
class InputNoise:
    """White noise on the input."""

    std: float  # in the input's unit
    # share by which gains are underestimated on average over the band: the noise's share of the
    # power in it
    attenuation: float


@kept
def input_noise(u: Real, fs: float, *, band: tuple[float, float]) -> InputNoise | None:
    """Estimate the noise on an input, (n,), from its spectrum above the excited band, in Hz.

    None if no noise is detected: there is no flat floor above rounding, or the input (steps, PRBS,
    noise) excites all frequencies, so that its noise is not identifiable.
    """
    if np.mean(np.diff(u) == 0.0) > PART:  # noise repeats no value
        return None
    power, bins = windowed_power(u) * (u.size / 2), u.size / fs
    low, high = band[0], min(band[1], _end(power) / bins)
    if PAST * high > NEARLY * fs / 2 or high <= low:
        return None
    floor = power[int(np.ceil(PAST * high * bins)) :]
    if floor.size < 32:
        return None
    half, every = floor.size // 2, every_of(floor.size)
    halves = _level(floor[:half:every]), _level(floor[half::every])
    variance = _level(floor)
    if variance <= 1e-20 * float(np.ptp(u)) ** 2 or halves[1] <= 0:
        return None
    # Steps and kinks of the stimulus decay with frequency; noise does not.
    if not TWICE**-2 < halves[0] / halves[1] < TWICE**2 or not _is_rough(u, variance):
        return None
    total = float(np.mean(power[max(int(low * bins), 1) : int(np.ceil(high * bins)) + 1]))
    if total < TWICE**2 * variance:  # the band does not stand out: all of it is stimulus
        return None
    return InputNoise(std=float(np.sqrt(variance)), attenuation=variance / total)


def _end(power: Real) -> int:
    """Last bin above the level of the top of the spectrum, which may be noise."""
    width = max(power.size // 50, 5)
    summed = np.cumsum(np.concatenate([[0.0], power]))
    mean = (summed[width:] - summed[:-width]) / width
    top = power[-(power.size // 4) :: every_of(power.size)]
    above = np.flatnonzero(mean > TWICE**2 * _level(top))
    return int(above[-1]) + width // 2 if above.size else power.size


def _level(power: Real) -> float:
    """Mean of exponentially distributed power, from its median, which ignores a line."""
    return median(power) / float(np.log(2.0))


def _is_rough(samples: Real, variance: float) -> bool:
    """Whether there is noise between jumps too; a clean square wave is constant there."""
    every = every_of(samples.size)
    first, second, third, last = (samples[k : k - 3 or None : every] for k in range(4))
    differences = last - first - 3.0 * (third - second)
    usual = median(np.abs(differences)) / BULK / np.sqrt(20.0)
    return bool(usual > 0.5 * np.sqrt(variance))
