"""What the arguments of a public call must be, read from its own annotations.

Annotations say it to people and to mypy already; `checked` says it to those who run no type
checker, in one sentence. Arrays are left to the function itself, which knows their shape.
"""

import inspect
import math
import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import is_dataclass
from functools import cache, lru_cache, wraps
from numbers import Integral, Real
from typing import Any, Literal, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmpim.errors import ArgumentError

__all__ = [
    "MOST_SAMPLES",
    "check_argument",
    "check_rate",
    "check_size",
    "checked",
    "fits",
    "generator",
    "numbers_of",
    "shown",
    "size_of",
]

Thing = TypeVar("Thing", bound=Callable[..., Any])

MOST_SAMPLES = 100_000_000
"""Samples that are made at once, at most.

A stimulus keeps time, position, velocity and acceleration, and its formulas take as much again:
64 bytes a sample, 6.4 GB in all. A day at 1 kHz is 86 400 000 samples.
"""

_BYTES = 64

_LARGEST = 1e30
"""Largest size that is computed with, and its reciprocal the smallest: the eighth power of either
is still a number, and no unit makes what can be measured so large or so small."""

_SOURCES = {
    "Record": "read a file with hmpim.read(path), or take hmpim.Record.from_arrays(...)",
    "Stimulus": "make one with hmpim.design(...)",
    "Limits": "make them with hmpim.Limits(...)",
    "Identification": "take what hmpim.identify(record) or hmpim.load(path) returns",
    "PairIdentification": "take one pair of a result, such as result['y', 'u']",
    "Model": "make one with hmpim.to_model(pair) or hmpim.Model(...)",
    "Waveform": "take one such as hmpim.Sweep(...)",
    "Generator": "give a seed such as 1, or numpy.random.default_rng(1)",
}


def checked(thing: Thing) -> Thing:
    """Refuse arguments of another kind than the annotations of a function or dataclass say.

    Parameters
    ----------
    thing : callable
        A function, or a dataclass.

    Returns
    -------
    callable
        The same; a call with something else raises `ArgumentError`, which quotes it.

    Examples
    --------
    >>> @checked
    ... def halved(length: float, unit: Literal["s", "ms"] = "s") -> float:
    ...     return length / 2
    >>> halved(3)
    1.5
    >>> halved("3")
    Traceback (most recent call last):
    hmpim.errors.ArgumentError: length = '3' is not a number
    >>> halved(3, unit="h")
    Traceback (most recent call last):
    hmpim.errors.ArgumentError: unit = 'h' is not one of 's', 'ms'
    """
    if is_dataclass(thing):
        made = cast(Any, thing)
        made.__init__ = _guarded(made.__init__, made)
        return thing
    return cast(Thing, _guarded(thing, thing))


def _guarded(function: Callable[..., Any], owner: Any) -> Callable[..., Any]:
    signature = inspect.signature(function)

    @lru_cache(maxsize=1)
    def hints() -> dict[str, Any]:
        found = get_type_hints(owner)
        return {k: v for k, v in found.items() if k in signature.parameters and not _array(v)}

    @wraps(function)
    def guarded(*args: Any, **kwargs: Any) -> Any:
        try:
            given = signature.bind(*args, **kwargs).arguments
        except TypeError:
            given = {}  # a name too many or too few: Python says it well, below
        for name, hint in hints().items():
            if name in given:
                check_argument(name, given[name], hint)
        return function(*args, **kwargs)

    return guarded


def check_argument(name: str, value: Any, hint: Any) -> None:
    """Refuse a value that is not what an annotation says.

    Raises
    ------
    ArgumentError
        The message names it, quotes it and says what is wanted.

    Examples
    --------
    >>> check_argument("band", 5.0, tuple[float, float])
    Traceback (most recent call last):
    hmpim.errors.ArgumentError: band = 5.0 is not two numbers
    """
    if not fits(value, hint):
        raise ArgumentError(f"{name} = {shown(value)} is not {_described(hint)}")


