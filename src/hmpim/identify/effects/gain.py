"""A gain that changes along the record: a unit that warms up, a supply that sags.

With s(t) zero on average, the output is K (1 + c s(t)) [G u](t) + bias + noise, and K the mean
gain. For a given fit, c multiplies one more row, s(t) times the model's response: a score test of c
(C. R. Rao, Proc. Cambridge Phil. Soc. 44, 1948) costs a few products. A sweep passes each frequency
at its own time, so zeros and further poles can imitate such a change, and vice versa: plain
structures whose gain changes are compared with richer ones by Schwarz's criterion.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.chance import CLEARLY, DEVIATIONS, searched
from hmpim.identify.effects.disturbance import criterion_gain
from hmpim.identify.fitting.derivatives import products
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.fit import Fit, Problem, fit_structure
from hmpim.identify.fitting.least_squares import inverted, projected, scores
from hmpim.identify.fitting.rows import Part
from hmpim.identify.fitting.sampled_rows import SampledPart, part_of
from hmpim.identify.fitting.trial import JointFit, Trial
from hmpim.identify.noise.whiteness import is_white
from hmpim.identify.worth import WORTH

__all__ = ["GainChange", "Scored", "changing_gain", "scored"]

_SETTLES = (1.5, 2.0, 2.8, 3.8, 5.2, 7.0, 9.5, 13.0)
"""Record lengths, in time constants, tried for a gain that settles."""

_STEP = 1.4
"""Ratio of neighbours among them; the likeliest is then refined within it."""

_FINELY = 9
"""Time constants tried between two neighbours; after each fit, between those two."""

_ROUNDS = 3
"""Fits after which the change, by which the output is divided, has converged."""

_LEAST = 0.2
"""Smallest gain, relative to its mean, by which the output is divided."""

_LONG = 20_000
"""Samples beyond which a change is approximated as constant in each of `_SPANS` parts."""

_SPANS = 256
"""In one part, a change of thirteen time constants moves by a twentieth of itself at most."""

_PROBE = 1e-3
"""Step in the logarithm of the rate for the derivative."""

_ALIKE = 1e-8
"""Least share of a row's power that the fit's other derivatives must not explain."""


_Fitted = Callable[[Real, Real], JointFit]
_Share = Callable[[Problem, Fit], float]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GainChange:
    """A fit with a gain that changes."""

    # Fitted to the output divided by `course`; the size of the change is free to move. Its gain is
    # the mean.
    joint: JointFit
    # whether it is clearly likelier than a constant gain, with plain dynamics and white noise
    taken: bool
    trend: Real  # (n,): what the change adds to the model's output, in its unit
    course: Real  # (n,): the gain over its mean, by which to multiply the residual of `joint`
    # change over the record, as a share of the mean gain, and its standard deviation
    change: float
    std: float
    share: float  # of the residual's power that it explains, for the fit with a constant gain
    others: tuple[Fit, ...]  # fits about as likely: `joint`'s own if the change is not taken


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scored:
    """Score test of a change of one shape."""

    rate: float  # record length in time constants; 0 for a steady change
    motion: Real  # (n,): motion of the output with the mean gain
    # change over the record, as a share of the mean gain, and its standard deviation
    change: float
    std: float
    gain: float  # in log-likelihood

    @property
    def shape(self) -> Real:
        """The course of the change, shape (n,): 1 in total, zero on average."""
        return np.asarray(_shapes(self.motion.size, (self.rate,))[0])

    @property
    def rows(self) -> Real:
        """Rows of the change, and of its derivative by the logarithm of its rate, (k, n)."""
        shape = self.shape
        if not self.rate:
            return (shape * self.motion)[None]
        near = _shapes(self.motion.size, (self.rate * (1.0 + _PROBE),))[0]
        return np.stack([shape * self.motion, (near - shape) / _PROBE * self.motion])


def changing_gain(first: JointFit, fitted: _Fitted, otherwise: _Share) -> GainChange | None:
    """Test whether the gain changes along the record.

    `first` has a constant gain. `fitted` makes the joint fit of plain structures to another output
    with more rows. `otherwise` returns the share of a fit's residual that something else explains,
    such as a nonlinearity.

    None if no change is significant, or if something else explains more.
    """
    best = first.best.fit
    if best.structure.integrators or best.structure.sampled:
        return None
    begin, share = _first_scores(first, otherwise)
    if not begin:
        return None
    lead = max(_tried(first, begin, fitted), key=lambda one: one.gained)
    plain = lead.white or best.structure.name in PLAIN
    if not plain:
        lead = _settled(first, lead.score, None)
    score = lead.score
    if abs(score.change) <= max(WORTH, DEVIATIONS * score.std):
        return None
    # The change is only a doubt with rich dynamics, where it may replace a missing pole, and if a
    # change of the delay or the dynamics explains about as much.
    taken = lead.white and plain and lead.gained > 2 * CLEARLY and _is_clear(lead, first.problem.y)
    return GainChange(
        joint=lead.joint,
        taken=taken,
        trend=(lead.joint.best.fit.prediction - lead.level) * (lead.course - 1.0),
        course=lead.course,
        change=score.change,
        std=score.std,
        share=0.0 if taken else share,
        others=() if taken else (lead.joint.best.fit,),
    )


def _first_scores(first: JointFit, otherwise: _Share) -> tuple[tuple[Scored, ...], float]:
    """Scores to start from, none if no test is significant; and the share that they explain."""
    count, best = first.counted, first.best.fit
    own = scored(first.weighed, best, count)
    lead = max(own, key=lambda one: one.gain, default=None)
    if lead is None or lead.gain <= searched(len(own)) or abs(lead.change) <= WORTH:
        return (), 0.0
    share = -float(np.expm1(-2.0 * lead.gain / count))
    if otherwise(first.weighed, best) > share:
        return (), 0.0
    return own, share


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Settled:
    """A joint fit with a change of one shape, and its gain in Schwarz's criterion."""

    joint: JointFit
    score: Scored
    gained: float
    course: Real
    level: float

    @property
    def white(self) -> bool:
        """Whether the residual is white."""
        return is_white(self.joint.problem.counting(self.joint.best.fit.residual))


