"""What follows from some samples alone, kept while records of one stimulus are identified.

Half a dozen steps of `hmpim.identify` begin with the input: its transform, its splines, the phase
of its sweep, the regressors of its windows; half a dozen ask whether a residual is white. Inside
`keeping()` each of these is made once for all samples that are met, and found again by the samples
themselves; outside nothing is kept. `identify` keeps for itself, a batch for all its records.

A long array is recognised by its address and not by its samples: nobody may write to one inside
`keeping`. Of long results at most the last one is kept, and only for functions that ask for it.
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
"""Results that are kept; that used longest ago goes first."""

_LARGEST = 1 << 18
"""Bytes of an array up to which it is told by its samples, and kept: 32 768 samples."""

_Named = dict[int, tuple[ref[np.ndarray], Hashable, Hashable]]
"""By address: an array, what shows that it is still the same, and what it is called."""

_SHOWN = 4096
"""Samples of a longer array that are looked at to see whether it has changed."""

_FEW = 8
"""Results that `recent` keeps; of larger inputs the last one alone."""

_KEPT: ContextVar[OrderedDict[Hashable, Any] | None] = ContextVar("kept", default=None)
_NAMED: ContextVar[_Named] = ContextVar("named")

P = ParamSpec("P")
T = TypeVar("T")


@contextmanager
def keeping() -> Iterator[None]:
    """Keep what follows from inputs alone until the end of the block; within another, for that.

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
    """Have a function of arrays and plain values made once for equal arguments, inside `keeping`.

    What it returns is handed out again: nobody may write to it, and arrays are locked. A long
    result is kept only with `long`, and only until the next one.
    """

    @wraps(function)
    def told(*args: P.args, **kwargs: P.kwargs) -> T:
        known = _KEPT.get()
        if known is None:
            return function(*args, **kwargs)
        key = _key(function, (*args, *kwargs.items()))
        if key is None:
            return function(*args, **kwargs)
        if key in known:
            known.move_to_end(key)
            return cast(T, known[key])
        last, found = known.get(told, (None, None))
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
            known[told] = key, found
        while len(known) > _MOST:
            known.popitem(last=False)
        return found

    return told


def recent(owner: Hashable, nbytes: int) -> "Recent | None":
    """What one owner has made of late, of inputs of so many bytes; None outside `keeping`."""
    known = _KEPT.get()
    if known is None:
        return None
    made = known.setdefault((owner, "recent"), Recent())
    made.most = _FEW if nbytes <= _LARGEST else 1
    return cast(Recent, made)


class Recent(OrderedDict[Hashable, Any]):
    """A few results, that made longest ago going first."""

    most = 1

    def __setitem__(self, key: Hashable, value: Any) -> None:
        super().__setitem__(key, value)
        while len(self) > self.most:
            self.popitem(last=False)


def _key(function: Callable[..., Any], values: tuple[Any, ...]) -> Hashable | None:
    """The samples themselves, or for many of them where they stand; None if one is no value."""
    parts: list[Hashable] = [function]
    for value in values:
        if isinstance(value, np.ndarray):
            parts += [value.shape, value.dtype.char, _name_of(value)]
        elif isinstance(value, Hashable):
            parts.append(value)
        else:
            return None
    return tuple(parts)


def _name_of(array: np.ndarray) -> Hashable:
    """What stands for an array: its bytes, whose hash is made once; of a long one its address."""
    named = _NAMED.get()
    long = array.nbytes > _LARGEST
    shown: Hashable = _some_of(array) if long else array.tobytes()
    known = named.get(id(array))
    if known is not None and known[0]() is array and known[1] == shown:
        return known[2]
    if len(named) > 4 * _MOST:
        named.clear()
    name = object() if long else shown
    named[id(array)] = ref(array), shown, name
    return name


def _some_of(array: np.ndarray) -> Hashable:
    """What shows that a long array is still the same."""
    shown: Hashable = array.flat[:: 1 + array.size // _SHOWN].sum().item()
    return shown


def _is_short(found: Any) -> bool:
    """Whether a result holds no long array."""
    if isinstance(found, np.ndarray):
        return found.nbytes <= _LARGEST
    if isinstance(found, tuple):
        return all(map(_is_short, found))
    names = getattr(type(found), "__dataclass_fields__", ())
    return all(_is_short(getattr(found, name)) for name in names)
