"""Other assumptions about the input between its samples, and the figures that they would move."""

from collections.abc import Iterable, Iterator

from hmpim.identify.judgement.evidence import Evidence, structure_in_words
from hmpim.identify.reading.spanned import rivals_of
from hmpim.identify.result.groups import PHASE_SPLIT, SIZES, in_words
from hmpim.identify.worth import FEW, PART
from hmpim.record import INTERSAMPLE_WORDS, Finding, Intersample

__all__ = ["other_intersample", "undetermined_between", "wide_span"]

_SHIFTED = (*PHASE_SPLIT, "delay_low_frequency", "bandwidth_phase90")
"""Figures that move with the delay, or with the structure."""


def other_intersample(evidence: Evidence) -> Iterator[Finding]:
    """Name the assumptions that fit as well: the intervals cover them."""
    best, rivals = evidence.joint.best, []
    for trial in rivals_of(evidence.joint):
        name = trial.fit.structure.name
        other = name if name != best.fit.structure.name else ""
        rivals.append((trial.intersample, trial.fit.delay - best.fit.delay, other))
    yield from undetermined_between(best.intersample, rivals)


def undetermined_between(
    taken: Intersample, rivals: Iterable[tuple[Intersample, float, str]]
) -> Iterator[Finding]:
    """Name the assumptions that fit as well as the one taken, if they move the delay.

    `rivals` holds each of these assumptions, the samples by which it moves the delay, and its
    structure, empty if that is the same.
    """
    moves = []
    for mode, apart, other in rivals:
        if other or abs(apart) > FEW:
            model = f"{_a_model(other)} and " if other else ""
            moves.append(f"{INTERSAMPLE_WORDS[mode]}, with {model}{_delay(apart)}")
    if not moves:
        return
    yield Finding(
        code="intersample",
        message="This record does not determine what the input does between its samples. "
        f"The input is assumed to be {INTERSAMPLE_WORDS[taken]}; "
        f"it may also be {', or '.join(moves)}. "
        "The intervals cover this. If you know it, state it with intersample=.",
        severity="info",
        parameters=_SHIFTED,
    )


def _a_model(structure: str) -> str:
    """Name a structure, with its remark last: 'a first-order model (with a zero)'."""
    name, _, remark = structure_in_words(structure).partition(" (")
    return f"a {name} model" + (f" ({remark}" if remark else "")


def _delay(apart: float) -> str:
    """Compare a delay that is `apart` samples longer with the stated one."""
    size = f"{abs(apart):.2f}"
    if size == "0.00":
        return "the same delay"
    return f"a delay {size} samples {'longer' if apart > 0.0 else 'shorter'}"


def wide_span(evidence: Evidence) -> Iterator[Finding]:
    """Doubt figures that differ widely among the models that the record allows."""
    wide: dict[str, str] = {}
    for name in SIZES:
        estimate, own = getattr(evidence.spanned, name), getattr(evidence.readings.parameters, name)
        if estimate is None or estimate.ci95 is None or estimate.ci95 == own.ci95:
            continue
        low, high = estimate.ci95
        if low is None or high is None:  # a model lacks it
            wide[name] = f"below {high:.4g}" if low is None else f"above {low:.4g}"
        elif high - low > PART * abs(estimate.value):
            wide[name] = f"from {low:.4g} to {high:.4g}"
    if not wide:
        return
    named = ", ".join(f"{in_words(name)} {span}" for name, span in wide.items())
    between = bool(rivals_of(evidence.joint))
    yield Finding(
        code="intersample" if between else "structure",
        message=f"Models that this record cannot distinguish differ widely: {named}. "
        + ("State what the input does between its samples" if between else "Sweep higher")
        + ", or lower the noise.",
        severity="doubt",
        parameters=tuple(wide),
    )
