"""The way of the joint fit up to the choice: start, climb, begin, enrich."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hmpim.identify.arrays import Mask, Real, every_of, median
from hmpim.identify.chance import BULK
from hmpim.identify.fitting.beginning import REACH, begin_at, begin_later, count_in, in_motion
from hmpim.identify.fitting.between import fit_under_each_assumption
from hmpim.identify.fitting.candidates import (
    almost_integrates,
    fit_integrating,
    fit_plain,
    fit_rich,
    is_poor,
    owed_to_input,
    spans_record,
    sums_to_noise,
)
from hmpim.identify.fitting.data import Data, Seen, follows, polished, refit, refit_all
from hmpim.identify.fitting.enrich import PLAIN, is_response
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.fitting.least_squares import solved
from hmpim.identify.fitting.plainer import reduced
from hmpim.identify.fitting.start import rough_response
from hmpim.identify.fitting.washout import washed_out
from hmpim.identify.fitting.whitening import prewhitened_of
from hmpim.identify.signals import longest_lag
from hmpim.identify.worth import FEW, MATERIAL, PART, TWICE, WORTH
from hmpim.model.dynamics import StructureName
from hmpim.model.sampled import WINDOW, interpolation_error
from hmpim.record import Intersample

__all__ = [
    "Course",
    "begun",
    "bridged",
    "completed",
    "continue_between",
    "continued",
    "enrich",
    "find_beginning",
    "free_from_wander",
    "is_unanswered",
    "looks_held",
    "set_free",
    "start",
    "turn_ahead",
]

_SOME = 100
"""Samples that tell at once of most inputs that they have more levels."""

_LEVELS = 3
"""Levels of a switched input: two of a binary sequence, and the rest before it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Course:
    """Where the joint fit of a record stands.

    Parameters
    ----------
    data : Data
        What all trials share.
    natural : {'zoh', 'foh', 'bandlimited'}
        The assumption between the samples that all begin with.
    alone : bool
        Whether no other is tried.
    known : ndarray of bool, shape (n,), or None
        Input samples that were measured.
    plain, others : tuple of str
        Structures to try first, and the richer ones.
    given, counted : Seen
        Samples as they were given, and those that count.
    fits : list of Fit
        Of the plain structures.
    settled : Fit or None
        The best of them where it leaves white noise and the record begins at rest: it is polished.
    shared : bool
        Whether other inputs, whose fits are unfinished, move the output too.
    """

    data: Data
    natural: Intersample
    alone: bool
    known: NDArray[np.bool_] | None
    plain: tuple[StructureName, ...]
    others: tuple[StructureName, ...]
    given: Seen
    counted: Seen
    fits: list[Fit]
    settled: Fit | None = None
    shared: bool = False

    @property
    def problem(self) -> Problem:
        """The samples that count, under the natural assumption."""
        return self.data.problem(self.natural, self.counted)

    @property
    def best(self) -> Fit:
        """The fit that leaves least."""
        return min(self.fits, key=lambda fit: fit.objective)


def start(
    u: NDArray[np.float64],
    y: NDArray[np.float64],
    valid: NDArray[np.bool_] | None,
    known: NDArray[np.bool_] | None,
    intersample: Intersample | None,
    structures: tuple[StructureName, ...],
    nuisance: NDArray[np.float64] | None,
    shared: bool = False,
) -> Course:
    """Start from the spectra, and climb with each plain structure, or an integrator that leads."""
    if intersample is None and looks_held(u):
        intersample = "zoh"  # an input that stands still and jumps does nothing else
    natural: Intersample = "bandlimited" if intersample is None else intersample
    data = Data(
        u=u,
        y=y,
        sources={},
        rough=rough_response(u, _level(y, nuisance, valid), longest_delay=longest_lag(u.size)),
        nuisance=nuisance,
    )
    course = begun(data, natural, structures, Seen(valid=valid, begins=None))
    fits = [*course.fits, *_leading_integrators(course)]
    return replace(course, alone=intersample is not None, known=known, fits=fits, shared=shared)


