"""Bandwidths, gain and phase read off the measured response, beside the model's.

A noisy phase crosses -90° many times, and the first crossing lies too low (the paper's Fig. 24:
22 Hz for 33). So the response is divided by the fitted model first: what remains is near 1 and
flat, its phase does not wrap, and a straight line through the neighbours of a frequency tells how
far measurement and model part there, and where the measurement crosses.
"""

from dataclasses import fields, replace

import numpy as np

from hmpim.identify.arrays import Complex, Real, median
from hmpim.identify.chance import DEVIATIONS, HALF
from hmpim.identify.reading.sampled_response import sampled_response
from hmpim.identify.result import Estimate, FrequencyResponse, Parameters, ResponseBandwidths
from hmpim.identify.result.error_bars import estimate
from hmpim.identify.worth import PART, TOLERATED
from hmpim.model import RationalDelay, response
from hmpim.record import Intersample

__all__ = ["are_apart", "disagreeing", "less_bias", "ratio_at", "response_bandwidths"]

_FEWEST = 5
"""Frequencies of the measured response that a line is laid through at least."""

_BESIDE = 2
"""Of them on either side."""

_NAMES = tuple(field.name for field in fields(ResponseBandwidths))
"""Bandwidths that are read."""


def ratio_at(
    measured: FrequencyResponse,
    system: RationalDelay,
    frequency: float,
    fs: float,
    intersample: Intersample,
) -> tuple[complex, float] | None:
    """Measured over modelled response at a frequency, and the standard deviation of it.

    Neighbouring frequencies share bins of the record, so averaging them is not counted as
    lowering the error: the standard deviation is that of one of them.
    """
    return _read_at(measured.frequency, *_divided(measured, system, fs, intersample), frequency)


def _divided(
    measured: FrequencyResponse, system: RationalDelay, fs: float, intersample: Intersample
) -> tuple[Complex, Real]:
    """Measured over modelled response at each frequency, and the standard deviation of it."""
    modelled = sampled_response(system, measured.frequency, fs=fs, intersample=intersample)
    return measured.response / modelled, measured.std / np.abs(modelled)


def _read_at(f: Real, ratio: Complex, std: Real, frequency: float) -> tuple[complex, float] | None:
    """A ratio at a frequency, by the line through its neighbours; None where it has too few."""
    apart = np.abs(f - frequency)
    if apart.size < _FEWEST:
        return None
    below = int(np.count_nonzero(f <= frequency))
    if min(below, apart.size - below) < _BESIDE:  # a line through one side reaches too far
        return None
    near = apart <= max(PART * frequency, float(np.partition(apart, _FEWEST - 1)[_FEWEST - 1]))
    weight = 1.0 / np.maximum(std[near], 1e-12)
    return _height(f[near] - frequency, ratio[near], weight**2), median(std[near])


def _height(x: Real, y: Complex, weight: Real) -> complex:
    """Height at 0 of the weighted least-squares line through points, some of them apart."""
    total = float(weight.sum())
    middle, mean = float(weight @ x) / total, complex(weight @ y) / total
    away = weight * (x - middle)
    spread = float(away @ (x - middle))
    return mean - middle * complex(away @ y) / spread if spread > 0.0 else mean


def response_bandwidths(
    measured: FrequencyResponse,
    system: RationalDelay,
    modelled: Parameters,
    *,
    fs: float,
    intersample: Intersample,
) -> ResponseBandwidths:
    """Where the measured response crosses -90° (with and without the delay) and -3 dB.

    It is looked at near the bandwidths `modelled` of the fitted system, scale factor included. A
    ratio of sampled spectra contains what the input does between its samples, the bandwidths of the
    system behind it do not.
    """
    near = {name: e.value for name in _NAMES if (e := getattr(modelled, name)) is not None}
    if not near:
        return ResponseBandwidths()
    steepness = _slopes(replace(system, delay=0.0), np.array([*near.values()]))
    divided = _divided(measured, system, fs, intersample)

    def crossing(name: str, value: float, steep: complex) -> Estimate | None:
        found = _read_at(measured.frequency, *divided, value)
        if found is None:
            return None
        ratio, std = found
        if name == "bandwidth_3db":
            rise = steep.real
            shift = -(abs(ratio) - 1.0) / rise
        else:
            late = 2 * np.pi * system.delay if name == "bandwidth_phase90" else 0.0
            rise = steep.imag - late
            shift = -float(np.angle(ratio)) / rise
        spread = std / np.sqrt(2) / abs(rise)
        return estimate(value + shift, float(spread) ** 2, unit="Hz")

    return ResponseBandwidths(
        **{
            name: crossing(name, value, steep)
            for (name, value), steep in zip(near.items(), steepness.tolist(), strict=True)
        }
    )


def are_apart(measured: Estimate | None, modelled: Estimate | None) -> bool:
    """Whether a bandwidth of the response and the model's differ beyond their error bars.

    A measured one whose own interval is wide, as beside another input that is barely
    distinguished, contradicts nothing.
    """
    if measured is None or modelled is None or HALF * measured.spread > PART * measured.value:
        return False
    allowed = DEVIATIONS * float(np.hypot(measured.spread, modelled.spread))
    return not abs(measured.value - modelled.value) <= max(allowed, TOLERATED * modelled.value)


def disagreeing(measured: ResponseBandwidths, modelled: Parameters) -> bool:
    """Whether any bandwidth of the response and the model's are apart."""
    return any(are_apart(getattr(measured, name), getattr(modelled, name)) for name in _NAMES)


def less_bias(
    measured: ResponseBandwidths, own: ResponseBandwidths, modelled: Parameters
) -> ResponseBandwidths:
    """Bandwidths of the response without the estimator's bias, which adds to their error.

    That bias is by how much `own`, from the model's output without noise, is off what is modelled.
    """

    def corrected(name: str) -> Estimate | None:
        found, biased, true = (getattr(one, name) for one in (measured, own, modelled))
        if found is None or biased is None or true is None:
            return None
        bias = biased.value - true.value
        variance = found.spread**2 + bias**2
        return estimate(found.value - bias, variance, unit="Hz")

    return ResponseBandwidths(**{name: corrected(name) for name in _NAMES})


def _slopes(still: RationalDelay, f: Real) -> Complex:
    """Derivative of ln G by frequency, 1/Hz, of a system without delay: of gain, and of phase."""
    step = 1e-4 * f
    low, high = np.split(response(still, np.concatenate([f - step, f + step])), 2)
    return np.asarray(np.log(high / low) / (2 * step))
