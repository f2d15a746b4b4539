"""One output, several inputs at once: each pair's fit with the others taken out.

The inputs that move the output most are fitted as if alone, each to what the others leave over;
what is weak beside them (`hmpim.identify.coupling.weak`) follows, with the noise whitened.
Then all pairs are moved at once, and only then is each coupling tested, the others allowed to take
over: of two inputs that are alike at some frequencies, the first took a share of the other's
coupling, which then looked like none. The error bars come from all pairs' derivatives together, so
that inputs that resemble each other widen them.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.chance import SEARCHED
from hmpim.identify.coupling.weak import Lag, coupling_fit, lag_of, whitening_of
from hmpim.identify.effects.drift import Drifting
from hmpim.identify.effects.gain import GainChange
from hmpim.identify.effects.hum import Humming
from hmpim.identify.fitting.course import bridged
from hmpim.identify.fitting.derivatives import jacobian
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.fitting.fit import fit_together as fit_all
from hmpim.identify.fitting.joint import joint_fit
from hmpim.identify.fitting.least_squares import without
from hmpim.identify.fitting.sampled_rows import part_of
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.noise.whiteness import effective_share
from hmpim.identify.section_iv.correlation import likeness
from hmpim.identify.worth import NEARLY, PART, TWICE
from hmpim.model.dynamics import StructureName
from hmpim.model.response import slowest_time_constant
from hmpim.model.sampled import prepare_input
from hmpim.record import Intersample

__all__ = ["OutputFit", "fit_together"]

_TURNS = 3
"""How often the strong inputs are fitted, each with the others known."""

_UNSEEN = 1e-13
"""Share of the greatest eigenvalue below which the record does not see a direction."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OutputFit:
    """Fits of one output to each input; by default of an output to its one input."""

    # one for each input; its output is what the other inputs leave over. One that the output does
    # not follow at all is not `related`.
    fits: tuple[JointFit, ...]
    # (p_i, p_i): of each fit's parameters, all fits considered together
    covariances: tuple[Real, ...] = ()
    # whether the input's contribution is large beside the output, not a coupling
    strong: tuple[bool, ...] = (True,)
    # delay and lag of couplings of no more than first order
    lags: tuple[Lag | None, ...] = (None,)
    # the bias's drift, of an output to one input; the fit's output is without it
    drifting: Drifting | None = None
    humming: Humming | None = None  # its hum, likewise
    steady: Real | None = None  # (n,): where it drifts, what a fit with a constant bias predicts
    # what is known of a gain that changes, of an output to one input
    gaining: GainChange | None = None

    @property
    def prediction(self) -> Real:
        """What all inputs together predict of the output, bias and drift included, shape (n,)."""
        first = self.fits[0].best.fit
        total: Real = np.full(first.prediction.size, first.linear[-1])
        for fit in self.fits:
            if fit.related:
                total = total + _part(fit)
        return total if self.disturbance is None else total + self.disturbance

    @property
    def leading(self) -> int:
        """The input that moves the output most."""
        parts = [float(np.std(_part(fit))) if fit.related else -1.0 for fit in self.fits]
        return int(np.argmax(parts))

    @property
    def disturbance(self) -> Real | None:
        """What moves the output beside the model, shape (n,): drift, hum, a change of the gain."""
        trends = [one.trend for one in (self.drifting, self.humming) if one is not None]
        if self.gaining is not None and self.gaining.taken:
            trends.append(self.gaining.trend)
        return np.sum(trends, axis=0) if trends else None


