"""What a stimulus holds: its spectrum, its spectrogram, how near it comes to its limits."""

from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.identify.section_iv.spectrum import decibel, spectrum
from hmpim.plots.description import Axis, Curve, Dashes, Figure, Image, Panel
from hmpim.plots.spectra import spectra
from hmpim.plots.style import Colour
from hmpim.stimulus.limits import QUANTITIES

if TYPE_CHECKING:
    from hmpim.stimulus import Stimulus

__all__ = ["share_beyond", "stimulus_spectrogram", "stimulus_spectrum", "time_near_limits"]

ALPHA = 1.5  # of the Gaussian window, as in the paper's figures
DEPTH = 60.0  # dB shown of a spectrogram
_OVERSAMPLING = 4  # so that peaks between samples are seen
_COLUMNS = 300  # of a spectrogram; no page shows more
_COLOURS: tuple[Colour, ...] = ("input", "output", "other", "limit")
_DASHES: tuple[Dashes, ...] = ("-", "--", "-.", ":")


def stimulus_spectrum(stimulus: "Stimulus", *, alpha: float = ALPHA) -> Figure:
    """Describe the spectrum of a stimulus with and without the window (Figs 12, 13, 18).

    Parameters
    ----------
    stimulus : hmpim.stimulus.Stimulus
        Its position's DFT, in dB re one unit, zeros padded after it.
    alpha : float
        Shape of the Gaussian window (15).

    Examples
    --------
    >>> from hmpim.stimulus import Limits, design
    >>> stimulus = design(band=(0.1, 10), duration=5, fs=100, limits=Limits(position=1))
    >>> len(stimulus_spectrum(stimulus).panels[0].of(Curve))
    2
    """
    plain = spectrum(stimulus.position, stimulus.fs, window="rectangular")
    windowed = spectrum(stimulus.position, stimulus.fs, window="gaussian", alpha=alpha)
    return spectra(
        plain.frequency,
        input_plain=decibel(plain.value),
        input_windowed=decibel(windowed.value),
        band=stimulus.band,
        input_name=stimulus.axis or "position",
    )


def stimulus_spectrogram(stimulus: "Stimulus") -> Figure:
    """Describe the spectrum of a stimulus as it changes over time.

    Parameters
    ----------
    stimulus : hmpim.stimulus.Stimulus
        Its position; levels are in dB below the highest.

    Examples
    --------
    >>> from hmpim.stimulus import Limits, design
    >>> stimulus = design(band=(0.1, 10), duration=5, fs=100, limits=Limits(position=1))
    >>> stimulus_spectrogram(stimulus).panels[0].y.label
    'Frequency (Hz)'
    """
    n, fs = stimulus.samples, stimulus.fs
    band = stimulus.band or (0.0, 0.5 * fs)
    # as long as a sweep stays within its own resolution
    seconds = 2.0 * np.sqrt(stimulus.sweep_duration / (band[1] - band[0] or 1.0))
    length = int(np.clip(seconds * fs, 16, max(n // 4, 16)))
    window = np.hanning(length + 2)[1:-1]
    transform = scipy.signal.ShortTimeFFT(
        window, hop=max(n // _COLUMNS, 1), fs=fs, mfft=max(4 * length, 256), fft_mode="onesided"
    )
    lines = np.abs(transform.stft(stimulus.position))
    times = transform.t(n)
    level = 20.0 * np.log10(np.maximum(lines / (lines.max() or 1.0), 1e-9))
    seen = (times >= 0.0) & (times <= stimulus.duration)
    highest = min(1.5 * band[1], 0.5 * fs)
    low = transform.f <= highest
    shown = times[seen]
    half = 0.5 * float(np.median(np.diff(shown))) if shown.size > 1 else 0.5
    spacing = 0.5 * float(transform.f[1] - transform.f[0])
    image = Image(
        values=level[np.ix_(low, seen)],
        x=(float(shown[0]) - half, float(shown[-1]) + half),
        y=(float(transform.f[0]) - spacing, float(transform.f[low][-1]) + spacing),
        low=-DEPTH,
        high=0.0,
        label="Level re highest (dB)",
    )
    return Figure(
        panels=(
            Panel(
                x=Axis(label="Time (s)", low=float(shown[0]), high=float(shown[-1]), grid=False),
                y=Axis(
                    label="Frequency (Hz)", low=0.0, high=float(transform.f[low][-1]), grid=False
                ),
                items=(image,),
            ),
        ),
        alt=f"Spectrogram of the stimulus: from {band[0]:g} to {band[1]:g} Hz in "
        f"{stimulus.duration:g} s.",
        heights=(3.0,),
    )


def share_beyond(values: NDArray[np.float64], levels: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share of the samples whose magnitude is at or beyond each level.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Samples, evenly spaced in time.
    levels : ndarray, shape (m,)
        Not negative.

    Returns
    -------
    ndarray, shape (m,)
        From 0 to 1.

    Examples
    --------
    >>> share_beyond(np.array([0.0, -1.0, 2.0, 3.0]), np.array([0.0, 2.0, 9.0])).tolist()
    [1.0, 0.5, 0.0]
    """
    size = np.sort(np.abs(values))
    beyond: NDArray[np.float64] = 1.0 - np.searchsorted(size, levels, side="left") / size.size
    return beyond


def time_near_limits(stimulus: "Stimulus") -> Figure:
    """Describe how long a stimulus is near each of its limits.

    For each limit, the share of the time that the motion spends beyond a share of the limit:
    at 90 % the curve tells how long the axis is within a tenth of what it may do.

    Parameters
    ----------
    stimulus : hmpim.stimulus.Stimulus
        With at least one finite limit.

    Examples
    --------
    >>> from hmpim.stimulus import Limits, design
    >>> limits = Limits(position=1, velocity=20)
    >>> figure = time_near_limits(design(band=(0.1, 10), duration=5, fs=100, limits=limits))
    >>> [curve.label for curve in figure.panels[0].items]
    ['position', 'velocity']
    """
    steps = np.arange(_OVERSAMPLING * stimulus.samples)
    motion = stimulus.motion(steps / (_OVERSAMPLING * stimulus.fs))
    share = np.linspace(0.0, 1.0, 501)
    items = []
    for name, colour, dashes in zip(QUANTITIES, _COLOURS, _DASHES, strict=True):
        values = getattr(motion, name)
        limit = np.inf if stimulus.limits is None else getattr(stimulus.limits, name)
        if values is None or not np.isfinite(limit):
            continue
        beyond = 100.0 * share_beyond(values / limit, share)
        seen = beyond > 0.0
        x, y = 100.0 * share[seen], beyond[seen]
        items.append(Curve(x=x, y=y, colour=colour, label=name, dashes=dashes))
    names = ", ".join(item.label for item in items) or "no quantity"
    return Figure(
        panels=(
            Panel(
                x=Axis(label="Share of the limit (%)", low=0.0, high=100.0),
                y=Axis(label="Time at or beyond it (%)", scale="log", low=0.05, high=100.0),
                items=tuple(items),
            ),
        ),
        alt=f"Share of the time that {names} of the stimulus is at or beyond a share of its limit.",
        heights=(2.6,),
    )
