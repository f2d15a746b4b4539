"""The steps of the algorithm in `hmpim.identify.identify`, in their order."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial

import numpy as np

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.asked.question import Question
from hmpim.identify.asked.reference import fit_through
from hmpim.identify.asked.swapped import is_swapped, lags_behind, swapped_finding
from hmpim.identify.coupling.output_fit import OutputFit, fit_together
from hmpim.identify.effects.disturbance import gain_by_rows, without_rows
from hmpim.identify.effects.drift import is_slow, with_drift, with_plain_drift
from hmpim.identify.effects.gain import changing_gain
from hmpim.identify.effects.hum import line_near, with_hum
from hmpim.identify.effects.imperfections import (
    Imperfections,
    find_imperfections,
    refine,
)
from hmpim.identify.effects.lost import stands_out
from hmpim.identify.effects.quantization import is_predicted
from hmpim.identify.effects.saturation import goes_beyond
from hmpim.identify.fitting.between import refit_between
from hmpim.identify.fitting.candidates import spans_record
from hmpim.identify.fitting.course import (
    Course,
    completed,
    continued,
    free_from_wander,
    set_free,
    start,
    turn_ahead,
)
from hmpim.identify.fitting.data import follows
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.fitting.joint import chosen_of
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.kept import kept
from hmpim.identify.noise.colour import tone_of
from hmpim.identify.noise.input_noise import input_noise
from hmpim.identify.noise.spectra import windowed_power
from hmpim.identify.noise.whiteness import is_white
from hmpim.identify.nonlinear.bends import bends
from hmpim.identify.nonlinear.lines import find_period
from hmpim.identify.nonlinear.speed import beside_speed, explains_more, limited_command
from hmpim.identify.worth import PART, WORTH
from hmpim.model.dynamics import StructureName

__all__ = [
    "drift_or_levels",
    "fit",
    "let_gain_change",
    "limit_speed",
    "look",
    "look_again",
    "mark_swapped",
    "through_reference",
]

_CLEAR = 8
"""Bins from a constant to a line: in the window's spectrum each is four wide to either side."""


def look(question: Question) -> Imperfections:
    """Find clipped, held, rounded, stuck and lost samples of the output."""
    if question.exact:
        return Imperfections()
    return _imperfections(question, inputs=[u.values for u in question.aligned.inputs])


def mark_swapped(question: Question) -> Question:
    """Say if the one input there is follows the output; a late clock alone may do it."""
    output = question.output
    if len(question.aligned.inputs) > 1 or question.instrument is not None:
        return question
    (source,) = question.aligned.inputs
    if not is_swapped(source.values, output.values, source.valid & output.valid):
        return question
    if lags_behind(_fit_once(question, look(question), question.plain).fits[0]):  # it was the clock
        return question
    finding = swapped_finding(source.name, output.name)
    return replace(question, structures=question.plain, swapped=finding)


def fit(question: Question, seen: Imperfections) -> tuple[Imperfections, OutputFit]:
    """Fit every structure, with hum and a drift where the residual asks for them.

    If plain dynamics with levels or with a drift leave white noise, no richer ones are tried: they
    would only follow the effect. The levels found are returned with the fit.
    """
    begun = _begin(question, seen)
    if begun is None:
        return seen, _fit_and_look_for_rows(question, seen)
    course = completed(begun)
    if not begun.best.is_white:
        levelled = _behind_levels(question, seen, begun, rests=course.counted.begins is None)
        if levelled is not None:
            return levelled
    drifting = None if course.best.is_white else _drifting(question, seen, course)
    if drifting is not None:
        return seen, drifting
    freed = free_from_wander(begun)
    if freed is not begun:
        course = completed(freed)
    return seen, _fit_and_look_for_rows(question, seen, course)


