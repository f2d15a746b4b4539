"""Nonlinearities of an output: in the model, or as alternatives to what the linear fit says."""

from dataclasses import replace
from functools import partial

import numpy as np

from hmpim.identify.chance import CLEARLY
from hmpim.identify.coupling.output_fit import OutputFit
from hmpim.identify.effects.disturbance import criterion_gain, without_rows
from hmpim.identify.effects.imperfections import Imperfections
from hmpim.identify.fits import fit, started
from hmpim.identify.fitting.course import completed, turn_ahead
from hmpim.identify.fitting.data import polished, refit
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.fitting.joint import chosen_of
from hmpim.identify.fitting.plainer import taking
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.judgement import attempt
from hmpim.identify.noise.input_noise import input_noise
from hmpim.identify.nonlinear.bends import Bend, bends, is_bent_instead, plainer_bends
from hmpim.identify.nonlinear.mechanisms import Kind
from hmpim.identify.nonlinear.modelled import (
    described,
    is_explained,
    kinds_in_question,
    leaves_noise,
    linear_starts,
    settled_rows,
)
from hmpim.identify.nonlinear.nonlinearity import Inspection, inspect_nonlinearity
from hmpim.identify.nonlinear.rows import Command, Nonlinearity, with_row
from hmpim.identify.nonlinear.speed import explains_more, limited_command, with_free_speed
from hmpim.identify.preparation.question import Question
from hmpim.identify.worth import ROUNDING, WORTH
from hmpim.record import Finding, Intersample

__all__ = ["looked_through", "model_nonlinearity", "possible_bends"]


def model_nonlinearity(
    question: Question, seen: Imperfections, fitted: OutputFit
) -> tuple[Question, OutputFit]:
    """Limit the speed of the command, or add a row for another nonlinearity, if that explains more.

    Only for a single input that the output follows; not for loops and software.
    """
    joint = fitted.fits[0]
    if len(fitted.fits) > 1 or not joint.related or question.instrument or question.swapped:
        return question, fitted
    if question.linear:
        return question, fitted
    question, fitted = _limit_speed(question, seen, fitted)
    if question.limited is not None:
        return question, fitted
    return question, _add_row(question, seen, fitted)


def _limit_speed(
    question: Question, seen: Imperfections, fitted: OutputFit
) -> tuple[Question, OutputFit]:
    """Limit the speed of the command if that explains more."""
    joint, aligned = fitted.fits[0], question.aligned
    (source,) = aligned.inputs
    limited = limited_command(source.values, joint)
    if limited is None:
        return question, fitted
    noise = input_noise(source.values, aligned.fs, band=question.band(0))
    if noise is not None and noise.attenuation > WORTH:
        return question, fitted  # a speed limit smooths the noise of a measured command
    followed = replace(aligned, inputs=(replace(source, values=limited.values),))
    slower = replace(question, aligned=followed, limited=limited)
    seen_then, again = fit(slower, seen)
    (other,) = again.fits
    if seen_then is not seen:
        return question, fitted  # levels were found: costs on different samples do not compare
    if not explains_more(other.problem, other.best.fit, joint.problem, joint.best.fit):
        return question, fitted
    return slower, replace(again, fits=(with_free_speed(other, limited.slope),))


def _add_row(question: Question, seen: Imperfections, fitted: OutputFit) -> OutputFit:
    """Add a row for backlash, a dead zone, friction, a spring or a bent scale if it leaves noise.

    Not for clipped or held outputs, and not together with a changing gain.
    """
    joint, source = fitted.fits[0], question.aligned.inputs[0]
    if question.exact or is_explained(joint):
        return fitted
    if fitted.gaining is not None and fitted.gaining.taken:
        return fitted
    if seen.saturation is not None or seen.hold is not None:
        return fitted
    attempts = [(fitted, joint.problem.y, joint.problem.nuisance)]
    if fitted.drifting is not None and fitted.humming is None:  # the drift may have imitated it
        attempts.append((replace(fitted, drifting=None), question.output.values, None))
    lead, most = fitted, 2 * CLEARLY
    for other, y, rows in attempts:
        steady = replace(question, output=replace(question.output, values=y))
        course = completed(turn_ahead(started(steady, seen, rows)))
        problem = course.problem
        known = joint.problem.fixed().shape[0] - problem.fixed().shape[0]
        leading = replace(joint, problem=replace(joint.problem, y=y, nuisance=rows))
        command = Command(u=source.values, intersample=course.natural)
        starts = linear_starts(problem, course.best, joint)
        for kind in kinds_in_question(command, problem, starts, joint.best.fit):
            one = _likeliest(kind, command, problem, starts, leading, joint.problem, 1 - known)
            if one is None:
                continue
            beside = _fitted_with(steady, seen, problem, one)
            gain = criterion_gain(beside, 1 - known, joint.best.fit, joint.problem)
            if beside.related and leaves_noise(beside, one, seen.rounding) and gain > most:
                kept = without_rows(beside, slice(problem.fixed().shape[0] - 1, None))
                bending, own = described(beside, one, course.natural, question.aligned.fs)
                lead = replace(
                    other, fits=(kept,), bending=bending, covariances=(own,), gaining=None
                )
                most = gain
    return lead


