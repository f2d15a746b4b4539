"""One output, several inputs at once: each pair's fit, with the others' contributions subtracted.

The input that moves the output most is fitted as if alone. Others join as long as one explains a
large part of the residual, each with its own beginning and assumption between the samples. Once all
are known, their initial states are decided together. They are fitted in turns, each to the output
without the others, until moving all at once gains little. Weak ones
(`hmpim.identify.coupling.weak`) are fitted with the noise whitened.

Then all pairs are moved at once, and only then is each coupling tested, with the others free: of
two inputs that are alike at some frequencies, the first may have explained a share of the other's
coupling. The error bars come from all pairs' derivatives together, so inputs that resemble each
other widen them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.chance import CLEARLY, FALSE_ALARM
from hmpim.identify.coupling.joint_errors import covariances, derivatives
from hmpim.identify.coupling.pairs import Pairs, constant_of, contribution, with_nuisance
from hmpim.identify.coupling.residual import misfit_at_any_lag
from hmpim.identify.coupling.weak import coupling_fit, whitening_of
from hmpim.identify.effects.disturbance import held_rows
from hmpim.identify.effects.drift import Drifting, drift_rows
from hmpim.identify.effects.gain import GainChange
from hmpim.identify.effects.hum import Humming
from hmpim.identify.fitting.candidates import spans_record
from hmpim.identify.fitting.course import Course, bridged
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.fit import Problem
from hmpim.identify.fitting.joint import fit_likeliest, joint_fit
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.nonlinear.modelled import Modelled
from hmpim.identify.section_iv.correlation import likeness
from hmpim.identify.section_iv.spectrum import excited_band
from hmpim.identify.worth import MOST, NEARLY, PART, TWICE
from hmpim.model.dynamics import StructureName
from hmpim.model.sampled import prepare_input
from hmpim.record import Intersample, is_held

__all__ = ["FitDrift", "Led", "OutputFit", "fit_leading", "fit_together", "without_slow"]

Led = Mapping[int, JointFit]
"""Fits to inputs that move an output strongly, the strongest first."""

_TURNS = 3
"""Times that the strong inputs are fitted, each with the others known."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OutputFit:
    """Fits of one output to each input; by default, to its only input."""

    # One for each input, to the output without the other inputs' contributions; not `related` if
    # the output does not follow the input at all.
    fits: tuple[JointFit, ...]
    covariances: tuple[Real, ...] = ()  # (p_i, p_i): of each fit's parameters, with all fits free
    strong: tuple[bool, ...] = (True,)  # whether the input's contribution is large, not a coupling
    drifting: Drifting | None = None  # drift of the bias; each fit's output is without it
    asked: int = 0  # the input with which the drift was fitted
    humming: Humming | None = None  # mains hum; each fit's output is without it
    gaining: GainChange | None = None  # a gain that changes, with one input only
    bending: Modelled | None = None  # a nonlinearity that the model includes
    bent: int = 0  # the input whose response has it
    begun: Course | None = None  # plain fits of the only input with a constant bias, if kept

    @property
    def prediction(self) -> Real:
        """Output predicted from all inputs, with bias and drift, shape (n,)."""
        first = next((fit for fit in self.fits if fit.related), self.fits[0]).best.fit
        total: Real = np.full(first.prediction.size, first.linear[-1])
        for fit in self.fits:
            if fit.related:
                total = total + contribution(fit)
        return total if self.disturbance is None else total + self.disturbance

    @property
    def slow(self) -> int | None:
        """An input whose fit may explain a drift; None without one."""
        for i, fit in enumerate(self.fits):
            if fit.related and self.strong[i] and _is_slow(fit):
                return i
        return None

    @property
    def led(self) -> Led:
        """Fits to the strong inputs, the strongest first, except those that may explain a drift."""
        known = [j for j, fit in enumerate(self.fits) if fit.related and self.strong[j]]
        known.sort(key=lambda j: -float(np.std(contribution(self.fits[j]))))
        return without_slow({j: self.fits[j] for j in known})

    @property
    def leading(self) -> int:
        """The input that moves the output most."""
        parts = [float(np.std(contribution(fit))) if fit.related else -1.0 for fit in self.fits]
        return int(np.argmax(parts))

    def bending_of(self, i: int) -> Modelled | None:
        """The nonlinearity of the response to an input, if the model includes one."""
        return self.bending if i == self.bent else None

    @property
    def disturbance(self) -> Real | None:
        """Output motion that the linear model does not cause, (n,): drift, hum, a nonlinearity."""
        known = (self.drifting, self.humming, self.bending)
        trends = [one.trend for one in known if one is not None]
        if self.gaining is not None and self.gaining.taken:
            trends.append(self.gaining.trend)
        return np.sum(trends, axis=0) if trends else None