def _leading_integrators(course: Course) -> list[Fit]:
    """Fits with an integrator, where plain structures leave much and the best of these white noise.

    A running sum wanders, and resembles its input a quarter of a period ahead or behind: what plain
    structures make of it would mislead all that follows.
    """
    if not is_poor(course.best, course.problem.spread):
        return []
    found = fit_integrating(course.data, course.problem, course.fits, course.others)
    return found if sums_to_noise([*course.fits, *found]) else []


def begun(
    data: Data, natural: Intersample, structures: tuple[StructureName, ...], seen: Seen
) -> Course:
    """Climb with each plain structure; other assumptions between the samples are left to try."""
    plain = tuple(name for name in structures if name in PLAIN)
    return Course(
        data=data,
        natural=natural,
        alone=False,
        known=None,
        plain=plain,
        others=tuple(name for name in structures if name not in PLAIN),
        given=seen,
        counted=seen,
        fits=fit_plain(data.problem(natural, seen), data.rough, plain or PLAIN),
    )


def turn_ahead(course: Course) -> Course:
    """The same with an output that is ahead of its input, where that leaves clearly less."""
    data, seen, best = course.data, course.given, course.best
    lag = data.rough.ahead
    if lag is None or best.is_white:
        return course
    level = _level(data.y, data.nuisance, seen.valid)
    rough = rough_response(data.u, level, longest_delay=longest_lag(level.size), lag=lag)
    ahead = replace(data, rough=rough)
    counted = np.ones(level.size, dtype=bool) if seen.valid is None else seen.valid.copy()
    counted[rough.earliest :] = False  # they answer what comes after the record
    shorter = replace(seen, valid=counted)
    count = np.count_nonzero(counted)
    if count < PART * level.size:
        return course
    found = fit_plain(ahead.problem(course.natural, shorter), rough, course.plain or PLAIN)
    least = min(f.objective for f in found) / count
    if TWICE * least > best.objective / course.problem.counted:
        return course
    return replace(course, data=ahead, given=shorter, counted=shorter, fits=found)


def free_from_wander(course: Course) -> Course:
    """The same from starts with the noise whitened, where its colour hides the response.

    What an integrator leaves over wanders too, and is the response.
    """
    if almost_integrates(course.best):
        return course
    whitened = prewhitened_of(course.data, course.natural, course.fits, course.given)
    if whitened is None or is_response(course.data.rough, course.best):
        return course
    problem = whitened.problem(course.natural, course.given)
    free = fit_plain(problem, whitened.rough, course.plain or PLAIN)
    if follows(course.data, min(free, key=lambda f: f.objective)):
        return course
    return replace(course, data=whitened, fits=free)


def interpolate_finely(course: Course) -> Course:
    """The same with the input interpolated as closely as the noise lets it be seen."""
    finer = interpolated_for(course, course.best)
    if finer is None or course.natural != "bandlimited":
        return finer or course
    return replace(finer, fits=_again(finer, course.fits))


def interpolated_for(course: Course, fit: Fit) -> Course | None:
    """The same with the input interpolated as closely as a fit asks for; None where it is.

    What is missed between the samples biases an estimate by its share of the output; the noise
    spreads it by its own share over the root of their number. Samples that the ends of the record
    spoil are no noise: the median does not see them.
    """
    if course.alone and course.natural != "bandlimited":
        return None
    problem = course.data.problem("bandlimited", course.counted)
    residual = fit.residual if problem.valid is None else fit.residual[problem.valid]
    spread = max(float(np.std(fit.prediction)), np.finfo(float).tiny)
    seen = median(np.abs(residual[:: every_of(residual.size)])) / BULK / spread
    wanted = PART * seen / float(np.sqrt(residual.size))
    if wanted * TWICE >= course.data.precision:
        return None
    used = problem.source.oversampling
    windowed = 0.0 if used == 1 else min(WINDOW, course.data.precision)
    if max(interpolation_error(course.data.u, used), windowed) <= wanted:
        return None
    return replace(course, data=replace(course.data, sources={}, precision=wanted))


def completed(course: Course) -> Course:
    """The plain fits with the input interpolated finely, to the samples that count."""
    return find_beginning(interpolate_finely(course))