def fits(value: Any, hint: Any) -> bool:
    """Whether a value is what an annotation says, numpy's numbers and lists for tuples included.

    Examples
    --------
    >>> fits(np.float32(1.0), float), fits(True, float), fits([1, 2], tuple[float, float])
    (True, False, True)
    """
    if type(value) is hint:
        return True  # most are, and a call asks of each number of a list
    origin, inner = get_origin(hint), get_args(hint)
    if hint is Any or isinstance(hint, TypeVar) or _array(hint):
        return True
    if origin in (Union, types.UnionType):
        return any(fits(value, one) for one in inner)
    if origin is Literal:
        return any(type(value) is type(one) and value == one for one in inner)
    if hint in (float, int):
        if isinstance(value, np.ndarray) and value.ndim == 0:
            value = value.item()
        real = isinstance(value, Real if hint is float else Integral)
        return real and not isinstance(value, (bool, np.bool_))
    if hint is None or hint is types.NoneType:
        return value is None
    if origin is tuple or origin in (Sequence, list):
        return _fits_all(value, inner, pair=origin is tuple and inner[-1] is not Ellipsis)
    if origin in (Mapping, dict):
        return isinstance(value, Mapping) and all(
            fits(k, inner[0]) and fits(v, inner[1]) for k, v in value.items()
        )
    if origin is Callable or hint is Callable:
        return callable(value)
    kind = origin or hint
    try:
        return isinstance(value, kind)
    except TypeError:  # a protocol that is not checked at run time, and the like
        return True


def _fits_all(value: Any, inner: tuple[Any, ...], *, pair: bool) -> bool:
    """Whether a list or tuple holds what it should; a string is neither."""
    if isinstance(value, (str, bytes)) or not isinstance(value, (Sequence, np.ndarray)):
        return False
    if isinstance(value, np.ndarray) and (value.ndim != 1 or not value.size or _masked(value)):
        return False
    if pair:
        return len(value) == len(inner) and all(map(fits, value, inner))
    return all(fits(one, inner[0]) for one in value)


def _masked(value: object) -> bool:
    return isinstance(value, np.ma.MaskedArray)


@cache
def _array(hint: Any) -> bool:
    parts = set(get_args(hint)) if get_origin(hint) in (Union, types.UnionType) else {hint}
    return set(get_args(ArrayLike)) <= parts or any(get_origin(p) is np.ndarray for p in parts)


def _described(hint: Any) -> str:
    """What is wanted, in words, and where it comes from."""
    words = _words(hint)
    sources = [text for name, text in _SOURCES.items() if name in words.split()]
    return f"{words}; {sources[0]}" if len(sources) == 1 else words


def _words(hint: Any) -> str:
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        parts = [_words(one) for one in inner if one is not types.NoneType]
        parts += ["None"] * (types.NoneType in inner)
        return " or ".join(dict.fromkeys(parts))
    if origin is Literal:
        return "one of " * (len(inner) > 1) + ", ".join(map(repr, inner))
    if origin is tuple and inner[-1] is not Ellipsis:
        return f"{_COUNTS.get(len(inner), len(inner))} {_plural(inner[0])}"
    if origin in (tuple, Sequence, list):
        return f"a list of {_plural(inner[0])}"
    if origin in (Mapping, dict):
        return f"a mapping of {_plural(inner[0])} to {_plural(inner[1])}"
    if origin is Callable or hint is Callable:
        return "a function"
    name: str = getattr(origin or hint, "__name__", str(hint))
    return _NAMES.get(name, f"{'an' if name[0] in 'AEIOU' else 'a'} {name}")


_COUNTS = {2: "two", 3: "three"}
_NAMES = {
    "float": "a number",
    "int": "a whole number",
    "str": "a text",
    "bool": "True or False",
    "PathLike": "a path",
    "Limits": "Limits",
}


def _plural(hint: Any) -> str:
    words = _words(hint)
    if get_origin(hint) is Literal:
        return words.removeprefix("one of ")
    if " or " in words or not words.startswith(("a ", "an ")):
        return words
    return words.partition(" ")[2] + "s"


def shown(value: object) -> str:
    """Quote a value in one short line.

    Examples
    --------
    >>> shown("x.csv"), shown(np.zeros((2, 3))), shown([1.0] * 1000)
    ("'x.csv'", 'an array of shape (2, 3)', '[1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0,…')
    """
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape}"
    if is_dataclass(value) and not isinstance(value, type):
        return f"a {type(value).__name__}"
    text = " ".join(repr(value).split())
    return text if len(text) <= _LONGEST else text[:_LONGEST].rstrip() + "…"


_LONGEST = 41


