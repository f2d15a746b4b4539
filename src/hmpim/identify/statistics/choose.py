"""The structure, what the input does between its samples, and the noise, from statistics.

The same steps as of the joint fit: start, climb, begin, enrich, continue between the samples,
whiten, choose.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from hmpim.errors import RecordError
from hmpim.identify.arrays import Real
from hmpim.identify.chance import DEVIATIONS, FALSE_ALARM
from hmpim.identify.fitting.candidates import nested
from hmpim.identify.fitting.data import shifted
from hmpim.identify.fitting.enrich import INTEGRATING, MODES, PLAIN, RICH, members, proposals
from hmpim.identify.fitting.growth import HiddenPole, grow
from hmpim.identify.fitting.least_squares import solved
from hmpim.identify.fitting.rows import Part, Problem
from hmpim.identify.fitting.start import RoughResponse, starting_values
from hmpim.identify.fitting.trial import Trial, likeliest_of, trial_of
from hmpim.identify.noise.autoregression import whitening_filter
from hmpim.identify.noise.misfit import Misfit
from hmpim.identify.statistics.fit import Fitted, fit_products, pulse
from hmpim.identify.statistics.misfit import hidden_pole_of, misfit_of
from hmpim.identify.statistics.products import Products
from hmpim.identify.statistics.reach import AHEAD
from hmpim.identify.statistics.start import excited, rough_of
from hmpim.identify.statistics.statistics import Statistics
from hmpim.identify.worth import FEW, MATERIAL, TWICE
from hmpim.model.dynamics import STRUCTURES, Structure, StructureName
from hmpim.record import BETWEEN, Intersample

__all__ = ["Chosen", "choose", "left_over"]

_FEWEST = 50
"""Samples that must count."""

_TASTE = 4
_LONG_TASTE = 12
"""Steps from each start before the best one is followed to its end; of richer structures."""

_ROUNDED = 1e-13
"""Share of the output's power below which what is left over is the rounding of sums."""

_FINAL_PRECISION = 1e-10
"""Of the chosen fit: 1e-5 standard deviations."""

