"""The joint fit: structure, and what the input does between samples, chosen by the data.

Each structure is fitted from starts that come from the data; the Bayesian information
criterion (G. Schwarz, Annals of Statistics 6, 1978) chooses, with the number of samples
counted down for a residual that is not white. The assumption between the samples is
chosen by likelihood alone, since none costs a parameter. For an input that is smooth
against the rate and a system that filters it, held, linear and band-limited differ
by little more than half a sample of delay, which no likelihood sees; the input is then
taken as band-limited, or as held if it mostly stands still and jumps, unless the record speaks
clearly against it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmpim.identify.fit import Fit, Problem, fit_structure
from hmpim.identify.start import RoughResponse, rough_response, starting_values
from hmpim.identify.whiteness import effective_share, is_white
from hmpim.model.dynamics import STRUCTURES, StructureName
from hmpim.model.sampled import prepare_input
from hmpim.record import Intersample

__all__ = ["CLEARLY", "JointFit", "Trial", "joint_fit"]

CLEARLY = 6.0
"""Difference in log-likelihood that decides against the natural assumption (odds of 400)."""

_HOPELESS = 2.0
"""A structure whose sum of squares is this many times the least is not tried again at once
under the other assumptions."""

_TASTE = 4
"""Steps taken from each start before the best one is followed to its end."""

_FALLING = 10.0
"""After so many steps a structure is given up if its sum of squares is this far from hopeful."""

_INTERSAMPLES: tuple[Intersample, ...] = ("bandlimited", "zoh", "foh")

_DELAY_SHIFT: dict[Intersample, float] = {"zoh": -0.5, "foh": 0.0, "bandlimited": 0.0}
"""Samples by which the fitted delay moves when held, against the other two."""

_JUMP = 0.05
"""Share of its range by which a held input jumps at least once."""

_FINAL_PRECISION = 1e-6
"""Precision of the chosen fit, see `fit_structure`."""

_SETTLED = 5.0
"""Time constants after which what came before the record is forgotten (0.7 % left)."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trial:
    """One structure under one assumption, fitted; `criterion` lower is better."""

    intersample: Intersample
    fit: Fit
    criterion: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointFit:
    """The chosen trial, all others, and the data they were fitted to.

    Parameters
    ----------
    problem : Problem
        The data under the chosen assumption, with the samples that counted.
    best : Trial
        The chosen one.
    trials : tuple of Trial
        All, the chosen one included.
    forgotten : int
        Samples left out at the beginning because the record does not begin at rest.
    effective_share : float
        Independent samples per sample, from the best residual's correlation.
    """

    problem: Problem
    best: Trial
    trials: tuple[Trial, ...]
    forgotten: int
    effective_share: float


