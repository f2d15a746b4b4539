"""Common properties of records of one stimulus and of second order, learnt from the first records.

The outputs of a model of one structure are a surface of few dimensions in the space of records.
This surface is sampled once over the box that contains the units of a fleet: an orthonormal basis
of some ten to sixty rows spans it, and a polynomial gives the coordinates of a model in the basis.
There is one such surface for each assumption on what the stimulus does between its samples, unless
that is stated, and a second one for the change that one more pole would cause.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.fitting.data import shifted
from hmpim.identify.fitting.growth import one_more_pole, with_pole
from hmpim.identify.fitting.rows import Part, Problem
from hmpim.identify.fleets.surface import Surface, places_in
from hmpim.identify.reading.figures import figures_at
from hmpim.identify.result import PairIdentification
from hmpim.identify.worth import FEW, NEARLY, PART
from hmpim.model.dynamics import STRUCTURES, Structure
from hmpim.model.sampled import SampledInput, prepare_input
from hmpim.record import BETWEEN, Intersample

__all__ = [
    "Fleet",
    "Member",
    "answers",
    "box_around",
    "in_basis",
    "is_alike",
    "learn_fleet",
    "theta_at",
]


_DEGREES = (9, 12, 15)
"""Degrees of a surface, tried in turn until its error is small compared with the noise."""

_SMOOTHER = 7
"""Degree for the figures of a model, and for the change that one more pole causes."""

_UNSEEN = 1e-9
"""Share of the greatest singular value below which a direction of the surface is left out."""

_MOST = 150
"""Greatest number of directions; a surface that has more is not represented."""

_CLEAR = 100.0
"""By how much the criterion must prefer the structure, so that no other widens its bars."""

_WIDE = 5.0
"""Half a side of the box, in deviations of the units that it is learnt from: with sixteen, one more
unit is outside once in 5000 (Student)."""

_APART = (0.1, 0.02, 0.02)
"""Shift by another assumption, in addition to half a sample: samples, and shares of ω and ζ."""

_PROBE = 0.3
"""Time constant, over the unit's own, at which one more pole is tried."""

_FEWEST = 5

_EFFECTS = ("hold_period", "saturation_low", "saturation_high", "quantization_step")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Member:
    """The surface under one assumption."""

    intersample: Intersample  # what the stimulus does between its samples
    basis: Real  # (r, n): orthonormal, each row without mean
    # coordinates in the basis, and the mean in the last column, of the unit-gain response; a
    # function of the delay in samples and of the logarithms of ω and ζ
    surface: Surface
    # coordinates of the change that one more pole causes, over the square of its time constant
    grown: Surface
    lost: float  # largest norm of the error of the basis and the surface
    source: SampledInput  # the stimulus, prepared


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fleet:
    """Common properties of records of one stimulus."""

    u: Real  # (n,): the stimulus
    fs: float  # rate in Hz
    band: tuple[float, float]  # excited band in Hz
    structure: Structure  # of every unit
    natural: Intersample  # assumption that is kept unless another is likelier at odds of 20
    members: tuple[Member, ...]  # one for each possible assumption
    figures: Surface  # figures of a model of unit gain, in the order of `names`
    names: tuple[str, ...]  # fields of `Parameters`

    @property
    def highest(self) -> float:
        """Frequency in Hz beyond which no figure is read off."""
        return min(self.band[1], self.fs / 2)