def _tried(first: JointFit, begin: tuple[Scored, ...], fitted: _Fitted) -> list[_Settled]:
    """Plain fits with a steady change and one that settles."""
    steady = [score for score in begin if not score.rate]
    settling = sorted((score for score in begin if score.rate), key=lambda score: -score.gain)
    return [_settled(first, score, fitted) for score in (*steady[:1], *settling[:1])]


def _is_clear(lead: _Settled, y: Real) -> bool:
    """Whether a change of the delay or the dynamics explains much less of the output y, (n,)."""
    fit, score = lead.joint.best.fit, lead.score
    data = _without_rows(lead.joint.problem, len(score.rows), y)
    constant = fit_structure(data, fit.structure, fit.theta)
    elsewhere = _gain_elsewhere(data, constant, tuple(sorted({0.0, score.rate})))
    return score.gain > elsewhere + CLEARLY


def _settled(first: JointFit, begin: Scored, fitted: _Fitted | None) -> _Settled:
    """Make the joint fit with a change of one shape.

    The output is divided by the gain so far, so that the row explains little. Its exact
    form, and the assumption between the samples, then do not matter. The change converges with the
    plain structure that leads; then all of these are `fitted`. If None, with the structure of
    `first` throughout.
    """
    y, score, spread = first.problem.y, begin, _STEP
    problem, best = first.problem, first.best
    fit, near = best.fit, best if fitted is None else _plain(first)
    for turn in range(_ROUNDS):
        course = np.maximum(1.0 + score.change * score.shape, _LEAST)
        # The output at the input's initial level does not change with the gain.
        initial = part_of(problem, fit.structure, fit.theta).level
        level = float(fit.linear[-1] + fit.linear[0] * initial)
        even, rows = level + (y - level) / course, score.rows
        if fitted is None or turn < _ROUNDS - 1:
            nuisance = np.vstack([first.problem.fixed()[1:], rows])
            problem = replace(first.problem, y=even, nuisance=nuisance)
            near = replace(near, fit=fit_structure(problem, near.fit.structure, near.fit.theta))
            joint = replace(first, problem=problem, best=near)
        else:
            joint = fitted(even, rows)
        fit, problem = joint.best.fit, joint.problem
        data, constant = _undivided(joint, rows, y)
        rates = (score.rate,)
        for _ in range(2 if begin.rate else 1):
            again = scored(data, constant, data.counted, rates=rates)
            score = max(again, key=lambda one: one.gain, default=score)
            rates = tuple(score.rate * spread ** np.linspace(-1.0, 1.0, _FINELY))
        spread **= 2.0 / (_FINELY - 1)
    # Compared with the residual of the undivided output, whose noise is even.
    even_noise = replace(joint.best, fit=replace(fit, residual=fit.residual * course))
    whole = replace(joint, best=even_noise)
    gained = criterion_gain(whole, len(score.rows), best.fit, first.problem)
    return _Settled(
        joint=joint,
        score=replace(score, std=_deviation(data, constant, score)),
        gained=gained,
        course=course,
        level=level,
    )


def _plain(joint: JointFit) -> Trial:
    """The likeliest trial of a plain structure; the best one where none was tried."""
    plain = [trial for trial in joint.trials if trial.fit.structure.name in PLAIN]
    if joint.best.fit.structure.name in PLAIN or not plain:
        return joint.best
    return min(plain, key=lambda trial: trial.criterion)


