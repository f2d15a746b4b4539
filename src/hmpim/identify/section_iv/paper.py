"""Section IV of the paper from end to end: every curve, and every figure read off them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import ArrayLike

from hmpim.arguments import checked
from hmpim.errors import ArgumentError, RecordError
from hmpim.identify.arrays import Complex, Mask, Real, median
from hmpim.identify.kept import kept
from hmpim.identify.result import PaperEstimates
from hmpim.identify.section_iv import response as reading
from hmpim.identify.section_iv.correlation import (
    CorrelationPeak,
    autocorrelation,
    correlation_peak,
    cross_correlation,
    likeness,
)
from hmpim.identify.section_iv.spectrum import decibel, excited_band, padding, ratio, well_excited
from hmpim.identify.section_iv.static import (
    bias_by_autocorrelation,
    noise_by_autocorrelation,
    scale_factor_near_dc,
    time_corrected_error,
)
from hmpim.identify.section_iv.windows import WindowName, window_samples
from hmpim.identify.signals import as_pair, check_band, check_rate, longest_lag

__all__ = ["PaperAnalysis", "estimates_of_many", "paper_analysis", "paper_estimates"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PaperAnalysis:
    """Every curve of the paper's section IV for one record, and what is read off them.

    Parameters
    ----------
    fs : float
        Sampling rate, Hz.
    band : tuple of float
        Excited band, Hz; `response` and what follows from it is given inside it.
    window, alpha
        The window of the spectra, and its shape where it is Gaussian.
    inverted : bool
        True if the cross-correlation peaks below zero: the device turns the sign.
    lag, cross_correlation : ndarray, shape (2n-1,)
        Lags in s, positive for a late output, and equation (8) (Fig. 8).
    error_time, error : ndarray, shape (e,)
        Time in s of the stimulus, and the time-corrected error of equation (9).
    error_lag, error_autocorrelation : ndarray, shape (2e-1,)
        Lags in s, and equation (10) (Figs 9 and 11).
    frequency : ndarray, shape (m,)
        Hz, 0 to fs/2, of the four spectra that follow.
    input_db, output_db, input_windowed_db, output_windowed_db : ndarray, shape (m,)
        Spectra of equation (17) in dB, zeros padded; without and with the window (Fig. 12).
    band_frequency : ndarray, shape (b,)
        Hz, the part of `frequency` inside the band.
    response : complex ndarray, shape (b,)
        Transfer function, equation (18).
    magnitude, magnitude_db : ndarray, shape (b,)
        Equation (24), and in dB.
    phase, phase_without_delay : ndarray, shape (b,)
        Degrees without jumps, equation (23); and with the delay's part (25) removed.
    estimates : PaperEstimates
        The figures read off these curves.
    """

    fs: float
    band: tuple[float, float]
    window: WindowName
    alpha: float
    inverted: bool
    lag: Real
    cross_correlation: Real
    error_time: Real
    error: Real
    error_lag: Real
    error_autocorrelation: Real
    frequency: Real
    input_db: Real
    output_db: Real
    input_windowed_db: Real
    output_windowed_db: Real
    band_frequency: Real
    response: Complex
    magnitude: Real
    magnitude_db: Real
    phase: Real
    phase_without_delay: Real
    estimates: PaperEstimates


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _TimeSteps:
    """What sections IV.A to IV.C give."""

    lag: int
    inverted: bool
    error: Real
    bias: float
    scale_factor: float | None
    noise_std: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _FrequencySteps:
    """What section IV.D gives inside the band; figures are read off the bins of `read`."""

    inside: slice
    read: Mask
    response: Complex
    magnitude: Real
    phase: Real
    phase_without_delay: Real


@checked
def paper_analysis(
    u: ArrayLike,
    y: ArrayLike,
    fs: float,
    *,
    band: tuple[float, float] | None = None,
    window: WindowName = "gaussian",
    alpha: float = 1.5,
    pad: int | None = None,
    remove_mean: bool = True,
) -> PaperAnalysis:
    """Return every step of the paper's section IV, done as printed, with its curves.

    The steps are taken one after another, and what one leaves over spoils the next: the
    correlation's delay contains what the dynamics add, and with it the error, the bias, the
    noise and the natural frequency. They are the paper's figures, kept beside better ones.

    Two steps are ours. Before the transforms of section IV.D, of which the paper says nothing
    either way, each signal's mean is taken off. Otherwise the measurement's bias fills the
    lowest bins, and at an amplitude near the bias the first -90° is found there, at 0.17 Hz
    instead of 1.53 Hz. `remove_mean=False` leaves it in. And figures are read off only those
    bins that are `well_excited`.

    Parameters
    ----------
    u, y : array_like, shape (n,)
        Stimulus and measured response on one clock; the steps take both in one unit.
    fs : float
        Sampling rate, Hz.
    band : tuple of float or None
        Excited band in Hz; None finds it from `u` with `excited_band`.
    window, alpha, pad
        As in `spectrum`.
    remove_mean : bool
        Whether spectra and transfer function are those of the signals without their means.

    Returns
    -------
    PaperAnalysis
        Curves and estimates; an estimate whose step has no answer is None.

    Raises
    ------
    RecordError
        For unequal lengths, fewer than four samples, NaN, infinity, or a constant `u`; and
        for an output that is zero throughout.
    ArgumentError
        For a rate, a band, a window or a padding that cannot be.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(2000) / 200
    >>> u = np.sin(2 * np.pi * (0.1 * t + t**2))
    >>> y = np.concatenate((np.zeros(30), u[:-30])) + 0.6
    >>> analysis = paper_analysis(u, y, fs=200.0, band=(0.1, 20.0))
    >>> analysis.estimates.delay, round(analysis.estimates.bias, 2)
    (0.15, 0.6)
    """
    stimulus, measured = as_pair(u, y)
    check_rate(fs)
    fs = float(fs)
    span = _band(stimulus, fs, band)
    correlation = cross_correlation(measured, stimulus)
    time = _time_steps(stimulus, measured, correlation_peak(correlation))
    n = stimulus.size
    zeros = padding(n) if pad is None else pad
    if zeros < 0:
        raise ArgumentError(f"pad is {zeros}; give the number of zeros to add, 0 or more")
    length = n + zeros
    taper = window_samples(window, n, alpha=alpha)
    # Both signals, without and with the window, in one transform.
    plain = np.stack((stimulus, measured))
    if remove_mean:
        plain -= plain.mean(axis=1, keepdims=True)
    value = np.asarray(scipy.fft.rfft(np.concatenate((plain, plain * taper)), length, axis=-1))
    level = decibel(value)
    frequency = np.asarray(scipy.fft.rfftfreq(length, 1 / fs), dtype=np.float64)
    (steps,) = _frequency_steps(value[2], value[3:], fs / length, span, [time], fs)
    inner = autocorrelation(time.error)
    return PaperAnalysis(
        fs=fs,
        band=span,
        window=window,
        alpha=alpha,
        inverted=time.inverted,
        lag=correlation.lag / fs,
        cross_correlation=correlation.value,
        error_time=np.arange(time.error.size) / fs,
        error=time.error,
        error_lag=inner.lag / fs,
        error_autocorrelation=inner.value,
        frequency=frequency,
        input_db=level[0],
        output_db=level[1],
        input_windowed_db=level[2],
        output_windowed_db=level[3],
        band_frequency=frequency[steps.inside],
        response=steps.response,
        magnitude=steps.magnitude,
        magnitude_db=decibel(steps.magnitude),
        phase=steps.phase,
        phase_without_delay=steps.phase_without_delay,
        estimates=_estimates(time, steps, frequency[steps.inside], fs),
    )


def paper_estimates(
    u: ArrayLike, y: ArrayLike, fs: float, band: tuple[float, float] | None = None
) -> PaperEstimates:
    """Return only the figures of `paper_analysis`, at the paper's own settings.

    Parameters
    ----------
    u, y : array_like, shape (n,)
        Stimulus and measured response on one clock.
    fs : float
        Sampling rate, Hz.
    band : tuple of float or None
        Excited band in Hz; None finds it from `u`.

    Returns
    -------
    PaperEstimates
        None for each figure whose step has no answer; all None if the output is dead.

    Raises
    ------
    RecordError
        For unequal lengths, fewer than four samples, NaN, infinity, or a constant `u`.
    ArgumentError
        For a rate or a band that cannot be.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(2000) / 200
    >>> u = np.sin(2 * np.pi * (0.1 * t + t**2))
    >>> paper_estimates(u, np.roll(u, 30), fs=200.0).delay
    0.15
    """
    stimulus, measured = as_pair(u, y)
    check_rate(fs)
    fs = float(fs)
    span = _band(stimulus, fs, band)
    (found,) = estimates_of_many(stimulus, [measured], fs, span)
    return found


def estimates_of_many(
    u: Real, outputs: Sequence[Real] | Real, fs: float, band: tuple[float, float]
) -> list[PaperEstimates]:
    """Return `paper_estimates` of many outputs of one stimulus, each (n,), all of them checked.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(2000) / 200
    >>> u = np.sin(2 * np.pi * (0.1 * t + t**2))
    >>> late = np.stack([np.roll(u, 30), np.roll(u, 20), np.zeros(2000)])
    >>> [own.delay for own in estimates_of_many(u, late, 200.0, (0.1, 20.0))]
    [0.15, 0.1, None]
    """
    n = u.size
    length = n + padding(n)
    found = [PaperEstimates()] * len(outputs)
    moving = [i for i, y in enumerate(outputs) if np.ptp(y) > 0]
    if not moving:
        return found
    seen = [likeness(u, outputs[i], longest_lag(n)).peak for i in moving]
    times = [_time_steps(u, outputs[i], peak) for i, peak in zip(moving, seen, strict=True)]
    times = [replace(time, error=np.empty(0)) for time in times]  # long, not needed
    bins, taper = int(band[1] * length / fs) + 2, _taper(n)
    asked = _asked(u, taper, length, bins)
    answered = np.stack([_tapered(outputs[i], taper, length, bins) for i in moving])
    every = _frequency_steps(asked, answered, fs / length, band, times, fs)
    inside = every[0].inside
    frequency = np.arange(inside.start, inside.stop) * (1.0 / (length * (1 / fs)))
    for i, time, steps in zip(moving, times, every, strict=True):
        found[i] = _estimates(time, steps, frequency, fs)
    return found


@kept
def _taper(samples: int) -> Real:
    return window_samples("gaussian", samples)


def _tapered(x: Real, taper: Real, length: int, bins: int) -> Complex:
    """First bins of the transform of a signal less its mean, after the paper's window, padded."""
    padded = np.zeros(length)
    np.subtract(x, x.mean(), out=padded[: x.size])
    padded[: x.size] *= taper
    return np.array(scipy.fft.rfft(padded)[:bins], dtype=np.complex128)


