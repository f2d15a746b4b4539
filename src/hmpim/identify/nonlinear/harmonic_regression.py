"""Harmonics of a sweep by regression: amplitudes that change slowly along it, in coloured noise.

What is regressed is written as the sum of cos kφ and sin kφ, φ the sweep's phase when the
input left, each weighted by a curve that is linear between about ten places along the sweep,
beside a mean that moves as slowly. Both sides are first made white by an autoregression.
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
"""Orders looked for; 1 and the mean are taken up with them."""

_PLACES = 10
"""Times between which an amplitude changes linearly, at most."""

_TURNS_PER_PLACE = 3.0
"""Turns of the sweep between them, at least."""

HIGHEST = 0.9
"""Share of the Nyquist frequency up to which an order is followed: beyond it folds back."""

_LONGEST_AUTOREGRESSION = 20

_FEWEST = 100
"""Samples of the sweep."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SweepView:
    """Samples during the sweep that count, and where the sweep was when they began.

    Parameters
    ----------
    index : integer ndarray, shape (m,)
        Which samples.
    phase : ndarray, shape (m,)
        Radians.
    rate : ndarray, shape (m,)
        Turns per sample.
    along : ndarray, shape (m,)
        From 0 to `places`: half by turns, half by time.
    places : int
        Stretches over which amplitudes change linearly.
    orders : tuple of int
        Orders that lie below the Nyquist frequency for part of the sweep.
    """

    index: NDArray[np.intp]
    phase: Real
    rate: Real
    along: Real
    places: int
    orders: tuple[int, ...]


def _turned(sweep: SweepPhase, index: NDArray[np.intp], late: float) -> Real:
    return np.asarray(np.interp(index - late, np.arange(sweep.phase.size), sweep.phase))


def view_of(e: Real, sweep: SweepPhase, fs: float, delay: float) -> SweepView | None:
    """The stretch that is looked at; None if it is too short, or no order lies below Nyquist."""
    late = delay * fs
    came = np.arange(e.size) - int(np.rint(late))  # to the sample is enough for what is inside
    inside = sweep.inside[np.clip(came, 0, e.size - 1)] & (came >= 0) & (came < e.size)
    index = np.flatnonzero(inside & (e != 0.0))
    if index.size < _FEWEST:
        return None
    phase = _turned(sweep, index, late)
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
    """Cosine and sine of order 1 and each of the others, the mean, then what other inputs do."""
    out = np.empty((3 + 2 * len(view.orders) + 2 * len(others), view.phase.size))
    turn = np.exp(1j * view.phase)
    spun = np.ones_like(turn)
    row = 0
    for k in range(1, max(view.orders) + 1):
        spun = spun * turn
        if k == 1 or k in view.orders:
            seen = k * view.rate < 0.5 * HIGHEST
            out[row], out[row + 1] = spun.real * seen, spun.imag * seen
            row += 2
    out[row] = 1.0
    for phase in others:
        out[row + 1], out[row + 2] = np.cos(phase), np.sin(phase)
        row += 2
    return out


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HarmonicFit:
    """A regression on harmonics, kept so that traces can be held against it.

    Parameters
    ----------
    view : SweepView
        What was looked at.
    columns : ndarray, shape (c, m)
        Cosine and sine of orders 1, 2, …, the mean, and what follows other inputs.
    whitening : ndarray
        Coefficients 1, -a1, … of the noise's autoregression.
    white : ndarray, shape (c, m)
        The columns made white.
    weights : ndarray, shape (p c,)
        Of each column at each place.
    covariance : ndarray, shape (p c, p c)
        Of the weights.
    used : ndarray of bool, shape (p c,)
        Weights that stand for anything.
    variance : float
        Of the whitened noise.
    freedom : int
        Its degrees.
    rest : ndarray, shape (m,)
        What the harmonics leave over.
    """

    view: SweepView
    columns: Real
    whitening: Real
    white: Real
    weights: Real
    covariance: Real
    used: Mask
    variance: float
    freedom: int
    rest: Real

    @property
    def orders(self) -> tuple[int, ...]:
        """Order 1, then those looked for."""
        return (1, *self.view.orders)

    @property
    def evidence(self) -> float:
        """Log-likelihood that orders 2 and up gain, less what noise would on average."""
        group = self.group(2, 2 * len(self.orders))
        inverse = np.linalg.pinv(self.covariance[np.ix_(group, group)], hermitian=True)
        gained = float(self.weights[group] @ inverse @ self.weights[group])
        return 0.5 * max(gained - group.size, 0.0)

    def group(self, first: int, last: int) -> NDArray[np.intp]:
        """Indices of the weights of columns `first` to `last`, the last not included."""
        place = np.arange(self.used.size) % self.columns.shape[0]
        return np.flatnonzero((place >= first) & (place < last) & self.used)

    def part(self, i: int) -> Real:
        """What the i-th order contributes, shape (m,)."""
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
        """Mean products of what the weights of a group stand for."""
        return _gram(self.columns, self.view)[np.ix_(group, group)] / self.rest.size

    def weights_of(self, traces: Real) -> Real:
        """Weights that traces, shape (k, n), would have by themselves, shape (k, p c)."""
        white = scipy.signal.lfilter(self.whitening, [1.0], traces[:, self.view.index], axis=1)
        moments = _moments(white, self.white, self.view)
        return np.asarray(moments @ self.covariance / self.variance)


def fit_harmonics(
    e: Real, view: SweepView, others: Sequence[SweepPhase], late: float
) -> HarmonicFit:
    """Regress `e`, shape (n,), on harmonics of the sweep in `view`, so many samples late.

    What follows the frequency of other inputs' sweeps is allowed for.
    """
    columns = columns_of(view, [_turned(other, view.index, late) for other in others])
    e = e[view.index]
    weights, _, _ = _solved(_gram(columns, view), _moments(e[None], columns, view)[0])
    count = columns.shape[0]
    left = e - _expanded(columns, weights.reshape(-1, count), view)
    whitening, _ = yule_walker(left, _LONGEST_AUTOREGRESSION)
    white_e = scipy.signal.lfilter(whitening, [1.0], e)
    white = scipy.signal.lfilter(whitening, [1.0], columns, axis=1)
    weights, covariance, used = _solved(_gram(white, view), _moments(white_e[None], white, view)[0])
    left = white_e - _expanded(white, weights.reshape(-1, count), view)
    freedom = max(e.size - int(np.count_nonzero(used)) - whitening.size + 1, 1)
    variance = max(float(left @ left) / freedom, 1e-300)
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
    """For each stretch between two places: its samples, and how far along each lies."""
    starts = np.searchsorted(view.along, np.arange(view.places + 1))
    return [(slice(a, b), view.along[a:b] - i) for i, (a, b) in enumerate(pairwise(starts))]


def _gram(columns: Real, view: SweepView) -> Real:
    """Products of all weighted columns, shape (p c, p c): only neighbours have any."""
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
    """Weights, their covariance for unit noise, and which columns have any content."""
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
