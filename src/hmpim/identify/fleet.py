"""Many records of one stimulus and of second order: fitted together, by what they share.

`hmpim.identify.learnt` tells what that is. Each output is one product with the basis, and all are
fitted at once by the same least squares as `hmpim.identify`, in a few numbers instead of thousands.
The basis is the stimulus' transforms and Gram matrix, made once for all. Every assumption on what
the stimulus does between its samples is tried, and what the record does not exclude widens the
intervals, as `hmpim.identify.spanned` does it.

The parameters and their errors are those of a fit to the record itself, as long as what the basis
and the polynomials are off is small beside a standard deviation: `FleetFit.sound` says where it is,
where the unit lies inside the box, where the residual is white and does not follow the input, and
where nothing asks for one more pole. All other records are for `identify`.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.identify.fitting.growth import BY_CHANCE
from hmpim.identify.fitting.trial import CLEARLY, LIKELIER
from hmpim.identify.judgement.between_samples import SHIFT, SIZES, WIDE
from hmpim.identify.learnt import Fleet, Member, learn_fleet
from hmpim.identify.result import Estimate, Parameters
from hmpim.identify.spanned import MOVES
from hmpim.identify.uncertainty import noise_estimate
from hmpim.identify.whiteness import is_white, misfit
from hmpim.record import Intersample

__all__ = ["Fleet", "FleetFit", "fit_fleet", "learn_fleet"]

Real = NDArray[np.float64]
Flags = NDArray[np.bool_]

_OFF = 0.05
"""Error of the surface, in standard deviations of a parameter, that is let pass."""

_ROUGH = 0.2
"""The same where another assumption only widens an interval: a tenth of its half width at most.

