"""The phase of a swept sine, found from its samples: the reference for its harmonics.

Zero crossings give the phase at every half turn, whatever the amplitude does in between, and a
spline gives it between them. They are found at four times the sampling rate, so that a sweep may
reach four fifths of the Nyquist frequency.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.kept import kept
from hmpim.identify.worth import DEEPEST, FEW, MATERIAL, MOST, PART

__all__ = ["SweepPhase", "sweep_phase"]

_FEWEST_CROSSINGS = 8
"""Four turns at least."""

_FINER = 4
"""Factor by which the rate is raised to find the crossings."""

_REST = 1e-6
"""Amplitude, over the greatest, below which a signal is at rest: ringing of the resampling.

The distance of crossings then exceeds the rounding of times in a record of 10^8 samples.
"""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SweepPhase:
    """Instantaneous phase of a sweep, all of shape (n,)."""

    phase: Real  # rad; the input is about its centre plus a multiple of cos(phase)
    frequency: Real  # Hz
    inside: Mask  # samples during the sweep itself


@kept
def sweep_phase(u: Real, fs: float) -> SweepPhase | None:
    """Find the phase of an input, (n,), at a rate in Hz, if it is a single sinusoid.

    Frequency and amplitude may vary. None for several sines, noise, steps, a binary sequence.
    """
    if np.ptp(u) == 0:
        return None
    x = u - _centre(u)
    crossings, peaks, first = _crossings(x)
    if crossings.size < _FEWEST_CROSSINGS:
        return None
    sample = np.arange(x.size, dtype=np.float64)
    phase = _through(crossings, first, sample)
    envelope = np.interp(sample, 0.5 * (crossings[1:] + crossings[:-1]), peaks)
    inside = envelope > np.sqrt(DEEPEST) * envelope.max()
    inside &= (sample >= crossings[0]) & (sample <= crossings[-1])
    level = x / np.maximum(envelope, np.sqrt(DEEPEST) * envelope.max())
    error = np.where(inside, (level - np.cos(phase)) ** 2, 0.0)
    inside &= _is_followed(error, level, crossings)
    power = float(level[inside] @ level[inside])
    # A sinusoid does not explain 1.4 % of a triangle's power, and 19 % of a square wave's.
    if np.mean(inside) < MOST or float(np.sum(error[inside])) > MATERIAL * power:
        return None
    return SweepPhase(
        phase=phase,
        frequency=np.gradient(phase) * fs / (2 * np.pi),
        inside=inside,
    )


def _centre(x: Real) -> float:
    """Median of the midpoints between neighbouring extremes."""
    turns = np.flatnonzero(np.diff(np.sign(np.diff(x))) != 0) + 1
    if turns.size < 4:
        return float(np.mean(x))
    return float(np.median(0.5 * (x[turns[1:]] + x[turns[:-1]])))


def _is_followed(error: Real, level: Real, crossings: Real) -> Mask:
    """Whether little power is unexplained in the three half turns around each sample."""
    starts = np.unique(np.clip(np.ceil(crossings).astype(np.intp), 0, error.size - 1))
    sums = np.add.reduceat(np.stack([error, level**2]), starts, axis=1)
    wide = sums.copy()
    wide[:, 1:] += sums[:, :-1]
    wide[:, :-1] += sums[:, 1:]
    little = wide[0] < FEW * wide[1]  # not where the input stands still
    which = np.searchsorted(starts, np.arange(error.size), side="right") - 1
    return np.asarray(little[np.maximum(which, 0)])


def _finer(x: Real) -> Real:
    """Samples at a multiple of the rate, shape ((n - 1) * finer + 1,), the ends reflected."""
    margin = min(32, x.size - 1)
    longer = np.pad(x, margin, mode="reflect", reflect_type="odd")
    extended = scipy.signal.resample_poly(longer, _FINER, 1, window=("kaiser", 8.0))
    start = margin * _FINER
    return np.asarray(extended[start : start + (x.size - 1) * _FINER + 1], dtype=np.float64)


def _crossings(x: Real) -> tuple[Real, Real, float]:
    """Times of the zero crossings in samples, peaks between them, phase at the first one."""
    fine = _finer(x)
    sign = _signs(fine)
    at = np.flatnonzero(np.diff(sign))
    while at.size > _FEWEST_CROSSINGS:
        peaks = np.maximum.reduceat(np.abs(fine), at)[:-1]
        ratio = peaks / np.maximum(_least_beside(peaks), np.finfo(float).tiny)
        flukes = np.flatnonzero((ratio < PART) & (ratio < _least_beside(ratio)))
        if flukes.size == 0:
            break
        at = np.delete(at, np.concatenate([flukes, flukes + 1]))  # never two next to each other
    if at.size < _FEWEST_CROSSINGS:
        return np.zeros(0), np.zeros(0), 0.0
    times = (at + fine[at] / (fine[at] - fine[at + 1])) / _FINER
    peaks = np.maximum.reduceat(np.abs(fine), at)[:-1]
    first = -0.5 * np.pi if sign[at[0]] < 0 else 0.5 * np.pi
    return np.asarray(times), np.asarray(peaks), first


def _least_beside(values: Real) -> Real:
    """The lesser neighbour of each value."""
    wide = np.pad(values, 1, constant_values=np.inf)
    return np.asarray(np.minimum(wide[:-2], wide[2:]))


def _signs(fine: Real) -> Real:
    """Sign of each sample; at rest, and where zero is touched but not crossed, the sign before."""
    # So two crossings never coincide: a moving sample lies between them.
    moving = np.abs(fine) > _REST * np.abs(fine).max()
    place = np.maximum.accumulate(np.where(moving, np.arange(fine.size), 0))
    place[: np.argmax(moving)] = np.argmax(moving)
    return np.asarray(np.sign(fine[place]), dtype=np.float64)


def _through(crossings: Real, first: float, sample: Real) -> Real:
    """Phase by a spline through the half turns, continued at the last rate beyond them."""
    turns = first + np.pi * np.arange(crossings.size)
    apart = np.diff(crossings, prepend=-np.inf) > 0.0  # rounding may put two at one instant
    curve = scipy.interpolate.CubicSpline(crossings[apart], turns[apart])
    inside = np.clip(sample, crossings[0], crossings[-1])
    beyond = sample - inside
    return np.asarray(curve(inside) + beyond * curve(inside, 1))
