"""From findings to a verdict for each parameter, and one for the pair."""

from collections.abc import Iterable
from dataclasses import replace
from typing import TypeVar

from hmpim.identify.result import (
    Estimate,
    PairIdentification,
    Parameters,
    ResponseBandwidths,
    Verdict,
)
from hmpim.identify.result.estimate import ParameterVerdict
from hmpim.identify.result.groups import EVERY
from hmpim.record import Finding

__all__ = ["UNKNOWN", "all_doubtful", "doubted", "judged", "judged_together", "unfollowed"]

H = TypeVar("H", Parameters, ResponseBandwidths)

_NOTHING = frozenset({"dead_channel", "unrelated"})
"""Codes of a pair whose output does not follow its input."""

_OF_THE_RECORD = frozenset(
    {"bandwidth_disagrees", "frozen", "halves_disagree", "nonlinear", "quantization", "spikes"}
    | _NOTHING
)
"""Codes of doubts that concern the measured response too; the others concern the model."""

_WITHHELD = frozenset(
    {
        "few_lines",
        "feedback",
        "halves_disagree",
        "held_output",
        "initial_transient",
        "lack_of_fit",
        "nonlinear",
        "other_dynamics",
        "unsampled_input",
    }
)
"""Codes of doubts under which a figure's error is unknown: its interval is withheld.

Either the record contradicts the model itself, or something other than noise moves the figure (a
slow free response the bias, motion between the samples the noise). In the study of families about
half of the intervals of such a model held. The deviation due to noise alone is still known."""

UNKNOWN = frozenset({"few_lines"})
"""Codes of doubts under which the deviation due to noise is unknown too."""


def judged(pair: PairIdentification) -> PairIdentification:
    """Return the pair with the verdicts that follow from its findings; its old ones are ignored.

    A parameter is doubtful if a doubt names it, or if its interval is withheld. The pair is not
    identifiable if its output does not follow its input; else it is ok if every figure given is.
    """
    withheld, unknown, shared = (
        doubted(finding for finding in pair.warnings if finding.code in codes)
        for codes in (_WITHHELD, UNKNOWN, _OF_THE_RECORD)
    )
    intervals = {
        name: replace(e, std=None if name in unknown else e.spread, ci95=None)
        for name, e in pair.parameters.given.items()
        if name in withheld
    }
    parameters = _all_weighed(replace(pair.parameters, **intervals), doubted(pair.warnings))
    sound = all(e.verdict == "ok" for e in parameters.given.values())
    verdict: Verdict = "ok" if sound else "doubtful"
    if any(finding.code in _NOTHING for finding in pair.warnings):
        verdict = "not_identifiable"
    response = _all_weighed(pair.from_response, shared)
    return replace(pair, parameters=parameters, from_response=response, verdict=verdict)


def judged_together(
    mean: Estimate, parts: Iterable[Estimate], *, name: str, findings: Iterable[Finding] = ()
) -> Estimate:
    """Return the mean of estimates of one parameter, doubtful if any of them is.

    `findings` concern all of them together.
    """
    doubtful = name in doubted(findings) or any(part.verdict == "doubtful" for part in parts)
    return _weighed(mean, doubtful=doubtful)


def all_doubtful(parameters: Parameters) -> Parameters:
    """Return the parameters, all of them doubtful."""
    return _all_weighed(parameters, frozenset(EVERY))


def unfollowed(output: str, source: str) -> Finding:
    """Report that an output does not follow the only input."""
    return Finding(
        code="unrelated",
        message=f"Output {output!r} does not follow input {source!r}: a constant explains it as "
        "well. Check the channels, or excite more.",
        severity="doubt",
        parameters=EVERY,
    )


def doubted(findings: Iterable[Finding]) -> frozenset[str]:
    """Return the names of all parameters in doubt.

    Examples
    --------
    >>> late = Finding(code="x", message="Late.", severity="doubt", parameters=("delay",))
    >>> sorted(doubted([late]))
    ['delay']
    """
    return frozenset(
        name for finding in findings if finding.severity == "doubt" for name in finding.parameters
    )


def _all_weighed(holder: H, names: frozenset[str]) -> H:
    """Give every estimate its verdict."""
    given = holder.given.items()
    return replace(holder, **{name: _weighed(e, doubtful=name in names) for name, e in given})


def _weighed(estimate: Estimate, *, doubtful: bool) -> Estimate:
    withheld = estimate.ci95 is None
    verdict: ParameterVerdict = "doubtful" if doubtful or withheld else "ok"
    return estimate if estimate.verdict == verdict else replace(estimate, verdict=verdict)