A held input's response bends where the delay passes a whole sample, which no polynomial follows.
"""

_CHANCE = 1e-3
"""Chance at which a record is taken as one whose residual follows the input."""

_STEPS = 12


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FleetFit:
    """Parameters of many records.

    Parameters
    ----------
    parameters : tuple of Parameters
        Of each record; without the paper's delay. Those of a record that is not sound are None.
    sound : ndarray of bool, shape (N,)
        Whether they are what `identify` would say.
    intersample : tuple of {'zoh', 'foh', 'bandlimited'}
        The likeliest assumption for each.
    undetermined : ndarray of bool, shape (N,)
        Whether another one would move the delay and is not excluded.
    fit_percent : ndarray, shape (N,)
        100 (1 - ||y - ŷ|| / ||y - mean y||).
    """

    parameters: tuple[Parameters | None, ...]
    sound: Flags
    intersample: tuple[Intersample, ...]
    undetermined: Flags
    fit_percent: Real


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Fits:
    """All records fitted under one assumption; first axis: the record."""

    member: Member
    theta: Real
    gain: Real
    bias: Real
    cost: Real
    left: Real
    """What the fit leaves inside the basis."""
    figures: Mapping[str, Real]


def fit_fleet(fleet: Fleet, outputs: Real, *, units: tuple[str, str] = ("", "")) -> FleetFit:
    """Fit many outputs of one stimulus at once.

    Parameters
    ----------
    fleet : Fleet
        From `learn_fleet`.
    outputs : ndarray, shape (N, n)
        One output a row.
    units : (str, str)
        Of input and output.

    Returns
    -------
    FleetFit
    """
    count, n = outputs.shape
    means = outputs.mean(axis=1)
    centred = outputs - means[:, None]
    power = np.einsum("ij,ij->i", centred, centred)
    fits = [_fitted(fleet, member, centred, means, power) for member in fleet.members]
    behind, chosen = _weighed(fleet, fits, n)
    found: list[Parameters | None] = [None] * count
    sound, undetermined = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
    for k, fit in enumerate(fits):
        some = np.flatnonzero(chosen == k)
        if some.size == 0:
            continue
        open_ = [
            (rival, behind[j, some] - behind[k, some] < 2 * CLEARLY)
            for j, rival in enumerate(fits)
            if j != k
        ]
        told, sound[some], undetermined[some] = _told(fleet, fit, some, open_, centred[some], units)
        for i, parameters in zip(some.tolist(), told, strict=True):
            found[i] = parameters
    cost = np.choose(chosen, [fit.cost for fit in fits])
    return FleetFit(
        parameters=tuple(found),
        sound=sound,
        intersample=tuple(fleet.members[k].intersample for k in chosen.tolist()),
        undetermined=undetermined,
        fit_percent=100.0 * (1.0 - np.sqrt(cost / np.maximum(power, np.finfo(float).tiny))),
    )


def _fitted(fleet: Fleet, member: Member, centred: Real, means: Real, power: Real) -> _Fits:
    """Fit all records under one assumption."""
    z = centred @ member.basis.T
    outside = np.maximum(power - np.einsum("ij,ij->i", z, z), 0.0)
    theta = _descended(fleet, member, z, outside)
    value, _ = member.surface.at(theta)
    g = value[:, :-1]
    gain = np.einsum("ij,ij->i", z, g) / np.einsum("ij,ij->i", g, g)
    left = z - gain[:, None] * g
    bias = means - gain * value[:, -1]
    values, _ = fleet.figures.at(theta)
    return _Fits(
        member=member,
        theta=theta,
        gain=gain,
        bias=bias,
        cost=outside + np.einsum("ij,ij->i", left, left),
        left=left,
        figures={
            **dict(zip(fleet.names, values.T, strict=True)),
            "scale_factor": gain,
            "bias": bias,
        },
    )


def _weighed(fleet: Fleet, fits: list[_Fits], n: int) -> tuple[Real, NDArray[np.intp]]:
    """Criterion of each record under each assumption, and which is taken."""
    tiny = np.finfo(float).tiny
    criterion = np.stack([n * np.log(np.maximum(fit.cost, tiny)) for fit in fits])
    chosen = criterion.argmin(axis=0)
    modes = [member.intersample for member in fleet.members]
    if fleet.natural in modes:
        natural = modes.index(fleet.natural)
        likelier = criterion[natural] - criterion.min(axis=0) > 2 * LIKELIER
        chosen = np.where(likelier, chosen, natural)
    return criterion, chosen


def _told(
    fleet: Fleet,
    fit: _Fits,
    some: NDArray[np.intp],
    others: list[tuple[_Fits, Flags]],
    centred: Real,
    units: tuple[str, str],
) -> tuple[list[Parameters | None], Flags, Flags]:
    """Parameters of some records under the assumption that is taken; which are sound; which open.

    The records are `some` of those fitted; `others` tells which other assumptions stay possible.
    """
    member, theta, cost = fit.member, fit.theta[some], fit.cost[some]
    errors = _errors(fleet, fit, some)
    sound = _is_plain(member, theta, fit.gain[some], errors.variance) & errors.exact
    sound &= ~_asks_for_a_pole(fit, some, errors)
    apart = np.zeros(some.size, dtype=bool)
    for rival, stays in others:
        there = rival.theta[some]
        sound &= ~stays | _is_plain(
            rival.member, there, rival.gain[some], errors.variance, off=_ROUGH
        )
        apart |= stays & (np.abs(there[:, 0] - theta[:, 0]) > SHIFT)
    highest = min(fleet.band[1], fleet.fs / 2)
    if "natural_frequency" in fleet.names:  # beyond the band no peak is told
        sound &= fit.figures["natural_frequency"][some] < highest
    half = float(scipy.special.stdtrit(errors.freedom, 0.975))
    columns = {}
    for name, deviation in errors.deviations.items():
        value = fit.figures[name][some]
        moved = [np.where(stays, rival.figures[name][some] - value, 0.0) for rival, stays in others]
        columns[name] = _column(value, deviation, half, np.array([*moved, 0.0 * value]))
        if name in SIZES:
            sound &= ~_is_wide(columns[name])
    residual = centred - (fit.gain[some] * member.surface.at(theta)[0][:, :-1].T).T @ member.basis
    sound &= _leaves_noise(fleet, theta, residual, sound)
    found: list[Parameters | None] = [None] * some.size
    for i in np.flatnonzero(sound).tolist():
        told = {
            name: column.estimate(i, _unit(name, units))
            for name, column in columns.items()
            if not name.startswith("bandwidth") or column.value[i] <= highest
        }
        noise = noise_estimate(float(cost[i]), freedom=errors.freedom, share=1.0, unit=units[1])
        found[i] = Parameters(**told, noise_std=noise)
    return found, sound, apart


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Errors:
    """What the fits of some records leave uncertain; first axis of an array: the record."""

    rows: Real
    """Derivatives by place and gain, in the basis."""
    inner: Real
    """Inverse of their Gram matrix."""
    variance: Real
    freedom: int
    deviations: Mapping[str, Real]
    exact: Flags
    """Whether the polynomials of what is read off are exact enough."""


def _errors(fleet: Fleet, fit: _Fits, some: NDArray[np.intp]) -> _Errors:
    """Standard deviations of all that is told, to first order."""
    n, theta, gain = fleet.u.size, fit.theta[some], fit.gain[some]
    value, slope = fit.member.surface.at(theta)
    size = theta.shape[1]
    freedom = n - size - 2
    variance = fit.cost[some] / freedom
    rows = np.concatenate([gain[:, None, None] * slope[:, :, :-1], value[:, None, :-1]], axis=1)
    inner = np.linalg.pinv(np.einsum("iaj,ibj->iab", rows, rows), rcond=1e-13, hermitian=True)
    covariance = variance[:, None, None] * inner
    _, steep = fleet.figures.at(theta)
    spread = np.einsum("iak,iab,ibk->ik", steep, covariance[:, :size, :size], steep)
    deviations = np.sqrt(np.maximum(spread, 0.0))
    # The bias is the mean less what the model makes of it; the mean's own error is apart.
    by_mean = -np.concatenate([gain[:, None] * slope[:, :, -1], value[:, -1:]], axis=1)
    of_bias = np.einsum("ia,iab,ib->i", by_mean, covariance, by_mean) + variance / n
    return _Errors(
        rows=rows,
        inner=inner,
        variance=variance,
        freedom=freedom,
        deviations={
            **dict(zip(fleet.names, deviations.T, strict=True)),
            "scale_factor": np.sqrt(covariance[:, size, size]),
            "bias": np.sqrt(of_bias),
        },
        exact=(fleet.figures.error <= _OFF * deviations + 1e-12).all(axis=1),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Column:
    """One parameter of many records, each array of shape (N,)."""

    value: Real
    std: Real
    low: Real
    high: Real
    widened: Flags

    def estimate(self, i: int, unit: str) -> Estimate:
        """Of one record; an interval that covers several models has no deviation."""
        return Estimate(
            value=float(self.value[i]),
            std=None if self.widened[i] else float(self.std[i]),
            ci95=(float(self.low[i]), float(self.high[i])),
            unit=unit,
        )


def _column(value: Real, std: Real, half: float, moved: Real) -> _Column:
    """Intervals that cover what other assumptions, (k, N), move, as `spanned` widens them."""
    below, above = np.minimum(moved.min(axis=0), 0.0), np.maximum(moved.max(axis=0), 0.0)
    widened = np.maximum(above, -below) > MOVES * half * std
    low = value - half * std + np.where(widened, below, 0.0)
    high = value + half * std + np.where(widened, above, 0.0)
    return _Column(value=value, std=std, low=low, high=high, widened=widened)


def _is_wide(column: _Column) -> Flags:
    """Whether what several models allow is no figure any more."""
    return np.asarray(column.widened & (column.high - column.low > 2 * WIDE * np.abs(column.value)))


def _asks_for_a_pole(fit: _Fits, some: NDArray[np.intp], errors: _Errors) -> Flags:
    """Whether a record asks for one more pole by more than chance, as the score test has it."""
    row = fit.gain[some, None] * fit.member.grown.at(fit.theta[some])[0]
    along = np.einsum("iab,ibj,ij->ia", errors.inner, errors.rows, row)
    own = row - np.einsum("ia,iaj->ij", along, errors.rows)  # what no other parameter can do
    score = np.einsum("ij,ij->i", own, fit.left[some])
    power = np.einsum("ij,ij->i", own, own) * fit.cost[some] / (errors.freedom - 1)
    return np.asarray(score > BY_CHANCE * np.sqrt(power))


_UNITS = {
    "damping_ratio": "", "peak_gain_db": "dB", "natural_frequency": "Hz",
    "bandwidth_phase90": "Hz", "bandwidth_phase90_without_delay": "Hz", "bandwidth_3db": "Hz",
    "delay": "s", "delay_low_frequency": "s", "time_constant": "s",
}  # fmt: skip


def _unit(name: str, units: tuple[str, str]) -> str:
    given, got = units
    if name == "bias":
        return got
    if name == "scale_factor":
        return "" if given == got else f"{got or '1'}/{given}" if given else got
    return _UNITS.get(name, "")


def _descended(fleet: Fleet, member: Member, z: Real, outside: Real) -> Real:
    """Gauss-Newton for all records at once, the gain solved exactly at each step."""
    low, high = member.surface.low, member.surface.high
    theta = np.tile((low + high) / 2, (z.shape[0], 1))
    step = np.zeros_like(theta)
    share = np.ones(z.shape[0])
    before, best = np.full(z.shape[0], np.inf), theta.copy()
    for _ in range(_STEPS):
        value, slope = member.surface.at(theta)
        g, dg = value[:, :-1], slope[:, :, :-1]
        square = np.einsum("ij,ij->i", g, g)
        gain = np.einsum("ij,ij->i", z, g) / square
        left = z - gain[:, None] * g
        cost = outside + np.einsum("ij,ij->i", left, left)
        better = cost < before
        best[better], before = theta[better], np.minimum(cost, before)
        rows = gain[:, None, None] * dg
        along = np.einsum("iaj,ij->ia", rows, g) / square[:, None]
        rows = rows - along[:, :, None] * g[:, None, :]
        moment = np.einsum("iaj,ij->ia", rows, left)
        gram = np.einsum("iaj,ibj->iab", rows, rows)
        gram += 1e-9 * np.einsum("iaa->ia", gram)[:, :, None] * np.eye(gram.shape[1])
        fresh = np.linalg.solve(gram, moment[:, :, None])[:, :, 0]
        step = np.where(better[:, None], fresh, step)
        share = np.where(better, 1.0, share / 4)
        gained = np.einsum("ia,ia->i", fresh, moment)
        if (gained < 1e-6 * cost / fleet.u.size).all():
            break
        theta = np.clip(best + share[:, None] * step, low, high)
    return best


def _is_plain(
    member: Member, theta: Real, gain: Real, variance: Real, *, off: float = _OFF
) -> Flags:
    """Whether each unit lies inside the box, and the surface is exact enough for its noise."""
    inside = member.surface.holds(theta) & np.isfinite(theta).all(axis=1)
    return np.asarray(inside & (np.abs(gain) * member.lost <= off * np.sqrt(variance)))


def _leaves_noise(fleet: Fleet, theta: Real, residual: Real, asked: Flags) -> Flags:
    """Which records that are asked for leave white noise that does not follow the stimulus."""
    plain = asked.copy()
    band = (fleet.band[0] / fleet.fs, fleet.band[1] / fleet.fs)
    for i in np.flatnonzero(asked).tolist():
        left = residual[i]
        plain[i] = (
            is_white(left)
            and misfit(fleet.u, left, delay=float(theta[i, 0]), band=band).probability > _CHANCE
        )
    return plain