def joint_fit(
    u: NDArray[np.float64],
    y: NDArray[np.float64],
    *,
    valid: NDArray[np.bool_] | None = None,
    known: NDArray[np.bool_] | None = None,
    intersample: Intersample | None = None,
    structures: tuple[StructureName, ...] = ("static", "first_order", "second_order"),
) -> JointFit:
    """Fit every structure and keep the one that the record supports.

    Parameters
    ----------
    u, y : ndarray, shape (n,)
        Uniform samples of input and output.
    valid : ndarray of bool, shape (n,), optional
        Output samples that count; all if None.
    known : ndarray of bool, shape (n,), optional
        Input samples that were measured, not filled in; what the output does until it has
        forgotten the others does not count. All if None.
    intersample : {'zoh', 'foh', 'bandlimited'}, optional
        What the input does between samples; chosen by likelihood if None.
    structures : tuple of str
        Which to try.

    Returns
    -------
    JointFit
    """
    longest = u.size // 2
    rough = rough_response(u, y if valid is None else _bridged(y, valid), longest_delay=longest)
    modes = _INTERSAMPLES if intersample is None else (intersample,)
    sources = {mode: prepare_input(u, mode) for mode in modes}

    def problem_for(mode: Intersample, counted: NDArray[np.bool_] | None) -> Problem:
        return Problem(source=sources[mode], y=y, valid=counted, longest_delay=float(longest + 2))

    first = modes[0]
    fits = _fit_all(problem_for(first, valid), rough, structures)
    forgotten = _forgotten(fits, valid)
    ahead = _ahead(fits)
    if forgotten or ahead or known is not None:
        counted = np.ones(y.size, dtype=bool) if valid is None else valid.copy()
        counted[:forgotten] = False
        counted[y.size - ahead :] = False
        if known is not None:
            counted &= _unaffected(known, _memory(fits))
        valid = counted
        fits = [fit_structure(problem_for(first, valid), f.structure, f.theta) for f in fits]
    fitted: list[tuple[Intersample, Fit]] = [(first, fit) for fit in fits]
    least = min(fit.cost for fit in fits)
    leading = [fit for fit in fits if fit.cost < _HOPELESS * least]
    for mode in modes[1:]:
        problem = problem_for(mode, valid)
        fitted += [(mode, _moved(problem, fit, first, mode)) for fit in leading]
    likeliest, _ = min(fitted, key=lambda item: item[1].cost)
    if likeliest != first:  # what was hopeless under a wrong assumption may not be so now
        for mode in modes[1:]:
            problem = problem_for(mode, valid)
            fitted += [(mode, _moved(problem, f, first, mode)) for f in fits if f not in leading]
    share = effective_share(min(fitted, key=lambda item: item[1].cost)[1].residual)
    count = problem_for(first, valid).counted * share
    trials = [_trial(mode, fit, count) for mode, fit in fitted]
    chosen = _chosen(trials, "zoh" if _looks_held(u) else "bandlimited")
    problem = problem_for(chosen.intersample, valid)
    polished = fit_structure(
        problem, chosen.fit.structure, chosen.fit.theta, precision=_FINAL_PRECISION
    )
    best = _trial(chosen.intersample, polished, count)
    trials = [best if trial is chosen else trial for trial in trials]
    return JointFit(
        problem=problem,
        best=best,
        trials=tuple(trials),
        forgotten=forgotten,
        effective_share=share,
    )


