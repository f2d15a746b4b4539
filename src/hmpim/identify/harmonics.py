"""Harmonics that follow a sweep: what no linear system can make.

A nonlinear system answers a sinusoid of phase φ(t) at 2φ, 3φ, …: a curve in time and
frequency of its own for each order (A. Farina, AES 108th Convention, 2000). The residual of a
linear fit is regressed on cos kφ and sin kφ, each with an amplitude that changes slowly with
time, after it and they were made white by an autoregression; an F test per order says whether
there is anything. Even orders come from asymmetry, odd ones from what is alike either way:
friction, backlash, a hard or soft spring, limits. The terms of order 1 take up whatever
linear misfit the residual holds, so a wrong linear structure makes no harmonic.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter
from scipy.stats import f as fisher

from hmpim.errors import RecordError
from hmpim.identify.signals import as_pair, check_rate
from hmpim.identify.sweep_phase import SweepPhase, sweep_phase
from hmpim.identify.whiteness import autocovariance

__all__ = ["Harmonic", "Harmonics", "sweep_harmonics", "whitener"]

_ORDERS = (2, 3, 4, 5)
"""Orders looked for; 1 and the mean are taken up with them."""

_PLACES = 10
"""Times between which an amplitude changes linearly, at most."""

_TURNS_PER_PLACE = 3.0
"""Turns of the sweep between them, at least."""

_HIGHEST = 0.9
"""Share of the Nyquist frequency up to which an order is followed: beyond it folds back."""

_LONGEST_AUTOREGRESSION = 20

_FEWEST = 100
"""Samples of the sweep."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Harmonic:
    """One order.

    Parameters
    ----------
    order : int
        Multiple of the sweep's frequency.
    rms : float
        Its r.m.s. over the sweep in the residual's unit, what noise puts there taken off.
    probability : float
        Chance of so much, or more, from noise alone.
    """

    order: int
    rms: float
    probability: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Harmonics:
    """What the residual of a linear fit is made of, over the sweep.

    Parameters
    ----------
    orders : tuple of Harmonic
        Orders 2 to 5, those that lie below the Nyquist frequency for part of the sweep.
    fundamental_rms : float
        R.m.s. of what still follows the sweep at its own frequency: linear misfit, and the part
        of a nonlinearity that looks linear.
    noise_rms : float
        R.m.s. of the rest.
    """

    orders: tuple[Harmonic, ...]
    fundamental_rms: float
    noise_rms: float

    def rms(self, parity: int) -> float:
        """R.m.s. of all even (0) or odd (1) orders together."""
        return float(np.sqrt(sum(h.rms**2 for h in self.orders if h.order % 2 == parity)))

    def probability(self, parity: int) -> float:
        """Chance of so much in the even (0) or odd (1) orders, the number looked at counted."""
        chances = [h.probability for h in self.orders if h.order % 2 == parity]
        return min(1.0, len(chances) * min(chances, default=1.0))


def sweep_harmonics(
    u: ArrayLike,
    residual: ArrayLike,
    fs: float,
    *,
    delay: float = 0.0,
    phase: SweepPhase | None = None,
) -> Harmonics | None:
    """Measure the harmonics of a sweep in the residual of a linear fit.

    Parameters
    ----------
    u : array_like, shape (n,)
        Input samples.
    residual : array_like, shape (n,)
        Output less prediction; 0 where a sample does not count.
    fs : float
        Rate in Hz.
    delay : float
        Delay of the system, s; the harmonics come as much later.
    phase : SweepPhase, optional
        From `hmpim.identify.sweep_phase.sweep_phase` if already known.

    Returns
    -------
    Harmonics or None
        None if the input is not a sweep, or has too few turns.

    Raises
    ------
    RecordError
        For the wrong shape, unequal lengths, NaN or infinity.
    ArgumentError
        If `fs` is not positive.

    Examples
    --------
    >>> t = np.arange(2000) / 200
    >>> u = np.sin(2 * np.pi * (0.1 * t + t**2))
    >>> noise = 0.01 * np.random.default_rng(0).standard_normal(2000)
    >>> found = sweep_harmonics(u, 0.1 * (u**3 - 0.75 * u) + noise, 200.0)
    >>> [h.order for h in found.orders if h.probability < 1e-4], round(found.rms(1), 3)
    ([3], 0.017)
    """
    check_rate(fs)
    source, e = as_pair(u, residual)
    sweep = phase if phase is not None else sweep_phase(source, fs)
    if sweep is None:
        return None
    if sweep.phase.size != e.size:
        raise RecordError(
            f"the sweep's phase has {sweep.phase.size} samples and the residual {e.size}; "
            "give both of one record"
        )
    sample = np.arange(e.size, dtype=np.float64)
    turned = np.interp(sample - delay * fs, sample, sweep.phase)
    rate = np.interp(sample - delay * fs, sample, sweep.frequency) / fs
    inside = np.interp(sample - delay * fs, sample, sweep.inside.astype(float)) > 0.99
    inside &= e != 0.0 if np.any(e == 0.0) else True
    orders = [k for k in _ORDERS if np.count_nonzero(inside & (k * rate < 0.5 * _HIGHEST)) > 50]
    turns = float(np.ptp(turned[inside])) / (2 * np.pi) if inside.any() else 0.0
    places = min(_PLACES, int(turns / _TURNS_PER_PLACE))
    if np.count_nonzero(inside) < _FEWEST or places < 2 or not orders:
        return None
    columns = _columns(turned, rate, inside, orders)
    return _tested(e * inside, columns, turned, inside, orders, places)


