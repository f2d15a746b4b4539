"""Figures that a nonlinearity has moved."""

from collections.abc import Iterator

from hmpim.identify.chance import FALSE_ALARM
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.judgement.between_samples import SIZES
from hmpim.identify.judgement.evidence import Evidence
from hmpim.identify.nonlinear.mechanisms import KIND_WORDS
from hmpim.identify.reading.spanned import bent_figures
from hmpim.identify.result.digits import percent
from hmpim.identify.result.groups import MODELLED, in_words
from hmpim.identify.worth import FEW, MATERIAL
from hmpim.record import Finding

__all__ = ["bent"]


def bent(evidence: Evidence) -> Iterator[Finding]:
    """Doubt the figures that a nonlinearity moves by more than a small part of their interval.

    How far it moves them is known to first order, for traces that are none of them exact: enough
    to tell which figures it leaves alone. What is small or only possible widens the intervals: no
    figure is doubted for less than a model must be right to. Where a rich structure and a
    nonlinearity that matters leave what is no noise, neither describes the record; the dynamics are
    accused where a linear response explains more of it.
    """
    sure = [one for one in evidence.bends if one.counts]
    if not sure:
        return
    fs, highest = evidence.fs, min(evidence.band[1], evidence.fs / 2)
    moved = evidence.moved(
        [bent_figures(one.fit, one.moved, fs=fs, highest=highest) for one in sure]
    )
    left = not sure[0].white or evidence.misfit.probability < FALSE_ALARM
    rich = evidence.joint.best.fit.structure.name not in PLAIN
    if left and rich and sure[0].effect > MATERIAL:
        moved = dict.fromkeys(MODELLED, 0.0) | moved  # taken for its sake, and in vain
    noise = {"noise_std"} if sure[0].share > 2 * FEW else set()
    parameters = tuple(name for name in MODELLED if name in moved.keys() | noise)
    if not parameters:
        return
    kinds = " or ".join(dict.fromkeys(KIND_WORDS[one.kind] for one in sure))
    linear, bend = evidence.misfit.share, sure[0].share
    if not sure[0].white and linear > bend:  # a linear response explains more, and more is left
        yield Finding(
            code="other_dynamics",
            message="The record requires dynamics other than the model's: of the residual's "
            f"power {percent(linear)} % follows the input as that of a linear system does, "
            f"and {kinds} would explain {percent(bend)} %. Sweep higher, or use the measured "
            "response.",
            severity="doubt",
            parameters=parameters,
        )
        return
    sized = [
        f"{in_words(name)} by {percent(moved[name])} %"
        for name in SIZES
        if 0.0 < moved.get(name, 0.0) <= 1.0
    ]
    which = f" It shifts figures of the linear model: {', '.join(sized)}." if sized else ""
    yield Finding(
        code="nonlinear",
        message=f"The residual looks like {kinds}, "
        f"{percent(sure[0].effect)} % of the output (r.m.s.).{which} Identify at several "
        "amplitudes to see where the linear model holds.",
        severity="doubt",
        parameters=parameters,
    )
