"""The curves behind a Bode plot: a fitted model's response, a measured one with its band."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hmpim.model.response import RationalDelay, phase, response

if TYPE_CHECKING:
    from hmpim.identify import FrequencyResponse, PairIdentification

__all__ = ["BodeCurve", "measured_curve", "model_curve"]

Z95 = 1.959963984540054  # 97.5 % point of the normal distribution


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BodeCurve:
    """Magnitude and phase over frequency, with the band that holds 95 %.

    Parameters
    ----------
    frequency : ndarray, shape (m,)
        Hz, positive and increasing.
    magnitude_db : ndarray, shape (m,)
        dB, of output unit per input unit.
    phase : ndarray, shape (m,)
        Degrees, unwrapped.
    magnitude_low, magnitude_high : ndarray, shape (m,), or None
        Band of the magnitude in dB; -inf where the magnitude may be nothing.
    phase_low, phase_high : ndarray, shape (m,), or None
        Band of the phase in degrees.
    """

    frequency: NDArray[np.float64]
    magnitude_db: NDArray[np.float64]
    phase: NDArray[np.float64]
    magnitude_low: NDArray[np.float64] | None = None
    magnitude_high: NDArray[np.float64] | None = None
    phase_low: NDArray[np.float64] | None = None
    phase_high: NDArray[np.float64] | None = None


def model_curve(
    pair: "PairIdentification", frequency: NDArray[np.float64], *, with_delay: bool = True
) -> BodeCurve | None:
    """Return the fitted model's curve, or None where no model was found.

    The model is K · num(s)/den(s) · exp(-s·delay) at s = jω; the phase is -360° f · delay
    (Eq. 25) plus that of the dynamics, and 180° less for a negative scale factor.

    Parameters
    ----------
    pair : PairIdentification
        What was found.
    frequency : ndarray, shape (m,)
        Hz, positive.
    with_delay : bool
        False leaves the delay's phase out.

    Examples
    --------
    >>> from hmpim.identify import Estimate, FrequencyResponse, PairIdentification
    >>> from hmpim.identify import PaperEstimates, Parameters
    >>> def of(value):
    ...     return Estimate(value=value, std=0.0, ci95=(value, value))
    >>> nothing = np.empty(0)
    >>> pair = PairIdentification(
    ...     input="u", output="y", structure="static", intersample="zoh", fit_percent=100.0,
    ...     parameters=Parameters(delay=of(0.25), scale_factor=of(10.0)),
    ...     paper=PaperEstimates(), candidates=(), verdict="ok", warnings=(),
    ...     frequency_response=FrequencyResponse(frequency=nothing, response=nothing, std=nothing),
    ...     numerator=(1.0,), denominator=(1.0,))
    >>> curve = model_curve(pair, np.array([1.0]))
    >>> float(curve.magnitude_db[0]), float(curve.phase[0])
    (20.0, -90.0)
    """
    scale = pair.parameters.scale_factor
    if scale is None or scale.value == 0.0 or not pair.numerator or not pair.denominator:
        return None
    delay = pair.parameters.delay
    system = RationalDelay(
        delay=0.0 if delay is None else delay.value,
        numerator=np.array(pair.numerator[::-1]),
        denominator=np.array(pair.denominator[::-1]),
    )
    lag = np.degrees(phase(system, frequency, delay=with_delay))
    return BodeCurve(
        frequency=frequency,
        magnitude_db=decibels(scale.value * response(system, frequency)),
        phase=lag - 180.0 if scale.value < 0.0 else lag,
    )


def measured_curve(measured: "FrequencyResponse", *, near: BodeCurve | None = None) -> BodeCurve:
    """Return a measured response's curve with the band that holds 95 % at each frequency.

    An error of standard deviation std in the complex plane is std/√2 along the response and
    std/√2 across it; where that reaches the response itself, its phase is unknown.

    Parameters
    ----------
    measured : FrequencyResponse
        As measured; frequencies that are not positive are left out.
    near : BodeCurve, optional
        A model's curve at the same positive frequencies: the phase is taken within 180° of
        it, so that noise cannot shift it by a turn. Without it, it is unwrapped in order.

    Examples
    --------
    >>> from hmpim.identify import FrequencyResponse
    >>> response = FrequencyResponse(
    ...     frequency=np.array([1.0]), response=np.array([-1j]), std=np.array([0.1]))
    >>> curve = measured_curve(response)
    >>> float(curve.phase[0]), round(float(curve.phase_high[0] - curve.phase[0]), 2)
    (-90.0, 7.97)
    """
    positive = measured.frequency > 0
    frequency = measured.frequency[positive]
    values = measured.response[positive]
    angle = np.angle(values)
    if near is not None and near.phase.size == angle.size:
        turns = np.round((near.phase - np.degrees(angle)) / 360.0)
        angles = np.degrees(angle) + 360.0 * turns
    else:
        angles = np.degrees(np.unwrap(angle))
    size = np.abs(values)
    reach = Z95 * measured.std[positive] / np.sqrt(2.0)
    ratio = np.divide(reach, size, out=np.ones_like(size), where=size > 0)
    swing = np.where(ratio < 1.0, np.degrees(np.arcsin(np.minimum(ratio, 1.0))), 180.0)
    return BodeCurve(
        frequency=frequency,
        magnitude_db=decibels(values),
        phase=angles,
        magnitude_low=decibels(np.maximum(size - reach, 0.0)),
        magnitude_high=decibels(size + reach),
        phase_low=angles - swing,
        phase_high=angles + swing,
    )


def decibels(values: NDArray[np.complex128] | NDArray[np.float64]) -> NDArray[np.float64]:
    """Return 20 log10 of the size, -inf for nothing.

    Examples
    --------
    >>> decibels(np.array([10.0, 0.0]))
    array([ 20., -inf])
    """
    size = np.abs(values)
    out = np.full(size.shape, -np.inf)
    np.log10(size, out=out, where=size > 0)
    return 20.0 * out