def _columns(
    phase: NDArray[np.float64],
    rate: NDArray[np.float64],
    inside: NDArray[np.bool_],
    orders: list[int],
) -> NDArray[np.float64]:
    """The mean, then cosine and sine of order 1 and each of `orders`; 0 where not looked at."""
    out = np.empty((3 + 2 * len(orders), phase.size))
    out[0] = inside
    for i, k in enumerate([1, *orders]):
        seen = inside & (k * rate < 0.5 * _HIGHEST)
        out[1 + 2 * i] = np.cos(k * phase) * seen
        out[2 + 2 * i] = np.sin(k * phase) * seen
    return out


def _hats(
    phase: NDArray[np.float64], inside: NDArray[np.bool_], places: int
) -> NDArray[np.float64]:
    """Place along the sweep, 0 to `places`: half by turns, half by time."""
    where = np.flatnonzero(inside)
    along = np.clip((phase - phase[where[0]]) / (phase[where[-1]] - phase[where[0]]), 0.0, 1.0)
    time = np.clip((np.arange(phase.size) - where[0]) / (where[-1] - where[0]), 0.0, 1.0)
    return np.asarray(np.minimum(0.5 * (along + time) * places, places - 1e-9))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Regression:
    """Normal equations of all columns, each at every place."""

    gram: NDArray[np.float64]
    moment: NDArray[np.float64]


def _regression(
    e: NDArray[np.float64], columns: NDArray[np.float64], along: NDArray[np.float64], places: int
) -> _Regression:
    """Sum the normal equations place by place: at any time only two places have weight."""
    count = columns.shape[0]
    gram = np.zeros((places + 1, count, places + 1, count))
    moment = np.zeros((places + 1, count))
    cell = along.astype(np.intp)
    for i in range(places):
        here = cell == i
        part, share = columns[:, here], along[here] - i
        left, right = part * (1.0 - share), part * share
        for a, first in ((i, left), (i + 1, right)):
            moment[a] += first @ e[here]
            for b, second in ((i, left), (i + 1, right)):
                gram[a, :, b, :] += first @ second.T
    size = (places + 1) * count
    return _Regression(gram=gram.reshape(size, size), moment=moment.reshape(size))