_FORGOTTEN = 1e-4
"""Of an impulse response's peak, below which it is over."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LeftOver:
    """What a fit leaves over, by samples and not whitened.

    Parameters
    ----------
    power : float
        Mean square.
    counted : int
        Samples of which it is.
    innovation : float
        Mean square of what its past does not foresee.
    share : float
        Independent samples per sample.
    noise : ndarray, shape (order + 1,)
        Autoregression, 1 first; 1 alone where it is white.
    """

    power: float
    counted: int
    innovation: float
    share: float
    noise: Real


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Chosen:
    """What was chosen, and all that was tried.

    Parameters
    ----------
    best : Fitted
        The chosen fit, polished.
    trials : tuple of Trial
        All, weighed alike; the chosen one's place is taken by `best`.
    left : LeftOver
        What it leaves over.
    misfit : Misfit
        Whether that follows the input.
    band : (float, float)
        Excited band in Hz.
    problem : Problem
        The pulse under the chosen assumption.
    rivals : tuple of Trial
        Fits with one more pole that are as likely, but for its price.
    hidden : HiddenPole
        What the statistics say of one more pole.
    first_order : Fitted or None
        The best of first order, under the same assumption.
    """

    best: Fitted
    trials: tuple[Trial, ...]
    left: LeftOver
    misfit: Misfit
    band: tuple[float, float]
    problem: Problem
    rivals: tuple[Trial, ...]
    hidden: HiddenPole
    first_order: Fitted | None


class _Search:
    """Fits of many structures to the same statistics."""

    def __init__(self, statistics: Statistics, products: Products, band: tuple[float, float]):
        self.statistics, self.products = statistics, products
        self.band = (band[0] / statistics.fs, band[1] / statistics.fs)
        self._pulses: dict[Intersample, Problem] = {}

    def problem(self, mode: Intersample) -> Problem:
        if mode not in self._pulses:
            self._pulses[mode] = pulse(self.statistics.reach, mode)
        return self._pulses[mode]

    def fit(
        self,
        mode: Intersample,
        structure: Structure,
        theta: Real,
        *,
        iterations: int = 40,
        precision: float = 1e-2,
    ) -> Fitted:
        return fit_products(
            self.products,
            self.problem(mode),
            mode,
            structure,
            theta,
            iterations=iterations,
            precision=precision,
        )

    def again(self, fitted: Fitted, *, precision: float = 1e-2) -> Fitted:
        """The same structure from where it ended, to the products as they are now."""
        fit = fitted.fit
        return self.fit(fitted.intersample, fit.structure, fit.theta, precision=precision)

    def best_of(
        self, mode: Intersample, structure: Structure, starts: list[Real], taste: int
    ) -> Fitted:
        """The best of several starts, followed to its end."""
        tried = [self.fit(mode, structure, theta, iterations=taste) for theta in starts]
        best = min(tried, key=lambda f: f.fit.objective)
        return best if best.fit.converged else self.again(best)

    def follows(self, fitted: Fitted) -> Misfit:
        """Whether what is left over follows the input, whatever its own colour."""
        noise = left_over(self.products, fitted).noise
        if noise.size == 1 or self.products.order:
            return misfit_of(fitted, self.products, self.band)
        return misfit_of(fitted, self.whitened(noise), self.band)

    def whitened(self, noise: Real) -> Products:
        """The same samples under a noise model."""
        return Products(self.statistics, skipped=self.products.skipped, noise=noise)


def choose(
    statistics: Statistics,
    *,
    intersample: Intersample | None = None,
    structures: tuple[StructureName, ...] | None = None,
) -> Chosen:
    """Fit every structure and keep the one that the statistics support.

    Parameters
    ----------
    statistics : Statistics
        What was read.
    intersample : {'zoh', 'foh', 'bandlimited'}, optional
        What the input does between its samples; chosen by likelihood if None.
    structures : tuple of str, optional
        Which to try; all but integrators by default.

    Raises
    ------
    RecordError
        If too few samples count.
    """
    if intersample == "sampled":
        raise RecordError("intersample='sampled' needs the samples; identify the record itself")
    conditioned = _is_conditioned(statistics)
    band = excited(statistics)
    search = _Search(
        statistics, Products(statistics, skipped=statistics.lags if conditioned else 0), band
    )
    names = tuple(n for n in structures or (*PLAIN, *RICH, *MODES) if n not in INTEGRATING)
    natural: Intersample = intersample or ("zoh" if _looks_held(statistics) else "bandlimited")
    alone = intersample is not None or natural == "zoh"
    rough = rough_of(statistics)
    fits = _plain(search, natural, rough, tuple(n for n in names if n in PLAIN) or PLAIN)
    if conditioned and len(statistics.runs) == 1:
        skipped = 0 if _rests(search, fits) else _memory(_least(fits))
        search.products = Products(statistics, skipped=skipped)
        fits = [search.again(f) for f in fits]
    fits = _enriched(search, natural, rough, fits, members(names, (*RICH, *MODES[:2])))
    fits = [f for f in fits if f.fit.structure.name in names] or fits
    fits += _moved(search, natural, fits, alone=alone)
    left = left_over(search.products, _least(fits))
    if left.noise.size > 1 and search.follows(_least(fits)).probability >= FALSE_ALARM:
        search.products = search.whitened(left.noise)
        least = _least(fits).fit.objective
        fits = [search.again(f) for f in fits if f.fit.objective < TWICE**2 * least]
    return _decided(search, natural, fits, band, names=names, alone=alone)


def _is_conditioned(statistics: Statistics) -> bool:
    """Whether the first outputs of each run can be spared; they must be, of several runs."""
    shortest = min(run.samples for run in statistics.runs)
    lags = statistics.reach.lags
    if len(statistics.runs) > 1 and shortest - lags < _FEWEST:
        raise RecordError(
            f"a run of {shortest} samples leaves {max(shortest - lags, 0)} behind a window of "
            f"{lags}, of which its beginning is conditioned; compress with fewer lags, or join "
            "longer runs"
        )
    if statistics.samples < _FEWEST:
        raise RecordError(
            f"{statistics.samples} samples were read; at least {_FEWEST} are needed to tell "
            "dynamics from noise"
        )
    return len(statistics.runs) > 1 or shortest > 3 * lags


def _looks_held(statistics: Statistics) -> bool:
    """Whether the input stands still most of the time and then jumps, as a held one does."""
    jumps = np.concatenate(
        [np.abs(np.diff(part)) for run in statistics.runs for part in (run.head_u, run.tail_u)]
    )
    moving = jumps[jumps > 0]
    size = max(float(np.ptp(np.concatenate([run.head_u for run in statistics.runs]))), 1e-300)
    return bool(0 < moving.size < 0.5 * jumps.size and moving.max() > FEW * size)


def _least(fits: list[Fitted]) -> Fitted:
    return min(fits, key=lambda f: f.fit.objective)


def _plain(
    search: _Search, mode: Intersample, rough: RoughResponse, names: tuple[StructureName, ...]
) -> list[Fitted]:
    """Each plain structure from its own starts, then the richer ones from the simpler."""
    fits: list[Fitted] = []
    for name in sorted(names, key=lambda name: -STRUCTURES[name].order):
        starts = starting_values(rough, STRUCTURES[name])
        fits.append(search.best_of(mode, STRUCTURES[name], starts, _TASTE))
    by_name = {f.fit.structure.name: f for f in fits}
    if {"first_order", "second_order"} <= by_name.keys():
        start = nested(by_name["first_order"].fit)
        rival = search.best_of(mode, STRUCTURES["second_order"], [start], _TASTE)
        if rival.fit.objective < by_name["second_order"].fit.objective:
            fits[fits.index(by_name["second_order"])] = rival
    return fits


def _rests(search: _Search, fits: list[Fitted]) -> bool:
    """Whether a run begins at rest: what its beginning leaves over is noise, if it does.

    Its power is chi-squared, and so is what a free response of the state explains of it.
    """
    best, lags = _least(fits), search.statistics.reach.lags
    left = left_over(search.products, best)
    begins = int(np.ceil(max(best.fit.delay, 0.0))) + 4
    problem = replace(search.problem(best.intersample), begins=begins)
    free = Part(problem, best.fit.structure, best.fit.theta).free[:, :lags]
    head = best.residual(search.products).head(0, lags)
    every = np.vstack([head, free])
    head, *free_rows = scipy.signal.lfilter(left.noise, np.ones(1), every)[:, left.noise.size :]
    if float(head @ head) > 2.0 * left.innovation * scipy.special.chdtri(head.size, FALSE_ALARM):
        return False
    if not free_rows or begins >= lags:
        return True
    free = np.array(free_rows)
    moment = free @ head
    told = float(moment @ solved(free @ free.T, moment))
    return told < left.innovation * float(scipy.special.chdtri(free.shape[0], FALSE_ALARM))


def _memory(fitted: Fitted) -> int:
    """Outputs that answer what came before a run, by the best fit so far and half as many again."""
    size = np.abs(fitted.response)
    last = int(np.flatnonzero(size > _FORGOTTEN * size.max())[-1]) - AHEAD
    return int(np.clip(1.5 * last, 1, fitted.products.statistics.lags))


def _enriched(
    search: _Search,
    mode: Intersample,
    rough: RoughResponse,
    fits: list[Fitted],
    rich: list[Structure],
) -> list[Fitted]:
    """Richer structures, the plainest first, until nothing is left to explain."""
    best = _least(fits)
    if not rich or not _owes(search, best):
        return fits
    for proposal in proposals(rough, rich, best.fit):
        fits.append(search.best_of(mode, proposal.structure, list(proposal.starts), _LONG_TASTE))
        if not _owes(search, _least(fits)):
            break
    return fits


def _owes(search: _Search, fitted: Fitted) -> bool:
    """Whether what is left over follows the input by more than a small share of the output."""
    left = search.follows(fitted)
    owed = left.share * fitted.fit.objective > MATERIAL**2 * search.products.energy
    return left.probability < FALSE_ALARM and bool(owed)


def _moved(
    search: _Search, natural: Intersample, fits: list[Fitted], *, alone: bool
) -> list[Fitted]:
    """The leading fits under the other assumptions on the input between its samples."""
    if alone:
        return []
    least = _least(fits).fit.objective
    out = []
    for mode in (m for m in BETWEEN if m != natural):
        for fitted in fits:
            if fitted.fit.objective < TWICE * least:
                theta = shifted(fitted.fit.theta, natural, mode)
                out.append(search.fit(mode, fitted.fit.structure, theta))
    return out


def left_over(products: Products, fitted: Fitted) -> LeftOver:
    """Power, colour and autoregression of what a fit leaves over."""
    plain = products
    if products.order:
        plain = Products(products.statistics, skipped=products.skipped)
    gram, count = fitted.residual(plain).gram(products.skipped)
    if gram[0, 0] <= _ROUNDED * plain.energy:
        least = fitted.fit.objective / products.counted
        return LeftOver(power=least, counted=count, innovation=least, share=1.0, noise=np.ones(1))
    power = float(gram[0, 0])
    rho = gram[0, 1 : max(min(gram.shape[0], count // 4), 1)] / power
    lags = np.arange(1, rho.size + 1)
    box = count * (count + 2.0) * float(np.sum(rho**2 / (count - lags)))
    white = rho.size == 0 or scipy.special.chdtrc(rho.size, box) > FALSE_ALARM
    if white and not products.order:
        power, count = fitted.fit.objective, products.counted
    clear = rho[np.abs(rho) > DEVIATIONS / np.sqrt(count)]
    noise = np.ones(1) if white else whitening_filter(gram, count)
    return LeftOver(
        power=power / count,
        counted=count,
        innovation=float(noise @ gram[: noise.size, : noise.size] @ noise) / count,
        share=1.0 if white else float(1.0 / (1.0 + 2.0 * np.sum(clear**2))),
        noise=noise,
    )


def _decided(
    search: _Search,
    natural: Intersample,
    fits: list[Fitted],
    band: tuple[float, float],
    *,
    names: tuple[StructureName, ...],
    alone: bool,
) -> Chosen:
    """Weigh all fits alike, add poles that the likelihood pays for, and polish the chosen one."""
    left = left_over(search.products, _least(fits))
    count = search.products.counted * (1.0 if search.products.order else left.share)
    trials = [trial_of(f.intersample, f.fit, count) for f in fits]
    likeliest = likeliest_of(trials, natural)
    growth = grow(
        fits[trials.index(likeliest)],
        hidden=lambda f: hidden_pole_of(f, search.problem(f.intersample)),
        refit=lambda structure, theta: search.fit(likeliest.intersample, structure, theta),
        count=lambda *_: count,
        names=names,
        white=lambda f: left_over(search.products, f).noise.size == 1,
    )
    chosen = growth.grown[-1] if growth.grown else fits[trials.index(likeliest)]
    best = search.again(chosen, precision=_FINAL_PRECISION)
    polished = trial_of(best.intersample, best.fit, count)
    if growth.grown:
        moved = _moved(search, best.intersample, [best], alone=alone)
        trials += [trial_of(f.intersample, f.fit, count) for f in (*growth.grown[:-1], *moved)]
        trials.append(polished)
    else:
        trials[trials.index(likeliest)] = polished
    simple = [
        f
        for f in fits
        if f.fit.structure.name == "first_order" and f.intersample == best.intersample
    ]
    return Chosen(
        best=best,
        trials=tuple(trials),
        left=left_over(search.products, best),
        misfit=search.follows(best),
        band=band,
        problem=search.problem(best.intersample),
        rivals=tuple(trial_of(f.intersample, f.fit, count) for f in growth.rivals),
        hidden=growth.hidden,
        first_order=simple[0] if simple else None,
    )
