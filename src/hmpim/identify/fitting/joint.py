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

from dataclasses import dataclass, replace
from typing import get_args

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.special import chdtri

from hmpim.identify.fitting.autoregression import autoregression
from hmpim.identify.fitting.enrich import (
    INTEGRATING,
    PLAIN,
    RICH,
    integrator_starts,
    members,
    proposals,
)
from hmpim.identify.fitting.fit import Fit, Problem, fit_structure, jacobian, solved
from hmpim.identify.fitting.rows import Part
from hmpim.identify.fitting.start import RoughResponse, rough_response, starting_values
from hmpim.identify.fitting.unexplained import unexplained_response
from hmpim.identify.fitting.unrelated import is_unrelated, says_nothing
from hmpim.identify.uncertainty import covariance
from hmpim.identify.whiteness import effective_share, is_white, misfit
from hmpim.model.dynamics import STRUCTURES, Structure, StructureName
from hmpim.model.response import slowest_time_constant
from hmpim.model.sampled import SampledInput, prepare_input
from hmpim.record import Intersample

__all__ = ["CLEARLY", "JointFit", "Trial", "joint_fit", "nested"]

CLEARLY = 6.0
"""Difference in log-likelihood that decides against the natural assumption (odds of 400)."""

_HOPELESS = 2.0
"""A structure whose sum of squares is this many times the least is not tried again at once
under the other assumptions."""

_MATERIAL = 0.01
"""Share of the output (r.m.s.) below which a misfit is reported but not modelled."""

_PARTLY = 0.08
"""Share of the response, evenly over the band, below which the same holds."""

_POOR = 0.2
"""Share of the output's power left over, in colour, that asks for a richer structure anyway."""

_LONG_TASTE = 12
"""Steps from each start of a richer structure, whose valleys are longer."""

_SLOW = 0.3
"""Time constant, over the record's length, from which an integrator may explain it as well."""

_SURE = 4
"""Poles up to which a structure may leave more than white noise."""

_AT_ONCE = 4
"""Richer structures tried before it is asked whether more are needed."""

_RETURNS = 12
"""Steps that a fit is taken once more when only the noise model has changed."""

_TASTE = 4
"""Steps taken from each start before the best one is followed to its end."""

_FALLING = 4.0
"""After so many steps a structure is given up if its sum of squares is this far from hopeful."""

_DELAY_SHIFT: dict[Intersample, float] = {"zoh": -0.5, "foh": 0.0, "bandlimited": 0.0}
"""Samples by which the fitted delay moves when held, against the other two."""

_FAR = 4.0
"""Standard deviations of the delay beyond which another structure contradicts the chosen one."""

_JUMP = 0.05
"""Share of its range by which a held input jumps at least once."""

_PRECISION = 1e-2
"""Precision of a fit that is weighed against others, see `fit_structure`."""

_FINAL_PRECISION = 1e-6
"""Precision of the chosen fit, see `fit_structure`."""

_FOLLOWS = 1e-4
"""Chance below which what is left over follows the input."""

_HIDES = 0.1
"""Share of a residual's power that is not foreseen, below which its colour may hide a response."""

_REACH = 4
"""Samples by which what lies between the samples reaches back: half of a spline's support."""

_REST = 1e-4
"""Chance of taking a record at rest for one in mid-motion."""