FitDrift = Callable[[Led, Callable[[Led], OutputFit]], OutputFit | None]
"""Fit plain dynamics with a drift. Arguments: the fits to the strong inputs, and a function that
fits given inputs without a drift."""


def without_slow(led: Led) -> Led:
    """The fits that are not as slow as a drift."""
    return {j: fit for j, fit in led.items() if not _is_slow(fit)}


def _is_slow(fit: JointFit) -> bool:
    """Whether a fit may explain a drift."""
    return spans_record(fit.best.fit) or fit.lingers


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
    led: Led | None = None,
    fit_drift: FitDrift | None = None,
    strong_only: bool = False,
) -> OutputFit:
    """Fit one output, (n,), to several inputs.

    `valid`, `known`, `intersample` and `structures` are as for
    `hmpim.identify.fitting.joint.joint_fit`; `known` is for all inputs together. `alike` names
    inputs that cannot be distinguished, and the bins where they cannot, (n // 2 + 1,): there, a
    coupling may be an error of the stronger input's model. `nuisance`, (k, n), are more rows that
    enter linearly, such as a drift's.
    The search starts from the fits `led` if given; they may have been made with other rows.

    If the strong inputs do not leave white noise, richer dynamics may explain a drift: `fit_drift`
    then fits plain dynamics with one, given the plain fits to the strong inputs and a function that
    fits plain dynamics without a drift to given inputs; its value is returned unless it is None. If
    `strong_only`, only strong inputs are fitted, with plain dynamics, and the others count as
    unrelated.
    """
    fitted = partial(joint_fit, known=known, intersample=intersample, nuisance=nuisance)
    if len(inputs) == 1:
        return OutputFit(fits=(fitted(inputs[0], y, valid=valid, structures=structures),))
    plain = tuple(name for name in structures if name in PLAIN) or structures
    plainly = partial(fitted, structures=plain, growing=False)
    pairs = Pairs(y=y, valid=valid, fits={}, strong=[], alike=alike)
    options = {"known": known, "intersample": intersample, "structures": plain}
    begun = led or fit_leading(inputs, y, valid, nuisance=nuisance, **options)
    pairs.resume(begun, nuisance)
    if led and strong_only:
        _fit_strong(inputs, pairs, plainly)
        pairs.refine(pairs.kept, None)
    joined = len(pairs.strong)
    _join(inputs, pairs, plainly)
    white = whitening_of(pairs.residual()) is None
    more = len(pairs.strong) > joined and not white
    if strong_only:
        pairs = _fitted_once_more(inputs, pairs, plainly) if more else pairs
        none = replace(pairs.fits[pairs.strong[0]], related=False)
        return OutputFit(
            fits=tuple(pairs.fits.get(j, none) for j in range(len(inputs))),
            strong=tuple(j in pairs.strong for j in range(len(inputs))),
        )
    if fit_drift is not None and not white and _may_drift(pairs):

        def steady(found: Led) -> OutputFit:
            same = Pairs(y=y, valid=valid, fits={}, strong=[], alike=alike)
            same.resume(found, nuisance)
            same = _fitted_once_more(inputs, same, plainly)
            _fit_couplings(inputs, same, plain)
            return _moved_at_once(same)

        drifting = fit_drift({j: pairs.fits[j] for j in pairs.strong}, steady)
        if drifting is not None:
            return drifting
    if more and pairs.cost < (PART * pairs.spread) ** 2:
        again = _fitted_once_more(inputs, pairs, plainly)
        if TWICE * again.cost < pairs.cost or whitening_of(again.residual()) is None:
            pairs = again
    return _finished(inputs, pairs, fitted, plainly, structures)


