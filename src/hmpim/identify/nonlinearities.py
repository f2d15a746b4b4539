"""Nonlinearities of an output: in the model, or as alternatives to what the linear fit says."""

from dataclasses import replace
from functools import partial

from hmpim.identify.added_row import add_row, add_row_of_leading, fit_bent, fit_with_row
from hmpim.identify.coupling.output_fit import OutputFit
from hmpim.identify.effects.imperfections import Imperfections
from hmpim.identify.fits import fit, lead
from hmpim.identify.fitting.fit import Fit
from hmpim.identify.fitting.plainer import taking
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.judgement import attempt
from hmpim.identify.nonlinear.bends import Bend, bends, is_bent_instead
from hmpim.identify.nonlinear.nonlinearity import Inspection, inspect_nonlinearity
from hmpim.identify.nonlinear.speed import limited_command, with_free_speed
from hmpim.identify.preparation.question import Question
from hmpim.record import Finding

__all__ = ["fit_output", "looked_through", "model_nonlinearity", "possible_bends"]


def fit_output(question: Question, seen: Imperfections) -> tuple[Imperfections, OutputFit]:
    """Fit an output as `hmpim.identify.fits.fit`, first with a nonlinearity.

    With a single input, a nonlinearity is tried first only if it likely explains the residual of
    plain dynamics. The levels found are returned with the fit.
    """
    if not _may_bend(question):
        return fit(question, seen)
    if len(question.aligned.inputs) == 1:
        return fit(question, seen, bent=partial(fit_bent, question, seen))
    led = lead(question, seen)
    ((leading, joint),) = led.items()
    bent = fit_with_row(question, seen, leading, joint)
    return fit(question, seen, led) if bent is None else (seen, bent)


def _may_bend(question: Question) -> bool:
    """Whether a nonlinearity is looked for: not in loops and software."""
    return not (question.linear or question.instrument or question.swapped)


def model_nonlinearity(
    question: Question, seen: Imperfections, fitted: OutputFit
) -> tuple[Question, OutputFit]:
    """Limit the speed of the command, or add a row for another nonlinearity, if that explains more.

    Only of an input that the output follows; a speed limit, of the only input. Not for loops and
    software.
    """
    if fitted.bending is not None or not _may_bend(question):
        return question, fitted
    if not fitted.fits[fitted.leading].related:
        return question, fitted
    if len(fitted.fits) > 1:
        return question, add_row_of_leading(question, seen, fitted)
    question, fitted = _limit_speed(question, seen, fitted)
    if question.limited is not None:
        return question, fitted
    return question, add_row(question, seen, fitted)


def _limit_speed(
    question: Question, seen: Imperfections, fitted: OutputFit
) -> tuple[Question, OutputFit]:
    """Limit the speed of the command if that explains more."""
    joint, aligned = fitted.fits[0], question.aligned
    (source,) = aligned.inputs
    limited = limited_command(source.values, joint)
    if limited is None:
        return question, fitted
    followed = replace(aligned, inputs=(replace(source, values=limited.values),))
    slower = replace(question, aligned=followed, limited=limited)
    _, again = fit(slower, seen)
    (other,) = again.fits
    return slower, replace(again, fits=(with_free_speed(other, limited.slope),))


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
    aligned, best, floor = question.aligned, joint.best, found.floor(question.output.values)
    source = aligned.inputs[i]
    problem, fit, bending = joint.problem, best.fit, joined.bending_of(i)
    if bending is not None:
        problem, fit = bending.as_measured(joint)
    look = partial(
        inspect_nonlinearity,
        source.values,
        problem,
        fit,
        fs=aligned.fs,
        plain=plain,
        modelled=bending is not None,
        others=[other.values for other in aligned.inputs if other is not source],
        floor=floor,
        unit=question.output.unit,
    )
    inspection, unseen = attempt("nonlinearity", look, None)
    if bending is not None:
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
        floor=floor,
    )
    bent_instead, untried = attempt("bends", look_at_bends, False)
    return taking(joint, plain) if bent_instead else joint, inspection, (*unseen, *untried)


def possible_bends(
    question: Question, found: Imperfections, joint: JointFit, i: int, said: tuple[Finding, ...]
) -> tuple[Bend, ...]:
    """How far a nonlinearity may have moved the figures; not tested where it made all doubtful.

    Nor with several inputs, in a loop, or for software.
    """
    best = joint.best
    doubted = any(finding.severity == "doubt" for finding in said)
    alone = question.inputs is None and question.instrument is None
    if doubted or not alone or best.fit.structure.sampled:
        return ()
    u = question.aligned.inputs[i].values
    floor = found.floor(question.output.values)
    return bends(u, joint.weighed, best.fit, intersample=best.intersample, floor=floor)
