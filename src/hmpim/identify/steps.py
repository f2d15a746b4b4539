"""The steps of the algorithm in `hmpim.identify.identify`, in their order."""

from dataclasses import replace
from functools import cache

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.coupling.output_fit import OutputFit
from hmpim.identify.effects.gain import changing_gain
from hmpim.identify.effects.imperfections import Imperfections
from hmpim.identify.effects.lost_samples import stand_out
from hmpim.identify.fits import counted_in, fit_once, imperfections_of, started
from hmpim.identify.fitting.course import Course, continued, turn_ahead
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.fitting.joint import chosen_of
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.noise.whiteness import is_white
from hmpim.identify.nonlinear.bends import bends
from hmpim.identify.preparation.question import Question
from hmpim.identify.preparation.reference import fit_through
from hmpim.identify.preparation.swapped import is_swapped, lags_behind, swapped_finding

__all__ = [
    "let_gain_change",
    "look",
    "look_again",
    "mark_swapped",
    "through_reference",
]


def look(question: Question) -> Imperfections:
    """Find clipped, held, rounded, stuck and lost samples of the output."""
    if question.exact:
        return Imperfections()
    return imperfections_of(question, inputs=[u.values for u in question.aligned.inputs])


def mark_swapped(question: Question) -> Question:
    """Mark the question if its only input follows the output; a late clock may look the same."""
    output = question.output
    if len(question.aligned.inputs) > 1 or question.instrument is not None:
        return question
    (source,) = question.aligned.inputs
    if not is_swapped(source.values, output.values, source.valid & output.valid):
        return question
    if lags_behind(fit_once(question, look(question), question.plain).fits[0]):
        return question  # the clock is late
    finding = swapped_finding(source.name, output.name)
    return replace(question, structures=question.plain, swapped=finding)


def look_again(question: Question, seen: Imperfections, fitted: OutputFit) -> Imperfections:
    """Look again with the model known, which distinguishes a plateau from a crest."""
    if question.exact:
        return seen
    first = fitted.fits[0]
    residual = first.best.fit.residual
    limited = seen.saturation is not None or seen.hold is not None
    if not limited and is_white(residual) and not stand_out(first.problem.counting(residual)):
        return seen
    prediction = fitted.prediction.copy()  # it is not valid before the free response
    prediction[: first.forgotten] = question.output.values[: first.forgotten]
    again = imperfections_of(question, prediction=prediction)
    again = replace(again, levels=seen.levels, quantization=seen.quantization)
    plateau, before = again.saturation, seen.saturation
    if plateau is None and before is not None and before.noise == "after":
        return replace(again, saturation=before)
    return again


def let_gain_change(question: Question, seen: Imperfections, fitted: OutputFit) -> OutputFit:
    """Let the gain change during the record if that explains more; plain dynamics may then suffice.

    Only for a single input that the output follows; not for loops, software, clipped or held
    outputs, nor with a nonlinearity in the model. The checks handle one that explains more.
    """
    joint, aligned = fitted.fits[0], question.aligned
    if len(fitted.fits) > 1 or not joint.related or question.instrument or question.swapped:
        return fitted
    limited = seen.saturation is not None or seen.hold is not None
    if question.exact or limited or fitted.bending or question.limited:
        return fitted
    steady = replace(question, output=replace(question.output, values=joint.problem.y))
    known, valid = joint.problem.nuisance, counted_in(question, seen)

    @cache
    def begun() -> Course:
        return turn_ahead(started(steady, seen, known))

    def with_rows(y: Real, rows: Real) -> JointFit:
        rows = rows if known is None else np.vstack([known, rows])
        course = replace(begun(), data=replace(begun().data, y=y))
        return chosen_of(continued(course, valid=valid, nuisance=rows), question.plain)

    def bent(problem: Problem, constant: Fit) -> float:
        u, between = aligned.inputs[0].values, joint.best.intersample
        kinds = bends(u, problem, constant, intersample=between)
        return kinds[0].share if kinds else 0.0

    found = changing_gain(joint, with_rows, bent)
    if found is None:
        return fitted
    fits = (found.joint,) if found.taken else fitted.fits
    return replace(fitted, fits=fits, gaining=found)


def through_reference(question: Question, fitted: OutputFit) -> OutputFit:
    """Transfer a fit made with the reference's part of the input to the whole input (a loop)."""
    if question.instrument is None or not fitted.fits[0].related:
        return fitted
    joint, own = fit_through(fitted.fits[0], question.instrument)
    return replace(fitted, fits=(joint,), covariances=(own,))
