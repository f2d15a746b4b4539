"""Harmonics that follow a sweep, which no linear system can make.

A nonlinear system responds to a sinusoid of phase φ(t) at 2φ, 3φ, …: each order has a curve of its
own in time and frequency (A. Farina, AES 108th Convention, 2000). The residual of a linear fit is
regressed on cos kφ and sin kφ with slowly changing amplitudes, after an autoregression has whitened
both. An F test decides whether an order exists. Even orders come from asymmetry, odd ones from
symmetric causes: friction, backlash, a hard or soft spring, limits. The terms of order 1 absorb any
linear misfit in the residual, so a wrong linear structure makes no harmonic.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy

from hmpim.identify.arrays import Real
from hmpim.identify.nonlinear.harmonic_regression import (
    HIGHEST,
    HarmonicFit,
    columns_of,
    fit_harmonics,
    view_of,
)
from hmpim.identify.nonlinear.sweep_phase import SweepPhase
from hmpim.identify.result import HarmonicCurve

__all__ = ["Harmonic", "Harmonics", "any_harmonics", "sweep_harmonics"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Harmonic:
    """One order."""

    curve: HarmonicCurve  # along the sweep, at places that the order reaches
    rms: float  # over the sweep, without the noise, in the residual's unit
    probability: float  # chance that noise alone produces as much or more


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Harmonics:
    """The parts of a linear fit's residual over the sweep."""

    orders: tuple[Harmonic, ...]  # 2 to 5, if below the Nyquist frequency for part of the sweep
    fundamental_rms: float  # of order 1: linear misfit, and a nonlinearity that looks linear
    noise_rms: float  # of the rest
    regression: HarmonicFit  # the regression that gave them

    def rms(self, parity: int) -> float:
        """R.m.s. of all even (0) or odd (1) orders together."""
        return float(np.sqrt(sum(h.rms**2 for h in self.orders if h.curve.order % 2 == parity)))

    def probability(self, parity: int) -> float:
        """Chance that noise makes the even (0) or odd (1) orders, corrected for their number."""
        chances = [h.probability for h in self.orders if h.curve.order % 2 == parity]
        return min(1.0, len(chances) * min(chances, default=1.0))


def sweep_harmonics(
    residual: Real,
    sweep: SweepPhase,
    fs: float,
    *,
    delay: float = 0.0,
    others: Sequence[SweepPhase] = (),
) -> Harmonics | None:
    """Measure the harmonics of a sweep in the residual of a linear fit; None if it is too short.

    The residual, (n,), is output less prediction, 0 where a sample does not count; `fs` is in Hz.
    The harmonics arrive later than the sweep by the system's delay, in s. What follows the sweeps
    of other inputs is no harmonic of this one.
    """
    view = view_of(residual, sweep, fs, delay)
    if view is None:
        return None
    return _tested(fit_harmonics(residual, view, others, delay * fs), fs)


def any_harmonics(residuals: Real, sweep: SweepPhase, fs: float, *, delay: float) -> Real:
    """Chances that noise alone makes the harmonics of white residuals, (k, n): a quick test.

    It takes a tenth of the work of `sweep_harmonics`, and holds only for white residuals. The delay
    in s is rounded to a sample, which turns the harmonics of a stretch but keeps their size.
    """
    chances = np.ones(residuals.shape[0])
    view = view_of(np.ones(residuals.shape[1]), sweep, fs, np.rint(delay * fs) / fs)
    if view is None:
        return chances
    e = residuals[:, view.index]
    counts = e != 0.0
    number = np.maximum(counts.sum(axis=1), 1)
    e = (e - (e.sum(axis=1) / number)[:, None]) * counts
    power = np.vecdot(e, e) / number
    orders = len(view.orders)
    columns = columns_of(view)[2 : 2 + 2 * orders].reshape(orders, 2, -1)
    present = np.hypot(columns[:, 0], columns[:, 1])
    statistic, places = np.zeros((2, residuals.shape[0], orders))
    edges = [*np.searchsorted(view.along, np.arange(view.places)).tolist(), view.index.size]
    for here in (slice(*pair) for pair in pairwise(edges)):
        products = np.tensordot(e[:, here], columns[..., here], axes=(1, 2))
        count = counts[:, here] @ present[:, here].T
        statistic += 2.0 * np.sum(products**2, axis=-1) / np.maximum(count, 1.0)
        places += count > 0.5
    moves = power > 0.0
    statistic = statistic[moves] / power[moves, None]
    least = scipy.special.chdtrc(2 * np.maximum(places[moves], 1), statistic).min(axis=1)
    chances[moves] = np.minimum(1.0, orders * least)
    return chances


def _tested(fit: HarmonicFit, fs: float) -> Harmonics:
    """Test each order, and compute its amplitude along the sweep."""
    view, count = fit.view, fit.columns.shape[0]
    frequency = np.interp(np.arange(view.places + 1), view.along, view.rate) * fs
    found = []
    for i, k in enumerate(fit.orders):
        group = fit.group(2 * i, 2 * i + 2)
        block, weights = fit.covariance[np.ix_(group, group)], fit.weights[group]
        statistic = float(weights @ np.linalg.pinv(block, hermitian=True) @ weights)
        part = fit.part(i)
        power = max(float(part @ part) - fit.noise_power(i), 0.0) / part.size
        at = np.arange(view.places + 1) * count + 2 * i
        reached = fit.used[at] & fit.used[at + 1] & (k * frequency < 0.5 * HIGHEST * fs)
        spread = 0.5 * (fit.covariance[at, at] + fit.covariance[at + 1, at + 1])
        chance = scipy.special.fdtrc(group.size, fit.freedom, statistic / group.size)
        curve = HarmonicCurve(
            order=k,
            frequency=tuple(frequency[reached].tolist()),
            amplitude=tuple(np.hypot(fit.weights[at], fit.weights[at + 1])[reached].tolist()),
            std=tuple(np.sqrt(spread[reached]).tolist()),
        )
        rms = float(np.sqrt(power))
        found.append(Harmonic(curve=curve, rms=rms, probability=float(chance)))
    degrees = max(fit.rest.size - int(np.count_nonzero(fit.used)), 1)
    return Harmonics(
        orders=tuple(found[1:]),
        fundamental_rms=found[0].rms,
        noise_rms=float(np.sqrt(fit.rest @ fit.rest / degrees)),
        regression=fit,
    )
