"""Many records of one stimulus and of second order: fitted together, by what they share.

`learnt.py` tells what that is. Each output is one product with the basis, and all are fitted at
once by the same least squares as `hmpim.identify`, in a few numbers instead of thousands.
The basis is the stimulus' transforms and Gram matrix, made once for all. Every assumption on what
the stimulus does between its samples is tried, and what the record does not exclude widens the
intervals, as `hmpim.identify.reading.spanned` does it. The few records that ask by chance for one
more pole, one in twenty, or for a zero, one in forty, are fitted by themselves, as `identify` does.

The parameters and their errors are those of a fit to the record itself, as long as what the basis
and the polynomials are off is small beside a standard deviation: `FleetFit.sound` says where it is,
where the unit lies inside the box, where the residual is white and does not follow the input, and
where no pole is to be added. All other records are for `identify`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from math import isnan

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.chance import CLEARLY, FALSE_ALARM, HALF, LIKELIER, ONE_SIDED
from hmpim.identify.effects.imperfections import find_imperfections
from hmpim.identify.fleets.fits import Errors, Fits, errors_of, fitted_all
from hmpim.identify.fleets.learnt import Fleet, Member, learn_fleet
from hmpim.identify.fleets.pole import with_tails
from hmpim.identify.judgement.between_samples import SIZES
from hmpim.identify.judgement.structure import ALMOST
from hmpim.identify.noise.misfit import misfits
from hmpim.identify.noise.whiteness import are_white
from hmpim.identify.reading.figures import units_of
from hmpim.identify.result import Estimate, Parameters
from hmpim.identify.result.error_bars import noise_estimate
from hmpim.identify.worth import FEW, PART
from hmpim.record import Intersample

__all__ = [
    "Column",
    "Fleet",
    "FleetFit",
    "Group",
    "fit_fleet",
    "learn_fleet",
    "parameters_of",
    "widen",
]

_ASKS = 0.98 * ONE_SIDED
"""Standard deviations from which one more pole is asked for: a little early, as the basis is not
exact; the fit to the record itself then decides."""

_COVERED = 0.98 * HALF
"""The same on the other side, from which on a zero or a pair of poles is covered."""

_CLOSE = 0.98 * ALMOST
"""The same, from which on `identify` says that it almost asks for other dynamics."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Column:
    """One parameter of many records, each array of shape (N,); NaN where there is none."""

    # (N,): as `Estimate` has them; `std` is NaN where an interval covers several models
    value: Real
    std: Real
    low: Real
    high: Real
    unit: str  # of all of them

    @classmethod
    def empty(cls, count: int, unit: str) -> "Column":
        """So many records without a figure."""
        return cls(**{k: np.full(count, np.nan) for k in _ENDS}, unit=unit)

    def estimate(self, i: int) -> Estimate | None:
        """Of one record."""
        value, std = float(self.value[i]), float(self.std[i])
        if isnan(value):
            return None
        return Estimate(
            value=value,
            std=None if isnan(std) else std,
            ci95=(float(self.low[i]), float(self.high[i])),
            unit=self.unit,
        )

    def copy(self) -> "Column":
        """Another to write to."""
        return Column(**{end: getattr(self, end).copy() for end in _ENDS}, unit=self.unit)

    def put(self, some: NDArray[np.intp], other: "Column", kept: Mask) -> None:
        """Take those records of another that are kept."""
        for end in _ENDS:
            getattr(self, end)[some[kept]] = getattr(other, end)[kept]


_ENDS = ("value", "std", "low", "high")


