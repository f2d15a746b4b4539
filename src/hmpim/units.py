"""Unit strings, checked with pint; values stay plain arrays.

The empty string means "no unit stated" and is taken as dimensionless.
"""

from functools import cache

import pint

from hmpim.errors import UnitError

__all__ = ["check_unit", "conversion_factor", "rate_label", "rate_unit"]


@cache
def _registry() -> "pint.UnitRegistry[float]":
    return pint.UnitRegistry()


@cache
def _parsed(unit: str) -> pint.Unit:
    try:
        return _registry().Unit(unit)
    except Exception as error:  # pint raises a dozen kinds, tokenize errors among them
        raise UnitError(
            f"unit {unit!r} is not known; use one such as 'deg', 'rad', 'm', 'V', or '' for none"
        ) from error


def check_unit(unit: str) -> str:
    """Return `unit` as given if pint knows it.

    Raises
    ------
    UnitError
        If the unit is not known.

    Examples
    --------
    >>> check_unit("deg/s")
    'deg/s'
    """
    if not isinstance(unit, str):
        raise UnitError(f"unit {unit!r} is not a string; write it as 'deg' or 'm/s'")
    _parsed(unit)
    return unit


def rate_unit(unit: str, order: int) -> str:
    """Unit of the `order`-th time derivative, written the usual way.

    Examples
    --------
    >>> rate_unit("deg", 1), rate_unit("deg", 2), rate_unit("", 1)
    ('deg/s', 'deg/s²', '1/s')
    """
    if order == 0:
        return unit
    power = {1: "", 2: "²", 3: "³"}[order]
    return f"{unit or '1'}/s{power}"


def rate_label(unit: str, order: int) -> str:
    """Unit of the `order`-th time derivative as people read it, where the position has none too.

    Examples
    --------
    >>> rate_label("deg", 1), rate_label("", 1), rate_label("", 0)
    ('deg/s', 'units/s', '')
    """
    return rate_unit(unit or "units", order) if unit or order else ""


def conversion_factor(unit: str, *, to: str) -> float:
    """Factor that turns a value in `unit` into a value in `to`.

    Raises
    ------
    UnitError
        If either is unknown, or the dimensions differ.

    Examples
    --------
    >>> round(conversion_factor("rad", to="deg"), 4)
    57.2958
    """
    if unit == to:
        return 1.0
    try:
        return float(_registry().Quantity(1.0, _parsed(unit)).to(_parsed(to)).magnitude)
    except pint.DimensionalityError as error:
        raise UnitError(f"unit {unit!r} cannot be turned into {to!r}: {error}") from error