def find_beginning(course: Course) -> Course:
    """The samples that count, and the fits to them: the record may not begin at rest."""
    data, natural, seen = course.data, course.natural, course.given
    if not course.best.converged:  # what is left of the way down looks like a free response
        ended = refit(course.problem, course.best)
        course = replace(course, fits=[ended if f is course.best else f for f in course.fits])
    fits, settled = course.fits, None
    if course.best.is_white:
        settled = polished(course.problem, course.best)
        fits = [settled if fit is course.best else fit for fit in fits]
    counted = count_in(data, natural, fits, seen, course.known)
    if counted.begins is None and settled is None and in_motion(data.u):
        counted = _in_motion(course) or counted
    if counted.begins is not None:  # from rest those fits ended anywhere
        problem = data.problem(natural, counted)
        integrating = [refit(problem, fit) for fit in fits if fit.structure.integrators]
        fits = fit_plain(problem, data.rough, course.plain or PLAIN, before=fits) + integrating
        later = count_in(data, natural, fits, seen, course.known)
        counted = counted if later.begins is None else later
    if counted is seen:
        return replace(course, counted=counted, fits=fits, settled=settled)
    course = replace(course, counted=counted, settled=None)
    return replace(course, fits=_again(course, fits))


def _in_motion(course: Course) -> Seen | None:
    """Samples that count from a beginning in mid-motion; None unless that leaves clearly less.

    From rest such fits ended so far off that no free response of theirs is of use.
    """
    data, seen = course.data, course.given
    begun = begin_at(seen, max(data.rough.lag, 0) + REACH, data.y.size)
    if begun is None:
        return None
    problem = data.problem(course.natural, begun)
    free = fit_plain(problem, data.rough, course.plain or PLAIN)
    least = min(fit.objective for fit in free) / problem.counted
    return begun if TWICE * least < course.best.objective / course.problem.counted else None


def _again(course: Course, fits: list[Fit]) -> list[Fit]:
    """Fits to the samples that count now, from where they ended."""
    natural = [(course.natural, fit) for fit in fits]
    return [fit for _, fit in refit_all(course.data, natural, course.counted)]


def continued(course: Course, *, valid: Mask | None, nuisance: Real | None = None) -> Course:
    """Fit the plain structures to other samples, or beside other rows, from where they ended.

    Parameters
    ----------
    course : Course
        The plain fits so far.
    valid, nuisance
        As for `hmpim.identify.fitting.joint.joint_fit`.
    """
    given = Seen(valid=valid, begins=None)
    data = replace(course.data.plain, nuisance=nuisance)
    course = replace(course, data=data, others=(), given=given, counted=given)
    course = replace(course, fits=_again(course, course.fits))
    return completed(course)


def set_free(course: Course, fit: Fit) -> Course | None:
    """The samples that count from mid-motion, and a fit to them; None unless white noise is left.

    Parameters
    ----------
    course : Course
        The plain fits so far.
    fit : Fit
        Of any structure, as it ended beside other rows. What drifted may be its free response, or
        that of a washout.
    """
    data, given = course.data, course.given
    counted = begin_at(given, max(int(np.ceil(fit.delay)), 0) + REACH, data.y.size)
    if counted is None or fit.structure.integrators:
        return None
    problem = data.problem(course.natural, counted)
    free: Fit | None = refit(problem, fit) if fit.structure.order else None
    if free is None or not free.is_white:
        free = washed_out(problem, fit)
    if free is None or not free.is_white:
        return None
    return replace(course, others=(), counted=counted, fits=[free], settled=None)


def continue_between(course: Course) -> list[tuple[Intersample, Fit]]:
    """The fits, and the leading ones under the other assumptions between the samples."""
    return fit_under_each_assumption(
        course.data,
        course.natural,
        course.fits,
        course.counted,
        course.others,
        alone=course.alone,
    )


def is_unanswered(course: Course, fitted: list[tuple[Intersample, Fit]]) -> bool:
    """Whether neither the likelihood nor a test without a model sees an answer."""
    mode, best = min(fitted, key=lambda item: item[1].objective)
    problem = course.data.problem(mode, course.counted)
    return course.data.says_nothing(problem, best)


