"""Figures that a nonlinearity has moved."""

from collections.abc import Sequence

from hmpim.identify.chance import FALSE_ALARM, HALF
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.judgement.between_samples import SIZES
from hmpim.identify.judgement.evidence import Evidence
from hmpim.identify.nonlinear.bends import Bend
from hmpim.identify.nonlinear.words import KIND_WORDS
from hmpim.identify.reading.spanned import bent_figures
from hmpim.identify.result.digits import percent
from hmpim.identify.result.groups import MODELLED, in_words
from hmpim.identify.worth import FEW, MATERIAL, TOLERATED
from hmpim.record import Finding

__all__ = ["bent"]


def bent(evidence: Evidence) -> tuple[Finding, ...]:
    """Doubt the figures that a nonlinearity moves by more than a small part of their interval.

    How far it moves them is known to first order, for traces that are none of them exact: enough
    to tell which figures it leaves alone. What is small or only possible widens the intervals: no
    figure is doubted for less than a model must be right to. Where a rich structure and a
    nonlinearity that matters leave what is no noise, neither describes the record; the dynamics are
    accused where a linear response explains more of it.
    """
    sure = [one for one in evidence.bends if one.counts]
    if not sure:
        return ()
    moved = _moved(evidence, sure)
    left = not sure[0].white or evidence.misfit.probability < FALSE_ALARM
    rich = evidence.joint.best.fit.structure.name not in PLAIN
    if left and rich and sure[0].effect > MATERIAL:
        moved = dict.fromkeys(MODELLED, 0.0) | moved  # taken for its sake, and in vain
    noise = {"noise_std"} if sure[0].share > 2 * FEW else set()
    parameters = tuple(name for name in MODELLED if name in moved.keys() | noise)
    if not parameters:
        return ()
    kinds = " or ".join(dict.fromkeys(KIND_WORDS[one.kind] for one in sure))
    linear, bend = evidence.misfit.share, sure[0].share
    if not sure[0].white and linear > bend:  # a linear response explains more, and more is left
        return (
            Finding(
                code="other_dynamics",
                message="The record requires dynamics other than the model's: of the residual's "
                f"power {percent(linear)} % follows the input as that of a linear system does, "
                f"and {kinds} would explain {percent(bend)} %. Sweep higher, or use the measured "
                "response.",
                severity="doubt",
                parameters=parameters,
            ),
        )
    sized = [
        f"{in_words(name)} by {percent(moved[name])} %"
        for name in SIZES
        if 0.0 < moved.get(name, 0.0) <= 1.0
    ]
    which = f" It shifts figures of the linear model: {', '.join(sized)}." if sized else ""
    return (
        Finding(
            code="nonlinear",
            message=f"The residual looks like {kinds}, "
            f"{percent(sure[0].effect)} % of the output (r.m.s.).{which} Identify at several "
            "amplitudes to see where the linear model holds.",
            severity="doubt",
            parameters=parameters,
        ),
    )


def _moved(evidence: Evidence, sure: Sequence[Bend]) -> dict[str, float]:
    """Figures that move, and by what share of themselves; 0 where one is no longer given."""
    fs, highest = evidence.fs, min(evidence.band[1], evidence.fs / 2)
    others = [bent_figures(one.fit, one.moved, fs=fs, highest=highest) for one in sure]
    moved = {}
    for name in MODELLED:
        own = getattr(evidence.readings.parameters, name)
        if own is None or name == "noise_std":
            continue
        values = [other.get(name) for other in others]
        far = max((abs(value - own.value) for value in values if value is not None), default=0.0)
        if None in values or far > max(FEW * HALF * own.spread, TOLERATED * abs(own.value)):
            moved[name] = far / abs(own.value) if own.value else 0.0
    return moved