def check_rate(fs: float) -> None:
    """Refuse a sampling rate that is not a positive number of Hz.

    Raises
    ------
    ArgumentError
        If it is zero, negative, NaN or infinite.

    Examples
    --------
    >>> check_rate(200.0)
    """
    if not 0.0 < fs < math.inf:
        raise ArgumentError(f"fs = {fs} Hz is not a sampling rate; it must be positive and finite")


def check_size(name: str, value: float, unit: str = "", *, added: bool = False) -> None:
    """Refuse a size so large or so small that numbers computed from it overflow.

    Zero, infinity and NaN are left to the caller.

    Parameters
    ----------
    name, value, unit : str, float, str
        The size, and what it is called.
    added : bool
        True for a size that is only added to others, so that it may be as small as it likes.

    Raises
    ------
    ArgumentError
        If it is beyond 1e30, or below 1e-30.

    Examples
    --------
    >>> check_size("fs", 200.0, "Hz")
    >>> check_size("fs", 1e308, "Hz")
    Traceback (most recent call last):
    hmpim.errors.ArgumentError: fs = 1e+308 Hz is too large to compute with; sizes ... 1e+30
    """
    size = abs(value)
    small = size < 1.0 / _LARGEST and size != 0 and not added
    if not math.isfinite(size) or not (small or size > _LARGEST):
        return
    much = "small" if small else "large"
    raise ArgumentError(
        f"{name} = {f'{value:g} {unit}'.rstrip()} is too {much} to compute with; "
        f"sizes may be from {1.0 / _LARGEST:g} to {_LARGEST:g}"
    )


def generator(rng: np.random.Generator | int | None) -> np.random.Generator:
    """Return a generator of random numbers from a generator, a seed, or None for a fresh one.

    Raises
    ------
    ArgumentError
        If it is none of these, or a negative seed.

    Examples
    --------
    >>> int(generator(1).integers(100)) == int(np.random.default_rng(1).integers(100))
    True
    >>> generator(-1)
    Traceback (most recent call last):
    hmpim.errors.ArgumentError: rng = -1 is not a seed; give a whole number from 0 on
    """
    if isinstance(rng, np.random.Generator):
        return rng
    if rng is not None and (not fits(rng, int) or rng < 0):
        raise ArgumentError(f"rng = {shown(rng)} is not a seed; give a whole number from 0 on")
    return np.random.default_rng(rng)


def numbers_of(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """Return values as finite real numbers, shape (n,); one number alone as shape ().

    Raises
    ------
    ArgumentError
        If they are none: text, complex, hidden by a mask, NaN, infinite or of more dimensions.

    Examples
    --------
    >>> numbers_of("frequency", [1, 2.5])
    array([1. , 2.5])
    >>> numbers_of("frequency", [1j])
    Traceback (most recent call last):
    hmpim.errors.ArgumentError: frequency = [1j] is not made of real numbers
    """
    try:
        array = np.asarray(values)
        real = array.dtype.kind in "iuf" and not np.ma.is_masked(values)
    except ValueError:  # rows of unequal lengths
        real = False
    if not real:
        raise ArgumentError(f"{name} = {shown(values)} is not made of real numbers")
    if array.ndim > 1:
        raise ArgumentError(f"{name} = {shown(values)} is not one row of numbers; give shape (n,)")
    bad = np.flatnonzero(~np.isfinite(array))
    if bad.size:
        value = np.atleast_1d(array)[bad[0]]
        raise ArgumentError(f"{name} holds {value} at place {bad[0]}; give finite numbers")
    return np.asarray(array, dtype=np.float64)


def size_of(duration: float, fs: float) -> int:
    """Number of samples at k/fs in a duration, if there is room for them.

    Parameters
    ----------
    duration : float
        In s.
    fs : float
        In Hz.

    Raises
    ------
    ArgumentError
        If they are more than `MOST_SAMPLES`.

    Examples
    --------
    >>> size_of(10.0, 200.0)
    2000
    >>> size_of(1e9, 200.0)
    Traceback (most recent call last):
    hmpim.errors.ArgumentError: 1e+09 s at 200 Hz are 2e+11 samples, 1.28e+04 GB of memory; ...
    """
    count = duration * fs
    if not count <= MOST_SAMPLES:
        raise ArgumentError(
            f"{duration:g} s at {fs:g} Hz are {count:.3g} samples, {count * _BYTES / 1e9:.3g} GB "
            f"of memory; at most {MOST_SAMPLES:.0e} samples are made at once, so take a shorter "
            "time or a lower rate"
        )
    return int(np.ceil(count - 1e-6))
