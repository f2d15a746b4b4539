"""The joint fit's own search, on statistics: products take the place of the samples."""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from hmpim.errors import RecordError
from hmpim.identify.arrays import Real
from hmpim.identify.chance import FALSE_ALARM, LIKELIER, SEARCHED
from hmpim.identify.fitting.course import Course, begun, looks_held
from hmpim.identify.fitting.data import Counted, Data, refit
from hmpim.identify.fitting.enrich import INTEGRATING, integrator_starts, members
from hmpim.identify.fitting.fit import Fit, Problem, fit_structure
from hmpim.identify.fitting.growth import HiddenPole
from hmpim.identify.fitting.joint import chosen_of
from hmpim.identify.fitting.least_squares import solved
from hmpim.identify.fitting.rows import Part
from hmpim.identify.fitting.start import RoughResponse
from hmpim.identify.fitting.trial import JointFit, schwarz
from hmpim.identify.noise.misfit import Misfit
from hmpim.identify.statistics.beyond import beyond_of, has_cubes
from hmpim.identify.statistics.fit import Compressed, Fitted, as_fitted, pulse
from hmpim.identify.statistics.misfit import hidden_pole_of, misfit_of, probes_at
from hmpim.identify.statistics.products import Products
from hmpim.identify.statistics.reach import AHEAD
from hmpim.identify.statistics.start import excited, rough_of
from hmpim.identify.statistics.statistics import Statistics
from hmpim.identify.worth import TWICE
from hmpim.model.dynamics import StructureName
from hmpim.record import Intersample

__all__ = ["CompressedData", "choose", "integrator_of"]

_FEWEST = 50
"""Samples that must count."""

_FORGOTTEN = 1e-4
"""Share of an impulse response's peak below which the response has ended."""

_TASTE = 5
"""Steps with an integrator from each start, before the best is followed if it is not hopeless."""

_LOOKS = 3
"""How often the samples that count at the ends are determined again."""

