"""Fit an output: all structures, and hum, a drift or levels where the residual requires them."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.coupling.output_fit import (
    FitDrift,
    Led,
    OutputFit,
    fit_leading,
    fit_together,
    without_slow,
)
from hmpim.identify.effects.disturbance import criterion_gain, without_rows
from hmpim.identify.effects.drift import is_slow, with_drift, with_plain_drift
from hmpim.identify.effects.hum import Humming, line_near, with_hum
from hmpim.identify.effects.imperfections import (
    Imperfections,
    find_imperfections,
    refine,
)
from hmpim.identify.effects.saturation import goes_beyond
from hmpim.identify.fitting.candidates import spans_record
from hmpim.identify.fitting.course import (
    Course,
    completed,
    continue_between,
    continued,
    free_from_wander,
    resumed,
    start,
    turn_ahead,
)
from hmpim.identify.fitting.data import Fits, follows
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.fitting.joint import chosen_of
from hmpim.identify.fitting.tail import fit_with_tail, hidden_tail
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.kept import kept
from hmpim.identify.noise.colour import tone_of
from hmpim.identify.noise.spectra import windowed_power
from hmpim.identify.noise.whiteness import is_white
from hmpim.identify.nonlinear.period import find_period
from hmpim.identify.preparation.question import Question
from hmpim.identify.worth import PART
from hmpim.model.dynamics import StructureName

__all__ = ["counted_in", "fit", "fit_once", "imperfections_of", "lead", "started"]

_CLEAR = 8
"""Bins between a constant and a line: in the window's spectrum each is four wide on either side."""


def fit(
    question: Question,
    seen: Imperfections,
    led: Led | None = None,
    bent: Callable[[Course], OutputFit | None] | None = None,
) -> tuple[Imperfections, OutputFit]:
    """Fit every structure, with hum and a drift where the residual requires them.

    If plain dynamics with levels or with a drift leave white noise, richer ones are not tried: they
    would only imitate the effect. The same holds for a nonlinearity that `bent` finds, with a
    single input. The levels found are returned with the fit. `led` is what `lead` found, if it is
    known.
    """
    begun = _begin(question, seen)
    if begun is None:
        return seen, _fit_and_look_for_rows(question, seen, led)
    course = completed(begun)
    if not begun.best.is_white:
        levelled = _behind_levels(question, seen, begun, rests=course.counted.begins is None)
        if levelled is not None:
            return levelled
    drifting = None if course.best.is_white else _drifting(question, seen, course)
    if drifting is not None:
        return seen, replace(drifting, begun=course)
    bending = bent(course) if bent and not course.best.is_white else None
    if bending is not None:
        return seen, bending
    freed = free_from_wander(begun)
    calm = course if freed is begun else completed(freed)
    return seen, replace(_fit_and_look_for_rows(question, seen, calm), begun=course)


