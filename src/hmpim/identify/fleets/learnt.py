"""What records of one stimulus and of second order share, learnt from the first of them.

What a model of one structure can make of one stimulus is a surface of few dimensions in the space
of records. Over the box in which the units of a fleet lie it is sampled once: an orthonormal basis
of some ten to sixty rows holds it, and a polynomial says where on it a model lies. There is one
such surface for each assumption on what the stimulus does between its samples, unless that is
stated, and beside each the surface of what one more pole would add.
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
"""Degrees of a surface, tried in turn until it is off by less than the noise lets be seen."""

_SMOOTHER = 7
"""Degree for what is read off a model, and for what one more pole adds."""

_UNSEEN = 1e-9
"""Share of the greatest singular value below which a direction of the surface is left out."""

_MOST = 150
"""Directions that are looked for at most; a surface that has more is not held by them."""

_CLEAR = 100.0
"""By how much the criterion must prefer the structure, so that no other widens its bars."""

_WIDE = 5.0
"""Half a side of the box, in deviations of the units that it is learnt from: of sixteen, what one
more unit exceeds once in 5000 (Student)."""

_APART = (0.1, 0.02, 0.02)
"""What another assumption moves beside half a sample: samples, and shares of ω and ζ."""

_PROBE = 0.3
"""Time constant, over the unit's own, at which one more pole is tried."""

_FEWEST = 5

_EFFECTS = ("hold_period", "saturation_low", "saturation_high", "quantization_step")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Member:
    """The surface under one assumption."""

    intersample: Intersample  # what the stimulus does between its samples
    basis: Real  # (r, n): orthonormal, each row without mean
    # places in the basis, and the mean in the last column, of the unit-gain response; a function of
    # the delay in samples and of the logarithms of ω and ζ
    surface: Surface
    # places in the basis of what one more pole adds, over the square of its time constant
    grown: Surface
    lost: float  # largest root of the sum of squares of what the basis and the surface leave out
    source: SampledInput  # the stimulus, prepared


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fleet:
    """What records of one stimulus share."""

    u: Real  # (n,): the stimulus
    fs: float  # rate in Hz
    band: tuple[float, float]  # excited band in Hz
    structure: Structure  # of every unit
    natural: Intersample  # assumption that stands unless another is likelier at odds of 20
    members: tuple[Member, ...]  # one for each assumption that is open
    figures: Surface  # what is read off a model of unit gain, in the order of `names`
    names: tuple[str, ...]  # fields of `Parameters`

    @property
    def highest(self) -> float:
        """Frequency in Hz beyond which nothing is read off."""
        return min(self.band[1], self.fs / 2)


