"""What a stimulus holds: its spectrum, its spectrogram, how near it comes to its limits."""

from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.signal import ShortTimeFFT

from hmpim.identify.spectrum import decibel, spectrum
from hmpim.plots.spectra import spectra
from hmpim.plots.style import Colour, draw_legend, draw_line, finish_axes, new_figure
from hmpim.stimulus.limits import QUANTITIES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hmpim.stimulus import Stimulus

__all__ = ["share_beyond", "stimulus_spectrogram", "stimulus_spectrum", "time_near_limits"]

ALPHA = 1.5  # of the Gaussian window, as in the paper's figures
DEPTH = 60.0  # dB shown of a spectrogram
_OVERSAMPLING = 4  # so that peaks between samples are seen
_COLUMNS = 300  # of a spectrogram; no page shows more
_COLOURS: tuple[Colour, ...] = ("input", "output", "other", "limit")
_DASHES: tuple[Literal["-", "--", "-.", ":"], ...] = ("-", "--", "-.", ":")


def stimulus_spectrum(stimulus: "Stimulus", *, alpha: float = ALPHA) -> "Figure":
    """Draw the spectrum of a stimulus with and without the window (Figs 12, 13, 18).

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
    >>> len(stimulus_spectrum(stimulus).axes[0].lines)
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


def stimulus_spectrogram(stimulus: "Stimulus") -> "Figure":
    """Draw the spectrum of a stimulus as it changes over time.

    Parameters
    ----------
    stimulus : hmpim.stimulus.Stimulus
        Its position; levels are in dB below the highest.

    Examples
    --------
    >>> from hmpim.stimulus import Limits, design
    >>> stimulus = design(band=(0.1, 10), duration=5, fs=100, limits=Limits(position=1))
    >>> stimulus_spectrogram(stimulus).axes[0].get_ylabel()
    'Frequency (Hz)'
    """
    figure, (axes,) = new_figure(height=3.0)
    n, fs = stimulus.samples, stimulus.fs
    band = stimulus.band or (0.0, 0.5 * fs)
    # as long as a sweep stays within its own resolution
    seconds = 2.0 * np.sqrt(stimulus.sweep_duration / (band[1] - band[0] or 1.0))
    length = int(np.clip(seconds * fs, 16, max(n // 4, 16)))
    window = np.hanning(length + 2)[1:-1]
    transform = ShortTimeFFT(
        window, hop=max(n // _COLUMNS, 1), fs=fs, mfft=max(4 * length, 256), fft_mode="onesided"
    )
    lines = np.abs(transform.stft(stimulus.position))
    times = transform.t(n)
    level = 20.0 * np.log10(np.maximum(lines / (lines.max() or 1.0), 1e-9))
    seen = (times >= 0.0) & (times <= stimulus.duration)
    highest = min(1.5 * band[1], 0.5 * fs)
    low = transform.f <= highest
    mesh = axes.pcolormesh(
        times[seen],
        transform.f[low],
        level[np.ix_(low, seen)],
        vmin=-DEPTH,
        vmax=0.0,
        cmap="viridis",
        shading="nearest",
        rasterized=True,
    )
    bar = figure.colorbar(mesh, ax=axes, pad=0.01)
    bar.set_label("Level re highest (dB)", fontsize=9)
    bar.ax.tick_params(labelsize=8)
    finish_axes(axes, x="Time (s)", y="Frequency (Hz)")
    axes.grid(visible=False)
    return figure


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


def time_near_limits(stimulus: "Stimulus") -> "Figure":
    """Draw how long a stimulus is near each of its limits.

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
    >>> [line.get_label() for line in figure.axes[0].lines]
    ['position', 'velocity']
    """
    figure, (axes,) = new_figure(height=2.6)
    steps = np.arange(_OVERSAMPLING * stimulus.samples)
    motion = stimulus.motion(steps / (_OVERSAMPLING * stimulus.fs))
    share = np.linspace(0.0, 1.0, 501)
    for name, colour, dashes in zip(QUANTITIES, _COLOURS, _DASHES, strict=True):
        values = getattr(motion, name)
        limit = np.inf if stimulus.limits is None else getattr(stimulus.limits, name)
        if values is None or not np.isfinite(limit):
            continue
        beyond = 100.0 * share_beyond(values / limit, share)
        seen = beyond > 0.0
        draw_line(axes, 100.0 * share[seen], beyond[seen], colour=colour, label=name, dashes=dashes)
    axes.set_xlim(0.0, 100.0)
    axes.set_yscale("log")
    axes.set_ylim(0.05, 100.0)
    finish_axes(axes, x="Share of the limit (%)", y="Time at or beyond it (%)")
    axes.set_yticks([0.1, 1.0, 10.0, 100.0], ["0.1", "1", "10", "100"])
    if axes.lines:
        draw_legend(axes, columns=4)
    return figure
