"""A nonlinearity in the fit of an output: its row, sought with one input and added to all."""

from collections.abc import Iterator
from dataclasses import replace
from operator import itemgetter

import numpy as np

from hmpim.identify.arrays import Real, count_alike
from hmpim.identify.chance import CLEARLY, DEVIATIONS, LIKELIER
from hmpim.identify.coupling.output_fit import OutputFit
from hmpim.identify.coupling.pairs import contribution
from hmpim.identify.effects.disturbance import criterion_gain, without_rows
from hmpim.identify.effects.imperfections import Imperfections
from hmpim.identify.fits import counted_in, fit, fit_once, started
from hmpim.identify.fitting.candidates import is_poor, spans_record
from hmpim.identify.fitting.course import Course, completed, resumed, turn_ahead
from hmpim.identify.fitting.data import Counted, polished, refit
from hmpim.identify.fitting.derivatives import jacobian
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.fitting.growth import hidden_pole
from hmpim.identify.fitting.joint import chosen_of
from hmpim.identify.fitting.plainer import taking
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.nonlinear.bends import bends
from hmpim.identify.nonlinear.modelled import (
    ALIKE,
    described,
    is_explained,
    is_rounding,
    kinds_in_question,
    leaves_noise,
    linear_starts,
    settled_rows,
)
from hmpim.identify.nonlinear.rows import Command, NonlinearRow, with_row
from hmpim.identify.preparation.question import Question
from hmpim.identify.worth import FEW, MOST, TWICE
from hmpim.model.nonlinear import Kind
from hmpim.record import Intersample

__all__ = ["add_row", "add_row_of_leading", "fit_bent", "fit_with_row"]

_Found = tuple[float, NonlinearRow, JointFit, OutputFit]
"""Gain in Schwarz's criterion by a row, the row, the fit with it, and the fit without it."""


def add_row(question: Question, seen: Imperfections, fitted: OutputFit) -> OutputFit:
    """Add a row for backlash, a dead zone, friction, a spring or a bent scale if it leaves noise.

    Not for clipped or held outputs.
    """
    found = [
        (gain, row, joint, linear)
        for gain, row, joint, linear in _with_rows(question, seen, fitted, None)
        if gain > 2 * CLEARLY and leaves_noise(joint, row, seen.rounding)
    ]
    if not found:
        return fitted
    most, best, chosen, linear = max(found, key=itemgetter(0))
    others = {
        row.kind: joint.best.fit
        for gain, row, joint, _ in sorted(found, key=itemgetter(0))  # of a kind, the likeliest
        if row.kind != best.kind and gain > most - 2 * LIKELIER
    }
    bending, own = described(chosen, best, question.aligned.fs)
    return replace(
        linear,
        fits=(without_rows(chosen, slice(-1, None)),),
        bending=replace(bending, others=others),
        covariances=(own,),
    )


def fit_bent(question: Question, seen: Imperfections, course: Course) -> OutputFit | None:
    """Plain dynamics with a nonlinearity that likely explains the residual, if that leaves noise.

    It is tried if the trace of the likeliest kind leaves white noise or explains most of the
    residual, or if that kind is friction, whose trace does not show where the unit sticks. None
    for a possible speed limit, which has no row, and if linear dynamics are missing.
    """
    if spans_record(course.best) or is_poor(course.best, course.problem.spread):
        return None
    u = question.aligned.inputs[0].values
    kinds = bends(u, course.problem, course.best, intersample=course.natural)
    if not kinds or not kinds[0].certain or any(one.kind == "rate_limit" for one in kinds):
        return None
    first = kinds[0]
    if first.kind != "friction" and first.share < MOST and not first.white:
        return None
    joint = chosen_of(replace(course, others=()), question.plain, growing=False)
    plainly = replace(question, structures=question.plain)
    fitted = add_row(plainly, seen, OutputFit(fits=(joint,), begun=course))
    if fitted.bending is None:
        return None
    (bent,) = fitted.fits
    missed = hidden_pole(bent.problem, bent.best.fit)
    return fitted if abs(missed.squared) < DEVIATIONS * missed.std else None