def _behind_levels(
    question: Question, seen: Imperfections, course: Course, *, rests: bool
) -> tuple[Imperfections, OutputFit] | None:
    """Plain dynamics behind levels, where they leave white noise."""
    best, y = course.best, question.output.values
    # Of what came before the record these fits know nothing.
    late = 0 if rests else min(int(np.ceil(max(best.delay, 0.0) + best.memory)), y.size // 4)
    prediction = np.concatenate([y[:late], best.prediction[late:]])
    shown = _imperfections(question, prediction=prediction).saturation
    levels = seen.saturation if shown is None else shown
    if levels is None:
        return None
    clipped = replace(seen, saturation=levels)
    behind = continued(course, valid=_counted(question, clipped))
    if levels.noise == "after" and not behind.best.is_white:
        return None
    joint = chosen_of(behind, question.plain)
    if levels.noise == "after" and not goes_beyond(levels, y, joint.best.fit.prediction):
        return None
    if not joint.related:
        return None
    refined = refine(joint, clipped, question.aligned.inputs[0].values, question.aligned.fs)
    if refined is None:
        return None
    told, _ = refined
    white = is_white(told.problem.counting(told.best.fit.residual))
    return (clipped, OutputFit(fits=(joint,))) if white else None


def _drifting(question: Question, seen: Imperfections, course: Course) -> OutputFit | None:
    """Plain dynamics and a drift, where they leave white noise."""
    valid, former = _counted(question, seen), course

    def with_rows(rows: Real, _: bool) -> JointFit:
        nonlocal course
        course = continued(course, valid=valid, nuisance=rows)
        return chosen_of(course, question.plain)

    if spans_record(former.best) or not is_slow(former.problem, former.best):
        return None
    drifting = with_plain_drift(former.problem, former.best, with_rows)
    if drifting is None or not drifting.joint.related:
        return None
    if follows(course.data, drifting.joint.best.fit):  # richer dynamics may be what is slow
        return None
    return OutputFit(fits=(drifting.joint,), drifting=drifting)


def _fit_and_look_for_rows(
    question: Question, seen: Imperfections, begun: Course | None = None
) -> OutputFit:
    """Fit every structure, and again with hum and a drift where the residual asks for them."""
    steady = question.exact or question.intersample == "sampled"
    drifts = None if steady else partial(_plain_beside_drift, question, seen)
    fitted = _fit_once(question, seen, question.structures, begun=begun, drifts=drifts)
    several = len(fitted.fits) > 1
    if fitted.drifting is not None:
        return fitted
    if fitted.fits[0].silent or question.swapped or question.exact:
        return fitted
    if several and question.intersample == "sampled":
        return fitted
    asked = 0
    if several:
        slow = fitted.slow
        asked = fitted.leading if slow is None else slow
    joint, beside, humming = fitted.fits[asked], fitted, None
    hum = np.zeros(0)
    aside: dict[int, JointFit] = {}

    def with_rows(rows: Real, plainly: bool) -> JointFit:
        nonlocal beside, hum
        names = question.plain if plainly else question.structures
        every = rows if humming is None else np.vstack([rows, humming.rows])
        before, beside = beside, _fit_once(question, seen, names, every, aside=aside)
        if not several and not plainly and before is not fitted:
            beside = _as_before(question, seen, every, before, beside)
        found = beside.fits[asked]
        if humming is None:
            return found
        quiet = without_rows(found, slice(len(rows), None))
        hum = found.problem.y - quiet.problem.y
        return quiet

    def steadily(beside: JointFit) -> JointFit | None:
        if several or question.intersample == "sampled":
            return None
        course = begun or _started(question, seen, None if humming is None else humming.rows)
        free = set_free(course, beside.best.fit)
        return None if free is None else chosen_of(free, question.structures)

    coloured = not is_white(joint.problem.counting(joint.best.fit.residual))
    if coloured and not any(_has_lines(source.values) for source in question.aligned.inputs):
        humming = with_hum(joint, with_rows)
    joint = joint if humming is None else humming.joint
    kept = fitted if humming is None else beside
    # Whether there is a drift, the inputs tell that the output is known to follow.
    aside = {i: fit for i, fit in enumerate(kept.fits) if not fit.related}
    if len(aside) == len(kept.fits):
        aside = {}
    first = joint
    joint, drifting = with_drift(first, with_rows, steadily)
    if aside and drifting is not None:
        aside = {}
        joint, drifting = with_drift(first, with_rows, steadily)
    if drifting is not None and humming is not None:
        humming = replace(humming, trend=hum)
    kept = kept if drifting is None else beside
    kept = replace(kept, drifting=drifting, humming=humming, asked=asked)
    if several:
        return replace(kept, fits=tuple(without_rows(one, slice(None)) for one in kept.fits))
    return replace(kept, fits=(joint,), steady=None if drifting is None else fitted.prediction)


def _as_before(
    question: Question, seen: Imperfections, rows: Real, before: OutputFit, found: OutputFit
) -> OutputFit:
    """Keep what a search beside `rows` found, or the plainer dynamics found before, if likelier.

    A search may end in modes without number.
    """
    (best,), (rich,) = ([one.best for one in fitted.fits] for fitted in (before, found))
    if best.fit.structure.parameters >= rich.fit.structure.parameters or not best.fit.is_white:
        return found
    course = completed(turn_ahead(_started(question, seen, rows)))
    again = refit_between(course.problem, best.fit, best.intersample, course.natural)
    joint = chosen_of(replace(course, fits=[*course.fits, again]), question.structures)
    gain = gain_by_rows(joint, 0, rich.fit, found.fits[0].problem)
    return OutputFit(fits=(joint,)) if gain > 0.0 else found


def _plain_beside_drift(
    question: Question, seen: Imperfections, asked: int, first: JointFit
) -> OutputFit | None:
    """Plain dynamics of several inputs and a drift, where they leave white noise.

    `first` is the plain fit to the input that leads, `asked`.
    """
    plain = OutputFit(fits=(first,))

    def with_rows(rows: Real, briefly: bool) -> JointFit:
        nonlocal plain
        plain = _fit_once(question, seen, question.plain, rows, briefly=briefly)
        return plain.fits[0 if briefly else asked]

    drifting = with_plain_drift(first.problem, first.best.fit, with_rows)
    if drifting is None or not drifting.joint.related:
        return None
    steady = _fit_once(question, seen, question.plain)
    former = steady.fits[asked]
    if former.best.fit.is_white and steady.slow is None:
        return None
    count = plain.fits[asked].best.fit.nuisance.size
    if gain_by_rows(plain.fits[asked], count, former.best.fit, former.problem) < 0.0:
        return None
    fits = tuple(without_rows(one, slice(None)) for one in plain.fits)
    return replace(plain, fits=fits, drifting=drifting, asked=asked)


@kept
def _has_lines(u: Real) -> bool:
    """Whether an input repeats, or one line is much of it: its distortion then has lines too."""
    moves, power = u - u.mean(), windowed_power(u)[_CLEAR:]
    line = line_near(moves, (_CLEAR + int(np.argmax(power))) / u.size) if power.size else 0.5
    much = float(np.var(tone_of(moves, line))) > PART * float(np.var(moves))
    return much or find_period(u) is not None


def drift_or_levels(
    question: Question, seen: Imperfections, fitted: OutputFit
) -> tuple[Imperfections, OutputFit]:
    """Take levels behind the noise, where they explain better what was taken for a drift."""
    if fitted.steady is None or seen.saturation is not None:
        return seen, fitted
    plateau = _imperfections(question, prediction=fitted.steady).saturation
    if plateau is None or plateau.noise != "after":
        return seen, fitted
    clipped = replace(seen, saturation=plateau)
    levelled = _fit_once(question, clipped, question.structures)
    u = question.aligned.inputs[0].values
    refined = refine(levelled.fits[0], clipped, u, question.aligned.fs)
    (drifted,) = fitted.fits
    left = drifted.best.fit.cost / drifted.problem.counted
    if refined is None or refined[1].noise_std ** 2 > left:
        return seen, fitted
    return clipped, levelled


def look_again(question: Question, seen: Imperfections, fitted: OutputFit) -> Imperfections:
    """Look with the model in hand: a plateau can now be told from a crest."""
    if question.exact:
        return seen
    first = fitted.fits[0]
    seen = _without_clusters(question, seen, fitted)
    residual = first.best.fit.residual
    asked = seen.saturation is not None or seen.hold is not None
    if not asked and is_white(residual) and not stands_out(first.problem.counting(residual)):
        return seen
    prediction = fitted.prediction.copy()  # of what came before the free response it says nothing
    prediction[: first.forgotten] = question.output.values[: first.forgotten]
    again = _imperfections(question, prediction=prediction)
    again = replace(again, levels=seen.levels, quantization=seen.quantization)
    told = again.telling(prediction.size, question.aligned.fs)
    if told is not None and np.ptp(question.output.values[told]) == 0.0:
        return seen  # all that moves would be taken for spikes
    plateau = again.saturation
    before = seen.saturation
    if plateau is None and before is not None and before.noise == "after":
        kept = goes_beyond(before, question.output.values, prediction)  # else it has settled there
        return replace(again, saturation=before if kept else None)
    if fitted.drifting is not None and plateau is not None and plateau.noise == "after":
        return replace(again, saturation=None)  # a wander bends the output as a level does
    return again


def _without_clusters(question: Question, seen: Imperfections, fitted: OutputFit) -> Imperfections:
    """Take no grid for rounding that the model explains: an input of few levels makes one."""
    if seen.quantization is None:
        return seen
    y, told = question.output.values, _counted(question, seen)
    told = np.ones(y.size, dtype=bool) if told is None else told.copy()
    told[: fitted.fits[0].forgotten] = False
    explained = is_predicted(seen.quantization, y[told], fitted.prediction[told])
    return replace(seen, quantization=None) if explained else seen


def _imperfections(
    question: Question, *, prediction: Real | None = None, inputs: Sequence[Real] = ()
) -> Imperfections:
    """What `hmpim.identify.effects.imperfections.find_imperfections` finds of the output."""
    output = question.output
    return find_imperfections(
        output.values,
        question.aligned.fs,
        valid=output.valid,
        prediction=prediction,
        inputs=inputs,
    )


def let_gain_change(question: Question, seen: Imperfections, fitted: OutputFit) -> OutputFit:
    """Let the gain change along the record, where that explains more; plain dynamics may then do.

    Of one input; not asked of a loop, of software, behind levels or holds, and where the output
    follows nothing. A nonlinearity that explains more is left to the checks.
    """
    joint, aligned = fitted.fits[0], question.aligned
    if len(fitted.fits) > 1 or not joint.related or question.instrument or question.swapped:
        return fitted
    if question.exact or seen.saturation is not None or seen.hold is not None:
        return fitted
    steady = replace(question, output=replace(question.output, values=joint.problem.y))
    known, valid = joint.problem.nuisance, _counted(question, seen)

    @cache
    def begun() -> Course:
        return turn_ahead(_started(steady, seen, known))

    def with_rows(y: Real, rows: Real, plainly: bool) -> JointFit:
        rows = rows if known is None else np.vstack([known, rows])
        course = replace(begun(), data=replace(begun().data, y=y))
        course = continued(course, valid=valid, nuisance=rows)
        if plainly:
            return chosen_of(course, question.plain)
        return chosen_of(replace(course, others=begun().others), question.structures)

    def bent(problem: Problem, constant: Fit) -> float:
        u, between = aligned.inputs[0].values, joint.best.intersample
        kinds = bends(u, problem, constant, intersample=between, fs=aligned.fs)
        return kinds[0].share if kinds else 0.0

    found = changing_gain(joint, with_rows, bent)
    if found is None:
        return fitted
    fits = (found.joint,) if found.taken else fitted.fits
    return replace(fitted, fits=fits, gaining=found)


def limit_speed(
    question: Question, seen: Imperfections, fitted: OutputFit
) -> tuple[Question, OutputFit]:
    """Take what a unit of limited speed makes of its command, where that explains more.

    Of one input; not asked of a loop, of software, and where the output follows nothing.
    """
    joint, aligned = fitted.fits[0], question.aligned
    if len(fitted.fits) > 1 or not joint.related or question.instrument or question.swapped:
        return question, fitted
    (source,) = aligned.inputs
    limited = limited_command(source.values, joint)
    if limited is None:
        return question, fitted
    noise = input_noise(source.values, aligned.fs, band=question.band(0))
    if noise is not None and noise.attenuation > WORTH:
        return question, fitted  # a limit of speed smooths the noise of a measured command
    followed = replace(aligned, inputs=(replace(source, values=limited.values),))
    slower = replace(question, aligned=followed, limited=limited)
    seen_then, again = fit(slower, seen)
    (other,) = again.fits
    if seen_then is not seen:
        return question, fitted  # levels explain the rest: the two are not weighed on other samples
    if not explains_more(other.problem, other.best.fit, joint.problem, joint.best.fit):
        return question, fitted
    return slower, replace(again, fits=(beside_speed(other, limited.slope),))


def through_reference(question: Question, fitted: OutputFit) -> OutputFit:
    """Move a fit to the reference's part of the input to where the input's own residual is."""
    if question.instrument is None or not fitted.fits[0].related:
        return fitted
    joint, own = fit_through(fitted.fits[0], question.instrument)
    return replace(fitted, fits=(joint,), covariances=(own,))


def _begin(question: Question, seen: Imperfections) -> Course | None:
    """Plain fits of one input; None where plain structures are all, and of loops and software."""
    alone = len(question.aligned.inputs) == 1 and question.instrument is None
    if (
        not alone
        or question.swapped
        or question.exact
        or question.intersample == "sampled"
        or question.plain == question.structures
    ):
        return None
    return turn_ahead(_started(question, seen))


def _started(question: Question, seen: Imperfections, rows: Real | None = None) -> Course:
    """Plain fits of one input, as they climb from the spectra, with `rows` beside the bias."""
    (source,) = question.aligned.inputs
    return start(
        source.values,
        question.output.values,
        _counted(question, seen),
        question.measured,
        question.intersample,
        question.structures,
        rows,
    )


def _counted(question: Question, seen: Imperfections) -> Mask | None:
    """Samples of the output that tell, (n,); None when all do."""
    return seen.counting(np.asarray(question.output.valid), question.aligned.fs)


def _fit_once(
    question: Question,
    seen: Imperfections,
    structures: tuple[StructureName, ...],
    rows: Real | None = None,
    *,
    begun: Course | None = None,
    aside: Mapping[int, JointFit] | None = None,
    drifts: Callable[[int, JointFit], OutputFit | None] | None = None,
    briefly: bool = False,
) -> OutputFit:
    """Fit an output to all inputs, with `rows` beside the bias, on the samples that tell.

    The search goes on from `begun`, where the plain fits to the one input are known. Inputs that
    stand `aside` are not asked; `drifts` and `briefly` are as for `fit_together`.
    """
    if begun is not None:
        return OutputFit(fits=(chosen_of(begun, structures),))
    aligned, output, inputs = question.aligned, question.output, question.inputs
    return fit_together(
        [source.values for source in aligned.inputs],
        output.values,
        valid=_counted(question, seen),
        known=question.measured,
        intersample=question.intersample,
        structures=structures,
        alike=() if inputs is None else inputs.alike_bins(aligned.samples, aligned.fs),
        nuisance=rows,
        aside=aside or {},
        drifts=drifts,
        briefly=briefly,
    )
