"""Other numbers of poles that the record does not exclude, and what would change with them."""

import numpy as np

from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.nested import HiddenPole, hidden_pole
from hmpim.identify.fitting.trial import Trial
from hmpim.identify.groups import PHASE_SPLIT
from hmpim.identify.judgement.evidence import Evidence, structure_in_words
from hmpim.identify.readings import system_of
from hmpim.model import bandwidth_3db, bandwidth_phase
from hmpim.record import Finding

__all__ = ["missed_pole", "one_more_pole", "other_structure", "undecided_order"]

_AMBIGUOUS = 4.0
"""Difference of the criterion within which another plain structure is worth naming."""

_DISAGREES = 4.0
"""Standard deviations by which its figures must differ to cast doubt."""

_MATTERS = 0.03
"""Share of a bandwidth below which a disagreement casts no doubt."""

_ASKED = 4.0
"""Standard deviations of the score test from which one more pole is asked for."""

_SECOND_POLE = 0.2
"""Share of the time constant up to which a second pole may hide in a first-order result."""


def other_structure(evidence: Evidence) -> tuple[Finding, ...]:
    """Doubt what another structure that fits hardly worse puts elsewhere."""
    best = evidence.joint.best
    for trial in evidence.joint.trials:
        if (
            trial.intersample != best.intersample
            or trial.fit.structure.name == best.fit.structure.name
            or not {trial.fit.structure.name, best.fit.structure.name} <= set(PLAIN)
            or trial.criterion - best.criterion > _AMBIGUOUS
        ):
            continue
        said = _parted(evidence, trial)
        if said is not None:
            parted, touched = said
            return (
                Finding(
                    code="structure",
                    message=f"A {structure_in_words(trial.fit.structure.name)} model fits about as "
                    f"well as the {structure_in_words(best.fit.structure.name)} one and puts the "
                    f"{parted}. Lower the noise, or sweep higher, to tell them apart.",
                    severity="doubt",
                    parameters=(*PHASE_SPLIT, *touched),
                ),
            )
    return ()


def _parted(evidence: Evidence, trial: Trial) -> tuple[str, tuple[str, ...]] | None:
    """What another structure puts elsewhere, in words, and the bandwidths among it."""
    fs, best = evidence.fs, evidence.joint.best
    bandwidths = _bandwidths_apart(evidence, trial)
    touched = tuple(name for name, *_ in bandwidths)
    std = float(np.sqrt(max(evidence.readings.covariance[0, 0], np.finfo(float).tiny)))
    apart = abs(trial.fit.delay - best.fit.delay)
    if apart > _DISAGREES * std:
        return f"delay {apart / std:.0f} standard deviations away", touched
    if bandwidths:
        _, words, other, stated = bandwidths[0]
        return f"{words} bandwidth at {other:.4g} instead of {stated:.4g} Hz", touched
    poles = best.fit.structure.order - trial.fit.structure.order
    if poles > 0 and evidence.joint.simpler is None:
        # Wide as the bars are, the second pole may be none.
        return f"delay at {trial.fit.delay / fs:.4g} s", ()
    return None


def _bandwidths_apart(evidence: Evidence, trial: Trial) -> list[tuple[str, str, float, float]]:
    """Name, words, value there and value here of each bandwidth that another structure moves."""
    p = evidence.readings.parameters
    highest = min(evidence.band[1], evidence.fs / 2)
    vector = np.concatenate([trial.fit.theta, trial.fit.linear])
    system = system_of(trial.fit.structure, vector, evidence.fs)
    moved = []
    for name, words, stated, other in (
        (
            "bandwidth_phase90",
            "-90°",
            p.bandwidth_phase90,
            bandwidth_phase(system, highest=highest),
        ),
        ("bandwidth_3db", "-3 dB", p.bandwidth_3db, bandwidth_3db(system, highest=highest)),
    ):
        if stated is None or other is None:
            continue
        if abs(other - stated.value) > max(_DISAGREES * stated.spread, _MATTERS * stated.value):
            moved.append((name, words, other, stated.value))
    return moved


def undecided_order(evidence: Evidence) -> tuple[Finding, ...]:
    """Doubt the split between delay and poles where the richer model was taken to be careful."""
    simpler = evidence.joint.simpler
    if simpler is None:
        return ()
    chosen = structure_in_words(evidence.joint.best.fit.structure.name)
    return (
        Finding(
            code="structure",
            message=f"The number of poles this record hardly tells: a {chosen} model is taken for "
            f"its wider error bars; a {structure_in_words(simpler.fit.structure.name)} one would "
            f"put the delay at {simpler.fit.delay / evidence.fs:.4g} s. Lower the noise, or sweep "
            "higher.",
            severity="doubt",
            parameters=PHASE_SPLIT,
        ),
    )


def missed_pole(evidence: Evidence) -> tuple[Finding, ...]:
    """Doubt the delay where the record asks for one more pole, or cannot exclude it."""
    joint = evidence.joint
    structure = joint.best.fit.structure
    if evidence.nonlinear or structure.name not in ("first_order", "second_order"):
        return ()
    readings = evidence.readings
    hidden = hidden_pole(joint.weighed, joint.best.fit, readings.rows, white=readings.whitened)
    return one_more_pole(hidden, structure.order, evidence.fs)


def one_more_pole(hidden: HiddenPole, order: int, fs: float) -> tuple[Finding, ...]:
    """Say what one more pole beside those of a first- or second-order fit would change.

    Parameters
    ----------
    hidden : HiddenPole
        What a score test says of it.
    order : int
        Of the fit.
    fs : float
        Rate in Hz.
    """
    moved = float(np.sqrt(abs(hidden.squared)))
    if abs(hidden.squared) > _ASKED * hidden.std and moved > _MATTERS * hidden.scale:
        message = (
            f"The record asks for more than {order} pole{'s' if order > 1 else ''} "
            f"({abs(hidden.squared) / hidden.std:.0f} standard deviations), and the delay may be "
            f"{moved / fs:.2g} s off. Lower the noise, or sweep higher, until a richer structure "
            "can be told."
        )
    elif order == 1 and hidden.limit > _SECOND_POLE * hidden.scale:
        message = (
            f"A second pole of up to {hidden.limit / fs:.3g} s beside the time constant would not "
            "show in this record, and would shorten the delay by as much. Lower the noise, or "
            "sweep higher."
        )
    else:
        return ()
    return (Finding(code="structure", message=message, severity="doubt", parameters=PHASE_SPLIT),)