def _may_drift(pairs: Pairs) -> bool:
    """Whether a drift, added to the strong inputs' fits, explains much of what they leave."""
    related = (pairs.fits[i] for i in pairs.strong if pairs.fits[i].related)
    if any(map(_is_slow, related)):  # this fit may explain it
        return True
    again, rows = pairs.copied(), drift_rows(pairs.y.size)
    for i in pairs.strong:
        again.put(i, with_nuisance(pairs.fits[i], rows))
    again.refine(again.kept, None)
    return again.cost < (1.0 - PART) * pairs.cost


def _fitted_once_more(inputs: list[Real], pairs: Pairs, plainly: Callable[..., JointFit]) -> Pairs:
    """Fit each strong input once more: it was fitted before the later ones were found."""
    again = pairs.copied()
    _fit_strong(inputs, again, plainly)
    again.refine(again.kept, None)
    again.free_states(inputs)
    return again


def _finished(
    inputs: list[Real],
    pairs: Pairs,
    fitted: Callable[..., JointFit],
    plainly: Callable[..., JointFit],
    structures: tuple[StructureName, ...],
) -> OutputFit:
    """Fit the strong inputs and the couplings until moving all at once gains little."""
    richly = partial(fitted, structures=structures, shared=True)
    least = pairs.cost
    _fit_couplings(inputs, pairs, structures)
    for _ in range(_TURNS):
        before, reached, rest = pairs.structures, pairs.cost, pairs.residual()
        fits, masks = {**pairs.fits}, {**pairs.masks}
        _fit_strong(inputs, pairs, richly, only_new=True)
        pairs.refine(pairs.kept, None)
        if pairs.cost > TWICE * reached and whitening_of(rest) is None:  # it ended elsewhere
            pairs.fits.update(fits)
            pairs.masks.update(masks)
            break
        clearer = pairs.cost * TWICE < least
        if clearer:
            _join(inputs, pairs, plainly)
            least = pairs.cost
        if pairs.structures == before and not clearer:
            break  # otherwise each was fitted with wrong contributions of the others
        _fit_couplings(inputs, pairs, structures)
        pairs.refine(pairs.kept, None)
    return _moved_at_once(pairs)


def _moved_at_once(pairs: Pairs) -> OutputFit:
    """Move all pairs at once, noise whitened, until no coupling is dropped; add the error bars."""
    whitening = whitening_of(pairs.residual())
    if whitening is not None:
        pairs.refine(pairs.kept, whitening)
    while pairs.together(whitening):
        pairs.refine(pairs.kept, whitening)
    errors: dict[int, Real] = {}
    fits = [pairs.fits[j] for j in pairs.kept]
    if fits:
        problem, blocks, bias = derivatives(fits, whitening)
        errors = dict(zip(pairs.kept, covariances(problem, fits[-1], blocks, bias), strict=True))
    everyone = range(len(pairs.fits))
    return OutputFit(
        fits=tuple(pairs.fits[j] for j in everyone),
        covariances=tuple(errors.get(j, np.zeros((0, 0))) for j in everyone),
        strong=tuple(j in pairs.strong for j in everyone),
    )


def _fit_strong(
    inputs: list[Real], pairs: Pairs, fitted: Callable[..., JointFit], *, only_new: bool = False
) -> None:
    """Fit each strong input, in place, to the output without the others.

    With `only_new`, only if that has changed since the last such fit. Unless the residual is white,
    the free responses of the others may change too (`_fit_beside`).
    """
    white = whitening_of(pairs.residual()) is None
    for i in pairs.strong:
        rest, counted = pairs.without_others(i), pairs.counted(j for j in pairs.kept if j != i)
        if not only_new or pairs.is_new(i, rest, counted):
            fit = partial(fitted, inputs[i], rest, valid=counted)
            own, free = pairs.fits[i].problem.nuisance, pairs.free_of_others(i)
            pairs.put(i, fit() if white or not len(free) else _fit_beside(fit, own, free))