def scored(
    problem: Problem, fit: Fit, count: float, *, rates: tuple[float, ...] = (0.0, *_SETTLES)
) -> tuple[Scored, ...]:
    """Test a fit with a constant gain, with `count` independent samples, for a gain that changes.

    `rates` are the record lengths in time constants of the changes to test; 0 for a steady one.
    There is a score for each shape that the fit's own parameters do not explain.
    """
    part = part_of(problem, fit.structure, fit.theta)
    # From the input's initial level: a change of gain at an offset is a drift of the bias.
    motion = fit.linear[:-1] @ part.rows
    if fit.initial.size:
        motion = motion + fit.initial @ part.free
    if motion.size > _LONG and problem.begins is None and problem.nuisance is None:
        gram = _products_in_spans(problem, fit, part, motion, rates)
    else:
        gram = _products(problem, fit, part, _shapes(motion.size, rates) * motion)
    *tested, total = scores(gram, len(rates), least=_ALIKE)
    return tuple(
        Scored(
            rate=rate,
            motion=motion,
            change=float(change),
            std=float(np.sqrt(total * (1.0 - taken) / max(count, 1.0) / power)),
            gain=-0.5 * count * float(np.log1p(-taken)),
        )
        for rate, change, power, taken in zip(rates, *tested, strict=True)
        if power > 0.0
    )


def _gain_elsewhere(problem: Problem, fit: Fit, rates: tuple[float, ...]) -> float:
    """Largest gain in log-likelihood if the delay or a parameter of the dynamics changes.

    The shape of the change multiplies the derivative by that parameter, as a change of the scale
    factor multiplies the motion. `rates` are as for `scored`.
    """
    part = part_of(problem, fit.structure, fit.theta)
    shapes, most = _shapes(problem.y.size, rates), 0.0
    for slope in part.slopes(fit.linear[:-1], fit.initial):
        gram = _products(problem, fit, part, shapes * slope)
        most = max(most, float(scores(gram, len(rates), least=_ALIKE)[2].max()))
    return -0.5 * problem.counted * float(np.log1p(-most))


def _products(problem: Problem, fit: Fit, part: Part | SampledPart, rows: Real) -> Real:
    """Products of the fit's derivatives, of rows, and of the residual."""
    residual = problem.innovations(fit.prediction, fit.residual)
    (gram,) = products(problem, fit, residual, *rows, part=part)
    return np.asarray(gram)


def _products_in_spans(
    problem: Problem, fit: Fit, part: Part | SampledPart, motion: Real, rates: tuple[float, ...]
) -> Real:
    """The same for changes that are constant in each of many spans; no row is computed."""
    residual, count = problem.innovations(fit.prediction, fit.residual), len(rates)
    edges = tuple(np.linspace(0, motion.size, _SPANS + 1).astype(int)[1:-1].tolist())
    sums = products(problem, fit, residual, motion, part=part, edges=edges)
    own = sums.shape[1] - 2
    turn = np.zeros((_SPANS, own + count + 1, own + 2))
    turn[:, :own, :own], turn[:, -1, -1] = np.eye(own), 1.0
    turn[:, own:-1, own] = _shapes(_SPANS, rates).T
    return np.asarray(np.sum(turn @ sums @ turn.transpose(0, 2, 1), axis=0))


def _deviation(problem: Problem, fit: Fit, score: Scored) -> float:
    """Standard deviation of the change, with the rate at which it settles unknown."""
    part, rows = part_of(problem, fit.structure, fit.theta), score.rows
    gram = projected(_products(problem, fit, part, rows), len(rows))
    inverse = inverted(gram[:-1, :-1])
    rest = float(gram[-1, -1] - gram[-1, :-1] @ inverse @ gram[:-1, -1])
    return float(np.sqrt(max(rest, 0.0) / problem.counted * inverse[0, 0]))


def _shapes(size: int, rates: tuple[float, ...]) -> Real:
    """Changes by 1 over a record, zero on average, shape (k, n)."""
    at = np.arange(size) / size
    rows = np.stack([1.0 - np.exp(-rate * at) if rate else at for rate in rates])
    rows -= rows.mean(axis=1, keepdims=True)
    return np.asarray(rows / np.ptp(rows, axis=1, keepdims=True))


def _undivided(joint: JointFit, rows: Real, y: Real) -> tuple[Problem, Fit]:
    """The undivided output, and the fit with its mean gain, so that its residual has the change."""
    count, fit = len(rows), joint.best.fit
    problem = _without_rows(joint.problem, count, y)
    mean = fit.prediction - fit.nuisance[-count:] @ rows
    residual = y - mean
    if problem.valid is not None:
        residual = residual * problem.valid
    return problem, replace(fit, prediction=mean, residual=residual, nuisance=fit.nuisance[:-count])


def _without_rows(problem: Problem, count: int, y: Real) -> Problem:
    """The data with another output, without the rows of the change, which come last."""
    rows = problem.nuisance
    kept = None if rows is None or len(rows) == count else rows[:-count]
    return replace(problem, y=y, nuisance=kept)
