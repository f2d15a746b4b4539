"""Other numbers of poles that the record does not exclude, and the figures that they change."""

from collections.abc import Iterator

import numpy as np

from hmpim.identify.chance import DEVIATIONS, LIKELIER
from hmpim.identify.fitting.tail import hidden_tail
from hmpim.identify.judgement.evidence import Evidence, structure_in_words
from hmpim.identify.reading.spanned import asked_rivals, plainer_rivals
from hmpim.identify.result.groups import AT_DC, PHASE_SPLIT
from hmpim.identify.worth import FEW, MATERIAL, MOST, TOLERATED
from hmpim.record import Finding

__all__ = ["ALMOST", "barely_distinguished", "missed_pole", "missed_tail", "other_order"]

ALMOST = DEVIATIONS - 1.0
"""Standard deviations from which another run may require other dynamics."""


def other_order(evidence: Evidence) -> Iterator[Finding]:
    """Name a structure with one more pole that is as likely: the intervals cover it.

    If the record clearly prefers one that may not be chosen, no model here is right.
    """
    joint = evidence.joint
    if not joint.rivals:
        yield from _plainer(evidence)
        return
    rival, ahead = joint.rivals[0].fit, joint.best.criterion - joint.rivals[0].criterion
    best, late = joint.best.fit.structure, rival.delay / evidence.fs
    if ahead <= 2 * LIKELIER:
        yield barely_distinguished(best.name, poles=rival.structure.order, delay=late)
        return
    yield Finding(
        code="other_dynamics",
        message=f"The record requires dynamics other than {_poles(best.order)}: a model with one "
        "more, which is none of those that may be chosen, is clearly likelier. The delay would "
        f"be {late:.4g} s with it. Lower the noise, or sweep higher, until a richer structure can "
        "be distinguished.",
        severity="doubt",
        parameters=evidence.of_other_poles,
    )


def _plainer(evidence: Evidence) -> Iterator[Finding]:
    """Name the structure that is almost as likely, plainer or richer: the intervals cover it."""
    joint, best = evidence.joint, evidence.joint.best.fit
    trials = sorted((*plainer_rivals(joint), *asked_rivals(joint)), key=lambda t: t.criterion)
    others = [trial.fit for trial in trials if trial.fit.structure != best.structure]
    twins = [trial.fit for trial in trials if abs(trial.fit.delay - best.delay) > FEW]
    for rival in (*others, *twins)[:1]:
        own, other = (structure_in_words(fit.structure.name) for fit in (best, rival))
        there = f"{other} one" if others else "same one with a zero in the other half plane"
        yield _undecided(
            f"This record barely distinguishes the {own} model from the {there}, with which the "
            f"delay would be {rival.delay / evidence.fs:.4g} s. The intervals cover this. Lower "
            "the noise, or sweep higher, to tell."
        )


def barely_distinguished(chosen: str, *, poles: int, delay: float) -> Finding:
    """Say that a structure with one more pole, and a delay in s, is as likely as the chosen one."""
    return _undecided(
        f"This record barely distinguishes {poles - 1} from {poles} poles. A "
        f"{structure_in_words(chosen)} model is taken; with one more pole the delay would be "
        f"{delay:.4g} s. The intervals cover this. Lower the noise, or "
        "sweep higher, to distinguish them."
    )


def _undecided(message: str) -> Finding:
    """Say that another structure is as likely, without a doubt."""
    return Finding(code="structure", message=message, severity="info", parameters=PHASE_SPLIT)


def _poles(order: int) -> str:
    return f"{order} pole{'s' * (order != 1)}"


def missed_pole(evidence: Evidence) -> Iterator[Finding]:
    """Doubt the delay if the record requires other dynamics, or cannot exclude a slow pole.

    A statistic within one deviation of its level may be on the other side of it in another run; the
    finding says so on both sides.
    """
    hidden = evidence.joint.hidden
    bent = evidence.nonlinear > MOST  # a nonlinear residual requires no pole
    if hidden is None or bent or evidence.joint.rivals:
        return
    poles, fs = _poles(evidence.joint.best.fit.structure.order), evidence.fs
    moved = float(np.sqrt(abs(hidden.squared)))
    statistic = abs(hidden.squared) / hidden.std if hidden.std > 0.0 else 0.0
    is_close = abs(statistic - DEVIATIONS) < DEVIATIONS - ALMOST
    close = "Another run may give the opposite verdict. " if is_close else ""
    level = (
        f"the evidence is {statistic:.1f} standard deviations, and a doubt begins at "
        f"{DEVIATIONS:.1f}"
    )
    matters = moved > TOLERATED * hidden.scale
    if statistic > DEVIATIONS and matters:
        yield Finding(
            code="other_dynamics",
            message=f"The record requires dynamics other than {poles}: {level}. The delay "
            f"may be off by {moved / fs:.2g} s. {close}Lower the noise, or sweep higher, until "
            "a richer structure can be distinguished.",
            severity="doubt",
            parameters=evidence.of_other_poles,
        )
    elif hidden.may_hide:
        yield _undecided(
            f"A further pole with a time constant of up to {hidden.limit / fs:.3g} s would "
            "not show in this record, and would shorten the delay by as much; the intervals cover "
            "it. Lower the noise, or sweep higher."
        )
    elif close and matters:
        yield _undecided(
            f"The record almost requires dynamics other than {poles}: {level}. {close}"
            "Lower the noise, or sweep higher."
        )


def missed_tail(evidence: Evidence) -> Iterator[Finding]:
    """Doubt the figures at DC if the record shows a slow tail that the model lacks.

    A slow tail hardly changes the response within the band.
    """
    joint, fs = evidence.joint, evidence.fs
    if evidence.nonlinear > MOST:
        return
    tail = hidden_tail(joint.weighed, joint.best.fit, share=joint.weighed_share)
    if tail is None or tail.size <= MATERIAL:
        return
    yield Finding(
        code="other_dynamics",
        message="The record requires slower dynamics than the model has: the output settles by "
        f"{100 * tail.size:.2g} % with a time constant of about {tail.lag / fs:.2g} s, and no "
        "available structure describes this. The figures at DC may be off by as much. "
        "Sweep lower, or record longer.",
        severity="doubt",
        parameters=AT_DC,
    )
