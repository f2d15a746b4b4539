"""Band-limited resampling that moves no delay: one symmetric kernel, for any ratio of rates."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

__all__ = ["CROSSINGS", "PASSED", "band_limited", "share_above"]

CROSSINGS = 32
"""Zero crossings of the kernel on either side.

With Kaiser's window for 80 dB the transition is 72/(2.285 · 64 · 2π) = 0.078 of the lower rate.
"""

_BETA = 0.1102 * (80.0 - 8.7)  # Kaiser's formula for 80 dB (Oppenheim and Schafer, eq. 7.75)
_TRANSITION = 72.0 / (2.285 * 2 * CROSSINGS * 2 * np.pi)
PASSED = 0.42
"""Part of the lower rate below which the kernel leaves a signal as it is."""

_FINENESS = 512  # entries of the table for one crossing; linear between them, error 2e-6
_CHUNK = 2**21  # products at once


@cache
def _kernel() -> NDArray[np.float64]:
    """Sinc in Kaiser's window, from the middle outwards."""
    x = np.arange(CROSSINGS * _FINENESS + 2) / _FINENESS
    window = np.i0(_BETA * np.sqrt(np.clip(1.0 - (x / CROSSINGS) ** 2, 0.0, None))) / np.i0(_BETA)
    table = np.sinc(x) * np.where(x <= CROSSINGS, window, 0.0)
    table.setflags(write=False)
    return table


def band_limited(
    values: NDArray[np.float64], place: NDArray[np.float64], *, ratio: float
) -> NDArray[np.float64]:
    """Values of a uniformly sampled signal at any places, without aliasing and without delay.

    Where the new rate is lower, what lies above its half is taken out first, by the same kernel:
    −80 dB from half the new rate on, unchanged (10⁻⁴) below 0.42 of it. Beyond its ends the
    signal is continued by its own reflection in its last sample.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Samples, n >= 2.
    place : ndarray, shape (m,)
        Where values are wanted, counted in samples of `values` from its first.
    ratio : float
        New rate over old.

    Returns
    -------
    ndarray, shape (m,)

    Notes
    -----
    A. V. Oppenheim, R. W. Schafer, *Discrete-Time Signal Processing*, 3rd ed., sections 4.6 and
    7.5 (Kaiser's window).

    Examples
    --------
    >>> t = np.arange(200.0)
    >>> wanted = np.arange(50.0, 150.0, 2.5)
    >>> found = band_limited(np.sin(0.3 * t), wanted, ratio=1 / 2.5)
    >>> bool(np.abs(found - np.sin(0.3 * wanted)).max() < 1e-3)
    True
    """
    lower = ratio < 1.0
    # The middle of the transition lies so far below half the new rate that its end is there.
    cutoff = ratio * (1.0 - _TRANSITION) if lower else 1.0
    half = int(np.ceil(CROSSINGS / cutoff))
    padded = _reflected(values, half)
    base = np.floor(place).astype(np.int64)
    taps = np.arange(-half + 1, half + 1)
    table = _kernel()
    out = np.empty(place.size)
    rows = max(1, _CHUNK // taps.size)
    for first in range(0, place.size, rows):
        part = slice(first, first + rows)
        away = np.abs((place[part] - base[part])[:, None] - taps[None, :]) * (cutoff * _FINENESS)
        entry = np.minimum(away.astype(np.int64), table.size - 2)
        weight = table[entry] + (away - entry) * (table[entry + 1] - table[entry])
        weight[away >= CROSSINGS * _FINENESS] = 0.0
        weight /= weight.sum(axis=1, keepdims=True)  # a constant stays one, to the last digit
        index = base[part][:, None] + taps[None, :] + half
        out[part] = np.einsum("ij,ij->i", weight, padded[np.clip(index, 0, padded.size - 1)])
    return out


def _reflected(values: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """The samples with `count` more on either side, reflected in the end points."""
    return np.pad(values, count, mode="reflect", reflect_type="odd")


def share_above(values: NDArray[np.float64], *, fs: float, limit: float) -> float:
    """Share of a signal's power (without its mean) that lies above a frequency.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Samples.
    fs, limit : float
        Rate and frequency in Hz.

    Examples
    --------
    >>> t = np.arange(1000) / 100.0
    >>> round(share_above(np.sin(6.28 * t) + 0.1 * np.sin(6.28 * 20 * t), fs=100.0, limit=10.0), 3)
    0.01
    """
    window = np.hanning(values.size + 2)[1:-1]
    largest = float(np.abs(values).max())
    values = values / largest if largest > 0.0 else values  # squares of any number must be one
    power = np.abs(np.fft.rfft((values - values.mean()) * window)) ** 2
    total = float(power.sum())
    above = np.fft.rfftfreq(values.size, 1.0 / fs) > limit
    return float(power[above].sum()) / total if total > 0.0 else 0.0