_ALL = Counted(valid=None, begins=None)
"""No selection: the products hold only samples that count."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CompressedData(Data):
    """What every trial of a compressed record shares."""

    products: Products  # without a noise model
    excited: tuple[float, float]  # band in cycles per sample

    @classmethod
    def of(cls, statistics: Statistics, *, skipped: int) -> "CompressedData":
        """Return the data of statistics; the first `skipped` outputs of each run do not count."""
        low, high = excited(statistics)
        return cls(
            u=np.empty(0),
            y=np.empty(0),
            sources={},
            rough=rough_of(statistics),
            nuisance=None,
            products=Products(statistics, skipped=skipped),
            excited=(low / statistics.fs, high / statistics.fs),
        )

    def problem(self, mode: Intersample, seen: Counted) -> Compressed:
        """The products under one assumption and the noise model."""
        if (mode, True) not in self.sources:
            self.sources[mode, True] = pulse(self.products.statistics.reach, mode)
        noise = np.ones(1) if self.noise is None else self.noise
        return Compressed.of(self.products.whitened(noise), self.sources[mode, True])

    @property
    def band(self) -> tuple[float, float]:
        """Band that is excited, in cycles per sample."""
        return self.excited

    def misfit(self, fit: Fit) -> Misfit:
        """How much of the residual follows the input, whatever its colour."""
        fitted = as_fitted(fit)
        products = fitted.whitening
        return misfit_of(fitted, products, self.band, probes_at(fit.delay, self.band, products))

    def beyond(self, fit: Fit) -> Misfit | None:
        """How much of the residual follows the cube of the input; None where no cube is kept."""
        if not has_cubes(self.products.statistics):
            return None
        return beyond_of(as_fitted(fit), as_fitted(fit).whitening, self.band)

    def noise_left(self, problem: Problem, fit: Fit) -> Real:
        """Autoregression of the residual of a fit, 1 first; 1 alone where it is white."""
        return as_fitted(fit).left.noise

    def level_left(self, problem: Problem, fit: Fit, noise: Real) -> None:
        """Products do not show a noise level that changes."""

    def rough_left(self, fit: Fit) -> RoughResponse:
        """Rough response of the residual of a fit."""
        known = as_fitted(fit).response
        return rough_of(self.products.statistics, known=known, lag=self.rough.lag)

    def is_unexplainable(self, problem: Problem, fit: Fit, *, least: float = 0.0) -> bool:
        """Whether a constant explains as much, and the residual does not follow the input."""
        products = as_fitted(fit).products
        share = 1.0 if products.order else fit.share
        gained = problem.counted * share * float(np.log(max(products.energy / fit.objective, 1.0)))
        limit = float(scipy.special.chdtri(fit.structure.parameters, FALSE_ALARM))
        return gained <= limit and self.misfit(fit).probability >= FALSE_ALARM

    def hidden_pole(self, problem: Problem, fit: Fit) -> HiddenPole:
        """The test of a fit for one more pole."""
        return hidden_pole_of(as_fitted(fit))


def choose(
    statistics: Statistics,
    *,
    intersample: Intersample | None,
    structures: tuple[StructureName, ...],
) -> tuple[CompressedData, JointFit]:
    """Fit every structure and choose one, as from samples; every fit is a `Fitted`.

    Arguments are those of `identify_statistics`. A `RecordError` is raised if too few samples
    count, or the output stands still where they do.
    """
    conditioned = _is_conditioned(statistics)
    names = tuple(name for name in structures if name not in INTEGRATING)
    natural: Intersample = intersample or ("zoh" if _looks_held(statistics) else "bandlimited")
    data = CompressedData.of(statistics, skipped=statistics.lags if conditioned else 0)
    course = begun(data, natural, names, _ALL)
    course = replace(course, alone=intersample is not None or natural == "zoh")
    data, joint = _look_and_choose(data, course, names, alone=len(statistics.runs) == 1)
    return data, replace(joint, forgotten=data.products.skipped)


def _look_and_choose(
    data: CompressedData, course: Course, names: tuple[StructureName, ...], *, alone: bool
) -> tuple[CompressedData, JointFit]:
    """Choose by the samples that count, and again where the chosen fit shows that others count.

    The first samples of several runs never count. All samples of a single short run count.
    """
    products, best = data.products, as_fitted(course.best)
    joint, begins = None, alone and products.skipped > 0
    for _ in range(_LOOKS):
        skipped, to_the_end = products.skipped, products.to_the_end and _ends_quietly(best)
        if begins:
            needed = 0 if _rests(best) else _memory(best)
            if joint is None or not needed or needed > skipped:
                skipped = needed
        if joint is not None and (skipped, to_the_end) == (products.skipped, products.to_the_end):
            break
        products = Products(data.products.statistics, skipped=skipped, to_the_end=to_the_end)
        if products.energy <= 0.0:
            raise RecordError(
                f"output {data.products.statistics.names[1]!r} moves only in the first {skipped} "
                "samples, which may answer input before the record; compress with fewer lags, or "
                "record longer"
            )
        data = replace(data, products=products)
        fits = [refit(data.problem(course.natural, _ALL), fit) for fit in course.fits]
        joint = chosen_of(replace(course, data=data, fits=fits), names)
        if not joint.related:
            break
        best = as_fitted(joint.best.fit)
    assert joint is not None
    return data, joint


def integrator_of(statistics: Statistics, data: CompressedData, joint: JointFit) -> Fitted | None:
    """Return an integrator unless the chosen fit is clearly likelier, each under its own noise.

    Where the output is unrelated, an integrator must explain more than a search does by chance.
    Its fit is exact: its response less the final value ends within the window, and the final value
    multiplies the running sum of the input.
    """
    rough = rough_of(statistics, differenced=True)
    mode, found, best = joint.best.intersample, [], as_fitted(joint.best.fit)
    problem, count = data.problem(mode, _ALL), data.products.counted
    hopeless = TWICE * best.left.power * count
    for structure in members(INTEGRATING, INTEGRATING):
        starts = integrator_starts(rough, structure)
        fits = [fit_structure(problem, structure, theta, iterations=_TASTE) for theta in starts]
        start = min(fits, key=lambda fit: fit.objective).theta
        fit = as_fitted(fit_structure(problem, structure, start, hopeless=hopeless))
        if fit.objective < hopeless and not fit.is_white:
            coloured = replace(data, noise=fit.left.noise).problem(mode, _ALL)
            fit = as_fitted(refit(coloured, fit))
        found.append(fit)
    weighed = [_criterion(fit, count) for fit in found]
    likeliest = found[int(np.argmin(weighed))]
    if not joint.related:
        gained = count * np.log(likeliest.problem.spread / likeliest.objective)
        return likeliest if gained > 2 * SEARCHED else None
    behind = min(weighed) - _criterion(best, count)
    return likeliest if behind < 2 * LIKELIER else None


def _criterion(fit: Fitted, count: int) -> float:
    """Schwarz's criterion of a fit under the autoregression of its residual."""
    left = fit.left
    # Where sums cancel, rounding may make the power negative.
    least = np.finfo(float).eps * fit.products.plain.energy / count
    parameters = fit.structure.parameters + left.noise.size - 1
    return schwarz(count * max(left.innovation, least), count, parameters)


