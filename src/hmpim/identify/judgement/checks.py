"""The checks in their order, and `judge`, which makes them."""

from collections.abc import Callable, Iterable, Sequence
from functools import partial

from hmpim.identify.judgement.bent import bent
from hmpim.identify.judgement.between_samples import other_intersample, wide_span
from hmpim.identify.judgement.errors import not_converged, weak_delay, weak_excitation
from hmpim.identify.judgement.evidence import Evidence
from hmpim.identify.judgement.failed import attempt
from hmpim.identify.judgement.feedback import feedback
from hmpim.identify.judgement.gain import gain_change
from hmpim.identify.judgement.reach import (
    beyond_band,
    fast_mode,
    few_lines,
    initial_transient,
    integrator,
    natural_frequency_beyond,
    negative_delay,
    short_record,
)
from hmpim.identify.judgement.residual import (
    changing_noise,
    coloured_noise,
    halves_disagree,
    lack_of_fit,
    noise_colour_of,
    noise_on_the_input,
    uneven_noise,
    unsampled_input,
)
from hmpim.identify.judgement.response import bandwidth_disagrees, grazed_bandwidth
from hmpim.identify.judgement.structure import missed_pole, other_order
from hmpim.identify.judgement.verdict import UNTOLD, doubted
from hmpim.record import Finding

__all__ = ["CHECKS", "Check", "judge"]

Check = Callable[[Evidence], Iterable[Finding]]
"""Looks at the evidence and says what it finds, if anything."""

CHECKS: tuple[Check, ...] = (
    initial_transient,
    lack_of_fit,
    coloured_noise,
    changing_noise,
    not_converged,
    weak_excitation,
    weak_delay,
    fast_mode,
    natural_frequency_beyond,
    few_lines,
    integrator,
    beyond_band,
    grazed_bandwidth,
    halves_disagree,
    other_order,
    missed_pole,
    other_intersample,
    wide_span,
    short_record,
    negative_delay,
    noise_colour_of,
    noise_on_the_input,
    uneven_noise,
    unsampled_input,
    feedback,
    bandwidth_disagrees,
    bent,
    gain_change,
)
"""All checks of one pair; each one's findings come in this order."""

SAMPLED: tuple[Check, ...] = (
    initial_transient,
    lack_of_fit,
    coloured_noise,
    changing_noise,
    few_lines,
    beyond_band,
    grazed_bandwidth,
    halves_disagree,
    noise_colour_of,
)
"""Those that ask something of software, which has neither poles beyond the band nor a clock."""


_OF_THE_RESIDUAL: frozenset[Check] = frozenset(
    {
        *(lack_of_fit, coloured_noise, changing_noise, halves_disagree, noise_colour_of),
        *(uneven_noise, unsampled_input, feedback, other_order, missed_pole),
    }
)
"""Those that ask something of the residual; nothing where that is the error of interpolation."""


def judge(evidence: Evidence, *, checks: Sequence[Check] | None = None) -> tuple[Finding, ...]:
    """Make every check, by default `CHECKS`, of software `SAMPLED`, and return what they find.

    One that raises costs itself and stands as 'check_failed'. Where all is explained to the last
    digit, those that ask something of the residual are left out.
    """
    if checks is None:
        checks = SAMPLED if evidence.joint.best.fit.structure.sampled else CHECKS
    if evidence.is_without_noise:
        checks = [check for check in checks if check not in _OF_THE_RESIDUAL]
    found: list[Finding] = []
    nothing: tuple[Finding, ...] = ()
    for check in checks:
        said, failure = attempt(check.__name__, partial(_said, check, evidence), nothing)
        found += [*said, *failure]
    # Of figures that are not given there is nothing more to say.
    untold = doubted(one for one in found if one.code in UNTOLD)
    return tuple(
        one
        for one in found
        if one.severity == "doubt" or not one.parameters or not untold.issuperset(one.parameters)
    )


def _said(check: Check, evidence: Evidence) -> tuple[Finding, ...]:
    """Return all that a check finds, looked for here and now."""
    return tuple(check(evidence))