def _fit_beside(fitted: Callable[..., JointFit], own: Real | None, free: Real) -> JointFit:
    """Fit an input with rows of its own, (k, n), and the free responses of the others, (m, n).

    Those of similar modes are nearly interchangeable: if one changes, the others must.
    """
    rows = free if own is None else np.vstack([own, free])
    fit = fitted(nuisance=rows, small=len(free))
    return held_rows(fit, len(rows) - len(free))


def fit_leading(
    inputs: list[Real],
    y: Real,
    valid: Mask | None,
    **options: Any,
) -> Led:
    """Fit the input that an output, (n,), follows most; the others count as noise.

    The options are those of `hmpim.identify.fitting.joint.fit_likeliest`.
    """
    level = bridged(y, valid)
    share = {j: _follows_at_all(u, level) for j, u in enumerate(inputs)}
    sums = {j: one for j in share if (one := _sum_in(inputs[j], level)) > share[j]}
    likely = {j: inputs[j] for j in (*_likely(share), *_likely(sums))}
    return dict([fit_likeliest(likely, y, valid=valid, **options)])


def _join(inputs: list[Real], pairs: Pairs, fitted: Callable[..., JointFit]) -> None:
    """Fit inputs that explain a large part of the residual, in place, the strongest first."""
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
        own = pairs.fits.get(i)
        if own is not None and own.related and _leaves_less(own, tried[i]):
            continue  # it is a coupling
        if _is_large(tried[i]) and _responds(inputs[i], tried[i], fitted, summed=i in summed):
            pairs.put(i, tried[i])
            pairs.strong.append(i)
            pairs.refine(pairs.kept, None)
            tried, (share, summed) = {}, _shares(inputs, pairs)  # the residual is clearer now
    pairs.free_states(inputs)


def _shares(inputs: list[Real], pairs: Pairs) -> tuple[dict[int, float], set[int]]:
    """Amplitude (r.m.s.) that each input, or its sum, explains, if it is much of the residual.

    The second value is the inputs of which only the sum does. Friction correlates with an input
    that does not cause it; a response to an input follows it over all its band.
    """
    waiting = _waiting(inputs, pairs)
    counted = pairs.counted(pairs.strong)
    constant = constant_of(pairs.fits[pairs.strong[0]])
    found: dict[int, float] = {}
    sums: set[int] = set()
    rare = FALSE_ALARM / max(len(waiting), 1)
    strong = [(inputs[i], pairs.fits[i].best.fit.delay) for i in pairs.strong]
    for j in waiting:
        rest = bridged(pairs.without_others(j) - constant, counted)
        least = PART * max(float(np.std(rest)), 1e-300)
        share = _follows_at_all(inputs[j], rest)
        if share > least:
            band = excited_band(inputs[j], 1.0)
            if misfit_at_any_lag(inputs[j], rest, band, strong).probability < rare:
                found[j] = share
        elif (share := _sum_in(inputs[j], rest, rare)) > least:
            found[j] = share
            sums.add(j)
    return found, sums


def _sum_in(u: Real, rest: Real, rare: float = FALSE_ALARM) -> float:
    """Amplitude (r.m.s.) that correlates with an input's sum; 0 if it may be by chance.

    The increments of such a response follow the input, and those of a drift are small.
    """
    moves = np.diff(rest, prepend=rest[0])
    if misfit_at_any_lag(u, moves, excited_band(u, 1.0)).probability >= rare:
        return 0.0
    return _follows_at_all(np.cumsum(u - u.mean()), rest)


def _likely(share: Mapping[int, float]) -> list[int]:
    """Inputs that may be the strongest: a delayed copy of one correlates as well."""
    most = max(share.values(), default=0.0)
    return [j for j, one in share.items() if one >= NEARLY * most]