def fit_together(
    inputs: list[Real],
    y: Real,
    *,
    valid: Mask | None,
    known: Mask | None,
    intersample: Intersample | None,
    structures: tuple[StructureName, ...],
    alike: Sequence[tuple[frozenset[int], Mask]] = (),
    nuisance: Real | None = None,
) -> OutputFit:
    """Fit one output to several inputs.

    Parameters
    ----------
    inputs : list of ndarray, shape (n,)
        Uniform samples of each input.
    y : ndarray, shape (n,)
        Uniform samples of the output.
    valid, known, intersample, structures
        As for `hmpim.identify.fitting.joint.joint_fit`; `known` is for all inputs together.
    alike : sequence of (frozenset of int, ndarray of bool, shape (n // 2 + 1,))
        Inputs that are not told apart, and the bins at which they are not. There a coupling is
        not told from what the stronger one's model lacks.
    nuisance : ndarray, shape (k, n), optional
        Rows beside the bias that enter linearly, such as a drift's.
    """
    fitted = partial(joint_fit, known=known, intersample=intersample, nuisance=nuisance)
    if len(inputs) == 1:
        return OutputFit(fits=(fitted(inputs[0], y, valid=valid, structures=structures),))
    plain = tuple(name for name in structures if name in PLAIN) or structures
    plainly = partial(fitted, structures=plain, growing=False)
    pairs = _Pairs(y=y, valid=valid, fits={}, strong=[], alike=alike)
    _join(inputs, pairs, plainly)
    if len(pairs.strong) > 1:  # each was fitted with the later ones unknown
        _fit_strong(inputs, pairs, plainly)
    _fit_couplings(inputs, pairs, plain)
    for _ in range(_TURNS):
        before = [pairs.fits[i].best.fit.structure for i in pairs.strong]
        _fit_strong(inputs, pairs, partial(fitted, structures=structures))
        joined = _join(inputs, pairs, plainly)
        if joined or [pairs.fits[i].best.fit.structure for i in pairs.strong] != before:
            _fit_couplings(inputs, pairs, plain)
        left = pairs.cost
        pairs.refine(pairs.kept, None)
        if not joined and pairs.cost * TWICE > left:
            break  # else each was fitted to the wrong rest
    return _moved_at_once(pairs)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Pairs:
    """The pairs of one output, (n,), as far as they are fitted.

    `valid` are the samples that count before any fit, `strong` the inputs that are no weak
    couplings, the strongest first; `alike` is as for `fit_together`. `fits` and `strong` are
    changed in place.
    """

    y: Real
    valid: Mask | None
    fits: dict[int, JointFit]
    strong: list[int]
    alike: Sequence[tuple[frozenset[int], Mask]]

    @property
    def kept(self) -> list[int]:
        """The inputs that the output follows, as far as is known."""
        return [j for j, fit in self.fits.items() if fit.related]

    def without(self, some: Iterable[int]) -> Real:
        """The output without what some of the inputs move it by."""
        parts = (_part(self.fits[j]) for j in some if self.fits[j].related)
        return np.asarray(self.y - sum(parts, np.zeros(self.y.size)))

    def without_others(self, i: int) -> Real:
        """The output without what all inputs but one move it by."""
        return self.without(j for j in self.fits if j != i)

    @property
    def cost(self) -> float:
        """Mean square of what all of them leave over."""
        rest, counts = self.left(), _common(self.valid, [self.fits[j] for j in self.kept])
        return float(np.mean(np.square(rest if counts is None else rest[counts])))

    def counted_by_others(self, i: int) -> Mask | None:
        """Samples that count for all inputs but one: those where what they do is known."""
        return _common(self.valid, [self.fits[j] for j in self.kept if j != i])

    def left(self) -> Real:
        """What all of them leave over."""
        best = self.fits[self.strong[0]]
        rest = self.without(self.fits) - _constant(best)
        counts = best.problem.valid
        return rest if counts is None else np.asarray(rest * counts)

    def refine(
        self, some: list[int], whitening: Real | None, y: Real | None = None
    ) -> tuple[list[Problem], list[Fit]]:
        """Move some of the fits at once to what the output, or another `y`, is but for a bias."""
        if not some:
            return [], []
        y = self.y if y is None else y
        fits = self.fits
        valid = _common(None, [fits[j] for j in some])
        problems = [replace(fits[j].problem, y=y, valid=valid, whitening=whitening) for j in some]
        begun = [fits[j].best.fit for j in some]
        found = fit_all(problems, [fit.structure for fit in begun], [fit.theta for fit in begun])
        beside = found[0].linear[-1] + found[0].nuisance @ problems[0].fixed()[1:]
        parts = {j: fit.prediction - beside for j, fit in zip(some, found, strict=True)}
        total = sum(parts.values(), np.zeros(y.size))
        for j, fit in zip(some, found, strict=True):
            trial = replace(fits[j].best, fit=fit)
            own = replace(fits[j].problem, y=y - (total - parts[j]))
            fits[j] = replace(
                fits[j],
                problem=own,
                weighed=own,
                best=trial,
                trials=tuple(trial if t is fits[j].best else t for t in fits[j].trials),
                effective_share=effective_share(fit.residual),
            )
        return problems, found

    def together(self, whitening: Real | None, *, drop: bool = True) -> bool:
        """Move all couplings at once; leave out the least if it adds nothing and may go.

        Returns
        -------
        bool
            Whether one was left out.
        """
        weak = [j for j in self.kept if j not in self.strong]
        if not weak:
            return False
        problems, found = self.refine(weak, whitening, self.without(self.strong))
        if not drop:
            return False
        gains = []
        for k, j in enumerate(weak):
            shared = [bins for group, bins in self.alike if j in group and group & {*self.strong}]
            slow = _too_slow(found[k], self.y.size)
            gains.append(0.0 if slow else _gained_by(_apart(problems, shared), found, k))
        least = int(np.argmin(gains))
        if gains[least] > SEARCHED:
            return False
        self.fits[weak[least]] = replace(self.fits[weak[least]], related=False)
        return True


