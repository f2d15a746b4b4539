r"""How much of its limits any stimulus takes at least, whatever its shape, for a wanted accuracy.

With v any combination of the parameters, the variance of parameter i is vᵢ² / (vᵀMv) or more (A.
Cauchy, H. A. Schwarz), and the information vᵀMv is linear in the energy that the stimulus has at
each frequency. That energy is bounded: what stays within a position P for T seconds has a sum of
squares of P²T at most, and its derivatives likewise (A. C. Parseval). So the least share of all
limits is at least that of a linear programme, whatever combinations it is made of; those that bind
are found in turn (cutting planes, J. E. Kelley, Journal of SIAM 8, 1960). Its dual is a
certificate, checked on finer frequencies than the programme's own. For designs that are spectra
see V. V. Fedorov, Theory of Optimal Experiments, 1972.
"""

import math

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.optimal.fisher import responses
from hmpim.optimal.wish import PARAMETERS, Wish

__all__ = ["least_share"]

FloatArray = NDArray[np.float64]

_FREQUENCIES = 160
"""Of the programme, beside those around each mode."""

_AROUND = np.array([0.0, 0.3, 0.7, 1.2, 2.0, 3.5, 6.0])
"""Distances from a natural frequency, in its half widths, at which the programme looks too."""

_FINER = 12
"""How much finer the certificate is checked."""

_ROUNDS, _ENOUGH = 24, 6
"""Programmes at most; as soon as the wish cannot be met."""

_CLOSE = 1.02
"""Energy of a spectrum that does, over the programme's, at which it is near enough."""

_MIXED = 1e-3
"""Share of even energy with which a spectrum is told apart, so that no parameter is unseen."""


def least_share(wish: Wish) -> float:
    """Bound the share of its limits that a stimulus must take to be as accurate as wanted.

    Parameters
    ----------
    wish : Wish
        What is wanted.

    Returns
    -------
    float
        No stimulus of any shape takes less; 0 where nothing is limited. Beyond 1 the wish cannot
        be met. Below 1 the bound is no closer than it takes to see that.

    Examples
    --------
    >>> from hmpim.optimal.wish import Accuracy, ModelRange, RoughModel
    >>> from hmpim.stimulus import Limits
    >>> rough = RoughModel(delay=0.15, natural_frequency=10, damping_ratio=0.4)
    >>> wish = Wish(accuracy=Accuracy(), model=rough, model_range=ModelRange(), noise_std=0.1,
    ...             limits=Limits(position=0.2, acceleration=300), fs=200.0,
    ...             gentle="peak_acceleration", duration=10.0)
    >>> round(least_share(wish), 1)
    2.1
    """
    if wish.unlimited:
        return 0.0
    omega = _frequencies(wish, 1)
    information, shares = _information(wish, omega), _shares(wish, omega)
    unit = 1.0 / shares.max(axis=0)  # energy that takes a limit in full
    information, shares = information * unit[:, None, None], shares * unit
    spectrum = np.full(omega.size, 1.0 / omega.size)
    cuts: list[tuple[int, FloatArray]] = []  # a model, and a combination with vᵢ = 1
    rows = np.empty((0, omega.size))
    bound = 0.0
    for turn in range(_ROUNDS):
        found = _combinations(information, spectrum)
        cuts += found
        rows = np.vstack([rows, _told(information, found)])
        solved = _programme(rows, shares)
        if solved is None:
            break
        spectrum, weights, prices = solved
        bound = max(bound, float(weights.sum()) / _excess(wish, cuts, weights, prices))
        enough = float((shares @ spectrum).max()) * _worst(information, spectrum)
        if enough < max(1.0, _CLOSE * bound) or (bound > 1.0 and turn >= _ENOUGH):
            break
        spectrum = spectrum + _MIXED * spectrum.sum() / omega.size
    return math.sqrt(bound)


def _frequencies(wish: Wish, finer: int) -> FloatArray:
    """Where a spectrum is looked at, in rad/s: from far below a cycle per record to fs / 2."""
    models = wish.models()
    lowest = min(0.05 / wish.duration, *(0.02 * m.natural_frequency for m in models))
    even = np.geomspace(lowest, 0.5 * wish.fs, _FREQUENCIES * finer)
    around = [even]
    steps = np.arange((_AROUND.size - 1) * finer + 1) / finer
    away = np.interp(steps, np.arange(_AROUND.size), _AROUND)
    for m in models:
        width = min(m.damping_ratio, 0.5) * m.natural_frequency
        around += [m.natural_frequency + width * away, m.natural_frequency - width * away]
    every = np.unique(np.concatenate(around))
    return np.asarray(2.0 * np.pi * every[(every >= lowest) & (every <= 0.5 * wish.fs)])