def _behind_levels(
    question: Question, seen: Imperfections, course: Course, *, rests: bool
) -> tuple[Imperfections, OutputFit] | None:
    """Plain dynamics followed by saturation, if they leave white noise; None otherwise."""
    best, y = course.best, question.output.values
    # These fits ignore any motion before the record.
    late = 0 if rests else min(int(np.ceil(max(best.delay, 0.0) + best.memory)), y.size // 4)
    prediction = np.concatenate([y[:late], best.prediction[late:]])
    found = imperfections_of(question, prediction=prediction).saturation
    levels = seen.saturation if found is None else found
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
    censored, _ = refined
    white = is_white(censored.problem.counting(censored.best.fit.residual))
    return (clipped, OutputFit(fits=(joint,))) if white else None


def _drifting(question: Question, seen: Imperfections, course: Course) -> OutputFit | None:
    """Plain dynamics and a drift, if they leave white noise; None otherwise."""
    valid, former = counted_in(question, seen), course

    def begun(rows: Real) -> tuple[Problem, Fit]:
        nonlocal course
        course = continued(course, valid=valid, nuisance=rows)
        return course.problem, course.best

    def fitted(rows: Real) -> JointFit:
        begun(rows)
        return chosen_of(course, question.plain)

    if spans_record(former.best) or not is_slow(former.problem, former.best):
        return None

    found = with_plain_drift(former.problem, former.best, begun, fitted)
    if found is None:
        return None
    joint, drifting = found
    if follows(course.data, joint.best.fit) or _leaves_tail(joint):
        return None
    if _is_tail(former, joint, question.structures):
        return None
    return OutputFit(fits=(joint,), drifting=drifting)


def _fit_and_look_for_rows(
    question: Question, seen: Imperfections, begun: Course | Led | None = None
) -> OutputFit:
    """Fit every structure, and again with hum and a drift where the residual requires them."""
    software = question.intersample == "sampled"
    fit_drift = None if software else partial(_plain_beside_drift, question, seen)
    fitted = fit_once(question, seen, question.structures, begun=begun, fit_drift=fit_drift)
    if fitted.drifting is not None or fitted.fits[0].silent:
        return fitted
    if question.swapped or question.exact or (software and len(fitted.fits) > 1):
        return fitted
    return _WithRows(question, seen, fitted, begun if isinstance(begun, Course) else None).found()


class _WithRows:
    """The search for hum and a drift, as rows that are fitted in addition to the bias.

    They are tested with one input, that which leads or may have taken a drift for its own; all
    inputs are fitted again.
    """

    def __init__(
        self, question: Question, seen: Imperfections, fitted: OutputFit, begun: Course | None
    ) -> None:
        self.question, self.seen, self.first = question, seen, fitted
        self.several = len(fitted.fits) > 1
        slow = fitted.slow if self.several else 0
        self.asked = fitted.leading if slow is None else slow
        self.latest = fitted  # with the rows that were tried last
        self.begun = begun  # plain fits of a single input, at first without rows
        self.between: Fits = []  # the same under each assumption between the samples
        self.humming: Humming | None = None
        self.hum = np.zeros(0)

    def found(self) -> OutputFit:
        """The fit with hum and a drift, or without where it does not need them."""
        joint, begun = self.first.fits[self.asked], self.begun
        coloured = not is_white(joint.problem.counting(joint.best.fit.residual))
        if coloured and not any(_has_lines(u.values) for u in self.question.aligned.inputs):
            self.humming = with_hum(joint, self.with_rows)
        if self.humming is None:  # as if it had not been tried
            self.begun, self.between, self.latest = begun, [], self.first
        steady = self.first if self.humming is None else self.latest
        before = joint if self.humming is None else self.humming.joint
        joint, drifting = with_drift(before, self.with_rows)
        humming = self.humming
        if drifting is not None:
            steady = self.latest
            humming = None if humming is None else replace(humming, trend=self.hum)
        kept = replace(steady, drifting=drifting, humming=humming, asked=self.asked)
        if self.several:
            return replace(kept, fits=tuple(without_rows(one, slice(None)) for one in kept.fits))
        return replace(kept, fits=(joint,))

    def with_rows(self, rows: Real, plainly: bool) -> JointFit:
        """Fit all inputs with rows, and with those of the hum found before."""
        question = self.question
        names = question.plain if plainly else question.structures
        every = rows if self.humming is None else np.vstack([rows, self.humming.rows])
        self.latest = self._fitted(names, every)
        found = self.latest.fits[self.asked]
        if self.humming is None:
            return found
        quiet = without_rows(found, slice(len(rows), None))
        self.hum = found.problem.y - quiet.problem.y
        return quiet

    def _fitted(self, names: tuple[StructureName, ...], rows: Real) -> OutputFit:
        """Fit all inputs with rows; plain fits of a single input are made once for as many rows."""
        question, seen, course = self.question, self.seen, self.begun
        if self.several or question.intersample == "sampled":
            led = self.latest.led
            return fit_once(question, seen, names, rows, begun=led)
        known = 0 if course is None or course.data.nuisance is None else len(course.data.nuisance)
        if course is None or len(rows) != known:
            course = started_with(question, seen, rows, course)
            self.begun, self.between = course, continue_between(course)
        others = tuple(name for name in course.others if name in names)
        joint = chosen_of(replace(course, others=others), names, fitted=self.between)
        return OutputFit(fits=(joint,))


def _is_tail(steady: Course, joint: JointFit, structures: tuple[StructureName, ...]) -> bool:
    """Whether a slow tail of the response is likelier than the drift of a joint fit.

    In a record that begins slowly, a tail follows the input, but resembles a drift.
    """
    tailed = fit_with_tail(steady.problem, steady.fits, structures)
    count = joint.best.fit.nuisance.size
    return tailed is not None and criterion_gain(joint, count, tailed, steady.problem) < 0.0


def _leaves_tail(joint: JointFit) -> bool:
    """Whether a slow tail is missing, so that richer dynamics may explain what the drift does."""
    return hidden_tail(joint.weighed, joint.best.fit, share=joint.weighed_share) is not None


def _plain_beside_drift(
    question: Question, seen: Imperfections, led: Led, steady_of: Callable[[Led], OutputFit]
) -> OutputFit | None:
    """Plain dynamics of several inputs and a drift, if they leave white noise; None otherwise.

    `led` are plain fits of the strong inputs, with a constant bias. `steady_of` fits given inputs
    without a drift. It gets all inputs found with the drift, since there may be more of them, so
    that the same inputs are compared.
    """
    known, (asked, first) = without_slow(led), next(iter(led.items()))
    plain = OutputFit(fits=(first,))

    def begun(rows: Real) -> tuple[Problem, Fit]:
        nonlocal known
        plainly = partial(fit_once, question, seen, question.plain, begun=known)
        strong = plainly(rows, strong_only=True)
        joint, known = strong.fits[strong.leading], strong.led
        return joint.problem, joint.best.fit

    def fitted(rows: Real) -> JointFit:
        nonlocal plain
        plain = fit_once(question, seen, question.plain, rows, begun=known)
        return plain.fits[asked]

    found = with_plain_drift(first.problem, first.best.fit, begun, fitted)
    if found is None or not found[0].related or _leaves_tail(found[0]):
        return None
    steady = steady_of({**led, **known})
    former = steady.fits[asked]
    if former.best.fit.is_white and steady.slow is None:
        return None
    count = plain.fits[asked].best.fit.nuisance.size
    if criterion_gain(plain.fits[asked], count, former.best.fit, former.problem) < 0.0:
        return None
    fits = tuple(without_rows(one, slice(None)) for one in plain.fits)
    return replace(plain, fits=fits, drifting=found[1], asked=asked)


@kept
def _has_lines(u: Real) -> bool:
    """Whether an input is periodic, or mostly one line: its distortion then has lines too."""
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
    """Plain fits of one input; None for loops, software and where no other structures are tried."""
    alone = len(question.aligned.inputs) == 1 and question.instrument is None
    software = question.intersample == "sampled"
    if not alone or software or question.swapped or question.plain == question.structures:
        return None
    return turn_ahead(started(question, seen))


def started(question: Question, seen: Imperfections, rows: Real | None = None) -> Course:
    """Plain fits of one input, started from the spectra, with `rows` in addition to the bias."""
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


def started_with(
    question: Question, seen: Imperfections, rows: Real, known: Course | None
) -> Course:
    """Plain fits of one input with other rows than the `known` ones.

    They continue from these if that leaves white noise. Otherwise what the rows explain may have
    led the known fits astray, and they are started from the spectra.
    """
    if known is not None and known.data.noise is None:
        course = resumed(known, replace(known.problem, nuisance=rows), known.fits)
        if course.best.is_white:
            return course
    return completed(free_from_wander(turn_ahead(started(question, seen, rows))))


def counted_in(question: Question, seen: Imperfections) -> Mask | None:
    """Informative samples of the output, (n,); None if all are."""
    return seen.counting(np.asarray(question.output.valid), question.aligned.fs)


def lead(question: Question, seen: Imperfections) -> Led:
    """Plain fit of the input that the output follows most, by its index."""
    return fit_leading(
        [source.values for source in question.aligned.inputs],
        question.output.values,
        counted_in(question, seen),
        known=question.measured,
        intersample=question.intersample,
        structures=question.plain,
    )


def fit_once(
    question: Question,
    seen: Imperfections,
    structures: tuple[StructureName, ...],
    rows: Real | None = None,
    *,
    begun: Course | Led | None = None,
    fit_drift: FitDrift | None = None,
    strong_only: bool = False,
) -> OutputFit:
    """Fit an output to all inputs, with `rows` in addition to the bias, on informative samples.

    The search continues from `begun`, if it is known: the plain fits to a single input, or fits to
    some of several; `fit_drift` and `strong_only` are as for `fit_together`.
    """
    if isinstance(begun, Course):
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
        led=begun,
        fit_drift=fit_drift,
        strong_only=strong_only,
    )