def _moved_at_once(pairs: _Pairs) -> OutputFit:
    """All pairs moved with the noise whitened until none is left out, with the errors of all."""
    whitening = whitening_of(pairs.left())
    if whitening is not None:
        pairs.refine(pairs.kept, whitening)
    while pairs.together(whitening):
        pairs.refine(pairs.kept, whitening)
    told: dict[int, Real] = {}
    lags: dict[int, Lag | None] = {}
    fits = [pairs.fits[j] for j in pairs.kept]
    if fits:
        problem, blocks, bias = _derivatives(fits, whitening)
        told = dict(zip(pairs.kept, _covariances(problem, fits[-1], blocks, bias), strict=True))
    for k, j in enumerate(pairs.kept):
        if j not in pairs.strong:
            lags[j] = _lag(problem, fits[k], [*blocks[:k], *blocks[k + 1 :], bias])
    everyone = range(len(pairs.fits))
    return OutputFit(
        fits=tuple(pairs.fits[j] for j in everyone),
        covariances=tuple(told.get(j, np.zeros((0, 0))) for j in everyone),
        strong=tuple(j in pairs.strong for j in everyone),
        lags=tuple(lags.get(j) for j in everyone),
    )


def _gained_by(problems: Sequence[Problem], fits: Sequence[Fit], i: int) -> float:
    """Log-likelihood that one pair's gain adds, all other parameters free to take over.

    Half of b' C⁻¹ b, b the pair's numerator, C its covariance, the pair's own poles and delay
    held: without a gain they mean nothing.
    """
    blocks = []
    for j, (p, f) in enumerate(zip(problems, fits, strict=True)):
        rows = jacobian(p, f)[:-1]
        blocks.append(rows[f.theta.size :] if j == i else rows)
    rows = np.vstack([*blocks, problems[0].masked(np.ones(problems[0].y.size))])
    residual = problems[i].masked(fits[i].residual)
    full = _joint_covariance(rows, residual, freedom=problems[i].counted)
    start = sum(block.shape[0] for block in blocks[:i])
    span = slice(start, start + blocks[i].shape[0])
    b = fits[i].linear[:-1]
    return float(0.5 * b @ np.linalg.pinv(full[span, span], hermitian=True) @ b)


