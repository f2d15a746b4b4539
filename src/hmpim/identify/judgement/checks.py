"""The checks in their order, and `judge`, which makes them."""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import TypeVar

from hmpim.identify.judgement import reach, residual
from hmpim.identify.judgement.bent import bent, gain_change
from hmpim.identify.judgement.between_samples import other_intersample, wide_span
from hmpim.identify.judgement.errors import not_converged, weak_delay, weak_excitation
from hmpim.identify.judgement.evidence import Evidence
from hmpim.identify.judgement.feedback import feedback
from hmpim.identify.judgement.response import bandwidth_disagrees, grazed_bandwidth
from hmpim.identify.judgement.structure import missed_pole, missed_tail, other_order
from hmpim.identify.judgement.verdict import UNKNOWN, doubted
from hmpim.record import Finding

__all__ = ["CHECKS", "COMPRESSED", "Check", "attempt", "judge"]

T = TypeVar("T")
U = TypeVar("U")

Check = Callable[[Evidence], Iterable[Finding]]
"""A function from the evidence to findings."""

CHECKS: tuple[Check, ...] = (
    reach.initial_transient,
    residual.lack_of_fit,
    residual.coloured_noise,
    residual.changing_noise,
    not_converged,
    weak_excitation,
    weak_delay,
    reach.fast_mode,
    reach.natural_frequency_beyond,
    reach.few_lines,
    reach.integrator,
    reach.beyond_band,
    grazed_bandwidth,
    residual.halves_disagree,
    other_order,
    missed_pole,
    missed_tail,
    other_intersample,
    wide_span,
    reach.short_record,
    reach.negative_delay,
    residual.noise_colour_of,
    residual.noise_on_the_input,
    residual.uneven_noise,
    residual.filled_input,
    residual.unsampled_input,
    feedback,
    bandwidth_disagrees,
    bent,
    gain_change,
)
"""All checks of one pair; each one's findings come in this order."""

SAMPLED: tuple[Check, ...] = (
    reach.initial_transient,
    residual.lack_of_fit,
    residual.coloured_noise,
    residual.changing_noise,
    reach.few_lines,
    reach.beyond_band,
    grazed_bandwidth,
    residual.halves_disagree,
    residual.noise_colour_of,
)
"""The checks for software, which has neither poles beyond the band nor a clock."""

COMPRESSED: tuple[Check, ...] = (
    *(reach.initial_transient, residual.lack_of_fit, not_converged, weak_excitation, weak_delay),
    *(reach.fast_mode, reach.natural_frequency_beyond, reach.integrator, reach.beyond_band),
    *(other_order, missed_pole, other_intersample, wide_span, reach.negative_delay),
)
"""The checks for statistics, which need no samples."""

_OF_THE_RESIDUAL: tuple[Check, ...] = (
    *(residual.lack_of_fit, residual.coloured_noise, residual.changing_noise),
    *(residual.halves_disagree, residual.noise_colour_of, residual.uneven_noise),
    *(residual.filled_input, residual.unsampled_input, feedback, other_order, missed_pole),
)
"""The checks of the residual, which are omitted if that is only the error of interpolation."""


def judge(evidence: Evidence, *, checks: Sequence[Check] | None = None) -> tuple[Finding, ...]:
    """Make every check, by default `CHECKS`, for software `SAMPLED`, and return the findings.

    A check that raises gives 'check_failed', and the others go on.
    """
    if checks is None:
        checks = SAMPLED if evidence.joint.best.fit.structure.sampled else CHECKS
    if evidence.is_without_noise:
        checks = [check for check in checks if check not in _OF_THE_RESIDUAL]
    found: list[Finding] = []
    for check in checks:
        made, failure = attempt(check.__name__, partial(_findings_of, check, evidence), ())
        found += [*made, *failure]
    # Figures that are not given need no further remark.
    unknown = doubted(finding for finding in found if finding.code in UNKNOWN)
    return tuple(
        finding
        for finding in found
        if finding.severity == "doubt"
        or not finding.parameters
        or not unknown.issuperset(finding.parameters)
    )


def _findings_of(check: Check, evidence: Evidence) -> tuple[Finding, ...]:
    """Run a generator to its end."""
    return tuple(check(evidence))


def attempt(name: str, look: Callable[[], T], otherwise: U) -> tuple[T | U, tuple[Finding, ...]]:
    """Return what `look` returns; if it raises, return `otherwise` and a finding.

    Examples
    --------
    >>> attempt("half", lambda: 1 / 2, 0.0)
    (0.5, ())
    >>> attempt("ratio", lambda: 1 / 0, 0.0)[1][0].message[:57]
    "The check 'ratio' failed to run (ZeroDivisionError: divis"
    """
    try:
        return look(), ()
    except Exception as error:  # whatever it is, the result stands without this check
        return otherwise, (failed(name, error),)


def failed(name: str, error: Exception) -> Finding:
    """Report which check raised, and what."""
    return Finding(
        code="check_failed",
        message=f"The check {name.replace('_', ' ')!r} failed to run ({type(error).__name__}: "
        f"{error}). The rest of the result is unaffected; please report the record.",
        severity="info",
        parameters=(),
    )
