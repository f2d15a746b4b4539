"""Starting values from the data alone: delay and denominator, for any structure.

1. The lag of the greatest cross-correlation gives the delay plus the lag of the dynamics.
2. With the output moved back by that lag, both records are tapered and their spectra divided: a
   response nearly free of leakage.
3. For every delay at once, and a few guesses of the corner frequency, the denominator that makes
   ``G e^(jωτ) A(jω)`` constant is a small linear least-squares problem (E. C. Levy, IRE Trans.
   Autom. Control 4, 1959); only inverse Fourier transforms in it depend on the delay. Reweighting
   by the last denominator (C. K. Sanathanan and J. Koerner, IEEE TAC 8, 1963) removes its bias.
4. The delays with the lowest local minima of the output error are the starts.

Levy's error weights noise by the denominator. Where noise is most of the output, starts come from
a grid of denominators, those that explain most of the power; one inverse transform gives the best
delay of each. For white noise this is the likelihood itself.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.identify.arrays import Complex, Real
from hmpim.identify.kept import kept
from hmpim.identify.section_iv.correlation import likeness
from hmpim.identify.worth import MUCH
from hmpim.model.dynamics import Structure, theta_of

__all__ = [
    "RoughResponse",
    "distinct",
    "local_minima",
    "rough_response",
    "searched",
    "starting_values",
]

_STAMPED_LATE = -2
"""Least delay in samples of a start where the output follows the input."""

_DYNAMICS = 24
"""Least lag of the dynamics, in samples, assumed for an output that is ahead."""

_TAPER = 0.1
"""Share of the record tapered at either end."""

_PHASE_STEP = 0.3
"""Most phase of one step of the delay at the highest frequency, in rad."""

_FINE, _COARSE = 8, 2
"""Most delay steps per sample, with one guess of the corner frequency and with several."""

_CORNERS = (0.08, 0.25, 1.0)
"""Corners, over the highest frequency, from which the first weight rolls off as 1/A would: above
the system's own corner the response is noise, which a fit without weight would follow."""

_STEPS = 12
"""Corner frequencies of the grid, over the decade and a half below the highest."""

_SHAPES = (0.1, 0.3, 1.0)
"""Its damping ratios: the resonances of neighbours overlap."""

_TURNS, _LATE = 64, 64
"""Bins of a long record are grouped while a delay of `lag + _LATE` samples turns their phases apart
by less than a turn over `_TURNS`."""

_ENOUGH = 16384
"""Samples of a record with at least as many bins as remain after grouping."""

