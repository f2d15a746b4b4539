"""Figures that a nonlinearity, or a gain that changes along the record, has moved."""

from collections.abc import Iterator

from hmpim.identify.chance import FALSE_ALARM
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.judgement.evidence import Evidence, structure_in_words
from hmpim.identify.reading.figures import figures_of
from hmpim.identify.reading.spanned import bent_figures
from hmpim.identify.result.digits import percent, plus_minus
from hmpim.identify.result.groups import MODELLED, SIZES, in_words
from hmpim.identify.worth import FEW, MATERIAL
from hmpim.model.nonlinear import KIND_WORDS
from hmpim.record import Finding

__all__ = ["bent", "gain_change"]


def bent(evidence: Evidence) -> Iterator[Finding]:
    """Doubt the figures that a nonlinearity moves by more than a small part of their interval.

    The traces are inexact and the moves are of first order, which suffices to find the figures that
    do not move. Small or merely possible moves widen the intervals instead. If a rich structure
    with a material nonlinearity does not leave white noise, neither describes the record. The
    finding blames the dynamics if a linear response explains more of the residual.
    """
    sure = [bend for bend in evidence.bends if bend.counts]
    if not sure:
        return
    likeliest, fs = sure[0], evidence.fs
    highest = min(evidence.band[1], fs / 2)
    figures = [bent_figures(bend.fit, bend.moved, fs=fs, highest=highest) for bend in sure]
    moved = evidence.moved(figures)
    unexplained = not likeliest.white or evidence.misfit.probability < FALSE_ALARM
    rich = evidence.joint.best.fit.structure.name not in PLAIN
    if unexplained and rich and likeliest.effect > MATERIAL:
        moved = dict.fromkeys(MODELLED, 0.0) | moved
    noise = {"noise_std"} if likeliest.share > 2 * FEW else set()
    parameters = tuple(name for name in MODELLED if name in moved.keys() | noise)
    if not parameters:
        return
    kinds = " or ".join(dict.fromkeys(KIND_WORDS[bend.kind] for bend in sure))
    linear, nonlinear = evidence.misfit.share, likeliest.share
    if not likeliest.white and linear > nonlinear:
        yield Finding(
            code="other_dynamics",
            message="The record requires dynamics other than the model's: of the residual's power "
            f"{percent(linear)} % follows the input as that of a linear system does, and {kinds} "
            f"would explain {percent(nonlinear)} %. Sweep higher, or use the measured response.",
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
        message=f"The residual looks like {kinds}, {percent(likeliest.effect)} % of the output "
        f"(r.m.s.).{which} Identify at several amplitudes to see where the linear model holds.",
        severity="doubt",
        parameters=parameters,
    )


def gain_change(evidence: Evidence) -> Iterator[Finding]:
    """Say that the gain changes; or that it may have changed, and doubt what would then move.

    Shifts below the tolerated error of a model raise no doubt: the interval covers them.
    """
    gaining = evidence.gaining
    if gaining is None:
        return
    way, fs = "rises" if gaining.change > 0.0 else "falls", evidence.fs
    others = [figures_of(fit, fs=fs, highest=fs / 2) for fit in gaining.others]
    moved = tuple(evidence.moved(others))
    if gaining.share > 2 * FEW:
        moved = (*moved, "noise_std")
    if gaining.taken:
        size = plus_minus(100.0 * abs(gaining.change), 100.0 * gaining.std)
        other = " Another time course of the gain, with different figures, is about as likely."
        message = (
            f"The gain {way} by ({size}) % along the record; the change is removed, and the scale "
            f"factor stated is the mean over the record.{other if moved else ''} Let the unit warm "
            "up, and check its supply."
        )
    else:
        name = structure_in_words(gaining.joint.best.fit.structure.name)
        message = (
            f"The gain may have changed along the record: a {name} model whose gain {way} by about "
            f"{percent(abs(gaining.change))} % explains it as well. A sweep passes each frequency "
            "at one time only, so dynamics and a change of gain look alike. Let the unit warm up, "
            "and repeat the test with the sweep reversed."
        )
    yield Finding(
        code="gain_change",
        message=message,
        severity="doubt" if moved else "info",
        parameters=moved or ("scale_factor",),
    )
