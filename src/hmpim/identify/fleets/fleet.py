"""Many records of one stimulus and of second order, fitted together in a common basis.

The basis comes from `learnt.py`. Each output is projected on it once, and all are fitted at once by
the same least squares as `hmpim.identify`, in a few numbers instead of thousands. Every assumption
on what the stimulus does between its samples is tried, and those that the record does not exclude
widen the intervals, as in `hmpim.identify.reading.spanned`. The few records that support one more
pole by chance, one in twenty, or a zero, one in forty, are fitted by themselves, as `identify`
does.

The parameters and their errors are those of a fit to the record itself, as long as the errors of
the basis and the polynomials are small compared with a standard deviation. `FleetFit.sound` says
where that holds, where the unit lies inside the box, where the residual is white and does not
follow the input, and where no pole is to be added. All other records are left to `identify`.
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
from hmpim.identify.fleets.learnt import Fleet, Member
from hmpim.identify.fleets.pole import with_tails
from hmpim.identify.judgement.structure import ALMOST
from hmpim.identify.noise.misfit import misfits
from hmpim.identify.noise.whiteness import are_white
from hmpim.identify.reading.figures import units_of
from hmpim.identify.result import Estimate, Parameters, fit_percent
from hmpim.identify.result.error_bars import noise_estimate
from hmpim.identify.result.groups import SIZES
from hmpim.identify.worth import FEW, PART
from hmpim.record import Intersample

__all__ = [
    "Column",
    "FleetFit",
    "Group",
    "fit_fleet",
    "parameters_of",
    "widen",
]

_ASKS = 0.98 * ONE_SIDED
"""Standard deviations from which one more pole is tested: a little early, as the basis is not
exact; the fit to the record itself then decides."""

_COVERED = 0.98 * HALF
"""The same on the other side, from which on a zero or a pair of poles is covered."""

_CLOSE = 0.98 * ALMOST
"""The same, from which on `identify` reports that other dynamics are almost required."""


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
        """A column of some records without a figure."""
        return cls(**{k: np.full(count, np.nan) for k in _ENDS}, unit=unit)

    def estimate(self, i: int) -> Estimate | None:
        """The figure of one record."""
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
        """A copy to write to."""
        return Column(**{end: getattr(self, end).copy() for end in _ENDS}, unit=self.unit)

    def put(self, some: NDArray[np.intp], other: "Column", kept: Mask) -> None:
        """Copy figures of some records from another column, where they are kept."""
        for end in _ENDS:
            getattr(self, end)[some[kept]] = getattr(other, end)[kept]


_ENDS = ("value", "std", "low", "high")


def parameters_of(columns: Mapping[str, Column], i: int) -> Parameters:
    """Return the figures of one record."""
    return Parameters(**{name: column.estimate(i) for name, column in columns.items()})


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Group:
    """The k records for which one assumption is chosen."""

    fit: Fits  # all records under that assumption
    some: NDArray[np.intp]  # (k,): indices of the group's records
    # all records under each other assumption, and for which of the k it remains possible
    others: list[tuple[Fits, Mask]]
    errors: Errors  # of the fit
    residual: Real  # (k, n)
    alone: dict[str, Column]  # figures with intervals of this fit alone
    spanned: dict[str, Column]  # figures with intervals that cover all possible models
    tails: dict[int, float]  # delay with one more pole, in s, where it is possible
    sound: Mask  # (k,): as in `FleetFit`
    codes: list[tuple[str, ...]]  # as in `FleetFit`

    def has_tail(self, k: int) -> bool:
        """Whether intervals of a record cover one more pole or zero."""
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
    sound: Mask  # (N,): whether they equal the results of `identify`
    intersample: tuple[Intersample, ...]  # the likeliest assumption for each
    # codes of the findings of `identify`: 'intersample' where another assumption would move the
    # delay and is not excluded, 'structure' where one more pole is as likely
    codes: tuple[tuple[str, ...], ...]
    fit_percent: Real  # (N,): 100 (1 - ||y - ŷ|| / ||y - mean y||)
    groups: tuple[Group, ...]  # the records by the chosen assumption, with intermediate results


def fit_fleet(fleet: Fleet, outputs: Real, *, units: tuple[str, str] = ("", "")) -> FleetFit:
    """Fit many outputs, (N, n), of one stimulus at once; `units` are those of input and output."""
    count, n = outputs.shape
    means = outputs.mean(axis=1)
    centred = outputs - means[:, None]
    power = np.vecdot(centred, centred)
    fits = fitted_all(fleet, centred, means, power)
    behind, chosen = _weighed(fleet, fits, n)
    names = (*fleet.names, "scale_factor", "bias", "noise_std")
    unit_of = units_of(fleet.structure, units)
    columns = {name: Column.empty(count, unit_of[name]) for name in names}
    sound = np.zeros(count, dtype=bool)
    codes: list[tuple[str, ...]] = [()] * count
    groups: list[Group] = []
    for k, fit in enumerate(fits):
        some = np.flatnonzero(chosen == k)
        if some.size == 0:
            continue
        others = [
            (rival, behind[j, some] - behind[k, some] < 2 * CLEARLY)
            for j, rival in enumerate(fits)
            if j != k
        ]
        group = _group_of(fleet, fit, some, others, outputs[some], unit_of)
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
        fit_percent=fit_percent(cost, power),
        groups=tuple(groups),
    )


def _weighed(fleet: Fleet, fits: list[Fits], n: int) -> tuple[Real, NDArray[np.intp]]:
    """Criterion of each record under each assumption, and the chosen assumption."""
    tiny = np.finfo(float).tiny
    criterion = np.stack([n * np.log(np.maximum(fit.cost, tiny)) for fit in fits])
    chosen = criterion.argmin(axis=0)
    modes = [member.intersample for member in fleet.members]
    if fleet.natural in modes:
        natural = modes.index(fleet.natural)
        likelier = criterion[natural] - criterion.min(axis=0) > 2 * LIKELIER
        chosen = np.where(likelier, chosen, natural)
    return criterion, chosen


def _group_of(
    fleet: Fleet,
    fit: Fits,
    some: NDArray[np.intp],
    others: list[tuple[Fits, Mask]],
    outputs: Real,
    units: Mapping[str, str],
) -> Group:
    """Read and test some records under the chosen assumption."""
    theta = fit.theta[some]
    errors = errors_of(fleet, fit, some)
    sound = _is_plain(fit.member, theta, fit.gain[some], errors.variance) & errors.exact
    apart = np.zeros(some.size, dtype=bool)
    for rival, possible in others:
        there, gain = rival.theta[some], rival.gain[some]
        sound &= ~possible | _is_plain(rival.member, there, gain, errors.variance, off=PART)
        apart |= possible & (np.abs(there[:, 0] - theta[:, 0]) > FEW)
    sound &= fit.figures["natural_frequency"][some] < fleet.highest  # no peak is known beyond it
    score = _score_of_a_pole(fit, some, errors)
    sound &= score > -_CLOSE
    model = fit.gain[some, None] * fit.member.surface.values(theta)[:, :-1] @ fit.member.basis
    residual = outputs - outputs.mean(axis=1, keepdims=True) - model
    sound[sound] = _leaves_noise(fleet, theta[sound], residual[sound])
    sound[sound] = _is_continuous(outputs[sound], fleet.fs)
    alone, spanned = _columns(fleet, fit, some, others, errors, units)
    codes = [("intersample",) * moved for moved in apart.tolist()]
    tails: dict[int, float] = {}
    for i in np.flatnonzero(sound & ((score > _ASKS) | (score < -_COVERED))).tolist():
        own = parameters_of(alone, i)
        tail = with_tails(fleet, fit.member, theta[i], outputs[i], own)
        sound[i] = tail is not None and (tail[1] is not None or score[i] < _CLOSE)
        if tail is None:
            continue
        wide, delay = tail
        widen(spanned, i, own, wide)
        if delay is not None:
            codes[i] = ("structure", *codes[i])
            tails[i] = delay
    for name, column in spanned.items():
        if name in SIZES:  # an interval over several models may be too wide for a figure
            wide_open = column.high - column.low > PART * np.abs(column.value)
            sound &= ~(np.isnan(column.std) & wide_open)
    return Group(
        fit=fit,
        some=some,
        others=others,
        errors=errors,
        residual=residual,
        alone=alone,
        spanned=spanned,
        tails=tails,
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
    """Figures of some fits alone, and with intervals that cover the other assumptions.

    No bandwidth is read off beyond the band, as in `read_parameters`.
    """
    half = float(scipy.special.stdtrit(errors.freedom, 0.975))
    alone, spanned = {}, {}
    for name, std in errors.deviations.items():
        value, unit = fit.figures[name][some], units[name]
        beyond = name.startswith("bandwidth") & (value > fleet.highest)
        value, std = (np.where(beyond, np.nan, x) for x in (value, std))
        column = partial(Column, value=value, unit=unit)
        moved = [np.where(on, rival.figures[name][some] - value, 0.0) for rival, on in others]
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
    """Let the intervals of one record cover `tails`, which `spanned` made from `own`."""
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


def _score_of_a_pole(fit: Fits, some: NDArray[np.intp], errors: Errors) -> Real:
    """Score test of one more pole for some records, in standard deviations."""
    row = fit.gain[some, None] * fit.member.grown.values(fit.theta[some])
    along = (errors.inner @ (errors.rows @ row[:, :, None]))[:, :, 0]
    own = row - np.einsum("ia,iaj->ij", along, errors.rows)  # no other parameter imitates this
    score = np.vecdot(own, fit.left[some])
    power = np.vecdot(own, own) * fit.cost[some] / (errors.freedom - 1)
    return np.asarray(score / np.sqrt(np.maximum(power, np.finfo(float).tiny)))


def _is_plain(member: Member, theta: Real, gain: Real, variance: Real, *, off: float = FEW) -> Mask:
    """Which units lie inside the box, with a surface that is exact enough for their noise."""
    inside = member.surface.holds(theta) & np.isfinite(theta).all(axis=1)
    return np.asarray(inside & (np.abs(gain) * member.lost <= off * np.sqrt(variance)))


def _leaves_noise(fleet: Fleet, theta: Real, residual: Real) -> Mask:
    """Which residuals are white noise that does not follow the stimulus."""
    if residual.shape[0] == 0:
        return np.zeros(0, dtype=bool)
    spectra = scipy.fft.rfft(residual)
    *_, probability = misfits(
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
        any_of = (found.saturation, found.hold, found.quantization, found.repeated, found.levels)
        plain[i] = all(effect is None for effect in any_of)
    return np.asarray(plain)
