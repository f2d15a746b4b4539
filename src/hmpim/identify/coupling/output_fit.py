"""One output, several inputs at once: each pair's fit with the others taken out.

The input that moves the output most is fitted as if alone; others join as long as one explains
much of what is left over, each with its own beginning and assumption between the samples. They are
fitted in turns, each to what the others leave, until moving all at once gains little. What is weak
beside them (`hmpim.identify.coupling.weak`) is fitted with the noise whitened.
Then all pairs are moved at once, and only then is each coupling tested, the others allowed to take
over: of two inputs that are alike at some frequencies, the first took a share of the other's
coupling, which then looked like none. The error bars come from all pairs' derivatives together, so
that inputs that resemble each other widen them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.chance import FALSE_ALARM
from hmpim.identify.coupling.joint_errors import common, covariances, derivatives, own_lag
from hmpim.identify.coupling.left import misfit_at_any_lag
from hmpim.identify.coupling.pairs import Pairs, constant_of, contribution
from hmpim.identify.coupling.weak import Lag, coupling_fit, whitening_of
from hmpim.identify.effects.drift import Drifting, drift_rows
from hmpim.identify.effects.gain import GainChange
from hmpim.identify.effects.hum import Humming
from hmpim.identify.fitting.beginning import REACH, begin_at, in_motion
from hmpim.identify.fitting.candidates import spans_record
from hmpim.identify.fitting.course import bridged
from hmpim.identify.fitting.data import Seen
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.fit import Problem
from hmpim.identify.fitting.joint import joint_fit
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.fitting.washout import washed_out
from hmpim.identify.nonlinear.modelled import Modelled
from hmpim.identify.section_iv.correlation import likeness
from hmpim.identify.section_iv.spectrum import excited_band
from hmpim.identify.worth import MOST, NEARLY, PART, TWICE
from hmpim.model.dynamics import StructureName
from hmpim.model.sampled import prepare_input
from hmpim.record import Intersample

__all__ = ["OutputFit", "fit_together", "set_free"]

_TURNS = 3
"""How often the strong inputs are fitted, each with the others known."""


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
    # the bias's drift; each fit's output is without it
    drifting: Drifting | None = None
    asked: int = 0  # the input beside which it was weighed
    humming: Humming | None = None  # its hum, likewise
    steady: Real | None = None  # (n,): where it drifts, what a fit with a constant bias predicts
    # what is known of a gain that changes, of an output to one input
    gaining: GainChange | None = None
    bending: Modelled | None = None  # a nonlinearity of an output to one input

    @property
    def prediction(self) -> Real:
        """What all inputs together predict of the output, bias and drift included, shape (n,)."""
        first = next((fit for fit in self.fits if fit.related), self.fits[0]).best.fit
        total: Real = np.full(first.prediction.size, first.linear[-1])
        for fit in self.fits:
            if fit.related:
                total = total + contribution(fit)
        return total if self.disturbance is None else total + self.disturbance

    @property
    def slow(self) -> int | None:
        """An input whose fit may have taken a drift for its own; None where there is none."""
        for i, fit in enumerate(self.fits):
            if fit.related and self.strong[i] and (spans_record(fit.best.fit) or fit.lingers):
                return i
        return None

    @property
    def leading(self) -> int:
        """The input that moves the output most."""
        parts = [float(np.std(contribution(fit))) if fit.related else -1.0 for fit in self.fits]
        return int(np.argmax(parts))

    @property
    def disturbance(self) -> Real | None:
        """What moves the output beside the model, shape (n,): drift, hum, a change of the gain."""
        known = (self.drifting, self.humming, self.bending)
        trends = [one.trend for one in known if one is not None]
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
    aside: Mapping[int, JointFit],
    drifts: Callable[[int, JointFit], OutputFit | None] | None = None,
    briefly: bool = False,
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
    aside : mapping of int to JointFit
        Inputs that are not asked, each with its fit, which is not related.
    drifts : callable, optional
        Fits plain dynamics with a drift, given the input that leads and its plain fit, where what
        is strong leaves more than white noise: richer dynamics may take a drift for their own.
        What it returns is taken, unless it is None.
    briefly : bool
        Whether plain dynamics of what is strong are all that is fitted; the input that leads is
        then all that is returned.
    """
    fitted = partial(joint_fit, known=known, intersample=intersample, nuisance=nuisance)
    if len(inputs) == 1:
        return OutputFit(fits=(fitted(inputs[0], y, valid=valid, structures=structures),))
    plain = tuple(name for name in structures if name in PLAIN) or structures
    plainly = partial(fitted, structures=plain, growing=False)
    pairs = Pairs(y=y, valid=valid, fits={**aside}, strong=[], alike=alike, aside=aside)
    _lead(inputs, pairs, plainly)
    _join(inputs, pairs, plainly)
    if briefly:
        pairs.refine(pairs.kept, None)
        return OutputFit(fits=(pairs.fits[pairs.strong[0]],))
    if drifts is not None and whitening_of(pairs.left()) is not None:
        drifting = drifts(pairs.strong[0], pairs.fits[pairs.strong[0]])
        if drifting is not None:
            return drifting
    asked = pairs.cost
    _fit_couplings(inputs, pairs, plain)
    for _ in range(_TURNS):
        before = pairs.structures
        _fit_strong(inputs, pairs, partial(fitted, structures=structures, shared=True))
        left = pairs.cost
        pairs.refine(pairs.kept, None)
        clearer = pairs.cost * TWICE < asked
        if clearer:
            _join(inputs, pairs, plainly)
            asked = pairs.cost
        others = pairs.structures != before
        if others or clearer:
            _fit_couplings(inputs, pairs, plain)
            pairs.refine(pairs.kept, None)
        simpler = pairs.simplify()
        if not others and not simpler and pairs.cost * TWICE > left:
            break  # else each was fitted to the wrong rest
    if pairs.reopen():
        _fit_strong(inputs, pairs, partial(fitted, structures=structures))
        _fit_couplings(inputs, pairs, plain)
        pairs.refine(pairs.kept, None)
    if pairs.demote():
        _fit_couplings(inputs, pairs, plain)
    return _moved_at_once(pairs)


