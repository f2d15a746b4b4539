"""Harmonics of a sweep by regression: amplitudes that change slowly along it, in coloured noise.

A residual is regressed on cos kφ and sin kφ, where φ is the sweep's phase when the input was sent,
and on a mean. Each has a weight that is linear between about ten places along the sweep. An
autoregression first whitens both sides.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.noise.autoregression import yule_walker
from hmpim.identify.nonlinear.sweep_phase import SweepPhase

__all__ = ["HIGHEST", "HarmonicFit", "SweepView", "columns_of", "fit_harmonics", "view_of"]

_ORDERS = (2, 3, 4, 5)
"""Orders to test; order 1 and the mean are fitted with them."""

_PLACES = 10
"""Most stretches over which an amplitude changes linearly."""

_TURNS_PER_PLACE = 3.0
"""Fewest turns of the sweep in a stretch."""

HIGHEST = 0.9
"""Share of the Nyquist frequency up to which an order is followed, before it folds back."""

_LONGEST_AUTOREGRESSION = 20

_FEWEST = 100
"""Fewest samples of a sweep."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SweepView:
    """Samples during the sweep that count, and the sweep's phase when their input was sent."""

    index: NDArray[np.intp]  # (m,): which samples
    phase: Real  # (m,): radians
    rate: Real  # (m,): turns per sample
    along: Real  # (m,): from 0 to `places`, half by turns and half by time
    places: int  # stretches over which amplitudes change linearly
    orders: tuple[int, ...]  # those below the Nyquist frequency for part of the sweep


def _phase_at(sweep: SweepPhase, index: NDArray[np.intp], late: float) -> Real:
    return np.asarray(np.interp(index - late, np.arange(sweep.phase.size), sweep.phase))


def view_of(e: Real, sweep: SweepPhase, fs: float, delay: float) -> SweepView | None:
    """The stretch to analyse; None if it is too short, or no order lies below Nyquist."""
    late = delay * fs
    sent = np.arange(e.size) - int(np.rint(late))  # a whole sample is exact enough here
    inside = sweep.inside[np.clip(sent, 0, e.size - 1)] & (sent >= 0) & (sent < e.size)
    index = np.flatnonzero(inside & (e != 0.0))
    if index.size < _FEWEST:
        return None
    phase = _phase_at(sweep, index, late)
    rate = np.interp(index - late, np.arange(e.size), sweep.frequency) / fs
    orders = [k for k in _ORDERS if np.count_nonzero(k * rate < 0.5 * HIGHEST) > 50]
    span = float(phase[-1] - phase[0])
    places = min(_PLACES, int(abs(span) / (2 * np.pi) / _TURNS_PER_PLACE))
    if places < 2 or not orders:
        return None
    time = (index - index[0]) / (index[-1] - index[0])
    along = 0.5 * (np.clip((phase - phase[0]) / span, 0.0, 1.0) + time) * places
    return SweepView(
        index=index,
        phase=phase,
        rate=rate,
        along=np.maximum.accumulate(np.minimum(along, places - 1e-9)),
        places=places,
        orders=tuple(orders),
    )


def columns_of(view: SweepView, others: Sequence[Real] = ()) -> Real:
    """Cosine and sine of order 1 and the view's orders, the mean, then those of other phases."""
    out = np.empty((3 + 2 * len(view.orders) + 2 * len(others), view.phase.size))
    turn = np.exp(1j * view.phase)
    power = np.ones_like(turn)
    row = 0
    for k in range(1, max(view.orders) + 1):
        power = power * turn
        below = k * view.rate < 0.5 * HIGHEST
        out[row], out[row + 1] = power.real * below, power.imag * below
        row += 2
    out[row] = 1.0
    for phase in others:
        out[row + 1], out[row + 2] = np.cos(phase), np.sin(phase)
        row += 2
    return out


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HarmonicFit:
    """A regression on harmonics, kept so that traces can be compared with it."""

    view: SweepView
    columns: Real  # (c, m): cosine and sine of orders 1, 2, …, the mean, other inputs' sweeps
    whitening: Real  # coefficients 1, -a1, … of the noise's autoregression
    white: Real  # (c, m): the columns, whitened
    weights: Real  # (p c,): of each column at each place
    covariance: Real  # (p c, p c): of the weights
    used: Mask  # (p c,): weights of columns that are not zero there
    variance: float  # of the whitened noise
    freedom: int  # its degrees of freedom
    rest: Real  # (m,): what the regression does not explain

    @property
    def orders(self) -> tuple[int, ...]:
        """Order 1, then the view's."""
        return (1, *self.view.orders)

    @property
    def evidence(self) -> float:
        """Log-likelihood that orders 2 and up gain, less what noise would gain on average."""
        group = self.group(2, 2 * len(self.orders))
        inverse = np.linalg.pinv(self.covariance[np.ix_(group, group)], hermitian=True)
        gained = float(self.weights[group] @ inverse @ self.weights[group])
        return 0.5 * max(gained - group.size, 0.0)

    def group(self, first: int, last: int) -> NDArray[np.intp]:
        """Indices of the weights of columns from `first` up to, but without, `last`."""
        place = np.arange(self.used.size) % self.columns.shape[0]
        return np.flatnonzero((place >= first) & (place < last) & self.used)

    def part(self, i: int) -> Real:
        """Contribution of the i-th order, shape (m,)."""
        shaped = self.weights.reshape(-1, self.columns.shape[0])
        return _expanded(self.columns[2 * i : 2 * i + 2], shaped[:, 2 * i : 2 * i + 2], self.view)

    def noise_power(self, i: int) -> float:
        """Sum of squares that noise alone puts into the i-th order."""
        pair = self.columns[2 * i : 2 * i + 2]
        own = _gram(pair, self.view)
        place = np.arange(self.used.size) % self.columns.shape[0]
        index = np.flatnonzero((place >= 2 * i) & (place < 2 * i + 2))
        return float(np.sum(own * self.covariance[np.ix_(index, index)]))

    def gram(self, group: NDArray[np.intp]) -> Real:
        """Mean products of the weighted columns of a group."""
        return _gram(self.columns, self.view)[np.ix_(group, group)] / self.rest.size

    def weights_of(self, traces: Real) -> Real:
        """Weights that traces, shape (k, n), have by themselves, shape (k, p c)."""
        white = scipy.signal.lfilter(self.whitening, [1.0], traces[:, self.view.index], axis=1)
        moments = _moments(white, self.white, self.view)
        return np.asarray(moments @ self.covariance / self.variance)


