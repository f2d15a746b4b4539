"""Unit strings, checked with pint; values stay plain arrays.

The empty string means "no unit stated" and is taken as dimensionless.
"""

import math
import re
from functools import cache
from typing import TYPE_CHECKING

from hmpim.errors import UnitError

if TYPE_CHECKING:
    import pint

__all__ = [
    "check_unit",
    "conversion_factor",
    "quotient_unit",
    "rate_label",
    "rate_unit",
    "read_unit",
]


_PLAIN = frozenset({"", "deg", "rad", "m", "mm", "V", "A", "N", "s", "Hz", "N*m"})
"""Units that need no registry to be known, which takes long to load."""


@cache
def _registry() -> "pint.UnitRegistry[float]":
    import pint  # half a second where Dask is installed, which it then loads

    return pint.UnitRegistry()


def _mismatch() -> type[Exception]:
    import pint

    return pint.DimensionalityError


@cache
def _parsed(unit: str) -> "pint.Unit":
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
    if unit not in _PLAIN:
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


def quotient_unit(above: str, below: str) -> str:
    """Return a unit over another one, as it is read unambiguously; '' where the two are the same.

    Examples
    --------
    >>> quotient_unit("V", "deg"), quotient_unit("deg", "deg/s"), quotient_unit("", "V")
    ('V/deg', 'deg/(deg/s)', '1/V')
    """
    if above == below:
        return ""
    return (
        f"{above or '1'}/({below})"
        if re.search(r"[/* ]", below)
        else f"{above or '1'}/{below or '1'}"
    )


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
        If either is unknown, the dimensions differ, or their zeros do, as of 'degC' and 'K'; or if
        one is in counts.

    Examples
    --------
    >>> round(conversion_factor("rad", to="deg"), 4)
    57.2958
    """
    return 1.0 if unit == to else _factor(unit, to)


_ANGLES = {("deg", "rad"): math.pi / 180.0, ("rad", "deg"): 180.0 / math.pi}


@cache
def _factor(unit: str, to: str) -> float:
    if (unit, to) in _ANGLES:  # asked for by every table; the registry takes half a second
        return _ANGLES[unit, to]
    if unit and to and _counts(unit) != _counts(to):
        raise UnitError(
            f"unit {unit!r} cannot be turned into {to!r}: what a count is worth is not known; "
            "scale the channel"
        )
    try:
        zero, size = (
            float(_registry().Quantity(value, _parsed(unit)).to(_parsed(to)).magnitude)
            for value in (0.0, 1.0)
        )
    except _mismatch() as error:
        raise UnitError(f"unit {unit!r} cannot be turned into {to!r}: {error}") from error
    if zero:
        raise UnitError(f"unit {unit!r} cannot be turned into {to!r} by a factor: its zero differs")
    return size


def _counts(unit: str) -> list[object]:
    """Powers of counts in a unit, which pint takes for numbers, and so for radians."""
    items = _registry().Quantity(1.0, _parsed(unit)).unit_items()
    return [power for name, power in items if name.endswith("count")]


# By how they are written: what pint takes for something else, or for nothing.
_SPELLINGS: dict[str, str | None] = {
    "Nm": "N*m",  # pint: number times metre
    "N m": "N*m",
    "Nmm": "N*mm",
    "mNm": "mN*m",
    "Nm/rad": "N*m/rad",
    "º": "deg",
    "º/s": "deg/s",
    "dps": "deg/s",
    "Vpp": "V",
    "amp": "A",
    "amps": "A",  # pint: attometre per second
    "volt": "V",
    "volts": "V",
    "ampere": "A",
    "amperes": "A",
    "second": "s",
    "seconds": "s",
    "degree": "deg",
    "degrees": "deg",
    "radian": "rad",
    "radians": "rad",
    "°": "deg",
    "°/s": "deg/s",
    "°/s²": "deg/s**2",
    "LSB": "count",
    "lsb": "count",
    "Grad": None,  # German degree, or gon; pint: gigaradian
    "grad": None,
}


def read_unit(text: str) -> str | None:
    """Return a unit as instruments and spreadsheets write it in a spelling that pint knows.

    Parameters
    ----------
    text : str
        Such as 'Volt', 'm/s2', 'dps', 'Nm', '°/s'.

    Returns
    -------
    str or None
        None if it is not known, or means different things to different people ('Grad').

    Examples
    --------
    >>> read_unit("Volt"), read_unit("m/s2"), read_unit("dps"), read_unit("Nm"), read_unit("deg")
    ('V', 'm/s**2', 'deg/s', 'N*m', 'deg')
    >>> read_unit("filtered") is None
    True
    """
    text = text.strip()
    for spelling in (text, text.casefold()):
        if spelling in _SPELLINGS:
            return _SPELLINGS[spelling]
    powers = re.sub(r"(?<=[A-Za-z])([23])\b", r"**\1", text)
    words = [text.casefold()] if len(text) > 3 and text.isalpha() else []
    for candidate in (text, powers, *words):
        if candidate and not re.fullmatch(r"[\d.+\- ]+", candidate):
            try:
                return check_unit(candidate)
            except UnitError:
                continue
    return None
