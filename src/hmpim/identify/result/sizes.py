"""The size of a nonlinearity in words, as findings and exports state it."""

from hmpim.identify.result.digits import plus_minus
from hmpim.model.nonlinear import Kind, NonlinearPart

__all__ = ["size_in_words"]

_WORDS: dict[Kind, str] = {
    "backlash": "half its gap is",
    "dead_zone": "half its width is",
    "friction": "it equals the restoring force at a deflection of",
    "rate_limit": "at most",
}


def size_in_words(part: NonlinearPart, units: tuple[str, str]) -> str:
    """State the size of a nonlinearity with its error; the units are the input's and the output's.

    Examples
    --------
    >>> gap = NonlinearPart(kind="backlash", at="output", size=0.1, std=0.01, reach=2.0)
    >>> size_in_words(gap, ("V", "deg"))
    'half its gap is 0.100 ± 0.010 deg'
    """
    source, output = units
    if part.kind not in _WORDS:
        share = plus_minus(100.0 * abs(part.size), 100.0 * part.std)
        return f"{share} % of the linear part at a deflection of {part.reach:.4g} {output}".rstrip()
    unit = output
    if part.kind == "dead_zone":
        unit = source
    if part.kind == "rate_limit":
        unit = f"{source}/s" if source else "per s"
    return f"{_WORDS[part.kind]} {plus_minus(part.size, part.std)} {unit}".rstrip()
