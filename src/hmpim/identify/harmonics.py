"""Harmonics that follow a sweep: what no linear system can make.

A nonlinear system answers a sinusoid of phase φ(t) at 2φ, 3φ, …: a curve in time and
frequency of its own for each order (A. Farina, AES 108th Convention, 2000). The residual of a
linear fit is regressed on cos kφ and sin kφ, each with an amplitude that changes slowly with
time, after it and they were made white by an autoregression; an F test per order says whether
there is anything. Even orders come from asymmetry, odd ones from what is alike either way:
friction, backlash, a hard or soft spring, limits. The terms of order 1 take up whatever
linear misfit the residual holds, so a wrong linear structure makes no harmonic.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter
from scipy.special import chdtrc, fdtrc

from hmpim.errors import RecordError
from hmpim.identify.signals import as_pair, check_rate
from hmpim.identify.sweep_phase import SweepPhase, sweep_phase
from hmpim.identify.whiteness import autocovariance

__all__ = ["Harmonic", "Harmonics", "any_harmonic", "sweep_harmonics", "whitener"]

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
    frequency, amplitude, std : tuple of float
        Amplitude of the harmonic and its standard deviation, in the residual's unit, where the
        sweep itself is at `frequency` in Hz; places that the order does not reach are left out.
    """

    order: int
    rms: float
    probability: float
    frequency: tuple[float, ...] = ()
    amplitude: tuple[float, ...] = ()
    std: tuple[float, ...] = ()


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
    others: Sequence[SweepPhase] = (),
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
    others : sequence of SweepPhase
        Sweeps of other inputs: what follows those is no harmonic of this one.

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
    view = _view(e, sweep, fs, delay)
    if view is None:
        return None
    more = [_turned(other, view.index, delay * fs) for other in others]
    return _tested(e[view.index], view, more, fs)


def any_harmonic(residual: ArrayLike, sweep: SweepPhase, fs: float, *, delay: float = 0.0) -> float:
    """Chance that noise alone makes the harmonics seen in a white residual: a quick look.

    A tenth of the work of `sweep_harmonics`, and only as good as the residual is white: it
    tells where nothing need be looked for.

    Parameters
    ----------
    residual : array_like, shape (n,)
        Output less prediction; 0 where a sample does not count.
    sweep : SweepPhase
        From `hmpim.identify.sweep_phase.sweep_phase`.
    fs : float
        Rate in Hz.
    delay : float
        Delay of the system, s.

    Examples
    --------
    >>> t = np.arange(2000) / 200
    >>> u = np.sin(2 * np.pi * (0.1 * t + t**2))
    >>> noise = 0.01 * np.random.default_rng(0).standard_normal(2000)
    >>> sweep = sweep_phase(u, 200.0)
    >>> any_harmonic(noise, sweep, 200.0) > 0.01
    True
    >>> any_harmonic(0.01 * u**2 + noise, sweep, 200.0) < 1e-20
    True
    """
    e = np.asarray(residual, dtype=np.float64)
    view = _view(e, sweep, fs, delay)
    if view is None:
        return 1.0
    e = e[view.index]
    e = e - e.mean()
    power = float(e @ e) / e.size
    if power == 0.0:
        return 1.0
    starts = np.searchsorted(view.along, np.arange(view.places))
    turn = np.exp(1j * view.phase)
    spun, chances = e * turn, []
    for k in range(2, max(view.orders) + 1):
        spun *= turn
        seen = k * view.rate < 0.5 * _HIGHEST
        if k not in view.orders:
            continue
        taken = np.add.reduceat(spun * seen, starts)
        count = np.add.reduceat(seen.astype(np.float64), starts)
        used = count > 0
        statistic = float(np.sum(2.0 * np.abs(taken[used]) ** 2 / count[used])) / power
        chances.append(float(chdtrc(2 * np.count_nonzero(used), statistic)))
    return min(1.0, len(chances) * min(chances))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _View:
    """Samples during the sweep that count, and where the sweep was when they began.

    `rate` in turns per sample; `along` from 0 to `places`: half by turns, half by time.
    """

    index: NDArray[np.intp]
    phase: NDArray[np.float64]
    rate: NDArray[np.float64]
    along: NDArray[np.float64]
    places: int
    orders: tuple[int, ...]


def _turned(sweep: SweepPhase, index: NDArray[np.intp], late: float) -> NDArray[np.float64]:
    return np.asarray(np.interp(index - late, np.arange(sweep.phase.size), sweep.phase))