def learn_fleet(
    u: Real, pairs: Sequence[PairIdentification], *, fs: float, band: tuple[float, float]
) -> Fleet | None:
    """Learn the common properties of a fleet from some units; None where most are not of one kind.

    The stimulus, (n,), is common to all; `pairs` are results of `identify` for five units or more;
    rate and excited band are in Hz.
    """
    structure = STRUCTURES["second_order"]
    plain = [pair for pair in pairs if is_alike(pair)]
    modes = [pair.intersample for pair in plain]
    found = max(BETWEEN, key=modes.count)
    alike = [pair for pair in plain if pair.intersample == found]
    if len(alike) < max(_FEWEST, NEARLY * len(pairs)):
        return None
    tried = {c.intersample for c in alike[0].candidates if c.structure == structure.name}
    open_ = tuple(mode for mode in BETWEEN if mode in tried)
    own = _box(alike, fs)
    boxes = {mode: _moved(own, found, mode) for mode in open_}
    low = np.min([box[0] for box in boxes.values()], axis=0)
    high = np.max([box[1] for box in boxes.values()], axis=0)
    places = places_in(low, high, _SMOOTHER)
    read = [_figures_at(theta_at(place), structure, fs) for place in places]
    names = tuple(read[0])
    if any(tuple(r) != names for r in read):
        return None  # some units of the box lack a figure that others have
    values = np.array([list(r.values()) for r in read])
    natural: Intersample = "bandlimited" if len(open_) > 1 else found
    noises = [
        noise.value / abs(gain.value) if noise is not None and gain is not None else 0.0
        for noise, gain in ((pair.noise_std, pair.scale_factor) for pair in alike)
    ]
    noise = float(np.median(noises))
    enough = {mode: noise * (FEW if mode == natural else PART) for mode in open_}
    return Fleet(
        u=u,
        fs=fs,
        band=band,
        structure=structure,
        natural=natural,
        members=tuple(
            _member(u, structure, mode, *boxes[mode], enough=enough[mode]) for mode in open_
        ),
        figures=Surface.fitted(low, high, places, values, degree=_SMOOTHER),
        names=names,
    )


def is_alike(pair: PairIdentification) -> bool:
    """Whether a unit is clearly of second order, without any doubt or imperfection."""
    if pair.structure != "second_order":  # a second pole is never clearly absent
        return False
    rivals = [c.criterion for c in pair.candidates if c.structure != pair.structure]
    chosen = next((c.criterion for c in pair.candidates if c.chosen), np.inf)
    return (
        pair.verdict == "ok"
        and all(w.severity == "info" for w in pair.warnings)
        and min(rivals, default=np.inf) - chosen > _CLEAR
        and all(getattr(pair.parameters, name) is None for name in _EFFECTS)
    )


def _box(pairs: Sequence[PairIdentification], fs: float) -> tuple[Real, Real]:
    """The box that contains the units of a fleet, under the assumption chosen for these units.

    A unit lies at its delay in samples and the logarithms of ω and ζ. The error of a delay is that
    of the fit alone: its interval may cover other models too, but a missing pole or zero does not
    move the best fit.
    """
    places, errors = [], []
    for pair in pairs:
        assert pair.delay is not None
        assert pair.covariance is not None
        second, first, unit = pair.denominator
        omega = float(np.sqrt(unit / second))
        zeta = first / unit * omega / 2
        places.append([pair.delay.value * fs, np.log(omega / fs), np.log(zeta)])
        errors.append(float(np.sqrt(pair.covariance[0, 0])))
    least = np.array([max(3 * (fs * max(errors)), 0.02), 0.005, 0.005])
    return box_around(np.array(places), least)


def box_around(places: Real, least: Real) -> tuple[Real, Real]:
    """Return the corners of a box that contains all but one in a thousand units like these.

    Some units lie at `places`, (k, d); `least`, (d,), are the smallest deviations between units
    that are assumed.

    Examples
    --------
    >>> low, high = box_around(np.array([[-1.0], [0.0], [1.0]]), np.array([0.1]))
    >>> low.round(2).tolist(), high.round(2).tolist()
    ([-7.41], [7.41])
    """
    middle = np.median(places, axis=0)
    # With so few units the median deviation alone may be too small by half.
    spread = np.maximum(
        1.4826 * np.median(np.abs(places - middle), axis=0), np.std(places, axis=0, ddof=1)
    )
    farthest = np.abs(places - middle).max(axis=0)
    reach = np.maximum(_WIDE * np.maximum(spread, least), 1.3 * farthest)
    return middle - reach, middle + reach