_TWICE = 2.0
"""Factor on what the beginning may hold, for noise that is not white or not Gaussian."""

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
    weighed : Problem
        The same with the noise whitened, as all trials were weighed.
    best : Trial
        The chosen one.
    trials : tuple of Trial
        All, the chosen one included.
    forgotten : int
        Samples left out at the beginning because the record does not begin at rest: as long as
        the output still depends on input before it.
    effective_share : float
        Independent samples per sample, from the best residual's correlation.
    related : bool
        Whether the best model explains more than a constant does.
    silent : bool
        Whether no model can: the output does not answer the input at all.
    simpler : Trial or None
        What the criterion alone would have chosen, where a richer structure was taken for its
        wider error bars.
    """

    problem: Problem
    weighed: Problem
    best: Trial
    trials: tuple[Trial, ...]
    forgotten: int
    effective_share: float
    related: bool
    silent: bool = False
    simpler: Trial | None = None


def joint_fit(
    u: NDArray[np.float64],
    y: NDArray[np.float64],
    *,
    valid: NDArray[np.bool_] | None = None,
    known: NDArray[np.bool_] | None = None,
    intersample: Intersample | None = None,
    structures: tuple[StructureName, ...] = (*PLAIN, *RICH, *INTEGRATING),
    nuisance: NDArray[np.float64] | None = None,
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
    nuisance : ndarray, shape (k, n), optional
        Rows beside the bias that enter linearly, such as a drift's.

    Returns
    -------
    JointFit
    """
    if intersample is None and _looks_held(u):
        intersample = "zoh"  # an input that stands still and jumps does nothing else
    natural: Intersample = "bandlimited" if intersample is None else intersample
    level = y if nuisance is None else y - _regressed(nuisance, y, valid)
    data = _Data(
        u=u,
        y=y,
        sources={natural: prepare_input(u, natural)},
        rough=rough_response(
            u, level if valid is None else _bridged(level, valid), longest_delay=u.size // 2
        ),
        nuisance=nuisance,
    )
    plain = tuple(name for name in structures if name in PLAIN)
    seen = _Seen(valid=valid, begins=None)
    fits = _fit_all(data.problem(natural, seen), data.rough, plain or PLAIN)
    prewhitened = _prewhitened(data, natural, fits, seen)
    if prewhitened is not None:
        free = _fit_all(prewhitened.problem(natural, seen), prewhitened.rough, plain or PLAIN)
        if not _follows(data, min(free, key=lambda f: f.objective)):
            data, fits = prewhitened, free
    counted = _counted(data, natural, fits, seen, known)
    if counted is not seen:
        fits = [_refit(data.problem(natural, counted), f) for f in fits]
    fitted = _under_each_assumption(data, natural, fits, counted, alone=intersample is not None)
    mode, best_fit = min(fitted, key=lambda item: item[1].objective)
    others = tuple(name for name in structures if name not in PLAIN)
    if says_nothing(data.u, data.problem(mode, counted), best_fit, _band(data)):
        return _unanswered(data, natural, fitted, counted)
    asked = _worth_explaining(data.problem(mode, counted), best_fit, data)
    if not plain or asked or _almost_integrates(best_fit):
        problem = data.problem(natural, counted)
        richer = _enriched(data, problem, fits, others, all_of_them=not plain)
        if richer and counted.begins is not None:
            resting = _counted(data, natural, richer, seen, known)
            if resting.begins is None:  # it was the structure that was wrong, not the beginning
                counted = resting
                fits = [_refit(data.problem(natural, counted), f) for f in fits]
                richer = [_refit(data.problem(natural, counted), f) for f in richer]
        kept = [*fits, *richer] if plain else richer or fits
        fitted = _under_each_assumption(data, natural, kept, counted, alone=intersample is not None)
    mode, leading = min(fitted, key=lambda item: item[1].objective)
    share = effective_share(leading.residual)
    noise = _colour(data.problem(mode, counted), leading, data) if share < 1.0 else None
    if noise is not None or data.noise is not None:
        data = replace(data, noise=noise)
        fitted = _whitened(data, fitted, counted)
    trials, chosen, likeliest, best = _decided(data, natural, fitted, counted, share)
    if noise is not None and _contradicts(data, best, counted):
        data = replace(data, noise=None)
        fitted = _whitened(data, fitted, counted)
        trials, chosen, likeliest, best = _decided(data, natural, fitted, counted, share)
    weighed = data.problem(chosen.intersample, counted)
    return JointFit(
        problem=replace(weighed, noise=None, told=None),
        weighed=weighed,
        best=best,
        trials=tuple(best if trial is chosen else trial for trial in trials),
        forgotten=counted.begins or 0,
        effective_share=share,
        related=not is_unrelated(replace(weighed, noise=None, told=None), best.fit, share),
        simpler=None if chosen is likeliest else likeliest,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Seen:
    """Which samples count, and from where on the state that a record begins with is fitted."""

    valid: NDArray[np.bool_] | None
    begins: int | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Data:
    """What every trial shares; inputs are prepared for an assumption when first asked for."""

    u: NDArray[np.float64]
    y: NDArray[np.float64]
    sources: dict[Intersample, SampledInput]
    rough: RoughResponse
    nuisance: NDArray[np.float64] | None
    noise: NDArray[np.float64] | None = None

    def problem(self, mode: Intersample, seen: _Seen) -> Problem:
        if mode not in self.sources:
            self.sources[mode] = prepare_input(self.u, mode)
        problem = Problem(
            source=self.sources[mode],
            y=self.y,
            valid=seen.valid,
            longest_delay=self.y.size // 2 + 2.0,
            nuisance=self.nuisance,
            begins=seen.begins,
        )
        return problem if self.noise is None else problem.coloured(self.noise)


def _unanswered(
    data: _Data, natural: Intersample, fitted: list[tuple[Intersample, Fit]], seen: _Seen
) -> JointFit:
    """The plain fits, of an output that no model explains."""
    share = effective_share(min((fit for _, fit in fitted), key=lambda f: f.objective).residual)
    count = data.problem(natural, seen).counted * share
    trials = [_trial(mode, fit, count) for mode, fit in fitted]
    best = _chosen(trials, natural)
    weighed = data.problem(best.intersample, seen)
    return JointFit(
        problem=replace(weighed, noise=None, told=None),
        weighed=weighed,
        best=best,
        trials=tuple(trials),
        forgotten=seen.begins or 0,
        effective_share=share,
        related=False,
        silent=True,
    )


def _band(data: _Data) -> tuple[float, float]:
    """Band in which a response was sought, in cycles per sample."""
    omega = data.rough.omega
    return float(omega[0] / (2 * np.pi)), float(omega[-1] / (2 * np.pi))


def _follows(data: _Data, fit: Fit) -> bool:
    """Whether what a fit leaves over still follows the input."""
    left = misfit(data.u, fit.residual, delay=fit.delay, band=_band(data))
    return left.probability < _FOLLOWS


def _decided(
    data: _Data,
    natural: Intersample,
    fitted: list[tuple[Intersample, Fit]],
    seen: _Seen,
    share: float,
) -> tuple[list[Trial], Trial, Trial, Trial]:
    """All trials, the chosen one, what the criterion alone would choose, the chosen polished."""
    count = data.problem(natural, seen).counted * (share if data.noise is None else 1.0)
    trials = [_trial(mode, fit, count) for mode, fit in fitted]
    likeliest = _chosen(trials, natural)
    weighed = data.problem(likeliest.intersample, seen)
    chosen = _wary(likeliest, trials, weighed, count)
    polished = fit_structure(
        weighed, chosen.fit.structure, chosen.fit.theta, precision=_FINAL_PRECISION
    )
    return trials, chosen, likeliest, _trial(chosen.intersample, polished, count)


def _contradicts(data: _Data, best: Trial, seen: _Seen) -> bool:
    """Whether whitening moves the estimate farther than noise could.

    A right model is estimated without bias with the noise whitened or not; where the two part,
    what is left over is no noise but what the model lacks (J. A. Hausman, Econometrica 46, 1978).
    """
    problem = replace(data, noise=None).problem(best.intersample, seen)
    plain = fit_structure(problem, best.fit.structure, best.fit.theta, precision=_FINAL_PRECISION)
    rows = jacobian(problem, plain)
    freedom = max(problem.counted - rows.shape[0], 1)
    unknown = plain.theta.size
    cov = covariance(rows, plain.residual, freedom=freedom, white=False)[:unknown, :unknown]
    apart = plain.theta - best.fit.theta
    statistic = float(apart @ np.linalg.pinv(cov, rcond=1e-12, hermitian=True) @ apart)
    return not statistic < chdtri(unknown, _FOLLOWS)


def _colour(problem: Problem, fit: Fit, data: _Data) -> NDArray[np.float64] | None:
    """Autoregression of what the best fit leaves over; None where that still follows the input.

    What follows the input is no noise, and whitening it would hide what a model lacks.
    """
    if _follows(data, fit):
        return None
    noise = autoregression(fit.residual, problem.valid)
    return noise if noise.size > 1 else None


def _whitened(
    data: _Data, fitted: list[tuple[Intersample, Fit]], seen: _Seen
) -> list[tuple[Intersample, Fit]]:
    """All fits once more under one noise model, the hopeless ones as they are."""
    least = min(fit.objective for _, fit in fitted)
    out = []
    for mode, fit in fitted:
        steps = _RETURNS if fit.objective < _HOPELESS * least else 0
        problem = data.problem(mode, seen)
        out.append((mode, fit_structure(problem, fit.structure, fit.theta, iterations=steps)))
    return out


def _prewhitened(data: _Data, mode: Intersample, fits: list[Fit], seen: _Seen) -> _Data | None:
    """Data with the noise whitened, where its colour hides the response; None elsewhere.

    Input and output are filtered alike, so that the response stays: starts are sought in what a
    wander or a line leaves free.
    """
    fit = min(fits, key=lambda f: f.objective)
    noise = autoregression(fit.residual, seen.valid)
    problem = data.problem(mode, seen)
    spread = problem.masked(problem.y - problem.y.mean())
    if noise.size == 1 or fit.cost < _POOR * float(spread @ spread):
        return None
    whitened = problem.coloured(noise)
    left = whitened.innovations(fit.prediction, fit.residual)
    if float(left @ left) > _HIDES * fit.cost:
        return None
    u, y = (lfilter(noise, np.ones(1), x - x.mean()) for x in (data.u, data.y))
    y = y if seen.valid is None else y * whitened.told
    rough = rough_response(u[noise.size :], y[noise.size :], longest_delay=data.u.size // 2)
    return replace(data, noise=noise, rough=rough)


def _regressed(
    rows: NDArray[np.float64], y: NDArray[np.float64], valid: NDArray[np.bool_] | None
) -> NDArray[np.float64]:
    """What of an output the rows explain beside a constant, by least squares."""
    counts = slice(None) if valid is None else valid
    every = np.vstack([rows, np.ones(y.size)])[:, counts]
    weights = solved(every @ every.T, every @ y[counts])[:-1]
    return np.asarray(weights @ rows)


def _counted(
    data: _Data,
    mode: Intersample,
    fits: list[Fit],
    seen: _Seen,
    known: NDArray[np.bool_] | None,
) -> _Seen:
    """Samples that count once it is known how the system remembers, and where it begins."""
    fit = min(fits, key=lambda f: f.objective)
    ahead = _ahead(fits)
    begins = _begins(data.problem(mode, seen), fit)
    if begins is None and not ahead and known is None:
        return seen
    n = fit.residual.size
    counted = np.ones(n, dtype=bool) if seen.valid is None else seen.valid.copy()
    counted[: begins or 0] = False
    counted[n - ahead :] = False
    if known is not None:
        counted &= _unaffected(known, _memory(fits))
    return _Seen(valid=counted, begins=begins)


def _begins(problem: Problem, fit: Fit) -> int | None:
    """Sample from which on an unknown state must be fitted; None for a record at rest.

    A score test (C. R. Rao, Proc. Camb. Phil. Soc. 44, 1948) of the free responses beside all other
    parameters, and a chi-squared test of what comes before them, when the output still answers
    input before the record.
    """
    begins = int(np.ceil(max(fit.delay, 0.0))) + _REACH
    if begins > problem.y.size // 2 or fit.objective <= 0.0:
        return None
    free = Part(replace(problem, begins=begins), fit.structure, fit.theta).free
    late = np.arange(problem.y.size) >= begins
    counts = problem.valid if problem.told is None else problem.told
    valid = late if counts is None else counts & late
    innovations = problem.innovations(fit.prediction, fit.residual)
    residual = innovations * late
    count = int(np.count_nonzero(valid))
    power = float(residual @ residual)
    share = effective_share(residual[valid])
    early = float(innovations[:begins] @ innovations[:begins]) if problem.valid is None else 0.0
    level = float(np.median(residual[valid] ** 2)) / 0.455  # of a squared Gaussian
    if early > _TWICE * level * chdtri(begins, _REST):
        return begins
    if not free.shape[0] or power <= 0.0:
        return None
    rows = np.vstack([jacobian(problem, fit), problem.masked(free)]) * valid
    gained = float((rows @ residual) @ solved(rows @ rows.T, rows @ residual))
    left = max(power - gained, np.finfo(float).tiny)
    statistic = share * count * float(np.log(power / left))
    return begins if statistic > chdtri(free.shape[0], _REST) else None


def _refit(problem: Problem, fit: Fit) -> Fit:
    return fit_structure(problem, fit.structure, fit.theta)


def _under_each_assumption(
    data: _Data,
    natural: Intersample,
    fits: list[Fit],
    seen: _Seen,
    *,
    alone: bool,
) -> list[tuple[Intersample, Fit]]:
    """Add to fits under the natural assumption those under the others, unless it stands alone."""
    fitted = [(natural, fit) for fit in fits]
    if alone:
        return fitted
    least = min(fit.objective for fit in fits)
    leading = [fit for fit in fits if fit.objective < _HOPELESS * least]
    trailing = [
        fit for fit in fits if fit.objective >= _HOPELESS * least and fit.structure.name in PLAIN
    ]
    others = [mode for mode in get_args(Intersample) if mode != natural]

    def moved(some: list[Fit]) -> list[tuple[Intersample, Fit]]:
        return [
            (mode, _moved(data.problem(mode, seen), fit, natural, mode))
            for mode in others
            for fit in some
        ]

    fitted += moved(leading)
    count = data.problem(natural, seen).counted
    if min(fit.objective for _, fit in fitted) < least * (1.0 - 2 * CLEARLY / count):
        fitted += moved(trailing)  # hopeless under a wrong assumption, perhaps not under this
    return fitted


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
        if settled and name == "first_order":
            starts = [_without_second_pole(fits[0])]
        else:
            starts = starting_values(rough, structure, earliest=-2, thorough=False)
        steps = 2 if settled else _TASTE
        fit = fit_structure(problem, structure, starts[0], iterations=steps)
        hopeful = min((f.objective for f in fits), default=np.inf) * _HOPELESS
        white = fit.objective < hopeful and is_white(fit.residual)
        if not white and fit.objective < _FALLING * hopeful:
            rivals = starts[1:]
            if not settled:
                rivals += starting_values(rough, structure, earliest=-2)
            for theta in rivals:
                rival = fit_structure(problem, structure, theta, iterations=_TASTE)
                fit = min(fit, rival, key=lambda f: f.objective)
        settled = settled or white
        fits.append(fit)
    for i, fit in enumerate(fits):
        for other in fits:
            if _nests(other, fit):
                rival = fit_structure(problem, fit.structure, nested(other), iterations=_TASTE)
                fits[i] = min(fits[i], rival, key=lambda f: f.objective)
    least = min(fit.objective for fit in fits)
    return [
        fit
        if fit.converged or fit.objective > _FALLING * least
        else fit_structure(problem, fit.structure, fit.theta)
        for fit in fits
    ]


def _enriched(
    data: _Data,
    problem: Problem,
    fits: list[Fit],
    structures: tuple[StructureName, ...],
    *,
    all_of_them: bool,
) -> list[Fit]:
    """Fits of the richer structures, the plainest first, until nothing is left to explain."""
    best = min(fits, key=lambda fit: fit.objective)
    integrating = members(structures, INTEGRATING)
    found: list[Fit] = []
    if integrating:
        added = np.cumsum(data.u - data.u[0])
        rough = rough_response(added, data.y, longest_delay=data.y.size // 2)
        for structure in integrating:
            if found and is_white(min(found, key=lambda fit: fit.objective).residual):
                return found
            starts = integrator_starts(rough, structure)
            found.append(_best_of(problem, structure, starts, [*fits, *found]))
        if is_white(min(found, key=lambda fit: fit.objective).residual):
            return found
    proposed = proposals(data.rough, members(structures, RICH), best, all_of_them=all_of_them)
    for start in range(0, len(proposed), _AT_ONCE):
        some = proposed[start : start + _AT_ONCE]
        for p in some:
            found.append(_best_of(problem, p.structure, list(p.starts), [*fits, *found]))
        best = min(found, key=lambda fit: fit.objective)
        if not _worth_explaining(problem, best, data) and is_white(best.residual):
            break
    if found and not is_white(min(found, key=lambda fit: fit.objective).residual):
        # Poles without end follow what no linear model describes: friction, rounding.
        found = [fit for fit in found if fit.structure.order <= _SURE]
    return found


def _best_of(
    problem: Problem, structure: Structure, starts: list[NDArray[np.float64]], rivals: list[Fit]
) -> Fit:
    """The best of several starts, followed to its end if it may lead.

    What is left over in colour has few independent samples: a step that gains less than one of
    those could tell is not worth making.
    """
    leading = min(rivals, key=lambda fit: fit.objective)
    precision = _PRECISION / effective_share(leading.residual)
    tried = [
        fit_structure(problem, structure, theta, iterations=_LONG_TASTE, precision=precision)
        for theta in starts
    ]
    best = min(tried, key=lambda fit: fit.objective)
    if best.converged or best.objective > _HOPELESS * leading.objective:
        return best
    return fit_structure(problem, structure, best.theta, precision=precision)


def _worth_explaining(problem: Problem, fit: Fit, data: _Data) -> bool:
    """Whether the residual follows the input by more than a small share of output or response."""
    band = _band(data)
    left = misfit(data.u, fit.residual, delay=fit.delay, band=band)
    spread = float(np.sum((problem.masked(problem.y - problem.y.mean())) ** 2))
    owed = float(np.sqrt(left.share * fit.cost / spread)) if spread else 0.0
    if left.probability < _FOLLOWS and (owed > _MATERIAL or _misses_part(problem, fit, data, band)):
        return True
    return fit.cost > _POOR * spread and not is_white(fit.residual)


def _almost_integrates(fit: Fit) -> bool:
    """Whether the slowest pole is as slow as the record is long."""
    return slowest_time_constant(fit.denominator) > _SLOW * fit.residual.size


def _misses_part(problem: Problem, fit: Fit, data: _Data, band: tuple[float, float]) -> bool:
    """Whether the response is missed where the output hardly moves, as at the end of a sweep."""
    span = slice(None)
    if problem.valid is not None:
        counted = np.flatnonzero(problem.valid)
        span = slice(int(counted[0]), int(counted[-1]) + 1)
        if counted.size < counted[-1] + 1 - counted[0]:
            return False  # spectra do not bear gaps
    missed = unexplained_response(
        data.u[span], data.y[span], fit.residual[span], delay=fit.delay, band=band
    )
    return missed > _PARTLY


def _nests(simple: Fit, rich: Fit) -> bool:
    """Whether the simpler structure is a start for a richer one that may have missed its best."""
    return (
        simple.structure.name == "first_order"
        and rich.structure.name == "second_order"
        and (simple.objective <= rich.objective or not is_white(rich.residual))
    )


def _without_second_pole(second_order: Fit) -> NDArray[np.float64]:
    """First order from second: a fast second pole counts as delay."""
    delay, log_lag, shape = second_order.theta
    return np.array([delay + min(shape, 0.25) * np.exp(log_lag), log_lag])


def nested(first_order: Fit) -> NDArray[np.float64]:
    """First order as second: a quarter of its time constant moved into a second pole."""
    return np.concatenate([first_order.theta, [0.1875]])  # (1 + 3/4 Ts)(1 + 1/4 Ts)


def _moved(problem: Problem, fit: Fit, origin: Intersample, mode: Intersample) -> Fit:
    """Fit the same structure under another assumption, from where the first one ended."""
    theta = fit.theta.copy()
    theta[0] += _DELAY_SHIFT[mode] - _DELAY_SHIFT[origin]
    return fit_structure(problem, fit.structure, theta)


def _memory(fits: list[Fit]) -> int:
    """Samples after which the output has forgotten its input, by the best fit so far."""
    fit = min(fits, key=lambda f: f.objective)
    slowest = slowest_time_constant(fit.denominator)
    span = int(np.ceil(max(fit.delay, 0.0) + _SETTLED * slowest)) + 2
    return min(span, fit.residual.size // 4)


def _ahead(fits: list[Fit]) -> int:
    """Samples at the end that depend on input after the record, if the delay is negative."""
    delay = min(fits, key=lambda f: f.objective).delay
    return int(np.ceil(-delay)) + 3 if delay < 0 else 0


def _unaffected(known: NDArray[np.bool_], memory: int) -> NDArray[np.bool_]:
    """Samples whose output depends on measured input alone."""
    unknown = np.concatenate([[0], np.cumsum(~known)])
    index = np.arange(known.size)
    return np.asarray(unknown[index + 1] == unknown[np.maximum(index - memory, 0)])


def _trial(mode: Intersample, fit: Fit, count: float) -> Trial:
    tiny = np.finfo(float).tiny
    criterion = count * np.log(
        max(fit.objective, tiny) / count
    ) + fit.structure.parameters * np.log(count)
    return Trial(intersample=mode, fit=fit, criterion=float(criterion))


def _looks_held(u: NDArray[np.float64]) -> bool:
    """Whether an input stands still most of the time and then jumps, as a held one does."""
    jumps = np.abs(np.diff(u))
    moving = jumps[jumps > 0]
    return bool(moving.size < 0.5 * jumps.size and moving.max() > _JUMP * np.ptp(u))


def _wary(chosen: Trial, trials: list[Trial], problem: Problem, count: float) -> Trial:
    """Prefer second order to first where it may well be right and would move the delay.

    The criterion keeps a simpler structure until the evidence is strong, and the simpler one's
    error bars take it for certain. Where the record half speaks for another pole and that
    pole would take the delay far outside those bars, the wider bars are the honest ones.
    """
    if chosen.fit.structure.name != "first_order":
        return chosen
    rows = jacobian(problem, chosen.fit)
    information = np.linalg.pinv(rows @ rows.T, hermitian=True)
    std = np.sqrt(max(information[0, 0], 0.0) * chosen.fit.objective / problem.counted)
    for trial in trials:
        extra = trial.fit.structure.parameters - chosen.fit.structure.parameters
        if (
            trial.intersample == chosen.intersample
            and trial.fit.structure.name in PLAIN
            and extra > 0
            and extra * np.log(count) - (trial.criterion - chosen.criterion) > 0.5 * extra
            and abs(trial.fit.delay - chosen.fit.delay) > _FAR * std
        ):
            return trial
    return chosen


def _chosen(trials: list[Trial], natural: Intersample) -> Trial:
    best = min(trials, key=lambda trial: trial.criterion)
    rivals = [trial for trial in trials if trial.intersample == natural]
    if not rivals or best in rivals:
        return best
    rival = min(rivals, key=lambda trial: trial.criterion)
    return best if rival.criterion - best.criterion > 2 * CLEARLY else rival