def _fitted_with(
    question: Question, seen: Imperfections, problem: Problem, one: Nonlinearity
) -> JointFit:
    """Fit every structure with a row for a nonlinearity."""
    valid = question.output.valid if one.counts is None else question.output.valid & one.counts
    question = replace(question, output=replace(question.output, valid=valid))
    course = completed(turn_ahead(started(question, seen, with_row(problem, one).nuisance)))
    if one.within is None:
        return chosen_of(course, question.structures)
    own = polished(course.problem, one.within)
    joint = chosen_of(replace(course, fits=[*course.fits, own]), question.structures)
    return _in_own_dynamics(joint, own, course.natural)


def _in_own_dynamics(joint: JointFit, own: Fit, between: Intersample) -> JointFit:
    """The fit with the dynamics in which the row's friction acts; others that lead are rivals."""
    if joint.best.fit.structure == own.structure:
        return joint
    if joint.best.intersample != between:
        return replace(joint, related=False)
    return replace(taking(joint, polished(joint.problem, own)), rivals=(joint.best,))


def _likeliest(
    kind: Kind,
    command: Command,
    problem: Problem,
    starts: list[Fit],
    joint: JointFit,
    former: Problem,
    count: int,
) -> Nonlinearity | None:
    """The row of a kind that gains most in Schwarz's criterion, if any does.

    With the dynamics of its start, or with those that lead. Further starts are tried only if none
    so far leaves white noise.
    """
    best, most, found = joint.best.fit, 0.0, None
    for start in starts:
        white = False
        for one in settled_rows(kind, command, problem, start):
            for before, begun in ((problem, start), (joint.problem, best)):
                fit = refit(with_row(before, one), begun)
                again = replace(
                    joint, problem=with_row(before, one), best=replace(joint.best, fit=fit)
                )
                gain = criterion_gain(again, count, best, former)
                white = white or fit.is_white
                if gain > most:
                    most, found = gain, one
        if white:
            break
    return found


def looked_through(
    question: Question,
    found: Imperfections,
    joined: OutputFit,
    joint: JointFit,
    i: int,
    plain: Fit | None,
) -> tuple[JointFit, Inspection | None, tuple[Finding, ...]]:
    """The fit, plain if a nonlinearity explains the rest; and the test for nonlinearity.

    Nothing is tested in a loop.
    """
    if question.instrument is not None:
        return joint, None, ()
    aligned, best, floor = question.aligned, joint.best, _floor(question, found)
    source = aligned.inputs[i]
    problem, fit = joint.problem, best.fit
    if joined.bending is not None:
        problem, fit = joined.bending.as_measured(joint)
    look = partial(
        inspect_nonlinearity,
        source.values,
        problem,
        fit,
        fs=aligned.fs,
        plain=plain,
        modelled=joined.bending is not None,
        others=[other.values for other in aligned.inputs if other is not source],
        floor=floor,
        unit=question.output.unit,
    )
    inspection, unseen = attempt("nonlinearity", look, None)
    if joined.bending is not None:
        return joint, inspection, unseen
    if inspection is not None and inspection.fit is not best.fit:
        return taking(joint, inspection.fit), inspection, unseen
    if plain is None or best.fit.structure.sampled:
        return joint, inspection, unseen
    look_at_bends = partial(
        is_bent_instead,
        source.values,
        problem,
        fit,
        plain,
        intersample=best.intersample,
        fs=aligned.fs,
        floor=floor,
    )
    bent_instead, untried = attempt("bends", look_at_bends, False)
    return taking(joint, plain) if bent_instead else joint, inspection, (*unseen, *untried)


def _floor(question: Question, found: Imperfections) -> float:
    """R.m.s. of the rounding error, by the steps of the output or of the arithmetic."""
    return max(found.rounding, ROUNDING * float(np.std(question.output.values)))


def possible_bends(
    question: Question,
    found: Imperfections,
    joint: JointFit,
    i: int,
    plain: Fit | None,
    said: tuple[Finding, ...],
) -> tuple[Bend, ...]:
    """How far a nonlinearity may have moved the figures; not tested where it made all doubtful.

    Nor with several inputs, in a loop, or for software.
    """
    best, fs = joint.best, question.aligned.fs
    doubted = any(finding.severity == "doubt" for finding in said)
    alone = question.inputs is None and question.instrument is None
    if doubted or not alone or best.fit.structure.sampled:
        return ()
    u = question.aligned.inputs[i].values
    floor = _floor(question, found)
    own = bends(u, joint.weighed, best.fit, intersample=best.intersample, fs=fs, floor=floor)
    return (*own, *plainer_bends(u, joint, plain, fs=fs, floor=floor))
