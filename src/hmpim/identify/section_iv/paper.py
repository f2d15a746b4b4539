"""Section IV of the paper from end to end: every curve, and every figure from them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from hmpim.arguments import checked
from hmpim.errors import RecordError
from hmpim.identify.arrays import Complex, Mask, Real, median
from hmpim.identify.kept import kept
from hmpim.identify.result import PaperEstimates
from hmpim.identify.section_iv import response as reading
from hmpim.identify.section_iv import static
from hmpim.identify.section_iv.correlation import (
    CorrelationPeak,
    autocorrelation,
    cross_correlation,
    likeness,
)
from hmpim.identify.section_iv.spectrum import (
    Spectrum,
    decibel,
    excited_band,
    ratio,
    spectrum,
    well_excited,
)
from hmpim.identify.section_iv.windows import WindowName
from hmpim.identify.signals import as_pair, bins_in, check_band, check_rate, longest_lag

__all__ = ["PaperAnalysis", "estimates_of_many", "paper_analysis", "paper_estimates"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PaperAnalysis:
    """Every curve of the paper's section IV for one record, and the figures from them.

    Parameters
    ----------
    fs : float
        Sampling rate, Hz.
    band : tuple of float
        Excited band, Hz, of `response` and all that follows from it.
    window, alpha
        The window of the spectra, and its shape if it is Gaussian.
    inverted : bool
        True if the cross-correlation peaks below zero: the device inverts the sign.
    lag, cross_correlation : ndarray, shape (2n-1,)
        Lags in s, positive for a late output, and equation (8) (Fig. 8).
    error : ndarray, shape (e,)
        Time-corrected error of equation (9), by samples of the stimulus.
    error_lag, error_autocorrelation : ndarray, shape (2e-1,)
        Lags in s, and equation (10) (Figs 9 and 11).
    frequency : ndarray, shape (m,)
        Hz, 0 to fs/2, of the four spectra that follow.
    input_db, output_db, input_windowed_db, output_windowed_db : ndarray, shape (m,)
        Spectra of equation (17) in dB, zero-padded; without and with the window (Fig. 12).
    band_frequency : ndarray, shape (b,)
        Hz, the part of `frequency` inside the band.
    response : complex ndarray, shape (b,)
        Transfer function, equation (18).
    magnitude, magnitude_db : ndarray, shape (b,)
        Equation (24), and in dB.
    phase, phase_without_delay : ndarray, shape (b,)
        Degrees without jumps, equation (23); and with the delay's part (25) removed.
    estimates : PaperEstimates
        The figures from these curves.
    """

    fs: float
    band: tuple[float, float]
    window: WindowName
    alpha: float
    inverted: bool
    lag: Real
    cross_correlation: Real
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
class _Inside:
    """Results of section IV.D inside a band, of several outputs."""

    frequency: Real  # (b,)
    read: Mask  # (b,): bins that give the figures
    response: Complex  # (k, b)
    phase: Real  # (k, b)


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

    The steps follow one another, and the error of one affects the next: the correlation's delay
    includes that of the dynamics, which affects the error, the bias, the noise and the natural
    frequency. They are the paper's figures, for comparison with better ones.

    Two steps are ours. Each signal's mean is removed before the transforms of section IV.D, on
    which the paper says nothing. Otherwise the measurement's bias fills the lowest bins, and at an
    amplitude near the bias the first -90° is found there, at 0.17 Hz instead of 1.53 Hz;
    `remove_mean=False` keeps it. And only bins that are `well_excited` give figures.

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
        Whether to remove the signals' means before spectra and transfer function.

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
        For an impossible rate, band, window or padding.

    Examples
    --------
    >>> t = np.arange(2000) / 200
    >>> u = np.sin(2 * np.pi * (0.1 * t + t**2))
    >>> y = np.concatenate((np.zeros(30), u[:-30])) + 0.6
    >>> analysis = paper_analysis(u, y, fs=200.0, band=(0.1, 20.0))
    >>> analysis.estimates.delay, round(analysis.estimates.bias, 2)
    (0.15, 0.6)
    """
    stimulus, measured, fs, span = _checked(u, y, fs, band)
    peak = likeness(stimulus, measured, longest_lag(stimulus.size)).peak
    if peak.value == 0.0:
        raise RecordError("the correlation is zero at every lag; one of the signals is dead")
    correlation = cross_correlation(measured, stimulus)
    estimates, error = _time_steps(stimulus, measured, peak, fs)
    plain = np.stack((stimulus, measured))
    if remove_mean:
        plain -= plain.mean(axis=1, keepdims=True)
    bare = [spectrum(x, fs, window="rectangular", pad=pad) for x in plain]
    below, above = (spectrum(x, fs, window=window, alpha=alpha, pad=pad) for x in plain)
    inside = _frequency_steps(below.value, above.value[None], below.frequency, span, [peak])
    inner = autocorrelation(error)
    magnitude, phase = np.abs(inside.response[0]), inside.phase[0]
    return PaperAnalysis(
        fs=fs,
        band=span,
        window=window,
        alpha=alpha,
        inverted=peak.value < 0,
        lag=correlation.lag / fs,
        cross_correlation=correlation.value,
        error=error,
        error_lag=inner.lag / fs,
        error_autocorrelation=inner.value,
        frequency=below.frequency,
        input_db=decibel(bare[0].value),
        output_db=decibel(bare[1].value),
        input_windowed_db=decibel(below.value),
        output_windowed_db=decibel(above.value),
        band_frequency=inside.frequency,
        response=inside.response[0],
        magnitude=magnitude,
        magnitude_db=decibel(magnitude),
        phase=phase,
        phase_without_delay=phase - reading.delay_phase(inside.frequency, estimates.delay or 0.0),
        estimates=_with_band(estimates, inside, 0),
    )


