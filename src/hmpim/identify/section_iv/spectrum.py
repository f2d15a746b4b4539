"""Windowed, padded spectra and their ratio (paper, section IV.D, equations 17-18)."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from hmpim.errors import ArgumentError, RecordError
from hmpim.identify.arrays import Complex, Mask, Real, averaged
from hmpim.identify.kept import kept
from hmpim.identify.noise.spectra import transform_of
from hmpim.identify.section_iv.windows import WindowName, window_samples
from hmpim.identify.signals import as_pair, as_signal, check_rate
from hmpim.identify.worth import DEEPEST, TOLERATED

__all__ = [
    "Spectrum",
    "TransferFunction",
    "band_of_levels",
    "decibel",
    "excited_band",
    "padding",
    "spectrum",
    "transfer_function",
    "well_excited",
]

_LONG = 100_000
_NOTCH_REACH = 20
_NOTCH_DEPTH = 0.1
_SMALLEST = 1e-300  # keeps the logarithm of an exact zero finite: -6000 dB
_EDGE = 10 ** (-12 / 20)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Spectrum:
    """Discrete Fourier transform of a real signal, its non-negative frequencies."""

    frequency: Real  # (m,): Hz, from 0 to at most fs/2
    value: Complex  # (m,): X of equation (17), in the signal's unit, not divided by N


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TransferFunction:
    """Ratio of response to stimulus over frequency."""

    frequency: Real  # (m,): Hz, increasing
    response: Complex  # (m,): G(jω), output unit per input unit; NaN where the stimulus is 0


def padding(samples: int) -> int:
    """Return the number of zeros that extends a record to about four times its length.

    Four times resolves the spectrum between its bins (the paper's picket fence, IV.D.3); from
    100 000 samples on it is twice, to save memory. The length suits the FFT.

    Examples
    --------
    >>> padding(2000)
    6000
    """
    times = 4 if samples < _LONG else 2
    return int(scipy.fft.next_fast_len(times * samples, real=True)) - samples


def spectrum(
    x: ArrayLike,
    fs: float,
    *,
    window: WindowName = "gaussian",
    alpha: float = 1.5,
    pad: int | None = None,
) -> Spectrum:
    """Return the transform of equation (17) of the windowed signal, zeros padded after it.

    X(k) = Σ x(j) ω_N^((j-1)(k-1)), j = 1 … N, with ω_N = exp(-2πi/N) and N the padded length.
    The window covers the signal only, not the zeros after it.

    Parameters
    ----------
    x : array_like, shape (n,)
        Signal.
    fs : float
        Sampling rate, Hz.
    window : str
        Name of the window, see `WindowName`.
    alpha : float
        Shape of the Gaussian window.
    pad : int or None
        Number of zeros after the signal; None takes `padding`.

    Returns
    -------
    Spectrum
        At (n + pad)//2 + 1 frequencies from 0 to at most fs/2.

    Raises
    ------
    RecordError
        For fewer than four samples, NaN or infinity.
    ArgumentError
        For an `fs` that is not positive, a negative `pad`, or an unknown window.

    Examples
    --------
    >>> x = spectrum([1.0, 1.0, 1.0, 1.0], fs=4.0, window="rectangular", pad=4)
    >>> x.frequency
    array([0. , 0.5, 1. , 1.5, 2. ])
    >>> abs(x.value[0]).item()
    4.0
    """
    array = as_signal("x", x)
    check_rate(fs)
    zeros = padding(array.size) if pad is None else pad
    if zeros < 0:
        raise ArgumentError(f"pad is {zeros}; give the number of zeros to add, 0 or more")
    length = array.size + zeros
    tapered = array * window_samples(window, array.size, alpha=alpha)
    return Spectrum(
        frequency=np.asarray(scipy.fft.rfftfreq(length, 1 / fs), dtype=np.float64),
        value=np.asarray(scipy.fft.rfft(tapered, length)),
    )


def decibel(value: ArrayLike) -> Real:
    """Return 20 log10 |value|; an exact zero becomes -6000 dB.

    Examples
    --------
    >>> decibel([1.0, -10.0])
    array([ 0., 20.])
    """
    level = 20 * np.log10(np.maximum(np.abs(np.asarray(value)), _SMALLEST))
    return np.asarray(level, dtype=np.float64)


def transfer_function(
    u: ArrayLike, y: ArrayLike, fs: float, *, pad: int | None = None
) -> TransferFunction:
    """Return the paper's transfer function, equation (18): FFT(response) / FFT(stimulus).

    Stimulus and response, (n,), are on one clock and get the paper's window and the same zeros, as
    in `spectrum`. Nothing is averaged or removed first. The ratio is meaningful only where the
    stimulus has content, see `excited_band`. A late response is elsewhere under the window than its
    stimulus, which makes the window a disadvantage.

    Examples
    --------
    >>> u = np.sin(np.arange(200) ** 2 / 500)
    >>> g = transfer_function(u, -2 * u, fs=100.0)
    >>> bool(np.allclose(g.response, -2))
    True
    """
    below, above = (spectrum(x, fs, pad=pad) for x in as_pair(u, y))
    return TransferFunction(frequency=below.frequency, response=ratio(above.value, below.value))


def ratio(y: Complex, u: Complex) -> Complex:
    """Return y / u, NaN where u is zero."""
    out = np.full(y.shape, complex(np.nan, np.nan))
    np.divide(y, u, out=out, where=u != 0)
    return out


@kept
def well_excited(u: Complex) -> Mask:
    """Return which bins of a stimulus's spectrum, (m,), are not in a notch.

    A stimulus has almost no power between the lines of a multisine, at multiples of the clock of a
    held sequence, and at random bins of a random one. There the ratio (18) is noise and leakage.
    A bin is well excited if its power is at least a tenth of the mean power of its neighbours: a
    fortieth of all bins on either side, at least 20. The bins are consecutive.

    Examples
    --------
    >>> well_excited(np.array([1.0, 1j, 0.01, -1.0, 1.0]))
    array([ True,  True, False,  True,  True])
    """
    power = np.abs(u) ** 2
    mean = averaged(power, max(_NOTCH_REACH, power.size // 40))
    return np.asarray((power > 0) & (power >= _NOTCH_DEPTH * mean), dtype=np.bool_)


@kept
def excited_band(u: ArrayLike, fs: float) -> tuple[float, float]:
    """Return the band that a stimulus excites, found from its spectrum.

    The lowest frequency is the first at which |U| is within 12 dB of its maximum. The highest is
    the last at which the velocity spectrum |f U| is within 12 dB of its maximum. A sweep's position
    spectrum falls with its extinction, 1/f for n = 1, while its velocity spectrum stays level up to
    the end of the sweep: so the velocity shows the end, the position the start. The spectrum is
    that of the whole record without its mean, its power averaged over five bins. Bins more than
    50 dB below the maximum do not count. Nor do bins less than 12 dB above the median of the top
    twentieth, the noise of a measured stimulus, unless that is within 30 dB of the maximum.

    Parameters
    ----------
    u : array_like, shape (n,)
        Stimulus.
    fs : float
        Sampling rate, Hz.

    Returns
    -------
    low, high : float
        Hz, with 0 < low < high <= fs/2, on the bins of the record (multiples of fs/n).

    Raises
    ------
    RecordError
        If the stimulus is constant, or for fewer than four samples, NaN or infinity.
    ArgumentError
        If `fs` is not positive.

    Examples
    --------
    >>> t = np.arange(2000) / 200
    >>> low, high = excited_band(np.sin(2 * np.pi * (2 * t + 0.5 * t**2)), fs=200.0)  # 2 to 12 Hz
    >>> 1.5 < low < 2 < 12 < high < 12.7
    True
    """
    array = as_signal("u", u)
    check_rate(fs)
    centred = array - array.mean()
    if not np.any(np.abs(centred) > 1e-12 * np.max(np.abs(array))):
        raise RecordError(f"u is constant at {array[0]:g}; a stimulus must move")
    n = array.size
    length = int(scipy.fft.next_fast_len(n, real=True))
    value = transform_of(array) if length == n else scipy.fft.rfft(centred, length)
    power = value.real**2 + value.imag**2
    power[0] = 0.0
    # A running sum of the power smooths the lines of a multisine and ripples.
    running = np.concatenate(([0.0], np.cumsum(np.concatenate(([0, 0], power, [0, 0])))))
    level = np.sqrt(np.maximum(running[5:] - running[:-5], 0.0))
    level[0] = 0.0
    low, high = band_of_levels(level, fs / length)
    return low, min(high, fs / 2)  # a bin's multiple may round to beyond it


def band_of_levels(level: Real, step: float) -> tuple[float, float]:
    """Excited band in Hz of an amplitude spectrum, by the rules of `excited_band`.

    The spectrum, (m,), is from 0 Hz to half the rate, without the mean, in steps of Hz.

    Examples
    --------
    >>> band_of_levels(np.array([0.0, 1.0, 1.0, 1.0, 0.0, 0.0]), 2.0)
    (2.0, 6.0)
    """
    frequency = np.arange(level.size) * step
    top = float(level.max())
    floor = np.sqrt(DEEPEST) * top
    ceiling = float(np.median(level[-max(level.size // 20, 1) :]))
    if ceiling < TOLERATED * top:
        floor = max(floor, ceiling / _EDGE)
    velocity = np.where(level >= floor, level * frequency, 0.0)
    low = int(np.argmax(level >= _EDGE * top))
    high = int(np.flatnonzero(velocity >= _EDGE * velocity.max())[-1])
    high = max(high, low + 1)
    return float(frequency[low]), min(float(frequency[high]), float(frequency[-1]))