def _bridged(y: NDArray[np.float64], valid: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Fill samples that do not count by straight lines, for spectra."""
    index = np.arange(y.size)
    return np.interp(index, index[valid], y[valid])


def _fit_all(
    problem: Problem, rough: RoughResponse, structures: tuple[StructureName, ...]
) -> list[Fit]:
    """Fit each structure, the richest first, from its own starts and then from the simpler ones.

    A residual that is white needs no other start, and tells which simpler structures are
    hopeless: those get one start and few steps.
    """
    fits: list[Fit] = []
    settled = False
    for name in sorted(structures, key=lambda name: -STRUCTURES[name].order):
        structure = STRUCTURES[name]
        starts = starting_values(rough, structure, earliest=-2, thorough=not settled)
        fit = fit_structure(problem, structure, starts[0], iterations=_TASTE)
        hopeful = min((f.cost for f in fits), default=np.inf) * _HOPELESS
        white = fit.cost < hopeful and is_white(fit.residual)
        if not white:
            for theta in starts[1:] if fit.cost < _FALLING * hopeful else []:
                rival = fit_structure(problem, structure, theta, iterations=_TASTE)
                fit = min(fit, rival, key=lambda f: f.cost)
        settled = settled or white
        fits.append(fit)
    for i, fit in enumerate(fits):
        for other in fits:
            if _nests(other, fit):
                rival = fit_structure(problem, fit.structure, _nested(other), iterations=_TASTE)
                fits[i] = min(fits[i], rival, key=lambda f: f.cost)
    least = min(fit.cost for fit in fits)
    return [
        fit
        if fit.converged or fit.cost > _FALLING * least
        else fit_structure(problem, fit.structure, fit.theta)
        for fit in fits
    ]


def _nests(simple: Fit, rich: Fit) -> bool:
    """Whether the simpler structure is a start for a richer one that may have missed its best."""
    return (
        simple.structure.name == "first_order"
        and rich.structure.name == "second_order"
        and (simple.cost <= rich.cost or not is_white(rich.residual))
    )


def _nested(first_order: Fit) -> NDArray[np.float64]:
    """First order as second: a quarter of its time constant moved into a second pole."""
    return np.concatenate([first_order.theta, [0.1875]])  # (1 + 3/4 Ts)(1 + 1/4 Ts)


def _moved(problem: Problem, fit: Fit, origin: Intersample, mode: Intersample) -> Fit:
    """Fit the same structure under another assumption, from where the first one ended."""
    theta = fit.theta.copy()
    theta[0] += _DELAY_SHIFT[mode] - _DELAY_SHIFT[origin]
    return fit_structure(problem, fit.structure, theta)


def _refit(problem: Problem, fit: Fit) -> Fit:
    return fit_structure(problem, fit.structure, fit.theta)


def _memory(fits: list[Fit]) -> int:
    """Samples after which the output has forgotten its input, by the best fit so far."""
    fit = min(fits, key=lambda f: f.cost)
    slowest = 0.0
    if fit.structure.order:
        slowest = float(np.max(-1.0 / np.roots(fit.denominator[::-1]).real))
    span = int(np.ceil(max(fit.delay, 0.0) + _SETTLED * slowest)) + 2
    return min(span, fit.residual.size // 4)


def _ahead(fits: list[Fit]) -> int:
    """Samples at the end that depend on input after the record, if the delay is negative."""
    delay = min(fits, key=lambda f: f.cost).delay
    return int(np.ceil(-delay)) + 3 if delay < 0 else 0


def _unaffected(known: NDArray[np.bool_], memory: int) -> NDArray[np.bool_]:
    """Samples whose output depends on measured input alone."""
    unknown = np.concatenate([[0], np.cumsum(~known)])
    index = np.arange(known.size)
    return np.asarray(unknown[index + 1] == unknown[np.maximum(index - memory, 0)])


def _forgotten(fits: list[Fit], valid: NDArray[np.bool_] | None) -> int:
    """Samples at the start that a system at rest cannot explain, to be left out."""
    fit = min(fits, key=lambda f: f.cost)
    n = fit.residual.size
    span = _memory(fits)
    counted = np.ones(n, dtype=bool) if valid is None else valid
    early, late = fit.residual[:span][counted[:span]], fit.residual[span:][counted[span:]]
    if early.size == 0 or late.size == 0:
        return 0
    level = float(np.median(late**2)) / 0.455  # median of a squared Gaussian of unit variance
    excess = float(np.mean(early**2)) / max(level, np.finfo(float).tiny)
    return span if excess > 1.0 + 10.0 * np.sqrt(2.0 / early.size) and excess > 4.0 else 0


def _trial(mode: Intersample, fit: Fit, count: float) -> Trial:
    tiny = np.finfo(float).tiny
    criterion = count * np.log(max(fit.cost, tiny) / count) + fit.structure.parameters * np.log(
        count
    )
    return Trial(intersample=mode, fit=fit, criterion=float(criterion))


def _looks_held(u: NDArray[np.float64]) -> bool:
    """Whether an input stands still most of the time and then jumps, as a held one does."""
    jumps = np.abs(np.diff(u))
    moving = jumps[jumps > 0]
    return bool(moving.size < 0.5 * jumps.size and moving.max() > _JUMP * np.ptp(u))


def _chosen(trials: list[Trial], natural: Intersample) -> Trial:
    best = min(trials, key=lambda trial: trial.criterion)
    rivals = [trial for trial in trials if trial.intersample == natural]
    if not rivals or best in rivals:
        return best
    rival = min(rivals, key=lambda trial: trial.criterion)
    return best if rival.criterion - best.criterion > 2 * CLEARLY else rival