def _joint_covariance(rows: Real, residual: Real, *, freedom: int) -> Real:
    """Covariance under white noise; a direction that the record does not see spoils no other one.

    Of the derivatives of the prediction, (p, n), the bias's the last, and of what is left over,
    (n,). The bias is taken out of the others first: where an input stands far from zero, the
    derivative by its gain is all but the same.
    """
    bias, mean = rows[-1], rows[:-1] @ rows[-1]
    power = max(float(bias @ bias), np.finfo(float).tiny)
    mean = mean / power
    moved = rows[:-1] - mean[:, None] * bias
    scale = np.sqrt(np.maximum(np.sum(moved**2, axis=1), np.finfo(float).tiny ** 0.5))
    scaled = moved / scale[:, None]
    values, vectors = np.linalg.eigh(scaled @ scaled.T)
    spread = vectors / np.sqrt(np.maximum(values, _UNSEEN * values[-1]))
    inner = spread @ spread.T / np.outer(scale, scale)
    mixed = -inner @ mean
    last = np.array([[1.0 / power - mean @ mixed]])
    full = np.block([[inner, mixed[:, None]], [mixed[None], last]])
    return np.asarray(full * float(residual @ residual) / freedom)


def _fit_strong(inputs: list[Real], pairs: _Pairs, fitted: Callable[..., JointFit]) -> None:
    """Fit, in place, each strong input to what all others leave over."""
    for i in pairs.strong:
        rest, counted = pairs.without_others(i), pairs.counted_by_others(i)
        pairs.fits[i] = fitted(inputs[i], rest, valid=counted)


def _join(inputs: list[Real], pairs: _Pairs, fitted: Callable[..., JointFit]) -> bool:
    """Fit, in place, the inputs that what is left over follows, the strongest first; at least one.

    Returns
    -------
    bool
        Whether one joined those that are strong.
    """
    fits, begun = pairs.fits, len(pairs.strong)
    waiting = [j for j in range(len(inputs)) if j not in pairs.strong]
    while waiting:
        left = {j: pairs.without_others(j) for j in waiting}
        counted = _common(pairs.valid, [fits[j] for j in pairs.strong])
        rest = left if counted is None else {j: bridged(one, counted) for j, one in left.items()}
        spread = {j: max(float(np.std(one)), 1e-300) for j, one in rest.items()}
        share = {j: _follows_at_all(inputs[j], rest[j]) / spread[j] for j in waiting}
        most = max(share.values())
        if pairs.strong and most < PART:
            break
        # A delayed copy of an input correlates as well; which one it is the fit tells.
        likely = [j for j in waiting if share[j] > NEARLY * most]
        tried = {j: fitted(inputs[j], left[j], valid=counted) for j in likely}
        i = min(tried, key=lambda j: tried[j].best.fit.cost)
        waiting.remove(i)
        part = float(np.std(_part(tried[i])))
        if not pairs.strong or (part > PART * spread[i] and tried[i].related):
            fits[i] = tried[i]
            pairs.strong.append(i)
    return len(pairs.strong) > begun


