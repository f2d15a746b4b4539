"""A specification over a batch: bounds on parameters, held against each record's interval."""

import operator
import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmpim.batch.rows import PARAMETERS
from hmpim.batch.summary import column, unit_of
from hmpim.batch.table import BatchTable
from hmpim.errors import ArgumentError, UnitError
from hmpim.identify.result.groups import FIXED_UNITS
from hmpim.units import conversion_factor

__all__ = ["Bound", "Outcome", "held_against", "read_bound"]

_BOUND = re.compile(
    r"^\s*(?P<name>\w+)\s*(?P<sign><=|>=|<|>)\s*(?P<number>[-+]?[\d.]+(?:[eE][-+]?\d+)?)"
    r"\s*(?P<unit>\S*)\s*$"
)
_SIGNS: dict[str, Callable[..., NDArray[np.bool_]]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Bound:
    """A bound on one parameter.

    Parameters
    ----------
    text : str
        As it was written.
    name : str
        Parameter.
    sign : {'<', '<=', '>', '>='}
        Which side is wanted.
    number : float
        In `unit`.
    unit : str
        Empty for the parameter's own.
    """

    text: str
    name: str
    sign: str
    number: float
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """How many records meet a bound.

    Parameters
    ----------
    bound : Bound
        Which.
    passed, failed, unsure, untold : int
        Rows whose whole interval meets it, whose whole interval does not, whose interval holds the
        bound, and those without the parameter.
    """

    bound: Bound
    passed: int
    failed: int
    unsure: int
    untold: int


def read_bound(text: str) -> Bound:
    """Read a bound such as ``delay < 5ms``.

    Raises
    ------
    ArgumentError
        If it is none, or its unit not one of a time or a frequency where the parameter is.

    Examples
    --------
    >>> read_bound("delay < 5ms").number
    5.0
    >>> read_bound("speed < 5")
    Traceback (most recent call last):
    ...
    hmpim.errors.ArgumentError: 'speed < 5' bounds 'speed', which is not a parameter; ...
    """
    match = _BOUND.match(text)
    try:
        if match is None:
            raise ValueError(text)
        number = float(match["number"])
    except ValueError:
        raise ArgumentError(f"{text!r} is not a bound; write it as 'delay < 5ms'") from None
    if match["name"] not in PARAMETERS:
        raise ArgumentError(
            f"{text!r} bounds {match['name']!r}, which is not a parameter; choose one of "
            f"{', '.join(PARAMETERS)}"
        )
    bound = Bound(
        text=text.strip(), name=match["name"], sign=match["sign"], number=number, unit=match["unit"]
    )
    if bound.name in FIXED_UNITS:  # before any record is identified
        _factor(bound, FIXED_UNITS[bound.name])
    return bound


def _factor(bound: Bound, own: str) -> float:
    """What the bound's number is multiplied by to be in the parameter's own unit."""
    if not bound.unit:
        return 1.0
    try:
        return conversion_factor(bound.unit, to=own)
    except UnitError as error:
        raise ArgumentError(f"{bound.text!r}: {error}") from None


def held_against(table: BatchTable, bound: Bound) -> Outcome:
    """Count the records that meet a bound.

    Raises
    ------
    ArgumentError
        If the bound's unit is not one of the parameter's dimension.
    """
    limit = bound.number * _factor(bound, unit_of(table, bound.name))
    meets = _SIGNS[bound.sign]
    value, low, high = (column(table, bound.name + end) for end in ("", "_low", "_high"))
    there = np.isfinite(value)
    ends = [np.where(np.isfinite(low), low, -np.inf), np.where(np.isfinite(high), high, np.inf)]
    good = meets(ends[0], limit) & meets(ends[1], limit) & there
    bad = ~meets(ends[0], limit) & ~meets(ends[1], limit) & there
    return Outcome(
        bound=bound,
        passed=int(good.sum()),
        failed=int(bad.sum()),
        unsure=int((there & ~good & ~bad).sum()),
        untold=int((~there).sum()),
    )
