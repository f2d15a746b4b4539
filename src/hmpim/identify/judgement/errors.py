"""Error bars that are too wide for the figure, and a fit that did not converge."""

from collections.abc import Iterator

from hmpim.identify.judgement.evidence import Evidence
from hmpim.identify.result import Estimate
from hmpim.identify.result.groups import MODELLED, SIZES, in_words
from hmpim.identify.worth import BLURRED, MOST, MUCH
from hmpim.record import Finding

__all__ = ["not_converged", "weak_delay", "weak_excitation"]


def not_converged(evidence: Evidence) -> Iterator[Finding]:
    """Doubt a fit that stopped before it converged."""
    if evidence.joint.best.fit.converged:
        return
    yield Finding(
        code="not_converged",
        message="The fit stopped before it converged. "
        "Try a longer record, or one with more excitation.",
        severity="doubt",
        parameters=MODELLED,
    )


def weak_excitation(evidence: Evidence) -> Iterator[Finding]:
    """Doubt each parameter whose standard deviation is above 30 % of its value."""
    p = evidence.readings.parameters
    for name in SIZES:
        estimate: Estimate | None = getattr(p, name)
        if estimate is None or estimate.spread <= MUCH * abs(estimate.value):
            continue
        yield Finding(
            code="weak_excitation",
            message=f"{_how_well(in_words(name), estimate)}. Excite more around the natural "
            "frequency, or longer.",
            severity="doubt",
            parameters=(name, *_along(name, estimate, evidence)),
        )


def _along(name: str, estimate: Estimate, evidence: Evidence) -> tuple[str, ...]:
    """Parameters that are in doubt together with one that the record does not determine."""
    if name == "scale_factor":
        cov, scale = evidence.readings.covariance, 1 + evidence.joint.best.fit.structure.order
        # With an input far from zero most of the bias's variance is that of the scale factor.
        if cov[scale, -1] ** 2 > MOST * cov[scale, scale] * cov[-1, -1]:
            return ("bias",)
    if name == "natural_frequency" and estimate.spread > abs(estimate.value):
        return ("delay",)  # a pole that may be anywhere acts like a delay
    return ()


def _how_well(words: str, estimate: Estimate) -> str:
    """State a deviation in per cent of the value, if it is below the value."""
    if estimate.spread < abs(estimate.value):
        percent = 100 * estimate.spread / abs(estimate.value)
        return (
            f"The record barely determines the {words}: its standard deviation is "
            f"{percent:.0f} % of its value"
        )
    return f"The record does not determine the {words}: its standard deviation exceeds its value"


def weak_delay(evidence: Evidence) -> Iterator[Finding]:
    """Doubt a delay whose standard deviation is above two samples and 30 % of its value."""
    p = evidence.readings.parameters
    delays = {"delay": p.delay, "delay_low_frequency": p.delay_low_frequency}
    blurred = tuple(
        name
        for name, delay in delays.items()
        if delay is not None and delay.spread > max(BLURRED / evidence.fs, MUCH * abs(delay.value))
    )
    if p.delay is None or "delay" not in blurred:
        return
    yield Finding(
        code="weak_excitation",
        message=f"The record barely determines the delay: its standard deviation is "
        f"{p.delay.spread:.2g} s. Excite more, or sweep higher.",
        severity="doubt",
        parameters=blurred,
    )