def set_free(
    fitted: OutputFit, inputs: list[Real], y: Real, asked: int, nuisance: Real | None
) -> OutputFit | None:
    """The same dynamics from a state that is free; None unless that leaves white noise.

    Parameters
    ----------
    fitted : OutputFit
        As it ended beside other rows.
    inputs, y, nuisance
        As for `fit_together`.
    asked : int
        The input that may have moved before the record; others may if they move from its start.
    """
    fits = {j: fit for j, fit in enumerate(fitted.fits) if fit.related}
    if asked not in fits or fits[asked].best.fit.structure.integrators:
        return None
    valid = common(fit.problem.valid for fit in fits.values())
    latest = max(int(np.ceil(fit.best.fit.delay)) for fit in fits.values())
    counted = begin_at(Seen(valid=valid, begins=None), max(latest, 0) + REACH, y.size)
    if counted is None:
        return None

    def freed(j: int, fit: JointFit) -> JointFit:
        moves = j == asked or in_motion(inputs[j])
        begins = counted.begins if moves else None
        problem = replace(fit.problem, valid=counted.valid, nuisance=nuisance, begins=begins)
        beside = np.zeros(0 if nuisance is None else len(nuisance))
        best = replace(fit.best, fit=replace(fit.best.fit, nuisance=beside))
        first = counted.first or 0
        return replace(fit, problem=problem, best=best, trials=(best,), forgotten=first)

    strong = [j for j, one in enumerate(fitted.strong) if one]
    pairs = Pairs(y=y, valid=counted.valid, fits={}, strong=strong, alike=(), aside={})
    for j, fit in enumerate(fitted.fits):
        pairs.put(j, freed(j, fit))
    pairs.refine(pairs.kept, None)
    found = pairs.fits[asked]
    if not found.best.fit.is_white:
        washed = washed_out(found.problem, found.best.fit)
        if washed is None:
            return None
        best = replace(found.best, fit=washed)
        pairs.put(asked, replace(found, best=best, trials=(best,), rivals=(), hidden=None))
        pairs.refine(pairs.kept, None)
    return _moved_at_once(pairs) if pairs.fits[asked].best.fit.is_white else None


