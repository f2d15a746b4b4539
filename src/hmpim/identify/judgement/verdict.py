"""From findings to a verdict for each parameter, and one for the pair."""

from collections.abc import Iterable
from dataclasses import fields, replace
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

__all__ = ["UNTOLD", "all_doubted", "doubted", "judged", "judged_together", "unfollowed"]

H = TypeVar("H", Parameters, ResponseBandwidths)

_NOTHING = frozenset({"dead_channel", "unrelated"})
"""Codes of a pair whose output does not follow its input at all."""

_OF_THE_RECORD = frozenset(
    {"bandwidth_disagrees", "frozen", "halves_disagree", "nonlinear", "quantization", "spikes"}
    | _NOTHING
)
"""Codes of doubts that the measured response shares; the others are about the model."""

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
"""Codes of doubts under which a figure's error is not known: its interval is withheld.

Either the record contradicts the model itself, or what noise cannot do to the figure something else
does (a slow free response to the bias, motion between the samples to the noise). Intervals made
with such a model held in about half of the study of families; what noise alone does to the figure
is known all the same."""

UNTOLD = frozenset({"few_lines"})
"""Those under which that is not known either."""


def judged(pair: PairIdentification) -> PairIdentification:
    """Return the pair with the verdicts that its findings ask for; those it has do not count.

    A parameter is doubtful if a doubt names it, or if its interval is withheld. The pair is not
    identifiable if its output does not follow its input; else it is ok if every figure given is.
    """
    names = doubted(pair.warnings)
    unknown = doubted(w for w in pair.warnings if w.code in _WITHHELD)
    untold = doubted(w for w in pair.warnings if w.code in UNTOLD)
    parameters = _all_weighed(_withheld(pair.parameters, unknown, untold), names)
    shared = doubted(w for w in pair.warnings if w.code in _OF_THE_RECORD)
    return replace(
        pair,
        parameters=parameters,
        from_response=_all_weighed(pair.from_response, shared),
        verdict=_verdict(parameters, pair.warnings),
    )


def judged_together(
    mean: Estimate, parts: Iterable[Estimate], *, name: str, findings: Iterable[Finding] = ()
) -> Estimate:
    """Return the mean of estimates of one parameter with its verdict: doubtful if any of them is.

    `findings` is what is said of all of them together.
    """
    doubtful = name in doubted(findings) or any(part.verdict == "doubtful" for part in parts)
    return _weighed(mean, doubtful=doubtful)


def all_doubted(parameters: Parameters) -> Parameters:
    """Return the parameters with a doubt on each: nothing is claimed yet."""
    return _all_weighed(parameters, frozenset(EVERY))


def unfollowed(output: str, source: str) -> Finding:
    """Say that an output does not follow the one input there is."""
    return Finding(
        code="unrelated",
        message=f"Output {output!r} does not follow input {source!r}: a constant explains it as "
        "well. Check the channels, or excite more.",
        severity="doubt",
        parameters=EVERY,
    )


def doubted(findings: Iterable[Finding]) -> frozenset[str]:
    """Return the names of all parameters that a doubt touches.

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
    """Weigh every estimate that is there."""
    given = {f.name: e for f in fields(holder) if (e := getattr(holder, f.name)) is not None}
    return replace(
        holder, **{name: _weighed(e, doubtful=name in names) for name, e in given.items()}
    )


def _withheld(parameters: Parameters, names: frozenset[str], untold: frozenset[str]) -> Parameters:
    """Take the intervals away whose figures are named, and the deviations of those untold."""
    given = {name: e for name in names if (e := getattr(parameters, name)) is not None}
    return replace(
        parameters,
        **{
            name: replace(e, std=None if name in untold else e.spread, ci95=None)
            for name, e in given.items()
        },
    )


def _weighed(estimate: Estimate, *, doubtful: bool) -> Estimate:
    withheld = estimate.ci95 is None
    verdict: ParameterVerdict = "doubtful" if doubtful or withheld else "ok"
    return estimate if estimate.verdict == verdict else replace(estimate, verdict=verdict)


def _verdict(parameters: Parameters, findings: Iterable[Finding]) -> Verdict:
    if any(finding.code in _NOTHING for finding in findings):
        return "not_identifiable"
    given = (getattr(parameters, name) for name in EVERY)
    return "ok" if all(e is None or e.verdict == "ok" for e in given) else "doubtful"