def fit_with_row(
    question: Question, seen: Imperfections, i: int, joint: JointFit
) -> OutputFit | None:
    """Fit all inputs with a nonlinearity of the leading one, if that leaves noise at once.

    That is the input at `i`, and `joint` its plain fit.

    Plain dynamics that leave noise with it end the search, as they do with a drift: richer ones,
    couplings and drifts would only imitate it. None otherwise.
    """
    if not joint.related or joint.best.fit.cost > FEW**2 * joint.problem.spread:
        return None  # others move it too
    alone = _alone(question, i, question.output.values)
    found = _likeliest_of(_with_rows(alone, seen, OutputFit(fits=(joint,)), None))
    if found is None or not leaves_noise(found[2], found[1], seen.rounding):
        return None
    return _with_all(question, seen, i, found, joint)


def add_row_of_leading(question: Question, seen: Imperfections, fitted: OutputFit) -> OutputFit:
    """Add a row for a nonlinearity of the input that moves the output most, of several.

    It is sought with that input alone, next to the motion by the others.
    """
    i = fitted.leading
    joint, others = fitted.fits[i], _moved_by_others(fitted, i)
    first = replace(fitted, fits=(joint,), covariances=(), asked=0)
    alone = _alone(question, i, question.output.values - others)
    found = _likeliest_of(_with_rows(alone, seen, first, others))
    if found is None:
        return fitted
    return _with_all(question, seen, i, found, joint) or fitted


def _alone(question: Question, i: int, y: Real) -> Question:
    """The same question with one input, of an output y, (n,)."""
    return replace(
        question,
        inputs=None,
        aligned=replace(question.aligned, inputs=question.aligned.inputs[i : i + 1]),
        output=replace(question.output, values=y),
    )


def _counting(question: Question, one: NonlinearRow) -> Question:
    """The same question without samples of the output that do not count with a row."""
    if one.counts is None:
        return question
    output = question.output
    return replace(question, output=replace(output, valid=output.valid & one.counts))


def _likeliest_of(found: Iterator[_Found]) -> _Found | None:
    """The row that gains most, if it is worth its price."""
    best = max(found, key=itemgetter(0), default=None)
    return None if best is None or best[0] <= 2 * CLEARLY else best


def _with_all(
    question: Question, seen: Imperfections, i: int, found: _Found, former: JointFit
) -> OutputFit | None:
    """Fit all inputs next to a row of one, `found` with that input alone.

    Twice if the size of the row changes by more than 5 %, and with a drift and hum if the residual
    is then not noise. None unless that leaves noise, and is likelier than the fit without the row,
    `former`.
    """
    _, row, beside, _ = found
    size, all_of_them = float(beside.best.fit.nuisance[-1]), None
    for _ in range(2):
        all_of_them = _fit_beside(question, seen, i, row, size, steadily=True)
        if all_of_them is None:
            break
        again, joined, row = all_of_them
        before, size = size, float(joined.best.fit.nuisance[-1])
        if abs(size - before) < FEW * abs(before):
            break
    noise = all_of_them is not None and leaves_noise(joined, row, seen.rounding)
    if not noise:
        all_of_them = _fit_beside(question, seen, i, row, size, steadily=False)
        if all_of_them is None:
            return None
        again, joined, row = all_of_them
        noise = leaves_noise(joined, row, seen.rounding)
    rows = joined.problem.fixed().shape[0] - former.problem.fixed().shape[0]
    gain = criterion_gain(joined, rows, former.best.fit, former.problem)
    if gain <= 2 * CLEARLY or not noise:
        return None
    bending, own = described(_known_besides(joined, again, i), row, question.aligned.fs)
    fits, covariances = list(again.fits), list(again.covariances)
    fits[i], covariances[i] = without_rows(joined, slice(-1, None)), own
    return replace(again, fits=tuple(fits), covariances=tuple(covariances), bending=bending, bent=i)