def _moved_at_once(pairs: Pairs) -> OutputFit:
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
        problem, blocks, bias = derivatives(fits, whitening)
        told = dict(zip(pairs.kept, covariances(problem, fits[-1], blocks, bias), strict=True))
    for k, j in enumerate(pairs.kept):
        if j not in pairs.strong:
            lags[j] = own_lag(problem, fits[k], [*blocks[:k], *blocks[k + 1 :], bias])
    everyone = range(len(pairs.fits))
    return OutputFit(
        fits=tuple(pairs.fits[j] for j in everyone),
        covariances=tuple(told.get(j, np.zeros((0, 0))) for j in everyone),
        strong=tuple(j in pairs.strong for j in everyone),
        lags=tuple(lags.get(j) for j in everyone),
    )


def _fit_strong(inputs: list[Real], pairs: Pairs, fitted: Callable[..., JointFit]) -> None:
    """Fit, in place, each strong input to what all others leave over, unless that is as before."""
    for i in pairs.strong:
        rest, counted = pairs.without_others(i), pairs.counted_by_others(i)
        if not pairs.is_settled(i, rest, counted):
            pairs.put(i, fitted(inputs[i], rest, valid=counted))
            pairs.settle(i, rest, counted)


def _lead(inputs: list[Real], pairs: Pairs, fitted: Callable[..., JointFit]) -> None:
    """Fit, in place, the input that the output follows most."""
    level = bridged(pairs.y, pairs.valid)
    share = {j: _follows_at_all(inputs[j], level) for j in _waiting(inputs, pairs)}
    sums = {j: one for j in share if (one := _sum_in(inputs[j], level)) > share[j]}
    likely = dict.fromkeys([*_likely(share), *_likely(sums)])  # each is fitted once
    tried = {j: fitted(inputs[j], pairs.y, valid=pairs.valid) for j in likely}
    i = min(tried, key=lambda j: tried[j].best.fit.cost)
    pairs.put(i, tried[i])
    pairs.strong.append(i)


def _join(inputs: list[Real], pairs: Pairs, fitted: Callable[..., JointFit]) -> None:
    """Fit, in place, inputs that much of what is left over follows, the strongest first."""
    tried: dict[int, JointFit] = {}
    share, summed = _shares(inputs, pairs)
    while share:
        counted = pairs.counted(pairs.strong)
        likely = _likely(share)
        for j in likely:
            if j not in tried:
                tried[j] = fitted(inputs[j], pairs.without_others(j), valid=counted)
        i = min(likely, key=lambda j: tried[j].best.fit.cost)
        del share[i]
        if _is_large(tried[i]) and (
            _is_followed(tried[i]) or (i in summed and _is_summed(inputs[i], tried[i], fitted))
        ):
            pairs.put(i, tried[i])
            pairs.strong.append(i)
            pairs.refine(pairs.kept, None)
            tried, (share, summed) = {}, _shares(inputs, pairs)  # what is left is clearer now


def _shares(inputs: list[Real], pairs: Pairs) -> tuple[dict[int, float], set[int]]:
    """Amplitude (r.m.s.) that correlates with an input, or its sum, where it is much of the rest.

    And the inputs of which it is the sum alone.
    Friction correlates with an input that does not cause it; what follows one does so over all its
    band.
    """
    waiting = _waiting(inputs, pairs)
    counted = pairs.counted(pairs.strong)
    if counted is not None and np.count_nonzero(counted) < MOST * counted.size:
        counted = pairs.valid  # nothing is told of what is hardly seen
    constant = constant_of(pairs.fits[pairs.strong[0]])
    found: dict[int, float] = {}
    sums: set[int] = set()
    rare = FALSE_ALARM / max(len(waiting), 1)
    for j in waiting:
        rest = bridged(pairs.without_others(j) - constant, counted)
        least = PART * max(float(np.std(rest)), 1e-300)
        share = _follows_at_all(inputs[j], rest)
        if share > least:
            band = excited_band(inputs[j], 1.0)
            if misfit_at_any_lag(inputs[j], rest, band).probability < rare:
                found[j] = share
        elif (share := _sum_in(inputs[j], rest, rare)) > least:
            found[j] = share
            sums.add(j)
    return found, sums


