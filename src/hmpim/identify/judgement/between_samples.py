"""Other assumptions on what the input does between its samples, and what they would move."""

from hmpim.identify.fitting.trial import CLEARLY, JointFit
from hmpim.identify.groups import PHASE_SPLIT
from hmpim.identify.judgement.evidence import Evidence, structure_in_words
from hmpim.record import Finding

__all__ = ["other_intersample"]

_LIKELIER = 6.0
"""Criterion by which another assumption between the samples is likelier (odds of 20) that the
natural one was preferred to: it then casts doubt."""

_SHIFT = 0.25
"""Difference of the delay, in samples, from which another assumption is worth a word."""

_SHIFTED = (*PHASE_SPLIT, "delay_low_frequency", "bandwidth_phase90")
"""What moves with the delay, or with the structure that goes with it."""

_WORDS = {"zoh": "held", "foh": "linear", "bandlimited": "band-limited"}


def other_intersample(evidence: Evidence) -> tuple[Finding, ...]:
    """Name another assumption that fits as well.

    It casts doubt if it is rather the likelier one, or asks for another structure.
    """
    joint = evidence.joint
    found = _other_structure(joint) or _same_structure(joint)
    return () if found is None else (found,)


def _other_structure(joint: JointFit) -> Finding | None:
    best = joint.best
    likeliest = min(joint.trials, key=lambda trial: trial.criterion)
    if (
        joint.simpler is not None
        or likeliest.intersample == best.intersample
        or likeliest.fit.structure.name == best.fit.structure.name
    ):
        return None
    here, there = _WORDS[best.intersample], _WORDS[likeliest.intersample]
    apart = likeliest.fit.delay - best.fit.delay
    return Finding(
        code="intersample",
        message=f"Whether the input is {here} or {there} between its samples, this record cannot "
        f"tell, and the structure depends on it: {there}, a "
        f"{structure_in_words(likeliest.fit.structure.name)} "
        f"model fits as well as the {structure_in_words(best.fit.structure.name)} one, with a "
        f"delay that is {apart:+.2f} samples away. State it with intersample=.",
        severity="doubt",
        parameters=(*_SHIFTED, "bandwidth_3db", "peak_gain_db"),
    )


def _same_structure(joint: JointFit) -> Finding | None:
    best = joint.best
    here = _WORDS[best.intersample]
    for trial in joint.trials:
        apart = trial.fit.delay - best.fit.delay
        if (
            trial.intersample == best.intersample
            or trial.fit.structure.name != best.fit.structure.name
            or trial.criterion - best.criterion >= 2 * CLEARLY
            or abs(apart) <= _SHIFT
        ):
            continue
        likelier = best.criterion - trial.criterion > _LIKELIER
        tells = "speaks for the other, though not clearly" if likelier else "cannot tell"
        return Finding(
            code="intersample",
            message=f"Whether the input is {here} or {_WORDS[trial.intersample]} "
            f"between its samples, this record {tells}. "
            f"{here.capitalize()} is assumed; the other would "
            f"move the delay by {apart:+.2f} samples. "
            "State it with intersample=.",
            severity="doubt" if likelier else "info",
            parameters=_SHIFTED,
        )
    return None