def _fit_beside(
    question: Question,
    seen: Imperfections,
    i: int,
    one: NonlinearRow,
    size: float,
    *,
    steadily: bool,
) -> tuple[OutputFit, JointFit, NonlinearRow] | None:
    """Fit all inputs to the output without a row of a size, and compute the row again from that.

    Without a drift and hum, if `steadily`. None if the output then does not follow input `i`.
    """
    trend, straight = size * one.row, _counting(question, one)
    output = replace(straight.output, values=straight.output.values - trend)
    without = replace(straight, output=output)
    again = fit_once(without, seen, without.structures) if steadily else fit(without, seen)[1]
    return (again, *_joined(again, i, one, trend)) if again.fits[i].related else None


def _moved_by_others(fitted: OutputFit, i: int) -> Real:
    """What all inputs but one move the output by, (n,)."""
    parts = (contribution(one) for j, one in enumerate(fitted.fits) if j != i and one.related)
    return np.asarray(sum(parts, np.zeros(fitted.fits[i].problem.y.size)))


def _joined(
    fitted: OutputFit, i: int, one: NonlinearRow, trend: Real
) -> tuple[JointFit, NonlinearRow]:
    """The leading fit with the row, which is computed once more with this fit, and the row."""
    joint = fitted.fits[i]
    former, best = joint.best, joint.best.fit
    problem = replace(joint.problem, y=joint.problem.y + trend)
    own = best if one.within is None else one.within
    start = best if best.structure == own.structure else own
    data = with_row(problem, one)
    row = replace(one.again(data, polished(data, start)), between=one.between)
    data = with_row(problem, row)
    found = polished(data, start)
    trial = replace(former, fit=found)
    joint = replace(joint, problem=data, weighed=data, best=trial, trials=(trial,))
    return joint if start is best else replace(joint, rivals=(former,), hidden=None), row


def _known_besides(joint: JointFit, fitted: OutputFit, i: int) -> JointFit:
    """The fit with the derivatives of all other inputs' fits as rows, so that all are free."""
    every = [one for j, one in enumerate(fitted.fits) if j != i and one.related]
    if not every:
        return joint
    plain = [replace(one.problem, valid=None, nuisance=None, begins=None) for one in every]
    moves = [
        jacobian(problem, one.best.fit)[:-1] for problem, one in zip(plain, every, strict=True)
    ]
    known, fit = joint.problem.fixed()[1:], joint.best.fit
    rows = np.vstack([*moves, known])
    weights = np.concatenate([np.zeros(rows.shape[0] - known.shape[0]), fit.nuisance])
    problem = replace(joint.problem, nuisance=rows)
    best = replace(joint.best, fit=replace(fit, nuisance=weights))
    return replace(joint, problem=problem, weighed=problem, best=best)


def _with_rows(
    question: Question, seen: Imperfections, fitted: OutputFit, others: Real | None
) -> Iterator[_Found]:
    """Fit each kind's row; the fit without it is also without a drift that the row replaces.

    `others`, (n,), is what other inputs move the output by; the output of `question` is without it.
    Once a kind leaves noise, another is given up if its row leaves more than twice that power,
    which better dynamics would not recover.
    """
    joint, source = fitted.fits[0], question.aligned.inputs[0]
    floor = seen.floor(question.output.values)
    if question.exact or is_explained(source.values, joint, floor=floor):
        return
    if seen.saturation is not None or seen.hold is not None:
        return
    attempts = [(fitted, joint.problem.y, joint.problem.nuisance)]
    if fitted.drifting is not None and fitted.humming is None:  # the drift may have imitated it
        attempts.append((replace(fitted, drifting=None), question.output.values, None))
    for other, y, rows in attempts:
        steady = replace(question, output=replace(question.output, values=y))
        leading = replace(joint, problem=replace(joint.problem, y=y, nuisance=rows))
        course = _plain(steady, seen, leading, fitted.begun)
        problem = course.problem
        count = 1 - (joint.problem.fixed().shape[0] - problem.fixed().shape[0])
        command = Command(u=source.values, intersample=course.natural, others=others)
        starts = linear_starts(problem, course.best, joint, question.structures)
        kinds = kinds_in_question(command, problem, starts, joint.best.fit)
        least = np.inf  # power of the noise that another kind leaves
        while kinds:
            kind = next(iter(kinds))
            begun = kinds.pop(kind)
            one, left = _likeliest(
                kind, command, problem, begun, leading, joint.problem, count, seen.rounding
            )
            if one is not None and left < TWICE * least:
                beside = _fitted_with(steady, seen, course, one)
                if beside.related:
                    gain = criterion_gain(beside, count, joint.best.fit, joint.problem)
                    yield gain, one, beside, other
                    if gain > 2 * CLEARLY and leaves_noise(beside, one, seen.rounding):
                        least = min(least, beside.best.fit.cost / beside.problem.counted)
                    if beside.best.fit.is_white:
                        continue
            play, friction = ALIKE
            if kind == play:  # the plain fit first
                kinds[friction] = [*begun, *kinds.pop(friction, [])]


