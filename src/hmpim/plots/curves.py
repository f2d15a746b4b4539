"""The curves behind a Bode plot: a fitted model's response, a measured one with its band."""

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hmpim.model.filters import in_z
from hmpim.model.response import RationalDelay, phase, response

if TYPE_CHECKING:
    from hmpim.identify import FrequencyResponse, PairIdentification

__all__ = [
    "BodeCurve",
    "deviation_curve",
    "interrupted",
    "measured_curve",
    "model_curve",
    "output_hold",
    "stretches",
]

_WHOLE = 1e-4  # of a sample: a period this near to a whole number of samples counts as one
GAP = 3.0  # times a step beside it: a larger one is no step, but nothing was measured in between
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
    pair: "PairIdentification",
    frequency: NDArray[np.float64],
    *,
    with_delay: bool = True,
    fs: float | None = None,
) -> BodeCurve | None:
    """Return the fitted model's curve, or None where no model was found.

    The model is K · num(s)/den(s) · exp(-s·delay) at s = jω; the phase is -360° f · delay
    (Eq. 25) plus that of the dynamics, and 180° less for a negative scale factor.

    With `fs` it is what a ratio of sampled spectra shows: an input that is held or joined
    linearly between its samples adds the hold's own response, and folds at fs/2 (K. J. Åström
    and B. Wittenmark, Computer-Controlled Systems, 3rd ed., 1997, section 2.4).

    Parameters
    ----------
    pair : PairIdentification
        What was found.
    frequency : ndarray, shape (m,)
        Hz, positive.
    with_delay : bool
        False leaves the delay's phase out.
    fs : float, optional
        Sampling rate in Hz, to see the model as the samples do, an output that is updated more
        slowly included.

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
    above, below = np.array(pair.numerator[::-1]), np.array(pair.denominator[::-1])
    rate = None
    if pair.intersample == "sampled":
        from hmpim.identify.uses.predict import rate_of

        rate = rate_of(pair) or fs
        if rate is None:
            return None
        above, below = in_z(above[::-1]), in_z(below[::-1])
    system = RationalDelay(
        delay=0.0 if delay is None else delay.value,
        numerator=above,
        denominator=below,
        step=None if rate is None else 1.0 / rate,
    )
    lag = np.degrees(phase(system, frequency, delay=with_delay))
    values = response(system, frequency)
    if fs is not None and with_delay and pair.intersample in ("zoh", "foh", "feedforward"):
        from hmpim.identify.reading.bandwidth import sampled_response

        values = sampled_response(system, frequency, fs=fs, intersample=pair.intersample)
        held = lag if pair.intersample == "foh" else lag - 180.0 * frequency / fs
        lag = _near(np.degrees(np.angle(values)), held)
    period = pair.parameters.hold_period
    if fs is not None and with_delay and period is not None:
        late = output_hold(frequency, period=period.value, fs=fs)
        values = values * late
        lag = lag + np.degrees(np.unwrap(np.angle(late)))
    return BodeCurve(
        frequency=frequency,
        magnitude_db=decibels(scale.value * values),
        phase=lag - 180.0 if scale.value < 0.0 else lag,
    )


def output_hold(
    frequency: NDArray[np.float64], *, period: float, fs: float
) -> NDArray[np.complex128]:
    """Return what an output that is updated every `period` adds, as samples at `fs` see it.

    A sample shows a value that is between nothing and one period old: where the period is a whole
    number of samples, one of as many ages; elsewhere, over the record, every age alike.

    Parameters
    ----------
    frequency : ndarray, shape (m,)
        Hz, positive.
    period, fs : float
        s, and Hz.

    Examples
    --------
    >>> late = output_hold(np.array([0.1]), period=0.02, fs=200.0)  # 0, 5, 10 or 15 ms old
    >>> round(float(-np.angle(late[0]) / (2 * np.pi * 0.1)), 6)
    0.0075
    """
    ages = period * fs
    whole = abs(ages - round(ages)) < _WHOLE
    turn = np.pi * frequency
    below = ages * np.sin(turn / fs) if whole else turn * period
    size = np.sin(turn * period) / below
    mean_age = 0.5 * (period - 1.0 / fs) if whole else 0.5 * period
    return np.asarray(size * np.exp(-2j * turn * mean_age))


def _near(angle: NDArray[np.float64], phase: NDArray[np.float64]) -> NDArray[np.float64]:
    """Add to each angle (degrees) the whole turns that bring it next to `phase`."""
    nearest: NDArray[np.float64] = angle + 360.0 * np.round((phase - angle) / 360.0)
    return nearest


def is_measured(pair: "PairIdentification") -> bool:
    """Whether the response of a pair was measured; of compressed records it is the model's own.

    Parameters
    ----------
    pair : PairIdentification
        What was found.
    """
    return all(finding.code != "no_samples" for finding in pair.warnings)


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
        angles = _near(np.degrees(angle), near.phase)
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


def stretches(frequency: NDArray[np.float64]) -> list[slice]:
    """Return the parts of a measured response between which nothing was measured.

    Parameters
    ----------
    frequency : ndarray, shape (m,)
        Hz, increasing.

    Examples
    --------
    >>> stretches(np.array([0.1, 0.2, 0.3, 3.0, 3.1, 3.2]))
    [slice(0, 3, None), slice(3, 6, None)]
    """
    step = np.diff(frequency)
    if step.size < 2:
        return [slice(0, frequency.size)]
    padded = np.concatenate(([np.inf], step, [np.inf]))
    ends = np.flatnonzero(step > GAP * np.minimum(padded[:-2], padded[2:])) + 1
    edges = [0, *(int(end) for end in ends), frequency.size]
    return [slice(a, b) for a, b in pairwise(edges)]


def interrupted(
    frequency: NDArray[np.float64], values: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a curve that is interrupted where nothing was measured.

    Examples
    --------
    >>> f = np.array([0.1, 0.2, 0.3, 3.0, 3.1, 3.2])
    >>> interrupted(f, 0.0 * f)[1]
    array([ 0.,  0.,  0., nan,  0.,  0.,  0.])
    """
    gaps = [part.start for part in stretches(frequency)[1:]]
    middle = [0.5 * (frequency[k - 1] + frequency[k]) for k in gaps]
    return np.insert(frequency, gaps, middle), np.insert(values, gaps, np.nan)


def deviation_curve(measured: BodeCurve, model: BodeCurve) -> BodeCurve:
    """Return what a measured curve has over a model's, its band carried along.

    Parameters
    ----------
    measured, model : BodeCurve
        At the same frequencies.

    Examples
    --------
    >>> f = np.array([1.0, 2.0])
    >>> model = BodeCurve(frequency=f, magnitude_db=-f, phase=-90.0 * f)
    >>> measured = BodeCurve(frequency=f, magnitude_db=1 - f, phase=2 - 90.0 * f)
    >>> deviation_curve(measured, model).phase.tolist()
    [2.0, 2.0]
    """

    def less(
        values: NDArray[np.float64] | None, base: NDArray[np.float64]
    ) -> NDArray[np.float64] | None:
        return None if values is None else np.asarray(values - base)

    return BodeCurve(
        frequency=measured.frequency,
        magnitude_db=measured.magnitude_db - model.magnitude_db,
        phase=measured.phase - model.phase,
        magnitude_low=less(measured.magnitude_low, model.magnitude_db),
        magnitude_high=less(measured.magnitude_high, model.magnitude_db),
        phase_low=less(measured.phase_low, model.phase),
        phase_high=less(measured.phase_high, model.phase),
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