def _information(wish: Wish, omega: FloatArray) -> FloatArray:
    """Information that energy of 1 at each frequency tells, in errors wanted: (models, k, 4, 4)."""
    told = []
    for model in wish.models():
        by = responses(model, _along(omega)) * wish.wanted(model)[:, None]
        told.append(np.einsum("ik,jk->kij", by.conj(), by).real)
    return np.array(told) * (wish.fs / wish.noise_std**2)


def _along(omega: FloatArray) -> NDArray[np.complex128]:
    return np.asarray(1j * omega, dtype=np.complex128)


def _shares(wish: Wish, omega: FloatArray) -> FloatArray:
    """Share of each limit's energy that energy of 1 takes, shape (limits, k).

    What is not limited, a limit of the next derivative limits: the motion begins and ends at rest.
    """
    limits, length = wish.limits, wish.duration
    most = [limits.position, limits.velocity, limits.acceleration, limits.jerk]
    for order in (2, 1, 0):
        most[order] = min(most[order], most[order + 1] * length / 2.0)
    return np.array(
        [
            omega ** (2 * order) / (value**2 * length)
            for order, value in enumerate(most)
            if math.isfinite(value)
        ]
    )


def _combinations(information: FloatArray, spectrum: FloatArray) -> list[tuple[int, FloatArray]]:
    """Combinations that this spectrum tells the least of, one for each model and parameter."""
    out = []
    for k, model in enumerate(information):
        matrix = np.tensordot(spectrum, model, axes=(0, 0))
        size = np.sqrt(np.diag(matrix))
        inverse = np.linalg.pinv(matrix / np.outer(size, size), rcond=1e-13, hermitian=True)
        inverse = inverse / np.outer(size, size)
        out += [(k, inverse[:, i] / inverse[i, i]) for i in range(len(PARAMETERS))]
    return out


def _told(information: FloatArray, cuts: list[tuple[int, FloatArray]]) -> FloatArray:
    """What energy of 1 at each frequency tells of combinations, (cuts, k)."""
    return np.array([np.einsum("i,kij,j->k", v, information[m], v) for m, v in cuts])


def _worst(information: FloatArray, spectrum: FloatArray) -> float:
    """Greatest variance over the one wanted."""
    worst = 0.0
    for model in information:
        matrix = np.tensordot(spectrum, model, axes=(0, 0))
        size = np.sqrt(np.diag(matrix))
        scaled = matrix / np.outer(size, size)
        if not np.isfinite(scaled).all() or np.linalg.cond(scaled) > 1e13:
            return math.inf
        worst = max(worst, float((np.diag(np.linalg.inv(scaled)) / size**2).max()))
    return worst


def _programme(
    rows: FloatArray, shares: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """The spectrum that takes the least of all limits and tells every combination, and prices.

    The prices are those of the combinations and of the limits; the first add up to that share.
    """
    scale = rows.max(axis=1)
    size = scale.min()  # the solver's tolerances are absolute
    count = rows.shape[1]
    solved = scipy.optimize.linprog(
        np.append(np.zeros(count), 1.0),
        A_ub=np.vstack(
            [
                np.column_stack([-rows / scale[:, None], np.zeros(len(rows))]),
                np.column_stack([shares, -np.ones(len(shares))]),
            ]
        ),
        b_ub=np.concatenate([-size / scale, np.zeros(len(shares))]),
        method="highs-ds",
    )
    if solved.x is None:
        return None
    prices = -np.asarray(solved.ineqlin.marginals)
    spectrum = np.maximum(solved.x[:-1], 0.0) / size
    paid = np.maximum(prices[len(rows) :], 0.0)
    # of limits, they add up to 1
    return spectrum, np.maximum(prices[: len(rows)], 0.0) / scale / paid.sum(), paid / paid.sum()


def _excess(
    wish: Wish, cuts: list[tuple[int, FloatArray]], weights: FloatArray, prices: FloatArray
) -> float:
    """Factor, 1 or more, by which the dual is broken between the programme's frequencies."""
    omega = _frequencies(wish, _FINER)
    told = np.zeros(omega.size)
    for k, model in enumerate(wish.models()):
        by = responses(model, _along(omega)) * wish.wanted(model)[:, None]
        used = [(v, w) for (m, v), w in zip(cuts, weights, strict=True) if m == k and w > 0.0]
        for v, w in used:
            told += w * np.abs(v @ by) ** 2
    told *= wish.fs / wish.noise_std**2
    return max(1.0, float((told / (prices @ _shares(wish, omega))).max()))