def enrich(
    course: Course, fitted: list[tuple[Intersample, Fit]]
) -> tuple[Course, list[tuple[Intersample, Fit]]]:
    """Richer structures while what is left over follows the input, then the plain ones again.

    What is little, and would be doubted all the same, counts as a lack of dynamics only where a
    richer structure leaves white noise: of real hardware it is something else as a rule.
    """
    data, plain = course.data, course.plain
    mode, best = min(fitted, key=lambda item: item[1].objective)
    owed = owed_to_input(data.problem(mode, course.counted), best, data)
    asked = not plain or owed > MATERIAL or spans_record(best)
    if not asked and owed <= WORTH:
        return course, fitted
    fits = course.fits
    richer = fit_rich(
        data,
        course.problem,
        fits,
        course.others,
        all_of_them=not plain,
        shared=course.shared,
    )
    if not asked and not any(fit.is_white for fit in richer):
        return course, fitted
    if richer and course.counted.begins is not None:
        leading = min(richer, key=lambda f: f.objective)
        from_rest = refit(data.problem(course.natural, course.given), leading)
        resting = count_in(data, course.natural, [from_rest], course.given, course.known)
        # At rest after all, it was the structure that was wrong, and not the beginning.
        rests = resting.begins is None
        counted = resting if rests else begin_later(course.counted, leading)
        if counted is not None:
            course = replace(course, counted=counted)
            every = _again(course, [*fits, *richer])
            fits, richer = every[: len(fits)], every[len(fits) :]
    if richer:
        fits = reduced(course.problem, fits, richer)
    course = replace(course, fits=[*fits, *richer] if plain else richer or fits)
    return course, continue_between(course)


def _level(
    y: NDArray[np.float64],
    nuisance: NDArray[np.float64] | None,
    valid: NDArray[np.bool_] | None,
) -> NDArray[np.float64]:
    """An output for spectra: without what its rows explain, gaps filled."""
    level = y if nuisance is None else y - _regressed(nuisance, y, valid)
    return bridged(level, valid)


def _regressed(
    rows: NDArray[np.float64], y: NDArray[np.float64], valid: NDArray[np.bool_] | None
) -> NDArray[np.float64]:
    """What of an output the rows explain beside a constant, by least squares."""
    counts = slice(None) if valid is None else valid
    every = np.vstack([rows, np.ones(y.size)])[:, counts]
    weights = solved(every @ every.T, every @ y[counts])[:-1]
    return np.asarray(weights @ rows)


def bridged(y: NDArray[np.float64], valid: NDArray[np.bool_] | None) -> NDArray[np.float64]:
    """Fill samples that do not count by straight lines, for spectra; all do if None."""
    if valid is None:
        return y
    index = np.arange(y.size)
    return np.interp(index, index[valid], y[valid])


def looks_held(u: NDArray[np.float64]) -> bool:
    """Whether an input stands still most of the time and then jumps, as a held one does.

    What moves between two samples moves at one instant only if it stood before and stands after;
    what has three levels at most and goes from one to another again and again is switched. What is
    rounded stands still too; it then moves by one step, its least.
    """
    jumps = np.abs(np.diff(u))
    moves = jumps > 0
    count = int(np.count_nonzero(moves))
    if count > _LEVELS and _has_few_levels(u):
        return True
    if 2 * count > moves.size + 1:
        return False
    alone = moves & ~np.append(moves[1:], False) & ~np.append(False, moves[:-1])
    if 2 * np.count_nonzero(alone) <= count:
        return False
    rounded = median(jumps[alone]) <= TWICE * float(jumps[moves].min())
    return bool(jumps.max() > FEW * np.ptp(u) or not rounded)


def _has_few_levels(u: NDArray[np.float64]) -> bool:
    """Whether an input stands at three levels at most; a few samples deny it."""
    some = u[:: u.size // _SOME + 1]
    return np.unique(some).size <= _LEVELS and np.unique(u).size <= _LEVELS
