"""Nonlinearities of an output: in the model, or as alternatives to what the linear fit says."""

from dataclasses import replace

import numpy as np

from hmpim.identify.chance import CLEARLY
from hmpim.identify.coupling.output_fit import OutputFit
from hmpim.identify.effects.disturbance import criterion_gain, without_rows
from hmpim.identify.effects.imperfections import Imperfections
from hmpim.identify.fits import fit, started
from hmpim.identify.fitting.course import completed, turn_ahead
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.fitting.joint import chosen_of
from hmpim.identify.fitting.plainer import taking
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.judgement import attempt
from hmpim.identify.noise.input_noise import input_noise
from hmpim.identify.nonlinear.bends import Bend, bends, is_bent_instead, plainer_bends
from hmpim.identify.nonlinear.modelled import (
    described,
    is_explained,
    kinds_in_question,
    leaves_noise,
    settled_rows,
)
from hmpim.identify.nonlinear.nonlinearity import Inspection, inspect_nonlinearity
from hmpim.identify.nonlinear.rows import Command, Nonlinearity, with_row
from hmpim.identify.nonlinear.speed import explains_more, limited_command, with_free_speed
from hmpim.identify.preparation.question import Question
from hmpim.identify.worth import ROUNDING, WORTH
from hmpim.record import Finding

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
    return question, _with_nonlinear_row(question, seen, fitted)


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


def _with_nonlinear_row(question: Question, seen: Imperfections, fitted: OutputFit) -> OutputFit:
    """Add a row for backlash, a dead zone, friction, a spring or a bent scale if it leaves noise.

    Not for clipped or held outputs, and not together with a changing gain.
    """
    joint, source = fitted.fits[0], question.aligned.inputs[0]
    if question.exact or fitted.gaining or is_explained(joint):
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
        command = Command(u=source.values, intersample=course.natural)
        for kind in kinds_in_question(command, problem, course.best, joint.best.fit):
            for one in settled_rows(kind, command, problem, course.best):
                beside = _with_row(steady, seen, problem, one)
                gain = criterion_gain(beside, 1 - known, joint.best.fit, joint.problem)
                if beside.related and leaves_noise(beside, one) and gain > most:
                    kept = without_rows(beside, slice(problem.fixed().shape[0] - 1, None))
                    bending, own = described(beside, one, course.natural)
                    lead = replace(other, fits=(kept,), bending=bending, covariances=(own,))
                    most = gain
    return lead


def _with_row(
    question: Question, seen: Imperfections, problem: Problem, one: Nonlinearity
) -> JointFit:
    """Fit every structure with a row for a nonlinearity."""
    valid = question.output.valid if one.counts is None else question.output.valid & one.counts
    question = replace(question, output=replace(question.output, valid=valid))
    course = turn_ahead(started(question, seen, with_row(problem, one).nuisance))
    return chosen_of(completed(course), question.structures)


def looked_through(
    question: Question,
    found: Imperfections,
    joined: OutputFit,
    joint: JointFit,
    i: int,
    plain: Fit | None,
) -> tuple[JointFit, Inspection | None, tuple[Finding, ...]]:
    """The fit, plain if a nonlinearity explains the rest; and the test for nonlinearity."""
    modelled = joined.bending is not None
    problem, fit = joint.problem, joint.best.fit
    if joined.bending is not None:
        problem, fit = joined.bending.as_measured(joint)
    inspection, unseen = attempt(
        "nonlinearity",
        lambda: _inspected(question, found, problem, fit, i, plain, modelled=modelled),
        None,
    )
    if modelled:
        return joint, inspection, unseen
    if inspection is not None and inspection.fit is not joint.best.fit:
        return taking(joint, inspection.fit), inspection, unseen
    if plain is None:
        return joint, inspection, unseen
    bent_instead, untried = attempt("bends", lambda: _is_bent(question, found, joint, plain), False)
    return taking(joint, plain) if bent_instead else joint, inspection, (*unseen, *untried)


def _inspected(
    question: Question,
    found: Imperfections,
    problem: Problem,
    fit: Fit,
    i: int,
    plain: Fit | None,
    *,
    modelled: bool = False,
) -> Inspection | None:
    """The nonlinear part of the residual; not tested in a loop."""
    if question.instrument is not None:
        return None
    aligned, output = question.aligned, question.output
    source = aligned.inputs[i]
    return inspect_nonlinearity(
        source.values,
        problem,
        fit,
        fs=aligned.fs,
        plain=plain,
        modelled=modelled,
        others=[other.values for other in aligned.inputs if other is not source],
        floor=_floor(question, found),
        unit=output.unit,
    )


def _floor(question: Question, found: Imperfections) -> float:
    """R.m.s. of the rounding error, by the steps of the output or of the arithmetic."""
    return max(found.rounding, ROUNDING * float(np.std(question.output.values)))


def _is_bent(question: Question, found: Imperfections, joint: JointFit, plain: Fit) -> bool:
    """Whether a plain fit and a nonlinearity replace a rich one; not tested in a loop."""
    if question.instrument is not None or joint.best.fit.structure.sampled:
        return False
    return is_bent_instead(
        question.aligned.inputs[0].values,
        joint.problem,
        joint.best.fit,
        plain,
        intersample=joint.best.intersample,
        fs=question.aligned.fs,
        floor=_floor(question, found),
    )


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