def _sum_in(u: Real, rest: Real, rare: float = FALSE_ALARM) -> float:
    """Amplitude (r.m.s.) of an output that correlates with an input's sum; 0 if by chance.

    A sum shows the input in its increments, which of a drift are small.
    """
    moves = np.diff(rest, prepend=rest[0])
    if misfit_at_any_lag(u, moves, excited_band(u, 1.0)).probability >= rare:
        return 0.0
    return _follows_at_all(np.cumsum(u - u.mean()), rest)


def _likely(share: Mapping[int, float]) -> list[int]:
    """Inputs that may be the strongest: a delayed copy of one correlates as well."""
    most = max(share.values(), default=0.0)
    return [j for j, one in share.items() if one >= NEARLY * most]


def _is_large(fit: JointFit) -> bool:
    """Whether an input is much of what the others leave over."""
    counts = slice(None) if fit.problem.valid is None else fit.problem.valid
    left = fit.problem.y - constant_of(fit)
    return float(np.std(contribution(fit)[counts])) > PART * float(np.std(left[counts]))


def _waiting(inputs: list[Real], pairs: Pairs) -> list[int]:
    """Inputs that are asked and not strong."""
    return [j for j in range(len(inputs)) if j not in pairs.strong and j not in pairs.aside]


def _is_followed(tried: JointFit) -> bool:
    """Whether what is left over follows an input, and not too late.

    A pole as slow as the record explains a drift as well, and what answers late enough to leave
    out most of the record explains what the stronger inputs' models lack, such as friction.
    """
    return not spans_record(tried.best.fit) and _is_in_time(tried)


def _is_summed(u: Real, tried: JointFit, fitted: Callable[..., JointFit]) -> bool:
    """Whether what is left over follows the sum of an input: a drift explains less."""
    if not _is_in_time(tried):
        return False
    problem = tried.problem
    rows = drift_rows(problem.y.size)
    rows = rows if problem.nuisance is None else np.vstack([rows, problem.nuisance])
    beside = fitted(u, problem.y, valid=problem.valid, nuisance=rows).best.fit
    return spans_record(beside) or tried.best.fit.cost < beside.cost


def _is_in_time(tried: JointFit) -> bool:
    """Whether an output answers an input, over most of the record."""
    problem = tried.problem
    late = max(tried.best.fit.delay, problem.begins or 0)
    return tried.related and bool(late < MOST * problem.y.size)


def _follows_at_all(u: Real, y: Real) -> float:
    """Amplitude (r.m.s.) of the output that correlates with the input at the best lag."""
    size = max(float(np.linalg.norm(u - u.mean())), 1e-300)
    return abs(likeness(u, y, u.size // 2 - 1).there) / size / float(np.sqrt(u.size))


def _fit_couplings(inputs: list[Real], pairs: Pairs, structures: tuple[StructureName, ...]) -> None:
    """Fit, in place, all that is weak, the strongest first."""
    fits = pairs.fits
    best = fits[pairs.strong[0]]
    mode = best.best.intersample
    weak = _waiting(inputs, pairs)
    if not weak:
        return
    latest = max(PART * pairs.y.size, 4.0 * best.best.fit.delay) + 2.0
    rest = pairs.left()
    whitening = whitening_of(rest)
    modes = {j: pairs.between.get(j, mode) for j in weak}
    sources = {j: prepare_input(inputs[j], modes[j]) for j in weak}
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
            fit = coupling_fit(problem, inputs[j], intersample=modes[j], structures=names)
            pairs.put(j, fit)
        # Not before all are right is one of them tested: alike, they take each other's share.
        while pairs.together(whitening, drop=names is structures):
            pass
        rest = pairs.left()
        whitening = whitening_of(rest)