def _plain(
    question: Question, seen: Imperfections, joint: JointFit, known: Course | None
) -> Course:
    """Plain fits of one input to the data of a joint fit; `known` has those without its rows."""
    rows = joint.problem.nuisance
    if known is not None and rows is not None:
        natural = [t.fit for t in joint.trials if t.intersample == known.natural]
        fits = [fit for fit in natural if fit.structure.name in question.plain]
        return resumed(known, joint.problem, fits or known.fits)
    if known is not None:
        counts, y = counted_in(question, seen), question.output.values
        if np.array_equal(known.data.y, y) and count_alike(known.given.valid, counts):
            return known
    return completed(turn_ahead(started(question, seen, rows)))


def _fitted_with(
    question: Question, seen: Imperfections, course: Course, one: NonlinearRow
) -> JointFit:
    """Fit every structure with a row for a nonlinearity; the `course` has plain fits without it.

    They are started anew unless they leave white noise: the row may explain what they followed.
    """
    question, own = _counting(question, one), [] if one.within is None else [one.within]
    given = Counted(valid=counted_in(question, seen), begins=None)
    others = tuple(name for name in question.structures if name not in course.plain)
    course, data = replace(course, given=given, others=others), with_row(course.problem, one)
    course = resumed(course, data, [*course.fits, *own])
    if not course.best.is_white:
        course = completed(turn_ahead(started(question, seen, data.nuisance)))
        fits = [*course.fits, *(polished(course.problem, fit) for fit in own)]
        course = replace(course, fits=fits)
    joint = chosen_of(course, question.structures)
    return _in_own_dynamics(joint, own[0], course.natural) if own else joint


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
    rounding: float,
) -> tuple[NonlinearRow | None, float]:
    """The row of a kind that gains most in Schwarz's criterion, if any does, and what it leaves.

    With the dynamics of its start, or, unless it acts within these, with those that lead. Of
    friction, no other lag is tried once it leaves noise; no further start once the noise is white.
    The second value is the power of the residual.
    """
    best, white = joint.best.fit, False
    found: NonlinearRow | None = None
    lead, led = best, former  # the likeliest fit so far, and its data
    for start in starts:
        for one in settled_rows(kind, command, problem, start):
            begins = [(problem, one.within or start)]
            if one.within is None:
                begins.append((joint.problem, best))
            for before, begun in begins:
                data = with_row(before, one)
                fit = refit(data, begun)
                again = replace(joint, problem=data, best=replace(joint.best, fit=fit))
                white = white or fit.is_white
                # Compared at samples that count in both: of friction, other samples may stick.
                if criterion_gain(again, count if found is None else 0, lead, led) > 0.0:
                    found, lead, led = one, fit, data
            if one.within is not None and (fit.is_white or is_rounding(data, fit, rounding)):
                break
        if white:
            break
    return found, lead.cost / led.counted