_asked = kept(_tapered)
"""The same of a stimulus, kept since all its outputs need it."""


def _band(u: Real, fs: float, band: tuple[float, float] | None) -> tuple[float, float]:
    if band is None:
        return excited_band(u, fs)
    check_band(band, fs)
    if np.ptp(u) == 0:
        raise RecordError(f"u is constant at {u[0]:g}; a stimulus must move")
    return band


def _time_steps(u: Real, y: Real, peak: CorrelationPeak) -> _TimeSteps:
    """Sections IV.A to IV.C, equations (8) to (14), of the output's correlation with the input.

    The measurement first: a late measurement then peaks at a positive lag.
    """
    error = time_corrected_error(u, y, min(peak.lag, u.size - 4))
    bias = bias_by_autocorrelation(error)
    return _TimeSteps(
        lag=u.size - error.size,
        inverted=peak.value < 0,
        error=error,
        bias=bias,
        scale_factor=scale_factor_near_dc(u, y, u.size - error.size, bias),
        noise_std=noise_by_autocorrelation(error),
    )


def _frequency_steps(
    u: Complex,
    y: Complex,
    step: float,
    band: tuple[float, float],
    times: Sequence[_TimeSteps],
    fs: float,
) -> list[_FrequencySteps]:
    """Section IV.D: equations (18) to (25) on the bins of spectra, y of shape (k, m), in a band."""
    # The bin at DC holds the bias and no stimulus.
    first = max(int(np.ceil(band[0] / step - 1e-9)), 1)
    last = min(int(np.floor(band[1] / step + 1e-9)), u.size - 1)
    inside = slice(first, max(last + 1, first))
    response = ratio(y[:, inside], u[inside])
    response = np.where(np.isfinite(response), response, 0.0)
    frequency = np.arange(inside.start, inside.stop) * step
    read = well_excited(u[inside])
    inverted = np.array([time.inverted for time in times])
    phase = np.zeros(response.shape)
    phase[:, read] = reading.phase(response[:, read], inverted=inverted)
    if not read.all() and read.any():
        # In a notch the angle is chance: it must not carry a turn into the bins beyond.
        near = np.stack([np.interp(frequency, frequency[read], own[read]) for own in phase])
        angle = np.degrees(np.angle(np.where(inverted[:, None], -response, response)))
        phase[:, ~read] = (near + (angle - near + 180.0) % 360.0 - 180.0)[:, ~read]
    magnitude = reading.magnitude(response)
    return [
        _FrequencySteps(
            inside=inside,
            read=read,
            response=response[i],
            magnitude=magnitude[i],
            phase=phase[i],
            phase_without_delay=reading.phase_without_delay(frequency, phase[i], time.lag / fs),
        )
        for i, time in enumerate(times)
    ]


def _estimates(
    time: _TimeSteps, steps: _FrequencySteps, frequency: Real, fs: float
) -> PaperEstimates:
    frequency, magnitude = frequency[steps.read], steps.magnitude[steps.read]
    hump = reading.peak_gain(magnitude)
    low = magnitude[: reading.near_dc(magnitude.size)]
    gain = median(low) if low.size else 0.0
    remaining = steps.phase_without_delay[steps.read]
    return PaperEstimates(
        delay=time.lag / fs,
        bias=time.bias,
        scale_factor=time.scale_factor,
        noise_std=time.noise_std,
        natural_frequency=reading.natural_frequency(frequency, remaining),
        damping_ratio=None if hump is None else reading.damping_from_hump(hump),
        bandwidth_phase90=reading.bandwidth_phase90(frequency, steps.phase[steps.read]),
        bandwidth_3db=reading.bandwidth_3db(frequency, magnitude, gain),
        peak_gain_db=None if hump is None else float(decibel(hump)),
    )