def _is_conditioned(statistics: Statistics) -> bool:
    """Whether the first outputs of each run are left out; those of several runs must be."""
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
    return len(statistics.runs) > 1 or shortest > lags + max(lags // 2, _FEWEST)


def _looks_held(statistics: Statistics) -> bool:
    """Whether the input looks held at the ends of the runs, where its samples are kept."""
    ends = [run.head_u[: run.samples] for run in statistics.runs]
    ends += [run.tail_u[-run.samples :] for run in statistics.runs]
    moving = [end for end in ends if np.ptp(end) > 0.0]
    return bool(moving) and all(looks_held(end) for end in moving)


def _rests(best: Fitted) -> bool:
    """Whether a run begins at rest, so that the residual of its beginning is noise.

    The power of that noise is chi-squared, and so is the power that a free response of the state
    explains. The noise is estimated from later samples, which a free response does not colour.
    """
    products, lags = best.products.plain, best.products.statistics.lags
    behind = products.alike(skipped=_memory(best))
    left = replace(best, problem=Compressed.of(behind, best.problem.source)).left
    begins = int(np.ceil(max(best.delay, 0.0))) + 4
    problem = replace(best.problem, begins=begins)
    free = Part(problem, best.structure, best.theta).free[:, :lags]
    head = best.remainder.heads[0, :lags]
    every = np.vstack([head, free])
    head, *free_rows = scipy.signal.lfilter(left.noise, np.ones(1), every)[:, left.noise.size :]
    if float(head @ head) > 2.0 * left.innovation * scipy.special.chdtri(head.size, FALSE_ALARM):
        return False
    if not free_rows or begins >= lags:
        return True
    free = np.array(free_rows)
    moment = free @ head
    explained = float(moment @ solved(free @ free.T, moment))
    return explained < left.innovation * float(scipy.special.chdtri(free.shape[0], FALSE_ALARM))


def _ends_quietly(best: Fitted) -> bool:
    """Whether the residual at the ends of the runs is noise; a band-limited input rings there."""
    left, runs = best.left, len(best.products.statistics.runs)
    if best.problem.source.degree <= 1 or left.counted < _FEWEST + AHEAD * runs:
        return True
    tails = scipy.signal.lfilter(left.noise, np.ones(1), best.remainder.tails)[:, left.noise.size :]
    limit = float(scipy.special.chdtri(max(tails.size, 1), FALSE_ALARM))
    return float(np.sum(tails**2)) <= left.innovation * limit


def _memory(fitted: Fitted) -> int:
    """Outputs that depend on the input before a run, by the best fit, and half as many again."""
    size = np.abs(fitted.response)
    last = int(np.max(np.flatnonzero(size > _FORGOTTEN * size.max()), initial=AHEAD)) - AHEAD
    return int(np.clip(1.5 * last, 1, fitted.products.statistics.lags))
