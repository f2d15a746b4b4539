"""Gain and phase at chosen frequencies, from the measured response and from the model."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from hmpim.arguments import numbers_of
from hmpim.errors import ArgumentError
from hmpim.identify.arrays import Real
from hmpim.identify.reading.bandwidth import ratio_at
from hmpim.identify.result import Estimate, PairIdentification
from hmpim.identify.result.error_bars import estimate
from hmpim.identify.result.pair import linear_model
from hmpim.model import RationalDelay, phase, response
from hmpim.model.dynamics import FILTERS
from hmpim.model.response import log_slopes

__all__ = ["GainPhase", "gain_and_phase", "measurable"]


_SCALES = {"dB": 20 / np.log(10), "deg": float(np.degrees(1.0))}


@dataclass(frozen=True, slots=True, kw_only=True)
class GainPhase:
    """Gain and phase at one frequency, measured and modelled.

    Parameters
    ----------
    frequency : float
        Hz.
    gain_db, phase : Estimate or None
        From the measured response, in dB (of output unit over input unit) and degrees,
        continuous from DC (from -90° of an integrator); None outside the measured band.
    model_gain_db, model_phase : Estimate
        From the fitted model; beyond that band they are an extrapolation.
    """

    frequency: float
    gain_db: Estimate | None
    phase: Estimate | None
    model_gain_db: Estimate
    model_phase: Estimate


def gain_and_phase(
    pair: PairIdentification, frequency: ArrayLike, *, fs: float
) -> tuple[GainPhase, ...]:
    """Gain and phase at chosen frequencies, each with its interval, by two methods.

    Parameters
    ----------
    pair : PairIdentification
        From `hmpim.identify`, or read back.
    frequency : array_like, shape (m,)
        Hz, positive.
    fs : float
        Rate of the record in Hz, ``result.record.fs``.

    Returns
    -------
    tuple of GainPhase
        One for each frequency.

    Raises
    ------
    ArgumentError
        For a frequency that is not positive or beyond half the rate, or a pair that was not
        identifiable.

    Notes
    -----
    The measurement is divided by the model first, whose phase gives the number of turns
    (`hmpim.identify.reading.bandwidth`). The model's error is propagated to first order from the
    covariance of its coefficients.

    Examples
    --------
    >>> from hmpim.identify import identify
    >>> from hmpim.record import Record
    >>> rng = np.random.default_rng(1)
    >>> t = np.arange(2000) / 200
    >>> u = np.sin(2 * np.pi * (0.1 * t + t**2))
    >>> y = 2.0 * np.interp(t - 0.05, t, u, left=0) + 0.01 * rng.standard_normal(2000)
    >>> result = identify(Record.from_arrays({"u": u}, {"y": y}, fs=200.0))
    >>> at = gain_and_phase(result["y", "u"], 5.0, fs=200.0)[0]
    >>> round(at.phase.value), round(at.model_phase.value), round(at.model_gain_db.value, 1)
    (-90, -90, 6.0)
    """
    places = measurable(frequency, fs)
    model = linear_model(pair, fs=fs)
    if model is None or pair.covariance is None:
        raise ArgumentError(
            f"{pair.output!r} from {pair.input!r} has no model with error bars, so no gain and "
            "phase can be read off; see its warnings"
        )
    system = model.system
    if system.step is not None:
        system = _as_fitted(system, pair)
    return tuple(_at(pair, float(f), system, pair.covariance, fs) for f in places)


def _as_fitted(system: RationalDelay, pair: PairIdentification) -> RationalDelay:
    """A filter with as many coefficients as were fitted, of powers of 1 - 1/z.

    Numerator and denominator are padded with zeros to equal length, which powers of z need. The
    covariance is of the delay and of all coefficients but the denominator's first.
    """
    order = FILTERS[pair.structure].order if pair.structure in FILTERS else 0  # of an FIR filter
    above = 0 if pair.covariance is None else len(pair.covariance) - 1 - order
    below = system.denominator[: 1 + order]
    return replace(system, numerator=system.numerator[:above], denominator=below)


def measurable(frequency: ArrayLike, fs: float) -> Real:
    """Return frequencies in Hz, shape (m,), if a record of rate `fs` can contain them.

    Raises
    ------
    ArgumentError
        If one is not positive, or beyond half the rate.

    Examples
    --------
    >>> measurable(120.0, 200.0)
    Traceback (most recent call last):
    hmpim.errors.ArgumentError: frequency 120 Hz is beyond the Nyquist frequency 100 Hz of ...
    """
    places = np.atleast_1d(numbers_of("frequency", frequency))
    low, high = places[places <= 0], places[places > 0.5 * fs]
    if low.size:
        raise ArgumentError(f"frequency {low[0]:g} Hz is not positive; give frequencies above 0")
    if high.size:
        raise ArgumentError(
            f"frequency {high[0]:g} Hz is beyond the Nyquist frequency {0.5 * fs:g} Hz of the "
            f"record, which says nothing there; ask at {0.5 * fs:g} Hz or below"
        )
    return places


def _at(
    pair: PairIdentification, f: float, system: RationalDelay, covariance: Real, fs: float
) -> GainPhase:
    there = np.array([f])
    value = complex(response(system, there)[0])
    by_delay, above, below = log_slopes(system, there)
    slope = np.concatenate([by_delay, above[::-1], below[::-1]])[:, 0]  # ordered as the covariance
    poles = np.trim_zeros(system.denominator, "f")  # an integrator turns by -90° everywhere
    integrators = system.denominator.size - poles.size
    turned = float(phase(replace(system, denominator=poles), there)[0]) - integrators * np.pi / 2
    if value.real * np.cos(turned) + value.imag * np.sin(turned) < 0:
        turned += np.pi  # the phase counts from DC; a negative scale factor adds half a turn
    log_gain = float(np.log(abs(value)))
    spread = [float(part @ covariance @ part) for part in (slope.real, slope.imag)]
    measured = ratio_at(pair.frequency_response, system, f, fs, pair.intersample)
    gain = lag = None
    if measured is not None:
        ratio, std = measured
        relative = std / np.sqrt(2) / max(abs(ratio), 1e-12)
        gain = _in("dB", log_gain + float(np.log(abs(ratio))), relative**2)
        lag = _in("deg", turned + float(np.angle(ratio)), relative**2)
    return GainPhase(
        frequency=f,
        gain_db=gain,
        phase=lag,
        model_gain_db=_in("dB", log_gain, spread[0]),
        model_phase=_in("deg", turned, spread[1]),
    )


def _in(unit: str, value: float, variance: float) -> Estimate:
    """Estimate in dB of the logarithm of a gain, or in degrees of a phase in radians."""
    scale = _SCALES[unit]
    return estimate(scale * value, scale**2 * variance, unit=unit)
