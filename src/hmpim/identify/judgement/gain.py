"""A gain that changes along the record, or may have changed."""

from collections.abc import Iterator

from hmpim.identify.judgement.evidence import Evidence, structure_in_words
from hmpim.identify.reading.figures import figures_of
from hmpim.identify.result.digits import percent, plus_minus
from hmpim.identify.worth import FEW
from hmpim.record import Finding

__all__ = ["gain_change"]


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