def paper_estimates(
    u: ArrayLike, y: ArrayLike, fs: float, band: tuple[float, float] | None = None
) -> PaperEstimates:
    """Return only the figures of `paper_analysis`, with the paper's own settings.

    A figure is None if its step has no answer; all are None if the output is dead.

    Examples
    --------
    >>> t = np.arange(2000) / 200
    >>> u = np.sin(2 * np.pi * (0.1 * t + t**2))
    >>> paper_estimates(u, np.roll(u, 30), fs=200.0).delay
    0.15
    """
    stimulus, measured, fs, span = _checked(u, y, fs, band)
    return estimates_of_many(stimulus, [measured], fs, span)[0]


def estimates_of_many(
    u: Real, outputs: Sequence[Real] | Real, fs: float, band: tuple[float, float]
) -> list[PaperEstimates]:
    """Return `paper_estimates` of many outputs of one stimulus, each (n,), all of them checked.

    Examples
    --------
    >>> t = np.arange(2000) / 200
    >>> u = np.sin(2 * np.pi * (0.1 * t + t**2))
    >>> late = np.stack([np.roll(u, 30), np.roll(u, 20), np.zeros(2000)])
    >>> [own.delay for own in estimates_of_many(u, late, 200.0, (0.1, 20.0))]
    [0.15, 0.1, None]
    """
    found = [PaperEstimates()] * len(outputs)
    moving = [i for i, y in enumerate(outputs) if np.ptp(y) > 0]
    if not moving:
        return found
    peaks = [likeness(u, outputs[i], longest_lag(u.size)).peak for i in moving]
    below = _input_spectrum(u, fs, band[1])
    above = np.stack([_spectrum(outputs[i], fs, band[1]).value for i in moving])
    inside = _frequency_steps(below.value, above, below.frequency, band, peaks)
    for k, (i, peak) in enumerate(zip(moving, peaks, strict=True)):
        estimates, _ = _time_steps(u, outputs[i], peak, fs)
        found[i] = _with_band(estimates, inside, k)
    return found