def _moved(box: tuple[Real, Real], found: Intersample, mode: Intersample) -> tuple[Real, Real]:
    """The box under another assumption."""
    apart = np.array(_APART) * (mode != found)
    away = shifted(np.zeros(3), found, mode)
    return box[0] + away - apart, box[1] + away + apart


def theta_at(place: Real) -> Real:
    """Return the parameters of a fit at a point of the box.

    ω and ζ are less correlated than the fit's own parameters, so that a box is smaller.
    """
    omega, zeta = np.exp(place[1:])
    return np.array([place[0], np.log(2 * zeta / omega), 0.25 / zeta**2])


def _member(
    u: Real, structure: Structure, mode: Intersample, low: Real, high: Real, *, enough: float
) -> Member:
    """The surface of the first degree whose error is small enough, or of the last degree."""
    source, smoother = prepare_input(u, mode), places_in(low, high, _SMOOTHER)
    lags = _PROBE * np.exp(-smoother[:, 1])  # over 1/ω, the unit's own
    poles = [
        with_pole(structure, theta_at(place), float(lag))
        for place, lag in zip(smoother, lags, strict=True)
    ]
    richer = answers(source, one_more_pole(structure), poles)
    for degree in _DEGREES:
        places = places_in(low, high, degree)  # `smoother` are the first of these
        rows = answers(source, structure, [theta_at(place) for place in places])
        grown = (richer - rows[: lags.size]) / lags[:, None] ** 2
        grown -= grown.mean(axis=1, keepdims=True)
        basis, values = in_basis(rows, grown)
        surface = Surface.fitted(low, high, places, values, degree=degree)
        left = rows - values @ np.vstack([basis, np.ones(source.samples)])
        lost = float(np.linalg.norm(left, axis=1).max() + np.linalg.norm(surface.error))
        if lost <= enough:
            break
    return Member(
        intersample=mode,
        basis=basis,
        surface=surface,
        grown=Surface.fitted(low, high, smoother, grown @ basis.T, degree=_SMOOTHER),
        lost=lost,
        source=source,
    )


def answers(source: SampledInput, structure: Structure, thetas: Iterable[Real]) -> Real:
    """Return the outputs of one structure of unit gain, (m, n), at some parameters."""
    size = source.samples
    problem = Problem(source=source, y=np.zeros(size), valid=None, longest_delay=float(size))
    return np.stack([Part(problem, structure, theta).driven(np.ones(1)) for theta in thetas])


def in_basis(rows: Real, *others: Real) -> tuple[Real, Real]:
    """Return an orthonormal basis, (r, n), of rows less their means, (m, n), and of other rows.

    Also returned are the coordinates of the rows, and their means in the last column, (m, r + 1).
    The basis is that of random sums of all rows, which span the same space if they are more than
    its dimensions: N. Halko, P. G. Martinsson, J. A. Tropp, SIAM Review 53, 2011.
    """
    means = rows.mean(axis=1, keepdims=True)
    rows = rows - means
    every = np.concatenate([rows, *others])
    sums = np.random.default_rng(0).standard_normal((min(_MOST, *every.shape), every.shape[0]))
    _, sizes, basis = np.linalg.svd(sums @ every, full_matrices=False)
    basis = np.asarray(basis[sizes > _UNSEEN * sizes[0]])
    return basis, np.hstack([rows @ basis.T, means])


def _figures_at(theta: Real, structure: Structure, fs: float) -> dict[str, float]:
    """Figures of the model of unit gain at a point of the box, up to half the rate."""
    vector = np.concatenate([theta, [1.0, 0.0]])
    found = figures_at(structure, vector, fs=fs, highest=fs / 2)
    own = ("scale_factor", "bias")
    return {name: v for name, v in found.items() if v is not None and name not in own}