def _solved(
    regression: _Regression,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Weights, their covariance for unit noise, and which columns have any content."""
    scale = np.sqrt(np.maximum(np.diag(regression.gram), 0.0))
    used = scale > 1e-6 * scale.max()
    gram = regression.gram[np.ix_(used, used)] / np.outer(scale[used], scale[used])
    values, vectors = np.linalg.eigh(gram)
    inverse = (vectors / np.maximum(values, 1e-8)) @ vectors.T
    weights, covariance = np.zeros(used.size), np.zeros(regression.gram.shape)
    weights[used] = inverse @ (regression.moment[used] / scale[used]) / scale[used]
    covariance[np.ix_(used, used)] = inverse / np.outer(scale[used], scale[used])
    return weights, covariance, used


def whitener(
    e: NDArray[np.float64], *, longest: int = _LONGEST_AUTOREGRESSION
) -> NDArray[np.float64]:
    """Coefficients 1, -a1, … of the autoregression that Akaike's criterion chooses."""
    longest = min(longest, e.size // 20)
    r = autocovariance(e, longest)
    if r[0] <= 0:
        return np.ones(1)
    best, chosen = e.size * np.log(r[0]), np.zeros(0)
    for order in range(1, longest + 1):
        coefficients = solve_toeplitz(r[:order], r[1 : order + 1])
        variance = float(r[0] - coefficients @ r[1 : order + 1])
        if variance <= 1e-12 * r[0]:
            break
        criterion = e.size * np.log(variance) + 2 * order
        if criterion < best:
            best, chosen = criterion, coefficients
    return np.concatenate([[1.0], -chosen])


def _expanded(
    columns: NDArray[np.float64], weights: NDArray[np.float64], along: NDArray[np.float64]
) -> NDArray[np.float64]:
    """What each column contributes over time, shape (columns, n)."""
    shaped = weights.reshape(-1, columns.shape[0]).T
    grid = np.arange(shaped.shape[1])
    return np.stack([c * np.interp(along, grid, w) for c, w in zip(columns, shaped, strict=True)])


def _tested(
    e: NDArray[np.float64],
    columns: NDArray[np.float64],
    phase: NDArray[np.float64],
    inside: NDArray[np.bool_],
    orders: list[int],
    places: int,
) -> Harmonics:
    along = _hats(phase, inside, places)
    weights, _, _ = _solved(_regression(e, columns, along, places))
    left = e - np.sum(_expanded(columns, weights, along), axis=0) * inside
    whitening = whitener(left[inside])
    white_e = lfilter(whitening, [1.0], e)
    white_columns = lfilter(whitening, [1.0], columns, axis=1)
    weights, covariance, used = _solved(_regression(white_e, white_columns, along, places))
    model = np.sum(_expanded(white_columns, weights, along), axis=0)
    counted = int(np.count_nonzero(inside))
    freedom = max(counted - int(np.count_nonzero(used)) - whitening.size + 1, 1)
    variance = float(np.sum((white_e - model)[inside] ** 2)) / freedom
    parts = _expanded(columns, weights, along)
    found = []
    for i, k in enumerate([1, *orders]):
        group = _group(1 + 2 * i, columns.shape[0], used)
        block = covariance[np.ix_(group, group)]
        statistic = float(weights[group] @ np.linalg.pinv(block, hermitian=True) @ weights[group])
        chance = fisher.sf(statistic / group.size / max(variance, 1e-300), group.size, freedom)
        part = parts[1 + 2 * i] + parts[2 + 2 * i]
        power = float(np.sum(part**2)) / counted
        # Noise alone puts as much there as the weights' variance makes of the columns.
        noise = variance * _noise_power(columns, covariance, along, 1 + 2 * i) / counted
        found.append(
            Harmonic(
                order=k, rms=float(np.sqrt(max(power - noise, 0.0))), probability=float(chance)
            )
        )
    rest = (e - np.sum(parts, axis=0))[inside]
    return Harmonics(
        orders=tuple(found[1:]),
        fundamental_rms=found[0].rms,
        noise_rms=float(np.sqrt(rest @ rest / max(counted - np.count_nonzero(used), 1))),
    )


def _group(first: int, count: int, used: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Indices of one order's cosine and sine at all places."""
    index = np.arange(used.size)
    chosen = ((index % count == first) | (index % count == first + 1)) & used
    return np.flatnonzero(chosen)


def _noise_power(
    columns: NDArray[np.float64],
    covariance: NDArray[np.float64],
    along: NDArray[np.float64],
    first: int,
) -> float:
    """Sum of squares that unit noise puts into one order."""
    count = columns.shape[0]
    places = covariance.shape[0] // count - 1
    pair = columns[first : first + 2]
    own = _regression(np.zeros(columns.shape[1]), pair, along, places).gram
    index = np.arange(covariance.shape[0])
    group = np.flatnonzero((index % count == first) | (index % count == first + 1))
    return float(np.sum(own * covariance[np.ix_(group, group)]))