def _view(e: NDArray[np.float64], sweep: SweepPhase, fs: float, delay: float) -> _View | None:
    """The stretch that is looked at; None if it is too short, or no order lies below Nyquist."""
    late = delay * fs
    came = np.arange(e.size) - int(np.rint(late))  # to the sample is enough for what is inside
    inside = sweep.inside[np.clip(came, 0, e.size - 1)] & (came >= 0) & (came < e.size)
    index = np.flatnonzero(inside & (e != 0.0))
    if index.size < _FEWEST:
        return None
    phase = _turned(sweep, index, late)
    rate = np.interp(index - late, np.arange(e.size), sweep.frequency) / fs
    orders = [k for k in _ORDERS if np.count_nonzero(k * rate < 0.5 * _HIGHEST) > 50]
    span = float(phase[-1] - phase[0])
    places = min(_PLACES, int(abs(span) / (2 * np.pi) / _TURNS_PER_PLACE))
    if places < 2 or not orders:
        return None
    time = (index - index[0]) / (index[-1] - index[0])
    along = 0.5 * (np.clip((phase - phase[0]) / span, 0.0, 1.0) + time) * places
    return _View(
        index=index,
        phase=phase,
        rate=rate,
        along=np.maximum.accumulate(np.minimum(along, places - 1e-9)),
        places=places,
        orders=tuple(orders),
    )


def _columns(view: _View, others: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Cosine and sine of order 1 and each of the others, the mean, then what other inputs do."""
    out = np.empty((3 + 2 * len(view.orders) + 2 * len(others), view.phase.size))
    turn = np.exp(1j * view.phase)
    spun = np.ones_like(turn)
    row = 0
    for k in range(1, max(view.orders) + 1):
        spun = spun * turn
        if k == 1 or k in view.orders:
            seen = k * view.rate < 0.5 * _HIGHEST
            out[row], out[row + 1] = spun.real * seen, spun.imag * seen
            row += 2
    out[row] = 1.0
    for phase in others:
        out[row + 1], out[row + 2] = np.cos(phase), np.sin(phase)
        row += 2
    return out


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
    e: NDArray[np.float64], view: _View, others: list[NDArray[np.float64]], fs: float
) -> Harmonics:
    columns = _columns(view, others)
    along, places = view.along, view.places
    weights, _, _ = _solved(_regression(e, columns, along, places))
    whitening = whitener(e - np.sum(_expanded(columns, weights, along), axis=0))
    white_e = lfilter(whitening, [1.0], e)
    white_columns = lfilter(whitening, [1.0], columns, axis=1)
    weights, covariance, used = _solved(_regression(white_e, white_columns, along, places))
    model = np.sum(_expanded(white_columns, weights, along), axis=0)
    freedom = max(e.size - int(np.count_nonzero(used)) - whitening.size + 1, 1)
    variance = float(np.sum((white_e - model) ** 2)) / freedom
    covariance = covariance * max(variance, 1e-300)
    parts = _expanded(columns, weights, along)
    frequency = np.interp(np.arange(places + 1), along, view.rate) * fs
    found = []
    for i, k in enumerate([1, *view.orders]):
        group = _group(2 * i, columns.shape[0], used)
        block = covariance[np.ix_(group, group)]
        statistic = float(weights[group] @ np.linalg.pinv(block, hermitian=True) @ weights[group])
        part = parts[2 * i] + parts[2 * i + 1]
        # Noise alone puts as much there as the weights' variance makes of the columns.
        noise = _noise_power(columns, covariance, along, 2 * i)
        power = max(float(part @ part) - noise, 0.0) / e.size
        at = np.arange(places + 1) * columns.shape[0] + 2 * i
        told = used[at] & used[at + 1] & (k * frequency < 0.5 * _HIGHEST * fs)
        spread = 0.5 * (covariance[at, at] + covariance[at + 1, at + 1])
        found.append(
            Harmonic(
                order=k,
                rms=float(np.sqrt(power)),
                probability=float(fdtrc(group.size, freedom, statistic / group.size)),
                frequency=tuple(frequency[told].tolist()),
                amplitude=tuple(np.hypot(weights[at], weights[at + 1])[told].tolist()),
                std=tuple(np.sqrt(spread[told]).tolist()),
            )
        )
    rest = e - np.sum(parts, axis=0)
    return Harmonics(
        orders=tuple(found[1:]),
        fundamental_rms=found[0].rms,
        noise_rms=float(np.sqrt(rest @ rest / max(e.size - np.count_nonzero(used), 1))),
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
