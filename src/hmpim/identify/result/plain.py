"""Results as plain JSON values, and back."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from itertools import repeat
from typing import Any, Self, TypeVar, get_args, get_origin, get_type_hints

import numpy as np

__all__ = ["Plain", "by_fields", "fields_in", "plain", "restored"]

T = TypeVar("T")

_kinds_of = cache(get_type_hints)
"""Types of a dataclass's fields."""


class Plain:
    """Base of dataclasses that are written as plain JSON values by their fields, and read back."""

    __slots__ = ()

    def to_dict(self) -> dict[str, Any]:
        """Return the value as plain JSON values, without fields that are not compared."""
        return fields_in(self)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Read back what `to_dict` wrote."""
        return by_fields(cls, data)


def by_fields(cls: type[T], data: Mapping[str, Any]) -> T:
    """Return a dataclass from its fields as plain JSON values.

    A field that may be None may be missing, as in results of older versions. A field that is not
    compared is not read.
    """
    known: Any = cls
    kinds, made = _kinds_of(known), {}
    for field in fields(known):
        if field.compare and (field.name in data or field.default is not None):
            made[field.name] = restored(kinds[field.name], data[field.name])
    return cls(**made)


def fields_in(value: Any) -> dict[str, Any]:
    """Return the fields of a dataclass by name as plain JSON values, if they are compared."""
    return {f.name: plain(getattr(value, f.name)) for f in fields(value) if f.compare}


def plain(value: Any) -> Any:
    """Return a dataclass by its fields, arrays and tuples as lists, and all else as it is.

    Examples
    --------
    >>> plain((np.zeros(2), None))
    [[0.0, 0.0], None]
    """
    if hasattr(value, "to_dict"):
        return value.to_dict()
    if is_dataclass(value):
        return fields_in(value)
    if isinstance(value, np.ndarray):
        return value.tolist()
    return [plain(one) for one in value] if isinstance(value, tuple) else value


def restored(kind: Any, data: Any) -> Any:
    """Return what `plain` wrote of a value of some type.

    Examples
    --------
    >>> restored(tuple[float, ...] | None, [1.0, 2.0]), restored(tuple[float, ...] | None, None)
    ((1.0, 2.0), None)
    """
    inner = get_args(kind)
    if type(None) in inner:
        return None if data is None else restored(inner[0], data)
    if get_origin(kind) is tuple:
        kinds = repeat(inner[0], len(data)) if inner[-1] is ... else inner
        return tuple(restored(one, each) for one, each in zip(kinds, data, strict=True))
    if get_origin(kind) is np.ndarray:
        return np.asarray(data, dtype=np.float64)
    return kind.from_dict(data) if hasattr(kind, "from_dict") else data
