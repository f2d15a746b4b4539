"""A cache of functions of arrays, for identifying one record or many records of one stimulus.

Several steps of `hmpim.identify` begin with the input: its transform, its splines, the phase of its
sweep, the regressors of its windows; several test whether a residual is white. Inside `keeping()`
each of these is computed once and found again by the samples themselves; outside nothing is cached.
`identify` caches for itself, a batch for all its records.

A long array is recognised by its address and not by its samples: nobody may write to one inside
`keeping`. At most one long result of a function is cached, and only if the function asks for it.
"""

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import wraps
from typing import Any, ParamSpec, TypeVar, cast
from weakref import ref

import numpy as np

__all__ = ["keeping", "kept", "recent"]

_MOST = 64
"""Cached results; the least recently used is dropped first."""

_LARGEST = 1 << 18
"""Bytes of the largest array that is recognised by its samples, and cached: 32 768 samples."""

_Named = dict[int, tuple[ref[np.ndarray], Hashable, Hashable]]
"""By address: an array, its fingerprint, and its name in keys."""

_SHOWN = 4096
"""Samples of a longer array that its fingerprint includes."""

_FEW = 8
"""Results that `recent` keeps; only the last one for larger inputs."""

_KEPT: ContextVar[OrderedDict[Hashable, Any] | None] = ContextVar("kept", default=None)
_NAMED: ContextVar[_Named] = ContextVar("named")

P = ParamSpec("P")
T = TypeVar("T")


@contextmanager
def keeping() -> Iterator[None]:
    """Cache results until the end of the block; an inner block shares the cache of the outer one.

    Examples
    --------
    >>> made = []
    >>> @kept
    ... def total(u):
    ...     made.append(u.size)
    ...     return float(u.sum())
    >>> with keeping():
    ...     total(np.ones(3)), total(np.ones(3)), total(np.zeros(3))
    (3.0, 3.0, 0.0)
    >>> made
    [3, 3]
    """
    if _KEPT.get() is not None:
        yield
        return
    kept_before, named_before = _KEPT.set(OrderedDict()), _NAMED.set({})
    try:
        yield
    finally:
        _KEPT.reset(kept_before)
        _NAMED.reset(named_before)


def kept(function: Callable[P, T], *, long: bool = False) -> Callable[P, T]:
    """Cache a function of arrays and plain values inside `keeping`.

    Results are shared: nobody may write to them, and arrays are read-only. A long result is cached
    only with `long`, and only until the next one.
    """

    @wraps(function)
    def cached(*args: P.args, **kwargs: P.kwargs) -> T:
        known = _KEPT.get()
        if known is None:
            return function(*args, **kwargs)
        key = _key(function, (*args, *kwargs.items()))
        if key in known:
            known.move_to_end(key)
            return cast(T, known[key])
        last, found = known.get(cached, (None, None))
        if last == key:
            return cast(T, found)
        found = function(*args, **kwargs)
        short = _is_short(found)
        if not short and not long:
            return found
        if isinstance(found, np.ndarray):
            found.flags.writeable = False
        if short:
            known[key] = found
        else:
            known[cached] = key, found
        while len(known) > _MOST:
            known.popitem(last=False)
        return found

    return cached


def recent(owner: Hashable, nbytes: int) -> "Recent | None":
    """Recent results of one owner, for inputs of `nbytes`; None outside `keeping`."""
    known = _KEPT.get()
    if known is None:
        return None
    made = known.setdefault((owner, "recent"), Recent())
    made.most = _FEW if nbytes <= _LARGEST else 1
    return cast(Recent, made)


class Recent(OrderedDict[Hashable, Any]):
    """A few results; the oldest is dropped first."""

    most = 1

    def __setitem__(self, key: Hashable, value: Any) -> None:
        super().__setitem__(key, value)
        while len(self) > self.most:
            self.popitem(last=False)


def _key(function: Callable[..., Any], values: tuple[Any, ...]) -> Hashable:
    """Key of a call, by samples or for long arrays by address."""
    parts: list[Hashable] = [function]
    for value in values:
        if isinstance(value, np.ndarray):
            parts += [value.shape, value.dtype.char, _name_of(value)]
        else:
            parts.append(value)
    return tuple(parts)


def _name_of(array: np.ndarray) -> Hashable:
    """Name of an array in keys: its bytes, hashed once, or an object for a long array."""
    named = _NAMED.get()
    long = array.nbytes > _LARGEST
    fingerprint: Hashable = _some_of(array) if long else array.tobytes()
    known = named.get(id(array))
    if known is not None and known[0]() is array and known[1] == fingerprint:
        return known[2]
    if len(named) > 4 * _MOST:
        named.clear()
    name = object() if long else fingerprint
    named[id(array)] = ref(array), fingerprint, name
    return name


def _some_of(array: np.ndarray) -> Hashable:
    """Fingerprint of a long array, to notice a change."""
    total: Hashable = array.flat[:: 1 + array.size // _SHOWN].sum().item()
    return total


def _is_short(found: Any) -> bool:
    """Whether a result holds no long array."""
    if isinstance(found, np.ndarray):
        return found.nbytes <= _LARGEST
    if isinstance(found, tuple):
        return all(map(_is_short, found))
    names = getattr(type(found), "__dataclass_fields__", ())
    return all(_is_short(getattr(found, name)) for name in names)
