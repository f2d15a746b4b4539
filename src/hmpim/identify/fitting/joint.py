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

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hmpim.identify.fitting.beginning import count_in, look_again
from hmpim.identify.fitting.candidates import (
    almost_integrates,
    fit_plain,
    fit_rich,
    fit_under_each_assumption,
    is_worth_explaining,
    reduced,
    refit_between,
)
from hmpim.identify.fitting.data import (
    FINAL_PRECISION,
    HOPELESS,
    Data,
    Seen,
    band_of,
    follows,
    prepared,
    refit,
)
from hmpim.identify.fitting.enrich import (
    INTEGRATING,
    PLAIN,
    RICH,
)
from hmpim.identify.fitting.fit import Fit, fit_structure
from hmpim.identify.fitting.growth import grow, hidden_pole
from hmpim.identify.fitting.least_squares import solved
from hmpim.identify.fitting.software import software_fit
from hmpim.identify.fitting.start import rough_response
from hmpim.identify.fitting.trial import JointFit, Trial, likeliest_of, trial_of
from hmpim.identify.fitting.unrelated import is_unrelated, says_nothing
from hmpim.identify.fitting.whitening import (
    is_contradicted,
    noise_of,
    prewhitened_of,
    refit_whitened,
)
from hmpim.identify.noise.whiteness import effective_share, is_white
from hmpim.identify.signals import longest_lag
from hmpim.model.dynamics import FILTERS, Structure, StructureName
from hmpim.record import BETWEEN, Intersample

__all__ = ["joint_fit"]

_LOOKS = 2
"""How often the samples that count are looked at again, once there is a structure."""

_SPARE = 0.1
"""Share of the record that an output ahead of its input must leave."""

_JUMP = 0.05
"""Share of its range by which a held input jumps at least once."""


