"""The joint fit: structure, and what the input does between samples, chosen by the data.

Each structure is fitted from starts that come from the data; the Bayesian information
criterion (G. Schwarz, Annals of Statistics 6, 1978) chooses, with the number of samples
counted down for a residual that is not white. The assumption between the samples is
chosen by likelihood alone, since none costs a parameter. For an input that is smooth
against the rate and a system that filters it, held, linear and band-limited differ
by little more than half a sample of delay, which no likelihood sees; the input is then
taken as band-limited unless the record speaks clearly against it.
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

_INTERSAMPLES: tuple[Intersample, ...] = ("bandlimited", "zoh", "foh")

_DELAY_SHIFT: dict[Intersample, float] = {"zoh": -0.5, "foh": 0.0, "bandlimited": 0.0}
"""Samples by which the fitted delay moves when held, against the other two."""

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
    if forgotten:
        counted = np.ones(y.size, dtype=bool) if valid is None else valid.copy()
        counted[:forgotten] = False
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
    chosen = _chosen(trials)
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
    """Fit each structure, the richest first: what it leaves tells which others are hopeless."""
    fits: list[Fit] = []
    for name in sorted(structures, key=lambda name: -STRUCTURES[name].order):
        structure = STRUCTURES[name]
        starts = starting_values(rough, structure, earliest=-2)
        enough = _HOPELESS * min((fit.cost for fit in fits), default=0.0)
        fit = fit_structure(problem, structure, starts[0], iterations=3 if enough else 40)
        for theta in starts[1:]:
            if enough < fit.cost and not is_white(fit.residual):
                other = fit_structure(problem, structure, theta, iterations=3)
                fit = min(fit, other, key=lambda f: f.cost)
        if not fit.converged and (enough == 0.0 or fit.cost < enough):
            fit = fit_structure(problem, structure, fit.theta)
        fits.append(fit)
    return fits


def _moved(problem: Problem, fit: Fit, origin: Intersample, mode: Intersample) -> Fit:
    """Fit the same structure under another assumption, from where the first one ended."""
    theta = fit.theta.copy()
    theta[0] += _DELAY_SHIFT[mode] - _DELAY_SHIFT[origin]
    return fit_structure(problem, fit.structure, theta)


def _refit(problem: Problem, fit: Fit) -> Fit:
    return fit_structure(problem, fit.structure, fit.theta)


def _forgotten(fits: list[Fit], valid: NDArray[np.bool_] | None) -> int:
    """Samples at the start that a system at rest cannot explain, to be left out."""
    fit = min(fits, key=lambda f: f.cost)
    n = fit.residual.size
    slowest = 0.0
    if fit.structure.order:
        poles = np.roots(fit.denominator[::-1])
        slowest = float(np.max(-1.0 / poles.real))
    span = int(np.ceil(max(fit.delay, 0.0) + _SETTLED * slowest)) + 2
    span = min(span, n // 4)
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


def _chosen(trials: list[Trial]) -> Trial:
    best = min(trials, key=lambda trial: trial.criterion)
    smooth = [trial for trial in trials if trial.intersample == "bandlimited"]
    if not smooth or best in smooth:
        return best
    rival = min(smooth, key=lambda trial: trial.criterion)
    return best if rival.criterion - best.criterion > 2 * CLEARLY else rival