def parameters_of(columns: Mapping[str, Column], i: int) -> Parameters:
    """Return the figures of one record."""
    return Parameters(**{name: column.estimate(i) for name, column in columns.items()})


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Group:
    """Records for which one assumption is taken; k of them."""

    fit: Fits  # all records under that assumption
    some: NDArray[np.intp]  # (k,): which they are
    # all records under each other assumption, and of which of these it stays possible
    others: list[tuple[Fits, Mask]]
    errors: Errors  # what the fit leaves uncertain
    residual: Real  # (k, n): what it leaves over
    # figures with intervals of this fit alone, and such as cover all that stays possible
    alone: dict[str, Column]
    spanned: dict[str, Column]
    # delay with one more pole, in s, of those that ask for it, by their place among these
    tails: dict[int, float]
    sound: Mask  # (k,): as in `FleetFit`
    codes: list[tuple[str, ...]]  # as in `FleetFit`

    def has_tail(self, k: int) -> bool:
        """Whether intervals of one of them cover one more pole or zero."""
        return any(
            not np.isnan(column.std[k]) and column.std[k] != self.alone[name].std[k]
            for name, column in self.spanned.items()
            if name in self.alone and not np.isnan(column.value[k])
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FleetFit:
    """Parameters of many records."""

    # parameters by name, without the paper's delay; NaN in those of a record that is not sound
    columns: Mapping[str, Column]
    sound: Mask  # (N,): whether they are what `identify` would say
    intersample: tuple[Intersample, ...]  # the likeliest assumption for each
    # codes of what `identify` would say beside it: 'intersample' where another assumption would
    # move the delay and is not excluded, 'structure' where one more pole is as likely
    codes: tuple[tuple[str, ...], ...]
    fit_percent: Real  # (N,): 100 (1 - ||y - ŷ|| / ||y - mean y||)
    # the records by the assumption that is taken, and all that was found on the way
    groups: tuple[Group, ...]


def fit_fleet(fleet: Fleet, outputs: Real, *, units: tuple[str, str] = ("", "")) -> FleetFit:
    """Fit many outputs, (N, n), of one stimulus at once; units are those of input and output."""
    count, n = outputs.shape
    means = outputs.mean(axis=1)
    centred = outputs - means[:, None]
    power = np.vecdot(centred, centred)
    fits = fitted_all(fleet, centred, means, power)
    behind, chosen = _weighed(fleet, fits, n)
    names = (*fleet.names, "scale_factor", "bias", "noise_std")
    told = units_of(fleet.structure, units)
    columns = {name: Column.empty(count, told[name]) for name in names}
    sound = np.zeros(count, dtype=bool)
    codes: list[tuple[str, ...]] = [()] * count
    groups: list[Group] = []
    for k, fit in enumerate(fits):
        some = np.flatnonzero(chosen == k)
        if some.size == 0:
            continue
        open_ = [
            (rival, behind[j, some] - behind[k, some] < 2 * CLEARLY)
            for j, rival in enumerate(fits)
            if j != k
        ]
        group = _told(fleet, fit, some, open_, outputs[some], told)
        groups.append(group)
        sound[some] = group.sound
        for name, column in group.spanned.items():
            columns[name].put(some, column, group.sound)
        for i, own in zip(some.tolist(), group.codes, strict=True):
            codes[i] = own
    cost = np.choose(chosen, [fit.cost for fit in fits])
    return FleetFit(
        columns=columns,
        sound=sound,
        intersample=tuple(fleet.members[k].intersample for k in chosen.tolist()),
        codes=tuple(codes),
        fit_percent=100.0 * (1.0 - np.sqrt(cost / np.maximum(power, np.finfo(float).tiny))),
        groups=tuple(groups),
    )


def _weighed(fleet: Fleet, fits: list[Fits], n: int) -> tuple[Real, NDArray[np.intp]]:
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
    fit: Fits,
    some: NDArray[np.intp],
    others: list[tuple[Fits, Mask]],
    outputs: Real,
    units: Mapping[str, str],
) -> Group:
    """Parameters of some records under the assumption that is taken; which are sound; what is said.

    The records are `some` of those fitted; `others` tells which other assumptions stay possible.
    """
    theta = fit.theta[some]
    errors = errors_of(fleet, fit, some)
    sound = _is_plain(fit.member, theta, fit.gain[some], errors.variance) & errors.exact
    apart = np.zeros(some.size, dtype=bool)
    for rival, stays in others:
        there = rival.theta[some]
        sound &= ~stays | _is_plain(
            rival.member, there, rival.gain[some], errors.variance, off=PART
        )
        apart |= stays & (np.abs(there[:, 0] - theta[:, 0]) > FEW)
    sound &= fit.figures["natural_frequency"][some] < fleet.highest  # beyond it no peak is told
    asked = _asks_for_a_pole(fit, some, errors)
    sound &= asked > -_CLOSE
    model = fit.gain[some, None] * fit.member.surface.values(theta)[:, :-1] @ fit.member.basis
    residual = outputs - outputs.mean(axis=1, keepdims=True) - model
    sound[sound] = _leaves_noise(fleet, theta[sound], residual[sound])
    sound[sound] = _is_continuous(outputs[sound], fleet.fs)
    alone, spanned = _columns(fleet, fit, some, others, errors, units)
    codes = [("intersample",) * moved for moved in apart.tolist()]
    asking: dict[int, float] = {}
    for i in np.flatnonzero(sound & ((asked > _ASKS) | (asked < -_COVERED))).tolist():
        own = parameters_of(alone, i)
        tails = with_tails(fleet, fit.member, theta[i], outputs[i], own)
        sound[i] = tails is not None and (tails[1] is not None or asked[i] < _CLOSE)
        if tails is None:
            continue
        wide, delay = tails
        widen(spanned, i, own, wide)
        if delay is not None:
            codes[i] = ("structure", *codes[i])
            asking[i] = delay
    for name in SIZES:
        if name in spanned:
            sound &= ~_is_wide(spanned[name])
    for name in spanned:
        if name.startswith("bandwidth"):
            beyond = spanned[name].value > fleet.highest
            for end in _ENDS:
                getattr(spanned[name], end)[beyond] = np.nan
    return Group(
        fit=fit,
        some=some,
        others=others,
        errors=errors,
        residual=residual,
        alone=alone,
        spanned=spanned,
        tails=asking,
        sound=sound,
        codes=codes,
    )