def _follows_at_all(u: Real, y: Real) -> float:
    """Amplitude (r.m.s.) of the output that correlates with the input at the best lag."""
    size = max(float(np.linalg.norm(u - u.mean())), 1e-300)
    return abs(likeness(u, y, u.size // 2 - 1).there) / size / float(np.sqrt(u.size))


def _fit_couplings(
    inputs: list[Real], pairs: _Pairs, structures: tuple[StructureName, ...]
) -> None:
    """Fit, in place, all that is weak, the strongest first."""
    fits = pairs.fits
    best = fits[pairs.strong[0]]
    mode = best.best.intersample
    weak = [j for j in range(len(inputs)) if j not in pairs.strong]
    if not weak:
        return
    latest = max(PART * pairs.y.size, 4.0 * best.best.fit.delay) + 2.0
    rest = pairs.left()
    whitening = whitening_of(rest)
    sources = {j: prepare_input(inputs[j], mode) for j in weak}
    roughly = tuple(name for name in structures if name == "first_order") or structures
    known = all(j in fits for j in weak)
    for names in (structures,) if known else (roughly, structures):  # each whitened anew
        for j in sorted(weak, key=lambda j: -_follows_at_all(inputs[j], rest)):
            problem = Problem(
                source=sources[j],
                y=pairs.without_others(j),
                valid=best.problem.valid,
                longest_delay=latest,
                whitening=whitening,
                nuisance=best.problem.nuisance,
            )
            fits[j] = coupling_fit(problem, inputs[j], intersample=mode, structures=names)
        # Not before all are right is one of them tested: alike, they take each other's share.
        while pairs.together(whitening, drop=names is structures):
            pass
        rest = pairs.left()
        whitening = whitening_of(rest)


def _too_slow(fit: Fit, samples: int) -> bool:
    """Whether a coupling is one of drifts only: its corner below a few periods of the record."""
    slowest = slowest_time_constant(fit.denominator)
    return bool(2 * np.pi * slowest * TWICE > samples)


def _apart(problems: list[Problem], shared: list[Mask]) -> list[Problem]:
    """The problems without the bins at which an input is not told from a stronger one."""
    if not shared:
        return problems
    known = problems[0].whitening
    gain = np.ones(problems[0].y.size // 2 + 1) if known is None else known
    for bins in shared:
        gain = gain * ~bins
    return [replace(problem, whitening=gain) for problem in problems]


def _part(fit: JointFit) -> Real:
    """What the input contributes to the output, the bias and the rows beside it aside."""
    return np.asarray(fit.best.fit.prediction - _constant(fit))


def _constant(fit: JointFit) -> Real:
    """Bias and the rows beside it, shape (n,)."""
    best = fit.best.fit
    return np.asarray(best.linear[-1] + best.nuisance @ fit.problem.fixed()[1:])


def _common(valid: Mask | None, fits: Iterable[JointFit]) -> Mask | None:
    """Samples that count, shape (n,), and do for all of some fits; None where all do."""
    told = [mask for mask in (valid, *(fit.problem.valid for fit in fits)) if mask is not None]
    counted = np.logical_and.reduce(told) if told else np.ones(1, dtype=bool)
    return None if counted.all() else np.asarray(counted)


def _derivatives(fits: list[JointFit], whitening: Real | None) -> tuple[Problem, list[Real], Real]:
    """Derivatives of each pair but by the bias, on the samples that count for all, and by the bias.

    What is not asked for, drift and the states that the inputs begin with, is projected out of all.
    """
    problem = replace(fits[-1].problem, valid=_common(None, fits), whitening=whitening, begins=None)
    ones, blocks, others = np.ones((1, problem.y.size)), [], []
    for fit in fits:
        own = replace(problem, source=fit.problem.source, begins=fit.problem.begins)
        part = part_of(own, fit.best.fit.structure, fit.best.fit.theta)
        alone = replace(own, begins=None, nuisance=None)
        blocks.append(jacobian(alone, fit.best.fit, part=part)[:-1])
        others.append(part.free)
    if problem.nuisance is not None:
        others.append(problem.nuisance)
    given = problem.masked(np.vstack(others))
    bias = problem.masked(ones)
    if given.shape[0]:
        edges = np.cumsum([block.shape[0] for block in blocks])
        *blocks, bias = np.split(without(np.vstack([*blocks, bias]), given), edges)
    return problem, blocks, bias


def _lag(problem: Problem, pair: JointFit, others: list[Real]) -> Lag | None:
    """Delay and lag of one of the pairs, if it is of no more than first order.

    `others` are the derivatives of the other pairs and by the bias.
    """
    fit = pair.best.fit
    if fit.structure.name not in ("static", "first_order"):
        return None
    own = replace(pair.problem, valid=problem.valid, whitening=problem.whitening)
    return lag_of(own, fit, np.vstack(others))


def _covariances(problem: Problem, last: JointFit, blocks: list[Real], bias: Real) -> list[Real]:
    """Covariance of each pair's parameters and the bias, from all derivatives together."""
    rows = np.vstack([*blocks, bias])
    residual = problem.masked(last.best.fit.residual)
    # What the noise is whitened by is None only where it is white already.
    full = _joint_covariance(rows, residual, freedom=max(problem.counted - rows.shape[0], 1))
    end, start, out = rows.shape[0] - 1, 0, []
    for block in blocks:
        span = [*range(start, start + block.shape[0]), end]
        out.append(full[np.ix_(span, span)])
        start += block.shape[0]
    return out
