"""The joint fit up to the choice of a structure: start, fit, find the beginning, enrich."""

from dataclasses import dataclass, replace

import numpy as np

from hmpim.identify.arrays import Mask, Real, count_alike, every_of, median
from hmpim.identify.chance import BULK, CLEARLY
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
from hmpim.identify.fitting.data import Counted, Data, Fits, follows, polished, refit, refit_all
from hmpim.identify.fitting.enrich import PLAIN, is_response
from hmpim.identify.fitting.fit import CONVERGED, Fit, Problem
from hmpim.identify.fitting.least_squares import solved
from hmpim.identify.fitting.plainer import reduced
from hmpim.identify.fitting.start import rough_response
from hmpim.identify.fitting.tail import fit_with_tail
from hmpim.identify.fitting.whitening import criterion_in_colour, prewhitened_of
from hmpim.identify.fitting.zeros import with_second_zero
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
    "resumed",
    "start",
    "turn_ahead",
]

_SOME = 100
"""Samples that are enough to show, for most inputs, that they have more levels."""

_LEVELS = 3
"""Levels of a switched input: two of a binary sequence, and rest before it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Course:
    """The state of a record's joint fit.

    Parameters
    ----------
    data : Data
        The data of all trials.
    natural : {'zoh', 'foh', 'bandlimited'}
        The first assumption between the samples.
    alone : bool
        Whether it is the only one.
    known : ndarray of bool, shape (n,), or None
        Input samples that were measured.
    plain, others : tuple of str
        Structures to try first, and the richer ones.
    given, counted : Counted
        The samples as given, and those that count.
    fits : list of Fit
        Fits of the plain structures.
    settled : Fit or None
        The best of them, polished, if it leaves white noise and the record begins at rest.
    shared : bool
        Whether other inputs, whose fits are unfinished, move the output too.
    """

    data: Data
    natural: Intersample
    alone: bool
    known: Mask | None
    plain: tuple[StructureName, ...]
    others: tuple[StructureName, ...]
    given: Counted
    counted: Counted
    fits: list[Fit]
    settled: Fit | None = None
    shared: bool = False

    @property
    def problem(self) -> Problem:
        """The samples that count, under the natural assumption."""
        return self.data.problem(self.natural, self.counted)

    @property
    def best(self) -> Fit:
        """The fit with the least objective."""
        return min(self.fits, key=lambda fit: fit.objective)


def start(
    u: Real,
    y: Real,
    valid: Mask | None,
    known: Mask | None,
    intersample: Intersample | None,
    structures: tuple[StructureName, ...],
    nuisance: Real | None,
    shared: bool = False,
    small: int = 0,
) -> Course:
    """Fit each plain structure from spectra, and integrators if these lead."""
    if intersample is None and looks_held(u):
        intersample = "zoh"  # only a held input stands still and jumps
    natural: Intersample = "bandlimited" if intersample is None else intersample
    level = _level(y, nuisance, valid, small=small)
    rough = rough_response(u, level, longest_delay=longest_lag(u.size))
    data = Data(u=u, y=y, sources={}, rough=rough, nuisance=nuisance, small=small)
    course = begun(data, natural, structures, Counted(valid=valid, begins=None))
    fits = [*course.fits, *_leading_integrators(course)]
    return replace(course, alone=intersample is not None, known=known, fits=fits, shared=shared)


def _leading_integrators(course: Course) -> list[Fit]:
    """Fits with an integrator, if plain ones are poor and the best of these leaves white noise.

    A running sum wanders, and resembles its input a quarter of a period ahead or behind: plain
    fits of it would mislead all later steps.
    """
    if not is_poor(course.best, course.problem.spread):
        return []
    found = fit_integrating(course.data, course.problem, course.fits, course.others)
    return found if sums_to_noise([*course.fits, *found]) else []


def begun(
    data: Data, natural: Intersample, structures: tuple[StructureName, ...], seen: Counted
) -> Course:
    """Fit each plain structure under the natural assumption, the others to be tried later."""
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
    """Assume that the output is ahead of its input, if the plain fits then improve clearly."""
    data, seen, best = course.data, course.given, course.best
    lag = data.rough.ahead
    if lag is None or best.is_white:
        return course
    level = _level(data.y, data.nuisance, seen.valid, small=data.small)
    rough = rough_response(data.u, level, longest_delay=longest_lag(level.size), lag=lag)
    ahead = replace(data, rough=rough)
    counted = np.ones(level.size, dtype=bool) if seen.valid is None else seen.valid.copy()
    counted[rough.earliest :] = False  # they answer input after the record
    shorter = replace(seen, valid=counted)
    count = np.count_nonzero(counted)
    if count < PART * level.size:
        return course
    problem, power = ahead.problem(course.natural, shorter), best.objective / course.problem.counted
    found = fit_plain(problem, rough, course.plain or PLAIN, largest=power * count)
    if TWICE * min(f.objective for f in found) > power * count:
        return course
    return replace(course, data=ahead, given=shorter, counted=shorter, fits=found)


def free_from_wander(course: Course) -> Course:
    """Fit the plain structures with the noise whitened, where its colour hides the response.

    Not where the best fit has a pole as slow as the record: its wander is the response. Nor where
    a test in noise of any colour finds no response either.
    """
    if almost_integrates(course.best):
        return course
    whitened = prewhitened_of(course.data, course.natural, course.fits, course.given)
    if whitened is None or is_response(course.data.rough, course.best):
        return course
    if is_unanswered(course, [(course.natural, fit) for fit in course.fits]):
        return course
    problem = whitened.problem(course.natural, course.given)
    free = fit_plain(problem, whitened.rough, course.plain or PLAIN)
    if follows(course.data, min(free, key=lambda f: f.objective)):
        return course
    return replace(course, data=whitened, fits=free)


def interpolate_finely(course: Course) -> Course:
    """Interpolate the input as finely as the noise makes worthwhile."""
    finer = interpolated_for(course, course.best)
    return course if finer is None else replace(finer, fits=_again(finer, course.fits))


def interpolated_for(course: Course, fit: Fit) -> Course | None:
    """The course with an interpolation as fine as a fit needs; None where it is fine enough.

    The interpolation error biases an estimate by its share of the output; the noise scatters it
    by its own share over the root of the number of samples. The noise is taken from a median,
    which ignores samples that the ends of the record spoil.
    """
    if course.natural != "bandlimited":
        return None
    problem = course.data.problem("bandlimited", course.counted)
    residual = fit.residual if problem.valid is None else fit.residual[problem.valid]
    spread = max(float(np.std(fit.prediction)), np.finfo(float).tiny)
    noise = median(np.abs(residual[:: every_of(residual.size)])) / BULK / spread
    wanted = PART * noise / float(np.sqrt(residual.size))
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
    """Fit the plain structures to the samples that count: the record may not begin at rest."""
    data, natural, seen = course.data, course.natural, course.given
    if not course.best.converged:  # an unfinished fit leaves what looks like a free response
        ended = refit(course.problem, course.best)
        course = replace(course, fits=[ended if f is course.best else f for f in course.fits])
    fits, settled = course.fits, None
    if course.best.is_white:
        settled = polished(course.problem, course.best)
        fits = [settled if fit is course.best else fit for fit in fits]
    counted = count_in(data, natural, fits, seen, course.known)
    poor = is_poor(course.best, course.problem.spread)
    if counted.begins is None and poor and in_motion(data.u):
        counted = _in_motion(course) or counted
    if counted.begins is not None:  # fits that assumed rest may have ended anywhere
        problem = data.problem(natural, counted)
        fits = fit_plain(problem, data.rough, course.plain or PLAIN, before=fits)
        later = count_in(data, natural, fits, seen, course.known)
        counted = counted if later.begins is None else later
    if counted is seen:
        return replace(course, counted=counted, fits=fits, settled=settled)
    course = replace(course, counted=counted, settled=None)
    return replace(course, fits=_again(course, fits))


def _in_motion(course: Course) -> Counted | None:
    """Samples that count if the record begins in mid-motion; None unless fits then improve clearly.

    Fits that assumed rest ended so far off that their own free responses are of no use.
    """
    data, seen = course.data, course.given
    begun = begin_at(seen, max(data.rough.lag, 0) + REACH, data.y.size)
    if begun is None:
        return None
    problem = data.problem(course.natural, begun)
    useless = course.best.objective / course.problem.counted * problem.counted
    free = fit_plain(problem, data.rough, course.plain or PLAIN, largest=useless)
    return begun if TWICE * min(fit.objective for fit in free) < useless else None


def _again(course: Course, fits: list[Fit], *, precision: float = CONVERGED) -> list[Fit]:
    """Fits to the samples that count now, from where they ended."""
    natural = [(course.natural, fit) for fit in fits]
    again = refit_all(course.data, natural, course.counted, precision=precision)
    return [fit for _, fit in again]


def continued(course: Course, *, valid: Mask | None, nuisance: Real | None = None) -> Course:
    """Fit the plain structures to other samples, or with other rows, from where they ended.

    Parameters
    ----------
    course : Course
        The plain fits so far.
    valid, nuisance
        As for `hmpim.identify.fitting.joint.joint_fit`.
    """
    given = Counted(valid=valid, begins=None)
    data = replace(course.data.plain, nuisance=nuisance)
    course = replace(course, data=data, others=(), given=given, counted=given)
    course = replace(course, fits=_again(course, course.fits))
    return completed(course)


def resumed(course: Course, problem: Problem, fits: list[Fit]) -> Course:
    """Fit structures to other data of the same input, each from where its fit ended.

    `problem` has the output, the rows and the samples that count. Unlike with `continued`, richer
    structures may be tried later, and a noise model is kept.
    """
    y, lag = _level(problem.y, problem.nuisance, problem.valid), course.data.rough.lag
    ahead = lag if lag < 0 else None
    rough = rough_response(course.data.u, y, longest_delay=longest_lag(y.size), lag=ahead)
    data = replace(course.data, y=problem.y, nuisance=problem.nuisance, rough=rough)
    seen = Counted(valid=problem.valid, begins=problem.begins)
    course = replace(course, data=data, counted=seen, settled=None)
    precision = CONVERGED / min(fits, key=lambda fit: fit.objective).share
    course = replace(course, fits=_again(course, fits, precision=precision))
    counted = _count_from_rest(course, course.best)
    if counted.begins == seen.begins and count_alike(counted.valid, seen.valid):
        return course
    course = replace(course, counted=counted)
    return replace(course, fits=_again(course, course.fits, precision=precision))


def _count_from_rest(course: Course, fit: Fit) -> Counted:
    """Samples that count by a fit that begins at rest: the record may or may not."""
    from_rest = refit(course.data.problem(course.natural, course.given), fit)
    return count_in(course.data, course.natural, [from_rest], course.given, course.known)


def continue_between(course: Course) -> Fits:
    """All fits, the leading ones also under the other assumptions between the samples."""
    return fit_under_each_assumption(
        course.data, course.natural, course.fits, course.counted, course.others, alone=course.alone
    )


def is_unanswered(course: Course, fitted: Fits) -> bool:
    """Whether neither the likelihood nor a test without a model finds an answer."""
    mode, best = min(fitted, key=lambda item: item[1].objective)
    problem = course.data.problem(mode, course.counted)
    return course.data.is_unexplainable(problem, best)


def enrich(course: Course, fitted: Fits) -> tuple[Course, Fits]:
    """Fit richer structures while the residual follows the input, then the plain ones again.

    A small residual that follows the input counts as missing dynamics only where a richer
    structure leaves white noise: on real hardware it usually has another cause.
    """
    data, plain = course.data, course.plain
    mode, best = min(fitted, key=lambda item: item[1].objective)
    owed = owed_to_input(data.problem(mode, course.counted), best, data)
    required = not plain or owed > MATERIAL or spans_record(best)
    fits, richer = course.fits, list[Fit]()
    if required or owed > WORTH:
        richer = fit_rich(
            data, course.problem, fits, course.others, all_of_them=not plain, shared=course.shared
        )
        richer = with_second_zero(course.problem, fits, richer, course.others)
    if not required and not any(fit.is_white for fit in richer):
        richer = []
    tried = [*fits, *richer]
    # Otherwise the natural assumption is wrong, and its residual shows no tail.
    if min(fit.objective for fit in tried) < TWICE * best.objective:
        richer = [*richer, *_with_tails(course, tried)]
    if not richer:
        return course, fitted
    if course.counted.begins is not None:
        leading = min(richer, key=lambda f: f.objective)
        resting = _count_from_rest(course, leading)
        # If it is at rest after all, the structure was wrong, and not the beginning.
        at_rest = resting.begins is None
        counted = resting if at_rest else begin_later(course.counted, leading)
        if counted is not None:
            course = replace(course, counted=counted)
            every = _again(course, [*fits, *richer])
            fits, richer = every[: len(fits)], every[len(fits) :]
    fits = reduced(course.problem, fits, richer)
    course = replace(course, fits=[*fits, *richer] if plain else richer)
    return course, continue_between(course)


def _with_tails(course: Course, fits: list[Fit]) -> list[Fit]:
    """Fits with one slow tail, two, and so on, while each is clearly likelier."""
    data, problem, found = course.data, course.problem, list[Fit]()
    enough: float | None = None  # criterion from which on one more tail is not clearly likelier
    while data.keeps_samples:
        every = [*fits, *found]
        tailed = fit_with_tail(problem, every, course.others)
        if tailed is None:
            break
        if enough is None:
            best = min(every, key=lambda fit: fit.objective)
            enough = criterion_in_colour(data, problem, best) - 2 * CLEARLY
        own = criterion_in_colour(data, problem, tailed, hopeless=enough)
        if own >= enough:
            break
        found.append(tailed)
        enough = own - 2 * CLEARLY
    return found


def _level(y: Real, nuisance: Real | None, valid: Mask | None, *, small: int = 0) -> Real:
    """An output for spectra: without its regression on the nuisance rows, gaps filled.

    The last `small` rows explain little, and stay.
    """
    nuisance = nuisance if nuisance is None or not small else nuisance[:-small]
    if nuisance is not None and len(nuisance):
        counts = slice(None) if valid is None else valid
        every = np.vstack([nuisance, np.ones(y.size)])[:, counts]
        y = y - solved(every @ every.T, every @ y[counts])[:-1] @ nuisance
    return bridged(y, valid)


def bridged(y: Real, valid: Mask | None) -> Real:
    """Fill samples that do not count by straight lines, for spectra; all count if None."""
    if valid is None:
        return y
    index = np.arange(y.size)
    return np.interp(index, index[valid], y[valid])


def looks_held(u: Real) -> bool:
    """Whether an input stands still most of the time and then jumps, as a held one does.

    A move between two samples is a jump if the input stands still before and after. An input with
    at most three levels that changes between them again and again is switched. A rounded input
    stands still too, but mostly moves by its smallest step.
    """
    jumps = np.abs(np.diff(u))
    moves = jumps > 0
    count = int(np.count_nonzero(moves))
    some = u[:: u.size // _SOME + 1]  # these are checked first
    if count > _LEVELS and all(np.unique(values).size <= _LEVELS for values in (some, u)):
        return True
    if 2 * count > moves.size + 1:
        return False
    alone = moves & ~np.append(moves[1:], False) & ~np.append(False, moves[:-1])
    if 2 * np.count_nonzero(alone) <= count:
        return False
    rounded = median(jumps[alone]) <= TWICE * float(jumps[moves].min())
    return bool(jumps.max() > FEW * np.ptp(u) or not rounded)
