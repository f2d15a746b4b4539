"""Averaged frequency responses H1, H2 and Hv, over repeats or over segments of a record.

J. S. Bendat and A. G. Piersol, Random Data, 4th ed., Wiley 2010, chapters 6, 9 and 11, unless
said otherwise. Bias and delay are taken out before anything is cut into segments: a delay
moves the response out of its segment, which costs coherence and biases every estimate low.
"""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import scipy
from numpy.typing import ArrayLike

from hmpim.errors import ArgumentError, RecordError
from hmpim.identify.arrays import Complex, Real
from hmpim.identify.result import FrequencyResponse
from hmpim.identify.section_iv.windows import WindowName, window_samples
from hmpim.identify.signals import check_band, check_rate

__all__ = [
    "Averaged",
    "Estimator",
    "averaged_response",
    "coherence_significance",
    "effective_averages",
]

Estimator = Literal["h1", "h2", "hv"]
"""Where the noise is taken to be: at the output, at the input, or at both alike."""

_FEWEST_SAMPLES = 16


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Averaged:
    """An averaged frequency response, and what its coherence is worth.

    Parameters
    ----------
    response : FrequencyResponse
        Its `coherence` γ² is as averaged, biased upwards; None where there is one segment.
    estimator : {'h1', 'h2', 'hv'}
        Which estimate.
    segments : int
        Number of segments that were averaged.
    averages : float
        Independent averages they amount to; fewer than the segments where these overlap.
    coherence_unbiased : ndarray, shape (m,), or None
        γ² less its bias (1 - γ²)²/averages, not below 0 (section 9.2.3).
    coherence_std : ndarray, shape (m,), or None
        Standard deviation of γ²: √2 (1 - γ²) |γ| / √averages (equation 9.82).
    significance : float or None
        γ² that an unrelated output stays below 95 times in 100.
    """

    response: FrequencyResponse
    estimator: Estimator
    segments: int
    averages: float
    coherence_unbiased: Real | None
    coherence_std: Real | None
    significance: float | None