def _leaves_less(one: JointFit, other: JointFit) -> bool:
    """Whether a fit is clearly likelier than another, as its residual is smaller."""
    (own, few), (rest, many) = ((f.best.fit.cost, f.problem.counted) for f in (one, other))
    return bool(0.5 * few * np.log(max(rest / many, 1e-300) / max(own / few, 1e-300)) > CLEARLY)


def _is_large(fit: JointFit) -> bool:
    """Whether an input explains a large part of the output without the others."""
    counts = slice(None) if fit.problem.valid is None else fit.problem.valid
    rest = fit.problem.y - constant_of(fit)
    return float(np.std(contribution(fit)[counts])) > PART * float(np.std(rest[counts]))


def _waiting(inputs: list[Real], pairs: Pairs) -> list[int]:
    """Inputs that are not strong."""
    return [j for j in range(len(inputs)) if j not in pairs.strong]


def _responds(u: Real, tried: JointFit, fitted: Callable[..., JointFit], *, summed: bool) -> bool:
    """Whether the output responds to an input or, if `summed`, its sum, rather than drifts.

    A response so late that it leaves out most of the record explains errors of the stronger inputs'
    models, such as friction. A pole as slow as the record also explains a drift: it counts only if
    a drift explains less than the sum does.
    """
    problem, fit = tried.problem, tried.best.fit
    if not tried.related or max(fit.delay, problem.begins or 0) >= MOST * problem.y.size:
        return False
    if not spans_record(fit):
        return True
    if not summed:
        return False
    rows = drift_rows(problem.y.size)
    rows = rows if problem.nuisance is None else np.vstack([rows, problem.nuisance])
    drifting = fitted(u, problem.y, valid=problem.valid, nuisance=rows).best.fit
    return spans_record(drifting) or fit.cost < drifting.cost


def _follows_at_all(u: Real, y: Real) -> float:
    """Amplitude (r.m.s.) of the output that correlates with the input at the best lag."""
    size = max(float(np.linalg.norm(u - u.mean())), 1e-300)
    return abs(likeness(u, y, u.size // 2 - 1).there) / size / float(np.sqrt(u.size))


def _fit_couplings(inputs: list[Real], pairs: Pairs, structures: tuple[StructureName, ...]) -> None:
    """Fit all weak couplings, in place, the strongest first."""
    fits = pairs.fits
    best = fits[pairs.strong[0]]
    mode = best.best.intersample
    weak = _waiting(inputs, pairs)
    if not weak:
        return
    latest = max(PART * pairs.y.size, 4.0 * best.best.fit.delay) + 2.0
    rest = pairs.residual()
    # A coupling answers about as late as the axis of the strongest input.
    late = likeness(inputs[pairs.strong[0]], contribution(best), pairs.y.size // 2 - 1).lag
    others = [inputs[j] for j in weak]
    whitening = whitening_of(rest, others, late=late)
    mode = "zoh" if is_held(mode) else mode  # a coupling receives no feedforward
    sources = {j: prepare_input(inputs[j], mode) for j in weak}
    roughly = tuple(name for name in structures if name == "first_order") or structures
    known = all(j in fits for j in weak)
    for names in (structures,) if known else (roughly, structures):  # whitened anew each time
        for j in sorted(weak, key=lambda j: -_follows_at_all(inputs[j], rest)):
            problem = Problem(
                source=sources[j],
                y=pairs.without_others(j),
                valid=best.problem.valid,
                longest_delay=latest,
                whitening=whitening,
                nuisance=best.problem.nuisance,
            )
            if names is not structures:
                problem = pairs.apart(problem, j)
            fit = coupling_fit(problem, inputs[j], intersample=mode, structures=names)
            pairs.put(j, fit)
        # Test none before all are fitted: inputs that are alike explain each other's share.
        while pairs.together(whitening, drop=names is structures):
            pass
        rest = pairs.residual()
        whitening = whitening_of(rest, others, late=late)
