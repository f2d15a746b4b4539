"""What follows from some samples alone, kept while records of one stimulus are identified.

Half a dozen steps of `hmpim.identify` begin with the input: its transform, its splines, the phase
of its sweep, the regressors of its windows; half a dozen ask whether a residual is white. Inside
`keeping()` each of these is made once for all samples that are met, and found again by the samples
themselves; outside nothing is kept. `identify` keeps for itself, a batch for all its records.
"""

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import wraps
from typing import Any, ParamSpec, TypeVar, cast

import numpy as np

__all__ = ["keeping", "kept"]

_MOST = 64
"""Results that are kept; that used longest ago goes first."""

_LARGEST = 1 << 18
"""Bytes of an array up to which anything is kept of it: 32 768 samples."""

_KEPT: ContextVar[OrderedDict[Hashable, Any] | None] = ContextVar("kept", default=None)

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
    token = _KEPT.set(OrderedDict())
    try:
        yield
    finally:
        _KEPT.reset(token)


def kept(function: Callable[P, T]) -> Callable[P, T]:
    """Have a function of arrays and plain values made once for equal arguments, inside `keeping`.

    What it returns is handed out again: nobody may write to it, and arrays are locked.
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
        found = function(*args, **kwargs)
        if isinstance(found, np.ndarray):
            found.flags.writeable = False
        known[key] = found
        while len(known) > _MOST:
            known.popitem(last=False)
        return found

    return told


def _key(function: Callable[..., Any], values: tuple[Any, ...]) -> Hashable | None:
    """The samples themselves, not where they stand; None for so many that none are kept."""
    parts: list[Hashable] = [function]
    for value in values:
        if not isinstance(value, np.ndarray):
            if not isinstance(value, Hashable):
                return None
            parts.append(value)
        elif value.nbytes > _LARGEST:
            return None
        else:
            parts += [value.shape, value.dtype.char, value.tobytes()]
    return tuple(parts)