def averaged_response(
    u: ArrayLike,
    y: ArrayLike,
    fs: float,
    *,
    band: tuple[float, float],
    delay: float = 0.0,
    estimator: Estimator = "h1",
    segment: int | None = None,
    window: WindowName = "hann",
    overlap: float = 0.5,
) -> Averaged:
    """Return H1, H2 or Hv, averaged over repeats, over segments of each, or over both.

    With S_uu, S_uy = mean U* Y and S_yy: H1 = S_uy/S_uu, H2 = S_yy/S_yu, and
    Hv = √(H1 H2) with the phase of both (G. T. Rocklin, J. Crowley and H. Vold, "A comparison
    of H1, H2 and Hv frequency response functions", IMAC 1985).

    Parameters
    ----------
    u, y : array_like, shape (n,) or (repeats, n)
        Input and output on one clock, each repeat from the same start.
    fs : float
        Sampling rate, Hz.
    band : tuple of float
        Excited band, Hz.
    delay : float
        Pure delay in s, not negative.
    estimator : {'h1', 'h2', 'hv'}
        'h1' for noise at the output, 'h2' at the input, 'hv' at both in the same proportion.
    segment : int or None
        Samples of a segment; None for each repeat as a whole, without a window, which is
        right for a stimulus that begins and ends at rest.
    window : str
        Taper of each segment.
    overlap : float
        Share of a segment that the next one has in common with it, 0 to 0.9.

    Returns
    -------
    Averaged
        At the bins of a segment inside the band.

    Raises
    ------
    RecordError
        For unequal shapes, fewer than 16 samples, NaN or infinity, or a constant `u`.
    ArgumentError
        For a rate, band, delay, estimator, segment or overlap that cannot be.

    Notes
    -----
    `std` of H1 is that of least squares given the input, √(S_yy (1 - γ²) / S_uu / (d - 1))
    with d averages; of H2 and Hv it is |H| √((1 - γ²)/γ² / (d - 1)), which is the same for
    large γ² (equation 9.91). With one segment it is NaN: nothing tells noise from response.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> u = rng.standard_normal(8000)
    >>> y = 2 * u + 0.5 + rng.standard_normal(8000)
    >>> found = averaged_response(u, y, 100.0, band=(1.0, 40.0), segment=200)
    >>> bool(np.all(np.abs(found.response.response - 2) < 5 * found.response.std))
    True
    >>> round(float(found.coherence_unbiased.mean()), 1)
    0.8
    """
    first, second = _repeats(u, y)
    check_rate(fs)
    check_band(band, fs)
    if estimator not in get_args(Estimator):
        raise ArgumentError(f"estimator is {estimator!r}; give h1, h2 or hv")
    if not (np.isfinite(delay) and delay >= 0):
        raise ArgumentError(f"delay is {delay} s; give a finite number, 0 or more")
    if not 0 <= overlap <= 0.9:
        raise ArgumentError(f"overlap is {overlap}; give a share from 0 to 0.9")
    lag = min(int(np.floor(delay * fs + 1e-9)), first.shape[1] // 2)
    first, second = first[:, : first.shape[1] - lag], second[:, lag:]
    first = first - first.mean(axis=1, keepdims=True)
    second = second - second.mean(axis=1, keepdims=True)
    length = first.shape[1] if segment is None else segment
    if not 4 <= length <= first.shape[1]:
        raise ArgumentError(
            f"segment is {length} samples; give 4 to {first.shape[1]}, the record without its delay"
        )
    taper = np.ones(length) if segment is None else window_samples(window, length)
    step = length if segment is None else max(round(length * (1 - overlap)), 1)
    frequency = np.asarray(np.arange((length - 1) // 2 + 1) * (fs / length))
    inside = (frequency > 0) & (frequency >= band[0] - 1e-9) & (frequency <= band[1] + 1e-9)
    if not inside.any():
        raise ArgumentError(
            f"band is ({band[0]:g}, {band[1]:g}) Hz, and a segment of {length} samples has no "
            f"bin in it, only multiples of {fs / length:g} Hz; give longer segments"
        )
    frequency = frequency[inside]
    keep = np.flatnonzero(inside)
    spectra_u, spectra_y = (_spectra(x, taper, step)[:, keep] for x in (first, second))
    spectra_y = spectra_y * np.exp(2j * np.pi * frequency * (delay - lag / fs))
    segments = spectra_u.shape[0]
    averages = first.shape[0] * effective_averages(taper, step, segments // first.shape[0])
    tiny = np.finfo(float).tiny
    s_uu = np.maximum(np.mean(np.abs(spectra_u) ** 2, axis=0), tiny)
    s_yy = np.maximum(np.mean(np.abs(spectra_y) ** 2, axis=0), tiny)
    s_uy = np.mean(np.conj(spectra_u) * spectra_y, axis=0)
    gamma2 = np.clip(np.abs(s_uy) ** 2 / (s_uu * s_yy), tiny, 1.0)
    response = s_uy / s_uu
    if estimator == "h2":
        response = response / gamma2
    elif estimator == "hv":
        response = response / np.sqrt(gamma2)
    several = segments > 1 and averages > 1
    relative = np.sqrt((1 - gamma2) / gamma2 / (averages - 1)) if several else np.nan
    return Averaged(
        response=FrequencyResponse(
            frequency=frequency,
            response=response * np.exp(-2j * np.pi * frequency * delay),
            std=np.abs(response) * relative,
            coherence=gamma2 if several else None,
        ),
        estimator=estimator,
        segments=segments,
        averages=averages,
        coherence_unbiased=np.maximum(gamma2 - (1 - gamma2) ** 2 / averages, 0.0)
        if several
        else None,
        coherence_std=np.sqrt(2 * gamma2 / averages) * (1 - gamma2) if several else None,
        significance=coherence_significance(averages) if several else None,
    )


def coherence_significance(averages: float, *, level: float = 0.05) -> float:
    """Return the coherence that unrelated noise exceeds with a chance of `level`.

    γ² = 1 - level^(1/(d - 1)) for d independent averages (G. C. Carter, "Coherence and time
    delay estimation", Proc. IEEE 75, 1987).

    Parameters
    ----------
    averages : float
        d, above 1.
    level : float
        Between 0 and 1.

    Raises
    ------
    ArgumentError
        If there is one average only, of which the coherence is always 1, or for a level that
        is no probability.

    Examples
    --------
    >>> round(coherence_significance(20), 3)
    0.146
    """
    if not averages > 1:
        raise ArgumentError(
            f"averages is {averages}; the coherence of one segment is 1 whatever the data, so "
            "give more than one"
        )
    if not 0 < level < 1:
        raise ArgumentError(f"level is {level}; give a probability between 0 and 1, such as 0.05")
    return float(1.0 - level ** (1.0 / (averages - 1.0)))


def effective_averages(window: ArrayLike, step: int, segments: int) -> float:
    """Return how many independent averages overlapping segments amount to.

    K / (1 + 2 Σ (1 - k/K) ρ(k)²), ρ the window's correlation with itself k steps on
    (P. D. Welch, IEEE Trans. Audio Electroacoust. 15, 1967).

    Parameters
    ----------
    window : array_like, shape (n,)
        Taper.
    step : int
        Samples from one segment to the next.
    segments : int
        K.

    Examples
    --------
    >>> effective_averages([1.0, 1.0], 2, 7)
    7.0
    >>> round(effective_averages(np.hanning(100), 50, 39) / 39, 2)
    0.95
    """
    taper = np.asarray(window, dtype=np.float64)
    energy = float(taper @ taper)
    doubt = 0.0
    for k in range(1, segments):
        if k * step >= taper.size:
            break
        rho = float(taper[: taper.size - k * step] @ taper[k * step :]) / energy
        doubt += (1 - k / segments) * rho**2
    return segments / (1 + 2 * doubt)


def _repeats(u: ArrayLike, y: ArrayLike) -> tuple[Real, Real]:
    """Return both as finite (repeats, n)."""
    first, second = (np.asarray(x, dtype=np.float64) for x in (u, y))
    if first.shape != second.shape or first.ndim not in (1, 2):
        raise RecordError(
            f"u has shape {first.shape} and y {second.shape}; give both as (n,) or (repeats, n)"
        )
    first, second = np.atleast_2d(first), np.atleast_2d(second)
    if first.shape[1] < _FEWEST_SAMPLES:
        raise RecordError(
            f"the record has {first.shape[1]} samples; give at least {_FEWEST_SAMPLES}"
        )
    for name, array in (("u", first), ("y", second)):
        bad = np.argwhere(~np.isfinite(array))
        if bad.size:
            raise RecordError(
                f"{name} holds {array[tuple(bad[0])]} at sample {bad[0][1]} of repeat {bad[0][0]}; "
                "cut it out or fill it first"
            )
    still = np.flatnonzero(np.ptp(first, axis=1) == 0)
    if still.size:
        raise RecordError(
            f"u is constant at {first[still[0], 0]:g} in repeat {still[0]}; an input must move"
        )
    return first, second


def _spectra(x: Real, taper: Real, step: int) -> Complex:
    """Transforms of all segments of all repeats, shape (repeats · segments, bins)."""
    views = np.lib.stride_tricks.sliding_window_view(x, taper.size, axis=1)[:, ::step]
    spectra = scipy.fft.rfft(views * taper, axis=2)
    return np.asarray(spectra.reshape(-1, spectra.shape[2]))