_FLOOR = 1e-3
"""Bins whose input amplitude is below this share of the greatest are ignored."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RoughResponse:
    """Spectra with the coarse delay removed, on uniform bins."""

    lag: int  # samples by which the output was moved back; below 0 where it is ahead of the input
    length: int  # length of the transform
    bins: NDArray[np.intp]  # (m,): bins with excitation
    omega: Real  # (m,): radians per sample at those bins
    response: Complex  # (m,): output over input
    weight: Real  # (m,): power of the input, largest 1
    # lag below 0 at which the output resembles the input most; None if that lag is not below 0
    ahead: int | None = None

    @property
    def earliest(self) -> int:
        """Least pure delay to consider, in samples."""
        if self.lag >= _STAMPED_LATE:
            return _STAMPED_LATE
        return self.lag - max(-self.lag // 4, _DYNAMICS)


def _tapered(x: Real) -> Real:
    """Samples less their weighted mean, both ends tapered."""
    edge = max(int(_TAPER * x.size), 1)
    ramp = np.sin(0.5 * np.pi * (np.arange(edge) + 0.5) / edge) ** 2
    inner = x[edge : x.size - edge]
    total = float(ramp @ x[:edge] + inner.sum() + ramp[::-1] @ x[x.size - edge :])
    out = x - total / (2.0 * float(ramp.sum()) + inner.size)
    out[:edge] *= ramp
    out[x.size - edge :] *= ramp[::-1]
    return np.asarray(out)


@kept
def _tapered_transform(u: Real, length: int) -> Complex:
    """Transform of an input, its ends tapered, padded to a length."""
    return np.asarray(scipy.fft.rfft(_tapered(u), length), dtype=np.complex128)


def rough_response(
    u: Real, y: Real, *, longest_delay: int, lag: int | None = None
) -> RoughResponse:
    """Divide tapered spectra of samples, (n,), the output first moved back by the coarse delay.

    That is `lag` samples or, if None, the lag of the greatest cross-correlation, from 0 to
    `longest_delay` samples.
    """
    ahead = None
    if lag is None:
        alike = likeness(u, y, longest_delay)
        lag, ahead = alike.lag, alike.lead
    overlap = u.size - abs(lag)
    group = max(min(u.size // (_TURNS * (abs(lag) + _LATE)), u.size // _ENOUGH), 1)
    length = scipy.fft.next_fast_len(-(-u.size // group), real=True)
    spectrum_u = _tapered_transform(u[max(-lag, 0) :][:overlap], group * length)
    answer = y[max(lag, 0) :][:overlap]
    spectrum_y = scipy.fft.rfft(_tapered(answer), group * length)
    power = _grouped(spectrum_u.real**2 + spectrum_u.imag**2, group)
    cross = _grouped(np.conj(spectrum_u) * spectrum_y, group)
    power[0] = 0.0
    if lag and not (power.any() and np.ptp(answer)):  # one of them stands still in the overlap
        return rough_response(u, y, longest_delay=longest_delay, lag=0)
    bins = np.flatnonzero(power > _FLOOR**2 * power.max())
    return RoughResponse(
        lag=lag,
        length=length,
        bins=bins,
        omega=2 * np.pi * bins / length,
        response=cross[bins] / power[bins],
        weight=power[bins] / power.max(),
        ahead=ahead,
    )


def _grouped(values: NDArray[Any], group: int) -> NDArray[Any]:
    """Sum over `group` neighbouring bins around each multiple of it, shape (m,)."""
    if group == 1:
        return values
    before = group // 2
    after = -(before + values.size) % group
    return np.asarray(np.pad(values, (before, after)).reshape(-1, group).sum(axis=1))


@lru_cache(maxsize=16)
def _chirp(bins: int, shifts: int, length: int) -> tuple[Complex, Complex]:
    """A chirp, and the transform of its conjugate around 0, for so many bins and shifts.

    With c(k) = e^(jπk²/length), e^(2πj km/length) = c(k) c(m) / c(m - k): a sum over a few bins
    at a few shifts is a convolution, whose transforms are as long as both together, and not as the
    record (L. I. Bluestein, IEEE Trans. Audio Electroacoust. 18, 1970).
    """
    k = np.arange(max(bins, shifts), dtype=np.int64)
    chirp = _turned(k * k, 2 * length)
    around = np.zeros(scipy.fft.next_fast_len(bins + shifts - 1), dtype=complex)
    around[:shifts] = chirp[:shifts].conj()
    around[around.size - bins + 1 :] = chirp[bins - 1 : 0 : -1].conj()
    return chirp, np.asarray(scipy.fft.fft(around))


def _turned(turns: NDArray[np.int64], length: int) -> Complex:
    """e^(2πj turns/length); whole turns are removed, since their rounding grows."""
    return np.asarray(np.exp(2j * np.pi / length * (turns % length)))


def _at_shifts(rough: RoughResponse, rows: Complex, shifts: NDArray[np.intp], finer: int) -> Real:
    """Real parts of Σ rows e^(jω shift/finer) over the bins, at neighbouring shifts, (..., k)."""
    length, first = rough.length * finer, int(rough.bins[0])
    count = int(rough.bins[-1]) - first + 1
    chirp, around = _chirp(count, shifts.size, length)
    dense = np.zeros((*rows.shape[:-1], around.size), dtype=complex)
    dense[..., rough.bins - first] = rows
    dense[..., :count] *= chirp[:count] * _turned(shifts[0] * np.arange(count), length)
    sums = scipy.fft.ifft(scipy.fft.fft(dense) * around)[..., : shifts.size]
    return np.asarray((sums * (chirp[: shifts.size] * _turned(first * shifts, length))).real)


def starting_values(
    rough: RoughResponse, structure: Structure, *, count: int = 3, thorough: bool = True
) -> list[Real]:
    """Starts for `hmpim.identify.fitting.fit.fit_structure`, the most promising first.

    At most `count`, each (1 + order,): delay in samples, parameters of the denominator's sections.
    A `thorough` search tries several guesses of the corner frequency, otherwise only one.
    """
    order, (finer, shifts) = structure.order, _shifts(rough, _COARSE if thorough else _FINE)
    scale = float(np.sqrt(rough.weight @ rough.omega**2 / rough.weight.sum()))
    # Multiplied by A's coefficients and e^(jω shift), these should sum to a constant.
    terms = np.vander(1j * rough.omega / scale, order + 1, increasing=True).T * rough.response
    if order == 0:
        cost, _ = _levy(rough, terms, shifts, finer, rough.weight)
        return [np.array([rough.lag + shifts[int(np.argmin(cost))] / finer])]
    found: list[tuple[float, Real]] = []
    for corner in _CORNERS if thorough else _CORNERS[1:2]:
        roll_off = 1.0 + (rough.omega / (corner * rough.omega[-1])) ** 2
        first = rough.weight / roll_off ** min(order, 2)
        cost, coefficients = _levy(rough, terms, shifts, finer, first)
        for i in local_minima(cost, 2):
            shift, a = shifts[i], coefficients[i]
            for _ in range(2):  # Sanathanan-Koerner: reweight, search nearby delays again
                weight = rough.weight / np.abs(_polynomial(a, rough.omega / scale)) ** 2
                near = shifts[np.abs(shifts - shift) <= max(3, shifts.size // 8)]
                local, solved = _levy(rough, terms, near, finer, weight)
                best = int(np.argmin(local))
                shift, a = near[best], solved[best]
            powers = np.arange(1, order + 1)
            stable = np.maximum(a, 1e-2**powers)
            error = _output_error(rough, shift / finer, stable, scale)
            sections = theta_of(structure, stable / scale**powers)
            found.append((error, np.append(rough.lag + shift / finer, sections)))
    found.sort(key=lambda item: item[0])
    return distinct(theta for _, theta in found)[:count]


def searched(rough: RoughResponse, structure: Structure) -> list[Real]:
    """Starts for one or two poles in much noise: those of a grid that explain most of the power."""
    if structure.sections not in ((1,), (2,)):
        return []
    finer, shifts = _shifts(rough, _FINE)
    found: list[tuple[float, Real]] = []
    for corner in rough.omega[-1] * np.geomspace(0.03, 1.0, _STEPS):
        for shape in _SHAPES if structure.order == 2 else _SHAPES[-1:]:
            a = np.array([2.0 * shape, 1.0]) if structure.order == 2 else np.ones(1)
            model = 1.0 / _polynomial(np.concatenate([[1.0], a]), rough.omega / corner)
            alike = _at_shifts(rough, rough.weight * model.conj() * rough.response, shifts, finer)
            explained = alike**2 / (rough.weight @ np.abs(model) ** 2)
            best = int(np.argmax(explained))
            theta = theta_of(structure, a / corner ** np.arange(1, structure.order + 1))
            delay = rough.lag + shifts[best] / finer
            found.append((-float(explained[best]), np.append(delay, theta)))
    found.sort(key=lambda item: item[0])
    return [theta for _, theta in found[:3]]


def distinct(thetas: Iterable[Real]) -> list[Real]:
    """Parameters without those that are close to earlier ones."""
    found: list[Real] = []
    for theta in thetas:
        if all(np.max(np.abs(theta - other)) > MUCH for other in found):
            found.append(theta)
    return found


def _shifts(rough: RoughResponse, most: int) -> tuple[int, NDArray[np.intp]]:
    """Steps of the delay per sample, at most so many, and delays to try, in steps from the lag."""
    finer = int(np.clip(np.ceil(rough.omega[-1] / _PHASE_STEP), 1, most))
    return finer, np.arange(min(rough.earliest - rough.lag, 0) * finer, 2 * finer + 1)


def _polynomial(a: Real, x: Real) -> Complex:
    """1 + a1 s + a2 s² + … at s = jx."""
    s, value = 1j * x, np.full(x.size, a[-1], dtype=complex)
    for coefficient in (*a[-2::-1], 1.0):
        value = coefficient + s * value
    return value


def _levy(
    rough: RoughResponse, terms: Complex, shifts: NDArray[np.intp], finer: int, weight: Real
) -> tuple[Real, Real]:
    """Solve at each shift, in samples / finer; return costs, (k,), and coefficients, (k, order)."""
    order = terms.shape[0] - 1
    weighted = terms * weight
    gram = (weighted @ terms.conj().T).real
    cross = _at_shifts(rough, weighted, shifts, finer)
    total = weight.sum()
    # Eliminate the constant K = sum_j a_j cross_j / total, a_0 = 1.
    reduced = gram[None, :, :] - cross.T[:, :, None] * cross.T[:, None, :] / total
    if order == 0:
        return reduced[:, 0, 0], np.zeros((shifts.size, 0))
    inner = reduced[:, 1:, 1:] + 1e-9 * np.trace(gram) * np.eye(order)
    a = np.linalg.solve(inner, -reduced[:, 1:, :1])[:, :, 0]
    full = np.concatenate([np.ones((shifts.size, 1)), a], axis=1)
    cost = np.einsum("ki,kij,kj->k", full, reduced, full)
    # An unstable denominator would fit backwards in time.
    return np.where(np.all(a > 0, axis=1), cost, cost + gram[0, 0]), a


def local_minima(cost: Real, count: int) -> list[int]:
    """Indices of the lowest local minima, ends included, the lowest first."""
    inside = np.concatenate([[np.inf], cost, [np.inf]])
    low = np.flatnonzero((inside[1:-1] <= inside[:-2]) & (inside[1:-1] <= inside[2:]))
    return [int(i) for i in low[np.argsort(cost[low])][:count]]


def _output_error(rough: RoughResponse, shift: float, a: Real, scale: float) -> float:
    """Weighted squared error of the response itself, with the best gain."""
    target = rough.response * np.exp(1j * rough.omega * shift)
    model = 1.0 / _polynomial(a, rough.omega / scale)
    power = (rough.weight * np.abs(model) ** 2).sum()
    gain = (rough.weight * model.conj() * target).sum().real / power
    return float((rough.weight * np.abs(target - gain * model) ** 2).sum())