def _columns(
    fleet: Fleet,
    fit: Fits,
    some: NDArray[np.intp],
    others: list[tuple[Fits, Mask]],
    errors: Errors,
    units: Mapping[str, str],
) -> tuple[dict[str, Column], dict[str, Column]]:
    """What some fits tell alone, and with intervals that cover the other assumptions."""
    half = float(scipy.special.stdtrit(errors.freedom, 0.975))
    alone, spanned = {}, {}
    for name, std in errors.deviations.items():
        value, unit = fit.figures[name][some], units[name]
        column = partial(Column, value=value, unit=unit)
        moved = [np.where(stays, rival.figures[name][some] - value, 0.0) for rival, stays in others]
        every = np.array([0.0 * value, *moved])
        below, above = every.min(axis=0), every.max(axis=0)
        widened = np.maximum(above, -below) > FEW * half * std
        low, high = value - half * std, value + half * std
        alone[name] = column(std=std, low=low, high=high)
        spanned[name] = column(
            std=np.where(widened, np.nan, std),
            low=np.where(widened, low + below, low),
            high=np.where(widened, high + above, high),
        )
    size = np.sqrt(fit.cost[some])
    single = noise_estimate(1.0, freedom=errors.freedom, share=1.0)
    ends = single.ci95 or (None, None)
    noise = Column(
        value=size * single.value,
        std=size * (single.std or np.nan),
        low=size * (ends[0] or np.nan),
        high=size * (ends[1] or np.nan),
        unit=units["noise_std"],
    )
    return {**alone, "noise_std": noise}, {**spanned, "noise_std": noise}


def widen(columns: dict[str, Column], i: int, own: Parameters, tails: Parameters) -> None:
    """Let the intervals of one record cover what `spanned` made of its own, and what they cover."""
    for name, column in columns.items():
        tail = getattr(tails, name)
        if tail is None or tail.ci95 is None or tail is getattr(own, name):
            continue
        low, high = tail.ci95
        if np.isnan(column.std[i]):  # it covers other assumptions as well
            low, high = min(low, column.low[i]), max(high, column.high[i])
        else:
            column.std[i] = tail.spread
        column.low[i], column.high[i] = low, high


def _is_wide(column: Column) -> Mask:
    """Whether what several models allow is no figure any more."""
    return np.asarray(
        np.isnan(column.std) & (column.high - column.low > PART * np.abs(column.value))
    )


def _asks_for_a_pole(fit: Fits, some: NDArray[np.intp], errors: Errors) -> Real:
    """By how many standard deviations records ask for one more pole, as the score test has it."""
    row = fit.gain[some, None] * fit.member.grown.values(fit.theta[some])
    along = (errors.inner @ (errors.rows @ row[:, :, None]))[:, :, 0]
    own = row - np.einsum("ia,iaj->ij", along, errors.rows)  # what no other parameter can do
    score = np.vecdot(own, fit.left[some])
    power = np.vecdot(own, own) * fit.cost[some] / (errors.freedom - 1)
    return np.asarray(score / np.sqrt(np.maximum(power, np.finfo(float).tiny)))


def _is_plain(member: Member, theta: Real, gain: Real, variance: Real, *, off: float = FEW) -> Mask:
    """Whether each unit lies inside the box, and the surface is exact enough for its noise."""
    inside = member.surface.holds(theta) & np.isfinite(theta).all(axis=1)
    return np.asarray(inside & (np.abs(gain) * member.lost <= off * np.sqrt(variance)))


def _leaves_noise(fleet: Fleet, theta: Real, residual: Real) -> Mask:
    """Which residuals are white noise that does not follow the stimulus."""
    if residual.shape[0] == 0:
        return np.zeros(0, dtype=bool)
    spectra = scipy.fft.rfft(residual)
    _, probability = misfits(
        scipy.fft.rfft(fleet.u - fleet.u.mean()),
        spectra,
        samples=fleet.u.size,
        delays=theta[:, 0],
        band=(fleet.band[0] / fleet.fs, fleet.band[1] / fleet.fs),
    )
    return np.asarray(are_white(residual, spectra) & (probability > FALSE_ALARM))


def _is_continuous(outputs: Real, fs: float) -> Mask:
    """Which outputs show no rounding, hold, level or repetition: most take no value twice."""
    ordered = np.sort(outputs, axis=1)
    plain = (ordered[:, 1:] != ordered[:, :-1]).all(axis=1)
    for i in np.flatnonzero(~plain).tolist():
        found = find_imperfections(outputs[i], fs)
        seen = (found.saturation, found.hold, found.quantization, found.repeated, found.levels)
        plain[i] = all(what is None for what in seen)
    return np.asarray(plain)