def _spectrum(x: Real, fs: float, highest: float) -> Spectrum:
    """Spectrum of a signal less its mean, with the paper's window, a little beyond a frequency."""
    whole = spectrum(x - x.mean(), fs)
    bins = int(np.searchsorted(whole.frequency, highest)) + 2
    return Spectrum(frequency=whole.frequency[:bins], value=whole.value[:bins].copy())


_input_spectrum = kept(_spectrum)
"""The same of a stimulus, kept since all its outputs need it."""


def _checked(
    u: ArrayLike, y: ArrayLike, fs: float, band: tuple[float, float] | None
) -> tuple[Real, Real, float, tuple[float, float]]:
    """Stimulus and response as samples, the rate, and the band, which is found if not given."""
    (stimulus, measured), rate = as_pair(u, y), float(fs)
    check_rate(rate)
    if band is None:
        return stimulus, measured, rate, excited_band(stimulus, rate)
    check_band(band, rate)
    if np.ptp(stimulus) == 0:
        raise RecordError(f"u is constant at {stimulus[0]:g}; a stimulus must move")
    return stimulus, measured, rate, band


def _time_steps(u: Real, y: Real, peak: CorrelationPeak, fs: float) -> tuple[PaperEstimates, Real]:
    """Figures of sections IV.A to IV.C, equations (8) to (14), and the error of equation (9)."""
    lag = min(peak.lag, u.size - 4)
    error = static.time_corrected_error(u, y, lag)
    bias = static.bias_by_autocorrelation(error)
    estimates = PaperEstimates(
        delay=lag / fs,
        bias=bias,
        scale_factor=static.scale_factor_near_dc(u, y, lag, bias),
        noise_std=static.noise_by_autocorrelation(error),
    )
    return estimates, error


def _frequency_steps(
    u: Complex, y: Complex, frequency: Real, band: tuple[float, float], peaks: list[CorrelationPeak]
) -> _Inside:
    """Section IV.D: equations (18) to (25) on the bins of spectra, y of shape (k, m), in a band."""
    # The bin at DC holds the bias and no stimulus.
    first, last = bins_in(band, float(frequency[1]), u.size)
    bins = slice(first, max(last + 1, first))
    frequency = frequency[bins]
    response = ratio(y[:, bins], u[bins])
    response = np.where(np.isfinite(response), response, 0.0)
    read = well_excited(u[bins])
    inverted = np.array([peak.value < 0 for peak in peaks])
    phase = np.zeros(response.shape)
    phase[:, read] = reading.phase(response[:, read], inverted=inverted)
    if not read.all() and read.any():
        # In a notch the angle is random: it must not add a turn to the bins beyond.
        near = np.stack([np.interp(frequency, frequency[read], own[read]) for own in phase])
        angle = np.degrees(np.angle(np.where(inverted[:, None], -response, response)))
        phase[:, ~read] = (near + (angle - near + 180.0) % 360.0 - 180.0)[:, ~read]
    return _Inside(frequency=frequency, read=read, response=response, phase=phase)


def _with_band(estimates: PaperEstimates, inside: _Inside, k: int) -> PaperEstimates:
    """The figures of one output, with those of section IV.D from its response."""
    frequency, phase = inside.frequency[inside.read], inside.phase[k, inside.read]
    magnitude = np.abs(inside.response[k, inside.read])
    hump = reading.peak_gain(magnitude)
    low = magnitude[: reading.near_dc(magnitude.size)]
    gain = median(low) if low.size else 0.0
    remaining = phase - reading.delay_phase(frequency, estimates.delay or 0.0)
    return replace(
        estimates,
        natural_frequency=reading.falling_crossing(frequency, remaining, -90.0),
        damping_ratio=None if hump is None else reading.damping_from_hump(hump),
        bandwidth_phase90=reading.falling_crossing(frequency, phase, -90.0),
        bandwidth_3db=reading.falling_crossing(frequency, magnitude, gain / math.sqrt(2)),
        peak_gain_db=None if hump is None else float(decibel(hump)),
    )
