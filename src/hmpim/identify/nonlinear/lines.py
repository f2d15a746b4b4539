"""Distortion at the lines that a periodic multisine does not excite.

A linear system responds to a sum of sines at the excited lines only. Output at the lines between
them is noise, which differs from period to period, or distortion, which repeats: at even lines from
asymmetric nonlinearities, at odd ones from symmetric ones (J. Schoukens, R. Pintelon, Y. Rolain and
T. Dobrowiecki, Automatica 41, 2005).
"""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import scipy

from hmpim.identify.arrays import Real
from hmpim.identify.noise.whiteness import autocovariance
from hmpim.identify.worth import MATERIAL, PART

__all__ = ["LineLevel", "detection_lines", "find_period"]

Parity = Literal["even", "odd"]

_FEWEST = 4
"""Fewest lines that a level is averaged over."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LineLevel:
    """Distortion at even lines (asymmetric nonlinearities) or at odd lines (symmetric ones)."""

    parity: Parity
    lines: int  # their number
    rms: float  # r.m.s. amplitude of a line without noise, in the output's unit
    share: float  # the same, over the r.m.s. amplitude of the output's excited lines
    probability: float  # chance that noise alone produces as much or more


def find_period(u: Real) -> int | None:
    """Samples after which an input, (n,), repeats exactly; None without two periods."""
    x = u - u.mean()
    n = x.size
    power = np.concatenate([[0.0], np.cumsum(x**2)])
    if power[-1] == 0:
        return None
    product = n * autocovariance(x, n // 2)
    lag = np.arange(n // 2 + 1)
    both = power[n - lag] + (power[n] - power[lag])
    different = (both - 2 * product) / np.maximum(both, np.finfo(float).tiny)
    moved = np.flatnonzero(different > PART)
    good = np.flatnonzero(different < MATERIAL**2)
    good = good[good > moved[0]] if moved.size else moved
    if good.size == 0:
        return None
    run = good[: 1 + int(np.argmax(np.append(np.diff(good), 2) > 1))]
    return int(run[np.argmin(different[run])])


def detection_lines(u: Real, y: Real, *, period: int) -> tuple[LineLevel, ...]:
    """Measure even and odd distortion at the unexcited lines of the excited band.

    Input and output, (n,), are in the steady state over two periods or more; the last whole ones
    count. The period is in samples.
    """
    periods = u.size // period
    start = u.size - periods * period
    U = scipy.fft.rfft(u[start:].reshape(periods, -1), axis=1) * 2.0 / period
    Y = scipy.fft.rfft(y[start:].reshape(periods, -1), axis=1) * 2.0 / period
    mean_u, mean_y = np.abs(U.mean(axis=0)), Y.mean(axis=0)
    scatter = np.sum(np.abs(Y - mean_y) ** 2, axis=0) / (periods - 1) / periods
    mean_u[0] = 0.0
    excited = np.flatnonzero(mean_u > MATERIAL * mean_u.max())
    line = np.arange(mean_u.size)
    within = (line >= max(excited[0], 1)) & (line <= min(excited[-1], mean_u.size - 2))
    silent = within & (mean_u < MATERIAL**2 * mean_u.max())
    signal = float(np.sqrt(np.mean(np.abs(mean_y[excited]) ** 2)))
    levels = []
    for remainder, parity in enumerate(get_args(Parity)):
        chosen = silent & (line % 2 == remainder)
        count = int(np.count_nonzero(chosen))
        if count < _FEWEST:
            continue
        noise = float(np.mean(scatter[chosen]))  # the part that does not repeat
        power = float(np.mean(np.abs(mean_y[chosen]) ** 2))
        chance = 1.0 if power == 0 else 0.0
        if noise > 0:
            chance = float(scipy.stats.f.sf(power / noise, 2 * count, 2 * count * (periods - 1)))
        rms = float(np.sqrt(max(power - noise, 0.0)))
        share = rms / signal if signal > 0 else 0.0
        level = LineLevel(parity=parity, lines=count, rms=rms, share=share, probability=chance)
        levels.append(level)
    return tuple(levels)
