"""From findings to a verdict for each parameter, and one for the pair."""

from collections.abc import Iterable
from dataclasses import fields, replace

from hmpim.identify.result import Estimate, PairIdentification, Parameters, Verdict
from hmpim.record import Finding

__all__ = ["doubted", "judged"]

_NOTHING = frozenset({"dead_channel", "unrelated"})
"""Codes of a pair whose output does not follow its input at all."""


def judged(pair: PairIdentification) -> PairIdentification:
    """Return the pair with the verdicts that its findings ask for.

    A parameter is doubtful if a doubt names it, or if its interval is withheld. The pair is not
    identifiable if its output does not follow its input; else it is ok if every figure given is.

    Parameters
    ----------
    pair : PairIdentification
        With all its findings; the verdicts that it has do not count.
    """
    names = doubted(pair.warnings)
    parameters = replace(
        pair.parameters,
        **{
            field.name: _weighed(estimate, doubtful=field.name in names)
            for field in fields(Parameters)
            if (estimate := getattr(pair.parameters, field.name)) is not None
        },
    )
    return replace(pair, parameters=parameters, verdict=_verdict(parameters, pair.warnings))


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


def _weighed(estimate: Estimate, *, doubtful: bool) -> Estimate:
    withheld = estimate.ci95 is None
    return replace(estimate, verdict="doubtful" if doubtful or withheld else "ok")


def _verdict(parameters: Parameters, findings: Iterable[Finding]) -> Verdict:
    if any(finding.code in _NOTHING for finding in findings):
        return "not_identifiable"
    given = (getattr(parameters, field.name) for field in fields(Parameters))
    return "ok" if all(e is None or e.verdict == "ok" for e in given) else "doubtful"
