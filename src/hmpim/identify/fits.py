"""Fit an output: every structure, with hum, a drift or levels where the residual asks for them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.asked.question import Question
from hmpim.identify.coupling.output_fit import OutputFit, fit_together
from hmpim.identify.coupling.output_fit import set_free as set_all_free
from hmpim.identify.effects.disturbance import gain_by_rows, without_rows
from hmpim.identify.effects.drift import is_slow, with_drift, with_plain_drift
from hmpim.identify.effects.hum import line_near, with_hum
from hmpim.identify.effects.imperfections import (
    Imperfections,
    find_imperfections,
    refine,
)
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
from hmpim.identify.fitting.joint import chosen_of
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.kept import kept
from hmpim.identify.noise.colour import tone_of
from hmpim.identify.noise.spectra import windowed_power
from hmpim.identify.noise.whiteness import is_white
from hmpim.identify.nonlinear.lines import find_period
from hmpim.identify.worth import PART
from hmpim.model.dynamics import StructureName

__all__ = ["counted_in", "fit", "fit_once", "imperfections_of", "started"]

_CLEAR = 8
"""Bins from a constant to a line: in the window's spectrum each is four wide to either side."""


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
    shown = imperfections_of(question, prediction=prediction).saturation
    levels = seen.saturation if shown is None else shown
    if levels is None:
        return None
    clipped = replace(seen, saturation=levels)
    behind = continued(course, valid=counted_in(question, clipped))
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
    valid, former = counted_in(question, seen), course

    def with_rows(rows: Real, _: bool) -> JointFit:
        nonlocal course
        course = continued(course, valid=valid, nuisance=rows)
        return chosen_of(course, question.plain)

    if spans_record(former.best) or not is_slow(former.problem, former.best):
        return None

    def steadily(drifted: JointFit) -> JointFit | None:
        free = set_free(former, drifted.best.fit)
        return None if free is None else chosen_of(free, question.structures)

    found = with_plain_drift(former.problem, former.best, with_rows, steadily)
    if found is None or not found[0].related:
        return None
    joint, drifting = found
    if follows(course.data, joint.best.fit):  # richer dynamics may be what is slow
        return None
    return OutputFit(fits=(joint,), drifting=drifting)


def _fit_and_look_for_rows(
    question: Question, seen: Imperfections, begun: Course | None = None
) -> OutputFit:
    """Fit every structure, and again with hum and a drift where the residual asks for them."""
    steady = question.exact or question.intersample == "sampled"
    drifts = None if steady else partial(_plain_beside_drift, question, seen)
    fitted = fit_once(question, seen, question.structures, begun=begun, drifts=drifts)
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
    freed: OutputFit | None = None
    hum = np.zeros(0)
    aside: dict[int, JointFit] = {}

    def with_rows(rows: Real, plainly: bool) -> JointFit:
        nonlocal beside, hum
        names = question.plain if plainly else question.structures
        every = rows if humming is None else np.vstack([rows, humming.rows])
        before, beside = beside, fit_once(question, seen, names, every, aside=aside)
        if not several and not plainly and before is not fitted:
            beside = _as_before(question, seen, every, before, beside)
        found = beside.fits[asked]
        if humming is None:
            return found
        quiet = without_rows(found, slice(len(rows), None))
        hum = found.problem.y - quiet.problem.y
        return quiet

    def steadily(drifted: JointFit) -> JointFit | None:
        nonlocal freed
        if question.intersample == "sampled":
            return None
        if several:
            freed = _all_free(question, beside, asked, None if humming is None else humming.rows)
            return None if freed is None else freed.fits[asked]
        course = begun or started(question, seen, None if humming is None else humming.rows)
        free = set_free(course, drifted.best.fit)
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
    if drifting is not None:
        kept = beside
    elif freed is not None and joint is freed.fits[asked]:
        kept = freed
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
    course = completed(turn_ahead(started(question, seen, rows)))
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
    freed: OutputFit | None = None

    def with_rows(rows: Real, briefly: bool) -> JointFit:
        nonlocal plain
        plain = fit_once(question, seen, question.plain, rows, briefly=briefly)
        return plain.fits[0 if briefly else asked]

    def steadily(_: JointFit) -> JointFit | None:
        nonlocal freed
        freed = _all_free(question, plain, asked)
        return None if freed is None else freed.fits[asked]

    found = with_plain_drift(first.problem, first.best.fit, with_rows, steadily)
    if found is None or not found[0].related:
        return None
    drifting = found[1]
    if drifting is None:
        return freed
    steady = fit_once(question, seen, question.plain)
    former = steady.fits[asked]
    if former.best.fit.is_white and steady.slow is None:
        return None
    count = plain.fits[asked].best.fit.nuisance.size
    if gain_by_rows(plain.fits[asked], count, former.best.fit, former.problem) < 0.0:
        return None
    fits = tuple(without_rows(one, slice(None)) for one in plain.fits)
    return replace(plain, fits=fits, drifting=drifting, asked=asked)


def _all_free(
    question: Question, fitted: OutputFit, asked: int, rows: Real | None = None
) -> OutputFit | None:
    """Fits of several inputs with a constant bias, from a state that is free."""
    u = [source.values for source in question.aligned.inputs]
    return set_all_free(fitted, u, question.output.values, asked, rows)


@kept
def _has_lines(u: Real) -> bool:
    """Whether an input repeats, or one line is much of it: its distortion then has lines too."""
    moves, power = u - u.mean(), windowed_power(u)[_CLEAR:]
    line = line_near(moves, (_CLEAR + int(np.argmax(power))) / u.size) if power.size else 0.5
    much = float(np.var(tone_of(moves, line))) > PART * float(np.var(moves))
    return much or find_period(u) is not None


def imperfections_of(
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
    return turn_ahead(started(question, seen))


def started(question: Question, seen: Imperfections, rows: Real | None = None) -> Course:
    """Plain fits of one input, as they climb from the spectra, with `rows` beside the bias."""
    (source,) = question.aligned.inputs
    return start(
        source.values,
        question.output.values,
        counted_in(question, seen),
        question.measured,
        question.intersample,
        question.structures,
        rows,
    )


def counted_in(question: Question, seen: Imperfections) -> Mask | None:
    """Samples of the output that tell, (n,); None when all do."""
    return seen.counting(np.asarray(question.output.valid), question.aligned.fs)


def fit_once(
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
        valid=counted_in(question, seen),
        known=question.measured,
        intersample=question.intersample,
        structures=structures,
        alike=() if inputs is None else inputs.alike_bins(aligned.samples, aligned.fs),
        nuisance=rows,
        aside=aside or {},
        drifts=drifts,
        briefly=briefly,
    )