def learn_fleet(
    u: Real, pairs: Sequence[PairIdentification], *, fs: float, band: tuple[float, float]
) -> Fleet | None:
    """Learn from some units what a fleet shares; None where most are not of one kind.

    The stimulus, (n,), is common to all; `pairs` are what `identify` said of five units or more;
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
        return None  # a figure that some units of the box have and others do not
    values = np.array([list(r.values()) for r in read])
    natural: Intersample = "bandlimited" if len(open_) > 1 else found
    noise = float(np.median([_noise_over_gain(pair) for pair in alike]))
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
    """Whether nothing but its structure, clearly, is said of a unit."""
    if pair.structure != "second_order":  # of a simpler one, a second pole is never clearly absent
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
    """Where units of the fleet lie, under the assumption under which they were found."""
    own = fs * max(_own_error(pair) for pair in pairs)
    least = np.array([max(3 * own, 0.02), 0.005, 0.005])
    return box_around(np.array([_place(pair, fs) for pair in pairs]), least)


def box_around(places: Real, least: Real) -> tuple[Real, Real]:
    """Return the corners of a box that holds units like these, all but one in a thousand.

    Some units lie at `places`, (k, d); `least`, (d,), are deviations between units that are allowed
    for anyway.

    Examples
    --------
    >>> low, high = box_around(np.array([[-1.0], [0.0], [1.0]]), np.array([0.1]))
    >>> low.round(2).tolist(), high.round(2).tolist()
    ([-7.41], [7.41])
    """
    middle = np.median(places, axis=0)
    # Of so few the median deviation alone may come out half as large as it is.
    spread = np.maximum(
        1.4826 * np.median(np.abs(places - middle), axis=0), np.std(places, axis=0, ddof=1)
    )
    farthest = np.abs(places - middle).max(axis=0)
    reach = np.maximum(_WIDE * np.maximum(spread, least), 1.3 * farthest)
    return middle - reach, middle + reach


def _moved(box: tuple[Real, Real], found: Intersample, mode: Intersample) -> tuple[Real, Real]:
    """Where they lie under another assumption."""
    apart = np.array(_APART) * (mode != found)
    away = shifted(np.zeros(3), found, mode)
    return box[0] + away - apart, box[1] + away + apart


def _own_error(pair: PairIdentification) -> float:
    """Deviation of a delay in s, of the fit alone: its interval may cover other models besides.

    The box is about where the best fit may lie, and a missing pole or zero does not move that.
    """
    assert pair.covariance is not None
    return float(np.sqrt(pair.covariance[0, 0]))


def _place(pair: PairIdentification, fs: float) -> Real:
    """Where a unit lies: delay in samples, logarithms of ω and ζ."""
    assert pair.delay is not None
    second, first, unit = pair.denominator
    omega = float(np.sqrt(unit / second))
    zeta = first / unit * omega / 2
    return np.array([pair.delay.value * fs, np.log(omega / fs), np.log(zeta)])


def theta_at(place: Real) -> Real:
    """Return the parameters of a fit at a place of a surface.

    ω and ζ move more independently of each other than the fit's own, so that a box is smaller.
    """
    omega, zeta = np.exp(place[1:])
    return np.array([place[0], np.log(2 * zeta / omega), 0.25 / zeta**2])


def _noise_over_gain(pair: PairIdentification) -> float:
    noise, gain = pair.noise_std, pair.scale_factor
    return 0.0 if noise is None or gain is None else noise.value / abs(gain.value)


def _member(
    u: Real, structure: Structure, mode: Intersample, low: Real, high: Real, *, enough: float
) -> Member:
    """The surface of the first degree that is off by no more than is enough, or of the last."""
    for degree in _DEGREES:
        found = _member_of(u, structure, mode, low, high, degree=degree)
        if found.lost <= enough:
            break
    return found


def _member_of(
    u: Real, structure: Structure, mode: Intersample, low: Real, high: Real, *, degree: int
) -> Member:
    source, richer = prepare_input(u, mode), one_more_pole(structure)
    places = places_in(low, high, degree)
    smoother = places_in(low, high, _SMOOTHER)  # the first of the others
    rows = answers(source, structure, [theta_at(place) for place in places])
    lags = _PROBE * np.exp(-smoother[:, 1])  # over 1/ω, the unit's own
    poles = [
        with_pole(structure, theta_at(place), float(lag))
        for place, lag in zip(smoother, lags, strict=True)
    ]
    grown = (answers(source, richer, poles) - rows[: lags.size]) / lags[:, None] ** 2
    grown -= grown.mean(axis=1, keepdims=True)
    basis, values = in_basis(rows, grown)
    surface = Surface.fitted(low, high, places, values, degree=degree)
    left = np.linalg.norm(rows - values @ np.vstack([basis, np.ones(source.samples)]), axis=1).max()
    return Member(
        intersample=mode,
        basis=basis,
        surface=surface,
        grown=Surface.fitted(low, high, smoother, grown @ basis.T, degree=_SMOOTHER),
        lost=float(left + np.linalg.norm(surface.error)),
        source=source,
    )


def answers(source: SampledInput, structure: Structure, thetas: Iterable[Real]) -> Real:
    """Return what one structure of unit gain makes of a stimulus, (m, n), at some parameters."""
    size = source.samples
    problem = Problem(source=source, y=np.zeros(size), valid=None, longest_delay=float(size))
    return np.stack([Part(problem, structure, theta).driven(np.ones(1)) for theta in thetas])


def in_basis(rows: Real, *others: Real) -> tuple[Real, Real]:
    """Return an orthonormal basis, (r, n), of rows less their means and of others without mean.

    Rows have shape (m, n). With it come their places in it, and their means in the last column,
    (m, r + 1). It is found from random sums of all rows: N. Halko, P. G. Martinsson, J. A. Tropp,
    SIAM Review 53, 2011: so many sums span the rows as well as all of them do, once they are more
    than the rows have dimensions.
    """
    means = rows.mean(axis=1, keepdims=True)
    rows = rows - means
    every = np.concatenate([rows, *others])
    sums = np.random.default_rng(0).standard_normal((min(_MOST, *every.shape), every.shape[0]))
    _, sizes, basis = np.linalg.svd(sums @ every, full_matrices=False)
    basis = np.asarray(basis[sizes > _UNSEEN * sizes[0]])
    return basis, np.hstack([rows @ basis.T, means])


def _figures_at(theta: Real, structure: Structure, fs: float) -> dict[str, float]:
    """What is read off the model of unit gain at a place, up to half the rate."""
    vector = np.concatenate([theta, [1.0, 0.0]])
    found = figures_at(structure, vector, fs=fs, highest=fs / 2)
    own = ("scale_factor", "bias")
    return {name: v for name, v in found.items() if v is not None and name not in own}
