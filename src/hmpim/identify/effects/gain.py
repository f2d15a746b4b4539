"""A gain that changes along the record: a unit that warms up, a supply that sags.

With s(t) zero on average, the output is K (1 + c s(t)) [G u](t) + bias + noise, and K the mean
gain. Beside a fit, c multiplies one more row, s(t) times the model's answer: a score test of c
(C. R. Rao, Proc. Cambridge Phil. Soc. 44, 1948) costs a few products. A sweep passes each frequency
at its own time, so that zeros and further poles imitate such a change, and vice versa: plain
structures whose gain changes are weighed against richer ones by Schwarz's criterion.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.chance import CLEARLY, DEVIATIONS, searched
from hmpim.identify.effects.disturbance import gain_by_rows
from hmpim.identify.fitting.derivatives import products
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.fit import Fit, Problem, fit_structure
from hmpim.identify.fitting.least_squares import inverted, solved
from hmpim.identify.fitting.rows import Part
from hmpim.identify.fitting.sampled_rows import SampledPart, part_of
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.noise.whiteness import is_white
from hmpim.identify.worth import TWICE, WORTH

__all__ = ["GainChange", "Scored", "changing_gain", "scored"]

_SETTLES = (1.5, 2.0, 2.8, 3.8, 5.2, 7.0, 9.5, 13.0)
"""Record lengths, in time constants, tried for a gain that settles; or it changes steadily."""

_STEP = 1.4
"""Ratio of neighbours among them, within which the likeliest is then sought."""

_FINELY = 9
"""Time constants tried at once between two neighbours; after each fit between those two."""

_ROUNDS = 3
"""Fits after which the change that is taken off the output has settled."""

_LEAST = 0.2
"""Gain, over its mean, down to which the output is divided by it."""

_LONG = 20_000
"""Samples beyond which a change is taken as constant in each of `_SPANS` parts of a record."""

_SPANS = 256
"""Within one a change of thirteen time constants moves by a twentieth of itself at most."""

_PROBE = 1e-3
"""Logarithm of the rate over which the derivative is taken."""

_ALIKE = 1e-8
"""Share of a row's power that must be left beside what the fit's other derivatives explain."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GainChange:
    """A fit beside a gain that changes.

    Parameters
    ----------
    joint : JointFit
        Fitted to the output divided by the course of the gain, whose size is free to move; the
        gain is its mean.
    taken : bool
        Whether it is clearly likelier than the fit with a constant gain, beside plain dynamics that
        leave white noise.
    trend : ndarray, shape (n,)
        What the change adds to the model's output, in its unit.
    course : ndarray, shape (n,)
        The gain over its mean, by which the residual of `joint` is to be multiplied.
    change, std : float
        Change over the record, as a share of the mean gain, and its standard deviation.
    share : float
        Share of the residual's power that it explains beside the fit that was chosen without it.
    others : tuple of Fit
        Fits with other shapes that are about as likely; `joint`'s own if the change is not taken.
    """

    joint: JointFit
    taken: bool
    trend: Real
    course: Real
    change: float
    std: float
    share: float
    others: tuple[Fit, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scored:
    """Score test of a change of one shape.

    Parameters
    ----------
    rate : float
        Time constants that the record has of it; 0 if it is steady.
    motion : ndarray, shape (n,)
        What the input does to the output with the mean gain.
    change, std : float
        Change over the record, as a share of the mean gain, and its standard deviation.
    gain : float
        Log-likelihood that it brings.
    """

    rate: float
    motion: Real
    change: float
    std: float
    gain: float

    @property
    def shape(self) -> Real:
        """The course of the change, shape (n,): 1 in total, zero on average."""
        return np.asarray(_shapes(self.motion.size, (self.rate,))[0])

    @property
    def rows(self) -> Real:
        """What the change multiplies, shape (k, n).

        And of one that settles the derivative with respect to the logarithm of its rate, up to a
        factor.
        """
        row = self.shape * self.motion
        if not self.rate:
            return row[None]
        return np.stack([row, _slope(self.shape, self.rate) * self.motion])


def changing_gain(
    first: JointFit,
    fitted: Callable[[Real, Real, bool], JointFit],
    otherwise: Callable[[Problem, Fit], float],
) -> GainChange | None:
    """Ask whether the gain changes, and whether that explains what a rich structure does.

    Parameters
    ----------
    first : JointFit
        With a constant gain.
    fitted : callable
        Makes the joint fit to another output with more rows; of the plain structures only if
        the third argument is true.
    otherwise : callable
        Share of what a fit leaves over that something else explains, such as a nonlinearity.

    Returns
    -------
    GainChange or None
        None where nothing says that it changes, and no plain structure with a changing gain is
        about as likely as the rich one chosen; and where something else explains more.

    Examples
    --------
    >>> from hmpim.identify.fitting.course import continued, start
    >>> from hmpim.identify.fitting.joint import chosen_of, joint_fit
    >>> t = np.arange(1000) / 1000
    >>> u, late = (np.sin(2 * np.pi * (2 * s + 40 * s**2)) for s in (t, t - 0.005))
    >>> y = (1.05 - 0.1 * t) * late + 0.01 * np.random.default_rng(0).standard_normal(1000)
    >>> begun = start(u, y, None, None, None, PLAIN, None)
    >>> def fitted(y, rows, plainly):
    ...     course = replace(begun, data=replace(begun.data, y=y))
    ...     return chosen_of(continued(course, valid=None, nuisance=rows), PLAIN)
    >>> found = changing_gain(joint_fit(u, y, structures=PLAIN), fitted, lambda *_: 0.0)
    >>> found.joint.best.fit.structure.name, found.taken, round(found.change, 2)
    ('static', True, -0.1)
    """
    best = first.best.fit
    if best.structure.integrators or best.structure.sampled or best.objective <= 0.0:
        return None
    begin, share = _asked(first, otherwise)
    found = _tried(first, begin, fitted, hopeless=np.inf if share else TWICE * best.cost)
    if not found:
        return None
    lead = max(found, key=lambda one: one.gained)
    constant, data = _constant(lead, first.problem)
    least = min(lead.joint.best.fit.cost, (1.0 - share) * best.cost)
    if (1.0 - otherwise(data, constant)) * constant.cost < least:
        return None
    if share and not lead.white and best.structure.name not in PLAIN:
        lead = _settled(first, lead.told, fitted, plainly=False) or lead
    told = lead.told
    if lead.gained < -2 * CLEARLY or abs(told.change) <= max(WORTH, DEVIATIONS * told.std):
        return None
    near = tuple(
        one.joint.best.fit
        for one in found
        if one.joint is not lead.joint and one.gained > lead.gained - 2 * CLEARLY
    )
    # Beside rich dynamics it may stand for a pole that is missing, and is only a doubt.
    plain = lead.joint.best.fit.structure.name in PLAIN
    taken = lead.gained > 2 * CLEARLY and lead.white and plain
    return GainChange(
        joint=lead.joint,
        taken=taken,
        trend=lead.trend,
        course=lead.course,
        change=told.change,
        std=told.std,
        share=0.0 if taken else share,
        others=near if taken else (lead.joint.best.fit, *near),
    )


def _asked(
    first: JointFit, otherwise: Callable[[Problem, Fit], float]
) -> tuple[tuple[Scored, ...], float]:
    """Scores to begin with, empty if no test is significant; and the share that they explain."""
    count, best = first.weighed.counted * first.weighed_share, first.best.fit
    own = scored(first.weighed, best, count)
    rich = best.structure.name not in PLAIN
    lead = max(own, key=lambda one: one.gain, default=None)
    if lead is None or lead.gain <= searched(len(own)) or abs(lead.change) <= WORTH:
        return (_beside_plain(first, count, otherwise) if rich else ()), 0.0
    share = -float(np.expm1(-2.0 * lead.gain / count))
    if otherwise(first.weighed, best) > share:
        return (), 0.0
    return own, share


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Settled:
    """A joint fit beside a change of one shape, and what it gains in Schwarz's criterion."""

    joint: JointFit
    told: Scored
    gained: float
    course: Real
    level: float

    @property
    def trend(self) -> Real:
        """What the change adds to the model's output."""
        return np.asarray((self.joint.best.fit.prediction - self.level) * (self.course - 1.0))

    @property
    def white(self) -> bool:
        """Whether it leaves white noise."""
        return is_white(self.joint.problem.counting(self.joint.best.fit.residual))


def _tried(
    first: JointFit,
    begin: tuple[Scored, ...],
    fitted: Callable[[Real, Real, bool], JointFit],
    *,
    hopeless: float,
) -> list[_Settled]:
    """The plain fits with a steady change and one that settles, without those that cannot win."""
    steady = [told for told in begin if not told.rate]
    settling = sorted((told for told in begin if told.rate), key=lambda told: -told.gain)
    found = []
    for told in (*steady[:1], *settling[:1]):
        one = _settled(first, told, fitted, hopeless=hopeless)
        if one is not None:
            found.append(one)
            hopeless = min(hopeless, TWICE**2 * one.joint.best.fit.cost)
    return found


def _beside_plain(
    first: JointFit, count: float, otherwise: Callable[[Problem, Fit], float]
) -> tuple[Scored, ...]:
    """Scores of a plain fit that with a changing gain may be as likely as the rich one chosen."""
    best, problem = first.best, first.weighed
    least, most, lead = TWICE * best.fit.objective, 0.0, best.fit
    scores: tuple[Scored, ...] = ()
    for trial in first.trials:
        plain = trial.fit.structure
        if plain.name not in PLAIN or trial.intersample != best.intersample:
            continue
        fit = fit_structure(problem, plain, trial.fit.theta, iterations=0)
        told = scored(problem, fit, count)
        gain = max((one.gain for one in told), default=0.0)
        fewer = best.fit.structure.parameters - plain.parameters - 1
        left = fit.objective * float(np.exp(-(2.0 * gain + fewer * np.log(count)) / count))
        if left < least:
            least, scores, most, lead = left, told, gain, fit
    if scores and otherwise(problem, lead) > -float(np.expm1(-2.0 * most / count)):
        return ()
    return scores


def _settled(
    first: JointFit,
    begin: Scored,
    fitted: Callable[[Real, Real, bool], JointFit],
    *,
    hopeless: float = np.inf,
    plainly: bool = True,
) -> _Settled | None:
    """The joint fit beside a change of one shape.

    The output is divided by the gain so far, so that the row has little left to explain: what it
    is made of, and under which assumption between the samples, does not matter then. None where
    `hopeless` or more is left over.
    """
    y, told, rest = first.problem.y, begin, _rest(first.problem, first.best.fit)
    spread = _STEP
    for turn in range(_ROUNDS):
        course = 1.0 + told.change * told.shape
        if course.min() < _LEAST:
            return None
        level = rest
        joint = fitted(level + (y - level) / course, told.rows, plainly)
        fit, rest = joint.best.fit, _rest(joint.problem, joint.best.fit)
        if not joint.related or fit.cost >= hopeless:
            return None
        data, constant = _undivided(joint, told.rows, y)
        rates = _SETTLES if turn == 0 and begin.rate else (told.rate,)
        for _ in range(2 if begin.rate else 1):
            again = scored(data, constant, data.counted, rates=rates)
            if not again:
                return None
            told = max(again, key=lambda one: one.gain)
            rates = tuple(told.rate * spread ** np.linspace(-1.0, 1.0, _FINELY))
        spread **= 2.0 / (_FINELY - 1)
    # Held against the residual of the output as it is, whose noise is even.
    even = replace(joint.best, fit=replace(fit, residual=fit.residual * course))
    return _Settled(
        joint=joint,
        told=replace(told, std=_deviation(data, constant, told)),
        gained=gain_by_rows(
            replace(joint, best=even), len(told.rows), first.best.fit, first.problem
        ),
        course=course,
        level=level,
    )


def _rest(problem: Problem, fit: Fit) -> float:
    """Output at the input's initial level."""
    return float(fit.linear[-1] + fit.linear[0] * part_of(problem, fit.structure, fit.theta).level)


def scored(
    problem: Problem, fit: Fit, count: float, *, rates: tuple[float, ...] = (0.0, *_SETTLES)
) -> tuple[Scored, ...]:
    """Test a fit for a gain that changes.

    Parameters
    ----------
    problem, fit
        The data, and a fit to them with a constant gain.
    count : float
        Independent samples.
    rates : tuple of float
        Time constants that the record has of the changes to test; 0 of a steady one.

    Returns
    -------
    tuple of Scored
        One for each shape that can be told from the fit's own parameters.
    """
    part = part_of(problem, fit.structure, fit.theta)
    motion = _motion(part, fit)
    if motion.size > _LONG and problem.begins is None and problem.nuisance is None:
        gram = _products_in_spans(problem, fit, part, motion, rates)
    else:
        gram = _products(problem, fit, part, _shapes(motion.size, rates) * motion)
    beside, whole = _beside(gram, len(rates)), gram.diagonal()[-len(rates) - 1 : -1]
    total, found = float(beside[-1, -1]), []
    for k, rate in enumerate(rates):
        power, along = float(beside[k, k]), float(beside[k, -1])
        if total <= 0.0 or power <= _ALIKE * whole[k]:
            continue
        taken = min(along**2 / power / total, 1.0 - np.finfo(float).eps)
        found.append(
            Scored(
                rate=rate,
                motion=motion,
                change=along / power,
                std=float(np.sqrt(total * (1.0 - taken) / max(count, 1.0) / power)),
                gain=-0.5 * count * float(np.log1p(-taken)),
            )
        )
    return tuple(found)


def _products(problem: Problem, fit: Fit, part: Part | SampledPart, rows: Real) -> Real:
    """Products of the fit's derivatives, of rows, and of the residual."""
    left = problem.innovations(fit.prediction, fit.residual)
    (gram,) = products(problem, fit, left, *rows, part=part)
    return np.asarray(gram)


def _products_in_spans(
    problem: Problem, fit: Fit, part: Part | SampledPart, motion: Real, rates: tuple[float, ...]
) -> Real:
    """The same of the rows of changes, each constant in each of many spans: none is made."""
    left, count = problem.innovations(fit.prediction, fit.residual), len(rates)
    edges = tuple(np.linspace(0, motion.size, _SPANS + 1).astype(int)[1:-1].tolist())
    sums = products(problem, fit, left, motion, part=part, edges=edges)
    own = sums.shape[1] - 2
    turn = np.zeros((_SPANS, own + count + 1, own + 2))
    turn[:, :own, :own], turn[:, -1, -1] = np.eye(own), 1.0
    turn[:, own:-1, own] = _shapes(_SPANS, rates).T
    return np.asarray(np.sum(turn @ sums @ turn.transpose(0, 2, 1), axis=0))


def _beside(gram: Real, count: int) -> Real:
    """Products of so many rows and the residual, the fit's own derivatives taken out."""
    size = gram.shape[0] - count - 1
    mixed = gram[:size, size:]
    return np.asarray(gram[size:, size:] - mixed.T @ solved(gram[:size, :size], mixed))


def _deviation(problem: Problem, fit: Fit, told: Scored) -> float:
    """Standard deviation of the change, the rate at which it settles unknown."""
    part = part_of(problem, fit.structure, fit.theta)
    rows = told.rows
    beside = _beside(_products(problem, fit, part, rows), len(rows))
    inverse = inverted(beside[:-1, :-1])
    rest = float(beside[-1, -1] - beside[-1, :-1] @ inverse @ beside[:-1, -1])
    return float(np.sqrt(max(rest, 0.0) / problem.counted * inverse[0, 0]))


def _shapes(size: int, rates: tuple[float, ...]) -> Real:
    """Changes by 1 over a record, zero on average, shape (k, n)."""
    at = np.arange(size) / size
    rows = np.stack([1.0 - np.exp(-rate * at) if rate else at for rate in rates])
    rows -= rows.mean(axis=1, keepdims=True)
    return np.asarray(rows / np.ptp(rows, axis=1, keepdims=True))


def _slope(shape: Real, rate: float) -> Real:
    """Derivative of a change that settles with respect to the logarithm of its rate."""
    near = _shapes(shape.size, (rate * (1.0 + _PROBE),))[0]
    return np.asarray((near - shape) / _PROBE)


def _motion(part: Part | SampledPart, fit: Fit) -> Real:
    """What the input, and the state that a record begins with, do to the output.

    From where the input begins: what a change makes of an offset is a drift of the bias.
    """
    moved = fit.linear[:-1] @ part.rows
    return moved + fit.initial @ part.free if fit.initial.size else np.asarray(moved)


def _undivided(joint: JointFit, rows: Real, y: Real) -> tuple[Problem, Fit]:
    """The output as it is, and the fit with its mean gain: what the change does is left over."""
    problem, fit, own = _without_rows(joint.problem, len(rows), y), joint.best.fit, len(rows)
    mean = fit.prediction - fit.nuisance[-own:] @ rows
    residual = y - mean
    if problem.valid is not None:
        residual = residual * problem.valid
    return problem, replace(fit, prediction=mean, residual=residual, nuisance=fit.nuisance[:-own])


def _without_rows(problem: Problem, count: int, y: Real) -> Problem:
    """The data with another output, without the rows of the change, which are the last."""
    rows = problem.nuisance
    kept = None if rows is None or len(rows) == count else rows[:-count]
    return replace(problem, y=y, nuisance=kept)


def _constant(lead: _Settled, before: Problem) -> tuple[Fit, Problem]:
    """A fit of the same structure with a constant gain, and the data that it is fitted to."""
    fit, data = lead.joint.best.fit, lead.joint.problem
    data = _without_rows(data, len(lead.told.rows), before.y)
    return fit_structure(data, fit.structure, fit.theta), data
