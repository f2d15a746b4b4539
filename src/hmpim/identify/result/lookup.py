"""Pairs by the names of their channels, output first, as in a transfer matrix."""

from collections.abc import Sequence
from typing import Protocol, TypeVar

from hmpim.arguments import shown
from hmpim.errors import RecordError

__all__ = ["find_pair"]


class _Pair(Protocol):
    @property
    def input(self) -> str: ...
    @property
    def output(self) -> str: ...


P = TypeVar("P", bound=_Pair)


def find_pair(pairs: Sequence[P], key: object, *, holder: str) -> P:
    """Return the pair of ``(output, input)``, or of an output alone that has one input.

    A `RecordError` names the pairs of the `holder` if there is none, or a choice of inputs.
    """
    known = ", ".join(f"({p.output!r}, {p.input!r})" for p in pairs)
    if isinstance(key, tuple) and len(key) == 2:
        for pair in pairs:
            if (pair.output, pair.input) == key:
                return pair
        output, source = key
        raise RecordError(f"there is no pair ({output!r}, {source!r}); {holder} has {known}")
    if not isinstance(key, str):
        raise RecordError(
            f"{shown(key)} names no pair; give the output and the input, as one of {known}"
        )
    found = [pair for pair in pairs if pair.output == key]
    if len(found) == 1:
        return found[0]
    if not found:
        raise RecordError(f"there is no output {key!r}; {holder} has {known}")
    choice = " or ".join(f"[{p.output!r}, {p.input!r}]" for p in found)
    raise RecordError(f"output {key!r} has {len(found)} inputs; say which: {choice}")
