"""Bandwidths, gain and phase read off the measured response, with the help of the model.

A noisy phase crosses -90° many times, and the first crossing lies too low (the paper's Fig. 24:
22 Hz for 33). So the response is divided by the fitted model first: the ratio is near 1 and flat,
its phase does not wrap, and a straight line through the neighbours of a frequency gives the
difference between measurement and model there, and so the measured crossing.
"""

from dataclasses import replace

import numpy as np

from hmpim.identify.arrays import Complex, Real, median
from hmpim.identify.chance import DEVIATIONS, HALF
from hmpim.identify.result import Estimate, FrequencyResponse, Parameters, ResponseBandwidths
from hmpim.identify.result.error_bars import estimate
from hmpim.identify.result.groups import BANDWIDTHS
from hmpim.identify.worth import INTERPOLATED, PART, TOLERATED
from hmpim.model import RationalDelay, response
from hmpim.model.discrete import discretise, fed_forward_response
from hmpim.model.response import response_std
from hmpim.record import Intersample

__all__ = [
    "are_apart",
    "beside_model",
    "disagreeing",
    "ratio_at",
    "response_bandwidths",
    "sampled_response",
]

_FEWEST = 5
"""Least number of frequencies of the measured response for a line."""

_BESIDE = 2
"""Least number of these on either side."""


def ratio_at(
    measured: FrequencyResponse,
    system: RationalDelay,
    frequency: float,
    fs: float,
    intersample: Intersample,
) -> tuple[complex, float] | None:
    """Ratio of measured to modelled response at a frequency, and its standard deviation.

    Neighbouring frequencies share bins of the record, so an average is taken to be no more exact:
    the standard deviation is that at a single frequency.
    """
    return _read_at(measured.frequency, *_divided(measured, system, fs, intersample), frequency)


def _divided(
    measured: FrequencyResponse, system: RationalDelay, fs: float, intersample: Intersample
) -> tuple[Complex, Real]:
    """Ratio of measured to modelled response at each frequency, and its standard deviation."""
    modelled = sampled_response(system, measured.frequency, fs=fs, intersample=intersample)
    return measured.response / modelled, measured.std / np.abs(modelled)


def sampled_response(
    system: RationalDelay, frequency: Real, *, fs: float, intersample: Intersample
) -> Complex:
    """Response from samples of the input to samples of the output, at frequencies in Hz, (m,).

    It depends on the input between its samples, and on its aliases: for a first-order lag these are
    a percent of the response well below a quarter of the rate.
    """
    if intersample in ("bandlimited", "sampled"):
        return response(system, frequency)
    whole = np.floor(system.delay * fs + 1e-9) / fs  # may be negative, unlike that of a program
    rest = replace(system, delay=max(system.delay - whole, 0.0))
    if intersample == "feedforward":
        samples = fed_forward_response(rest, frequency, fs=fs)
    else:
        samples = discretise(rest, fs=fs, intersample=intersample).response(frequency)
    return np.asarray(samples * np.exp(-2j * np.pi * frequency * whole))


def beside_model(
    left: FrequencyResponse,
    system: RationalDelay,
    covariance: Real,
    *,
    fs: float,
    intersample: Intersample,
    whole: bool = True,
) -> FrequencyResponse:
    """Return the response of an output: the model's, and that measured on the model's residual.

    The model's error is independent of the residual. A large one also shows in the residual, so
    that it adds no more than the local error does, if the `whole` record counts. The covariance is
    that of `hmpim.model.response.response_std`; a model of which it is unknown adds none. No error
    is less than that of interpolation.
    """
    modelled = sampled_response(system, left.frequency, fs=fs, intersample=intersample)
    std = left.std
    if np.isfinite(covariance).all():
        own = response_std(system, covariance, left.frequency)
        std = np.hypot(std, np.minimum(own, std) if whole else own)
    total = left.response + modelled
    return replace(left, response=total, std=np.maximum(std, INTERPOLATED * np.abs(total)))


def _read_at(f: Real, ratio: Complex, std: Real, frequency: float) -> tuple[complex, float] | None:
    """A ratio at a frequency, by the line through its neighbours; None if they are too few."""
    apart = np.abs(f - frequency)
    if apart.size < _FEWEST:
        return None
    below = int(np.count_nonzero(f <= frequency))
    if min(below, apart.size - below) < _BESIDE:  # this would be an extrapolation
        return None
    near = apart <= max(PART * frequency, float(np.partition(apart, _FEWEST - 1)[_FEWEST - 1]))
    x, y, weight = f[near] - frequency, ratio[near], (1.0 / np.maximum(std[near], 1e-12)) ** 2
    # The weighted least-squares line through these points, at 0.
    total = float(weight.sum())
    middle, mean = float(weight @ x) / total, complex(weight @ y) / total
    away = weight * (x - middle)
    spread = float(away @ (x - middle))
    height = mean - middle * complex(away @ y) / spread if spread > 0.0 else mean
    return height, median(std[near])


def response_bandwidths(
    measured: FrequencyResponse,
    system: RationalDelay,
    modelled: Parameters,
    *,
    fs: float,
    intersample: Intersample,
) -> ResponseBandwidths:
    """Frequencies at which the measured response crosses -90° (with and without delay) and -3 dB.

    It is evaluated near the bandwidths `modelled` of the fitted system, scale factor included. A
    ratio of sampled spectra depends on what the input does between its samples; the bandwidths of
    the system do not.
    """
    near = {name: e.value for name in BANDWIDTHS if (e := getattr(modelled, name)) is not None}
    if not near:
        return ResponseBandwidths()
    # Derivative of ln G by frequency, 1/Hz, without the delay: gain and phase.
    f = np.array([*near.values()])
    ends = response(replace(system, delay=0.0), np.concatenate([f - 1e-4 * f, f + 1e-4 * f]))
    low, high = np.split(ends, 2)
    steepness = np.asarray(np.log(high / low) / (2 * (1e-4 * f)))
    divided = _divided(measured, system, fs, intersample)

    def crossing(name: str, value: float, steep: complex) -> Estimate | None:
        found = _read_at(measured.frequency, *divided, value)
        if found is None:
            return None
        ratio, std = found
        if name == "bandwidth_3db":
            off, slope = abs(ratio) - 1.0, steep.real
        else:
            late = 2 * np.pi * system.delay if name == "bandwidth_phase90" else 0.0
            off, slope = float(np.angle(ratio)), steep.imag - late
        spread = std / np.sqrt(2) / abs(slope)
        return estimate(value - off / slope, float(spread) ** 2, unit="Hz")

    return ResponseBandwidths(
        **{
            name: crossing(name, value, steep)
            for (name, value), steep in zip(near.items(), steepness.tolist(), strict=True)
        }
    )


def are_apart(measured: Estimate | None, modelled: Estimate) -> bool:
    """Whether a bandwidth of the response and the model's differ beyond their error bars.

    A measured bandwidth with a wide interval contradicts nothing; an example is an input that is
    barely distinguished from another one.
    """
    if measured is None or HALF * measured.spread > PART * measured.value:
        return False
    allowed = DEVIATIONS * float(np.hypot(measured.spread, modelled.spread))
    return not abs(measured.value - modelled.value) <= max(allowed, TOLERATED * modelled.value)


def disagreeing(measured: ResponseBandwidths, modelled: Parameters) -> bool:
    """Whether any bandwidth of the response differs from the model's."""
    return any(are_apart(getattr(measured, name), getattr(modelled, name)) for name in BANDWIDTHS)