def joint_fit(
    u: NDArray[np.float64],
    y: NDArray[np.float64],
    *,
    valid: NDArray[np.bool_] | None = None,
    known: NDArray[np.bool_] | None = None,
    intersample: Intersample | None = None,
    structures: tuple[StructureName, ...] = (*PLAIN, *RICH, *INTEGRATING),
    nuisance: NDArray[np.float64] | None = None,
    growing: bool = True,
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
    intersample : {'zoh', 'foh', 'bandlimited', 'sampled'}, optional
        What the input does between samples, or 'sampled' for software, whose structures are
        filters; chosen by likelihood among the first three if None.
    structures : tuple of str
        Which to try.
    nuisance : ndarray, shape (k, n), optional
        Rows beside the bias that enter linearly, such as a drift's.
    growing : bool
        Whether it is asked for one more pole at the end, and what that leaves open.

    Returns
    -------
    JointFit
    """
    if intersample == "sampled":
        named: tuple[str, ...] = structures
        filters = tuple(name for name in named if name in FILTERS)
        return software_fit(
            u, y, valid=valid, structures=filters or tuple(FILTERS), nuisance=nuisance
        )
    if intersample is None and _looks_held(u):
        intersample = "zoh"  # an input that stands still and jumps does nothing else
    natural: Intersample = "bandlimited" if intersample is None else intersample
    level = y if nuisance is None else y - _regressed(nuisance, y, valid)
    level = level if valid is None else _bridged(level, valid)
    data = Data(
        u=u,
        y=y,
        sources={natural: prepared(u, natural)},
        rough=rough_response(u, level, longest_delay=longest_lag(u.size)),
        nuisance=nuisance,
    )
    plain = tuple(name for name in structures if name in PLAIN)
    seen = Seen(valid=valid, begins=None)
    fits = fit_plain(data.problem(natural, seen), data.rough, plain or PLAIN)
    data, seen, fits = _or_ahead(data, natural, seen, fits, level, plain or PLAIN)
    prewhitened = prewhitened_of(data, natural, fits, seen)
    if prewhitened is not None:
        free = fit_plain(prewhitened.problem(natural, seen), prewhitened.rough, plain or PLAIN)
        if not follows(data, min(free, key=lambda f: f.objective)):
            data, fits = prewhitened, free
    counted = count_in(data, natural, fits, seen, known)
    if counted.begins is not None:  # from rest those fits ended anywhere
        problem = data.problem(natural, counted)
        before = {fit.structure.name: fit for fit in fits}
        fits = [
            min(fit, refit(problem, before[fit.structure.name]), key=lambda f: f.objective)
            for fit in fit_plain(problem, data.rough, plain or PLAIN)
        ]
        later = count_in(data, natural, fits, seen, known)
        counted = counted if later.begins is None else later
    if counted is not seen:
        fits = [refit(data.problem(natural, counted), f) for f in fits]
    fitted = fit_under_each_assumption(data, natural, fits, counted, alone=intersample is not None)
    mode, best_fit = min(fitted, key=lambda item: item[1].objective)
    others = tuple(name for name in structures if name not in PLAIN)
    if says_nothing(data.u, data.problem(mode, counted), best_fit, band_of(data)):
        return _unanswered(data, natural, fitted, counted)
    asked = is_worth_explaining(data.problem(mode, counted), best_fit, data)
    if not plain or asked or almost_integrates(best_fit):
        problem = data.problem(natural, counted)
        richer = fit_rich(data, problem, fits, others, all_of_them=not plain)
        if richer and counted.begins is not None:
            leading = min(richer, key=lambda f: f.objective)
            from_rest = refit(data.problem(natural, seen), leading)
            resting = count_in(data, natural, [from_rest], seen, known)
            if resting.begins is None:  # it was the structure that was wrong, not the beginning
                counted = resting
                fits = [refit(data.problem(natural, counted), f) for f in fits]
                richer = [refit(data.problem(natural, counted), f) for f in richer]
        if richer:
            fits = reduced(data.problem(natural, counted), fits, richer)
        kept = [*fits, *richer] if plain else richer or fits
        fitted = fit_under_each_assumption(
            data, natural, kept, counted, alone=intersample is not None
        )
    data, counted, trials, best, share = _looked_again(data, natural, fitted, counted)
    weighed = data.problem(best.intersample, counted)
    joint = JointFit(
        problem=replace(weighed, noise=None, told=None),
        weighed=weighed,
        best=best,
        trials=tuple(trials),
        forgotten=counted.begins or 0,
        effective_share=share,
        related=not is_unrelated(replace(weighed, noise=None, told=None), best.fit, share),
    )
    if not growing:
        return joint
    modes = [mode for mode in BETWEEN if intersample is None and mode != best.intersample]
    return _grown(joint, data, counted, structures, modes)


def _looked_again(
    data: Data, natural: Intersample, fitted: list[tuple[Intersample, Fit]], seen: Seen
) -> tuple[Data, Seen, list[Trial], Trial, float]:
    """Weigh all fits, and again where the best of them shows that other samples count."""
    data, trials, best, share = _weighed(data, natural, fitted, seen)
    for _ in range(_LOOKS):
        again = look_again(data.problem(best.intersample, seen), best, seen, lag=data.rough.lag)
        if again is None:
            break
        seen, data = again, replace(data, noise=None)
        chosen = (best.intersample, best.fit.structure)
        hopeful = [(best.intersample, best.fit)] + [
            (mode, fit)
            for mode, fit in fitted
            if (mode, fit.structure) != chosen
            and (fit.cost < HOPELESS**2 * best.fit.cost or fit.structure.name in PLAIN)
        ]
        fitted = [(mode, refit(data.problem(mode, seen), fit)) for mode, fit in hopeful]
        data, trials, best, share = _weighed(data, natural, fitted, seen)
    return data, seen, trials, best, share


def _grown(
    joint: JointFit,
    data: Data,
    seen: Seen,
    structures: tuple[StructureName, ...],
    others: list[Intersample],
) -> JointFit:
    """Add poles that the likelihood pays for, and note what it leaves open."""
    best, weighed = joint.best, joint.weighed
    count = weighed.counted * joint.weighed_share

    def refit(structure: Structure, theta: NDArray[np.float64]) -> Trial:
        return trial_of(best.intersample, fit_structure(weighed, structure, theta), count)

    growth = grow(
        best,
        hidden=lambda trial: hidden_pole(weighed, trial.fit),
        refit=refit,
        count=count,
        names=structures,
        white=lambda trial: is_white(trial.fit.residual),
    )
    if not growth.grown:
        return replace(joint, rivals=growth.rivals, hidden=growth.hidden)
    *between, last = growth.grown
    polished = fit_structure(weighed, last.fit.structure, last.fit.theta, precision=FINAL_PRECISION)
    best = trial_of(last.intersample, polished, count)
    moved = [
        trial_of(
            mode,
            refit_between(data.problem(mode, seen), polished, best.intersample, mode),
            count,
        )
        for mode in others
    ]
    return replace(
        joint,
        best=best,
        trials=(*joint.trials, *between, *moved, best),
        rivals=growth.rivals,
        hidden=growth.hidden,
    )


def _unanswered(
    data: Data, natural: Intersample, fitted: list[tuple[Intersample, Fit]], seen: Seen
) -> JointFit:
    """The plain fits, of an output that no model explains."""
    share = effective_share(min((fit for _, fit in fitted), key=lambda f: f.objective).residual)
    count = data.problem(natural, seen).counted * share
    trials = [trial_of(mode, fit, count) for mode, fit in fitted]
    best = likeliest_of(trials, natural)
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


def _weighed(
    data: Data, natural: Intersample, fitted: list[tuple[Intersample, Fit]], seen: Seen
) -> tuple[Data, list[Trial], Trial, float]:
    """Weigh all fits under one noise model: it, the trials, the best, independent samples each."""
    mode, leading = min(fitted, key=lambda item: item[1].objective)
    share = effective_share(leading.residual)
    noise = noise_of(data.problem(mode, seen), leading, data) if share < 1.0 else None
    if noise is not None or data.noise is not None:
        data = replace(data, noise=noise)
        fitted = refit_whitened(data, fitted, seen)
    trials, best = _decided(data, natural, fitted, seen, share)
    if noise is not None and is_contradicted(data, best, seen):
        data = replace(data, noise=None)
        trials, best = _decided(data, natural, refit_whitened(data, fitted, seen), seen, share)
    return data, trials, best, share


def _decided(
    data: Data,
    natural: Intersample,
    fitted: list[tuple[Intersample, Fit]],
    seen: Seen,
    share: float,
) -> tuple[list[Trial], Trial]:
    """All trials, and the chosen one among them, polished."""
    count = data.problem(natural, seen).counted * (share if data.noise is None else 1.0)
    trials = [trial_of(mode, fit, count) for mode, fit in fitted]
    chosen = likeliest_of(trials, natural)
    polished = fit_structure(
        data.problem(chosen.intersample, seen),
        chosen.fit.structure,
        chosen.fit.theta,
        precision=FINAL_PRECISION,
    )
    best = trial_of(chosen.intersample, polished, count)
    return [best if trial is chosen else trial for trial in trials], best


def _regressed(
    rows: NDArray[np.float64], y: NDArray[np.float64], valid: NDArray[np.bool_] | None
) -> NDArray[np.float64]:
    """What of an output the rows explain beside a constant, by least squares."""
    counts = slice(None) if valid is None else valid
    every = np.vstack([rows, np.ones(y.size)])[:, counts]
    weights = solved(every @ every.T, every @ y[counts])[:-1]
    return np.asarray(weights @ rows)


def _or_ahead(
    data: Data,
    natural: Intersample,
    seen: Seen,
    fits: list[Fit],
    level: NDArray[np.float64],
    plain: tuple[StructureName, ...],
) -> tuple[Data, Seen, list[Fit]]:
    """The same with an output that is ahead of its input, where that leaves clearly less."""
    best = min(fits, key=lambda f: f.objective)
    longest = longest_lag(level.size)
    lag = data.rough.ahead
    if lag is None or is_white(best.residual):
        return data, seen, fits
    rough = rough_response(data.u, level, longest_delay=longest, lag=lag)
    ahead = replace(data, rough=rough)
    counted = np.ones(level.size, dtype=bool) if seen.valid is None else seen.valid.copy()
    counted[rough.earliest :] = False  # they answer what comes after the record
    shorter = replace(seen, valid=counted)
    count = np.count_nonzero(counted)
    if count < _SPARE * level.size:
        return data, seen, fits
    found = fit_plain(ahead.problem(natural, shorter), rough, plain)
    least = min(f.objective for f in found) / count
    if HOPELESS * least > best.objective / data.problem(natural, seen).counted:
        return data, seen, fits
    return ahead, shorter, found


def _bridged(y: NDArray[np.float64], valid: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Fill samples that do not count by straight lines, for spectra."""
    index = np.arange(y.size)
    return np.interp(index, index[valid], y[valid])


def _looks_held(u: NDArray[np.float64]) -> bool:
    """Whether an input stands still most of the time and then jumps, as a held one does.

    What moves between two samples moves at one instant only if it stood before and stands after.
    """
    jumps = np.abs(np.diff(u))
    moves = jumps > 0
    count = int(np.count_nonzero(moves))
    alone = moves & ~np.append(moves[1:], False) & ~np.append(False, moves[:-1])
    return bool(
        2 * count < moves.size
        and jumps.max() > _JUMP * np.ptp(u)
        and 2 * np.count_nonzero(alone) > count
    )