def fit_harmonics(
    e: Real, view: SweepView, others: Sequence[SweepPhase], late: float
) -> HarmonicFit:
    """Regress `e`, shape (n,), on harmonics of the sweep in `view`, `late` in samples.

    The regression includes the frequencies of other inputs' sweeps.
    """
    columns = columns_of(view, [_phase_at(other, view.index, late) for other in others])
    e = e[view.index]
    weights, _, _ = _solved(_gram(columns, view), _moments(e[None], columns, view)[0])
    count = columns.shape[0]
    residual = e - _expanded(columns, weights.reshape(-1, count), view)
    whitening, _ = yule_walker(residual, _LONGEST_AUTOREGRESSION)
    white_e = scipy.signal.lfilter(whitening, [1.0], e)
    white = scipy.signal.lfilter(whitening, [1.0], columns, axis=1)
    weights, covariance, used = _solved(_gram(white, view), _moments(white_e[None], white, view)[0])
    residual = white_e - _expanded(white, weights.reshape(-1, count), view)
    freedom = max(e.size - int(np.count_nonzero(used)) - whitening.size + 1, 1)
    variance = max(float(residual @ residual) / freedom, 1e-300)
    return HarmonicFit(
        view=view,
        columns=columns,
        whitening=whitening,
        white=white,
        weights=weights,
        covariance=covariance * variance,
        used=used,
        variance=variance,
        freedom=freedom,
        rest=e - _expanded(columns, weights.reshape(-1, count), view),
    )


def _cells(view: SweepView) -> list[tuple[slice, Real]]:
    """For each stretch between two places: its samples, and how far along it each one is."""
    starts = np.searchsorted(view.along, np.arange(view.places + 1))
    return [(slice(a, b), view.along[a:b] - i) for i, (a, b) in enumerate(pairwise(starts))]


def _gram(columns: Real, view: SweepView) -> Real:
    """Products of all weighted columns, shape (p c, p c): only neighbouring places overlap."""
    count, p = columns.shape[0], view.places + 1
    gram = np.zeros((p, count, p, count))
    for i, (here, share) in enumerate(_cells(view)):
        part = columns[:, here]
        left, right = part * (1.0 - share), part * share
        gram[i, :, i] += left @ left.T
        gram[i + 1, :, i + 1] += right @ right.T
        gram[i, :, i + 1] += left @ right.T
        gram[i + 1, :, i] += right @ left.T
    return gram.reshape(p * count, p * count)


def _moments(rows: Real, columns: Real, view: SweepView) -> Real:
    """Products of rows, shape (k, m), with all weighted columns, shape (k, p c)."""
    count, p = columns.shape[0], view.places + 1
    out = np.zeros((rows.shape[0], p, count))
    for i, (here, share) in enumerate(_cells(view)):
        part = columns[:, here]
        out[:, i] += rows[:, here] @ (part * (1.0 - share)).T
        out[:, i + 1] += rows[:, here] @ (part * share).T
    return out.reshape(rows.shape[0], -1)


def _solved(gram: Real, moment: Real) -> tuple[Real, Real, Mask]:
    """Weights, their covariance for unit noise, and which columns are not zero."""
    scale = np.sqrt(np.maximum(np.diag(gram), 0.0))
    used = scale > 1e-6 * scale.max()
    values, vectors = np.linalg.eigh(gram[np.ix_(used, used)] / np.outer(scale[used], scale[used]))
    inverse = (vectors / np.maximum(values, 1e-8)) @ vectors.T
    weights, covariance = np.zeros(used.size), np.zeros(gram.shape)
    weights[used] = inverse @ (moment[used] / scale[used]) / scale[used]
    covariance[np.ix_(used, used)] = inverse / np.outer(scale[used], scale[used])
    return weights, covariance, used


def _expanded(columns: Real, weights: Real, view: SweepView) -> Real:
    """Sum of the columns, shape (c, m), by weights at each place, shape (p, c)."""
    grid = np.arange(weights.shape[0])
    out = np.zeros(columns.shape[1])
    for column, weight in zip(columns, weights.T, strict=True):
        out += column * np.interp(view.along, grid, weight)
    return out
