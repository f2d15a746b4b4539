"""Values that are equal when their fields are, arrays included."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np

__all__ = ["ByValue"]


class ByValue:
    """Base of frozen dataclasses that hold arrays: equality and hash by value.

    A dataclass made with ``eq=False`` compares by identity, and the equality that dataclasses
    make for themselves fails on arrays. Fields with ``compare=False`` do not count. NaN equals
    NaN, as what is read back from a file equals what was written.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> @dataclass(frozen=True, slots=True, kw_only=True, eq=False)
    ... class Curve(ByValue):
    ...     values: np.ndarray
    >>> Curve(values=np.array([1.0, np.nan])) == Curve(values=np.array([1.0, np.nan]))
    True
    >>> len({Curve(values=np.zeros(2)), Curve(values=-np.zeros(2)), Curve(values=np.zeros(3))})
    2
    """

    __slots__ = ()

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        if type(self) is not type(other):
            return NotImplemented
        return all(_same(getattr(self, n), getattr(other, n)) for n in _compared(self))

    def __hash__(self) -> int:
        return hash((type(self), *(_hashable(getattr(self, n)) for n in _compared(self))))


def _compared(value: Any) -> list[str]:
    return [field.name for field in fields(value) if field.compare]


def _same(one: Any, other: Any) -> bool:
    if one is other:
        return True
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        if not (isinstance(one, np.ndarray) and isinstance(other, np.ndarray)):
            return False
        number = np.issubdtype(one.dtype, np.inexact) and np.issubdtype(other.dtype, np.inexact)
        return np.array_equal(one, other, equal_nan=number)
    if isinstance(one, tuple | list):
        return type(one) is type(other) and len(one) == len(other) and all(map(_same, one, other))
    if isinstance(one, Mapping):
        return (
            isinstance(other, Mapping)
            and one.keys() == other.keys()
            and all(_same(one[key], other[key]) for key in one)
        )
    return bool(one == other) or bool(one != one and other != other)  # NaN


def _hashable(value: Any) -> Any:
    """Something that is hashable and equal for what is equal."""
    if isinstance(value, np.ndarray):
        values = value + 0.0  # one zero, and numbers of one type
        return value.shape, b"" if np.isnan(values).any() else values.tobytes()
    if isinstance(value, tuple | list):
        return tuple(map(_hashable, value))
    if isinstance(value, Mapping):
        return frozenset((key, _hashable(value[key])) for key in value)
    return "nan" if isinstance(value, float) and value != value else value
