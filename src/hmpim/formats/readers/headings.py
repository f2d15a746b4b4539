"""A heading cut in two: the name of a channel and its unit."""

import re

from hmpim.errors import UnitError
from hmpim.units import check_unit

__all__ = ["named"]

_BRACKETS = re.compile(r"^(?P<name>.*?)\s*\[(?P<unit>[^\[\]]*)\]$")
_PARENTHESES = re.compile(r"^(?P<name>.*?)\s*\((?P<unit>[^()]*)\)$")


def named(heading: str) -> tuple[str, str]:
    """Cut ``u [deg]`` or ``u (deg)`` in two.

    What is in brackets is a unit, known or not. What is in parentheses may be part of the name:
    it is a unit only if it is a known one.

    Examples
    --------
    >>> named("u [deg]"), named("y (V)"), named("y (filtered)"), named("n [-]")
    (('u', 'deg'), ('y', 'V'), ('y (filtered)', ''), ('n', ''))
    """
    match = _BRACKETS.match(heading)
    if match and match["name"]:
        unit = match["unit"].strip()
        return match["name"], "" if unit in ("", "-", "1") else unit
    match = _PARENTHESES.match(heading)
    if match and match["name"]:
        unit = match["unit"].strip()
        if unit in ("", "-", "1"):
            return match["name"], ""
        try:
            return match["name"], check_unit(unit)
        except UnitError:
            return heading, ""
    return heading, ""
