"""A check that raises is reported, and the rest of the result stands."""

from collections.abc import Callable
from typing import TypeVar

from hmpim.record import Finding

__all__ = ["attempt", "failed"]

T = TypeVar("T")


def attempt(name: str, look: Callable[[], T], otherwise: T) -> tuple[T, tuple[Finding, ...]]:
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
