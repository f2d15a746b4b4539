"""Whether records are of one test: repeats, one stimulus at several levels, or one record twice."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TypeVar

import numpy as np

from hmpim.errors import ArgumentError, RecordError
from hmpim.identify.worth import FEW
from hmpim.record import Record, uniform

__all__ = [
    "check_alike",
    "check_apart",
    "check_channels",
    "each_named",
    "names_of",
    "naming",
    "same_at_levels",
]

R = TypeVar("R")

_SAME_RATE = 1e-3
"""Relative difference up to which the rates of two clocks are the same."""


def names_of(records: Sequence[Record], names: Sequence[str] | None) -> tuple[str, ...]:
    """Return what messages call the records: names in quotes, or numbers from 0."""
    if names is None:
        return tuple(f"record {k}" for k in range(len(records)))
    if len(names) != len(records):
        raise ArgumentError(f"{len(names)} names are given for {len(records)} records; give each")
    return tuple(repr(name) for name in names)


@contextmanager
def naming(name: str, *, arguments: bool = False) -> Iterator[None]:
    """Begin what is refused of a record with what it is called.

    With `arguments`, what is refused of an argument too, where that depends on the record.
    """
    try:
        yield
    except RecordError as error:
        raise RecordError(f"{name}: {error}") from error
    except ArgumentError as error:
        if not arguments:
            raise
        raise ArgumentError(f"{name}: {error}") from error


def each_named(
    function: Callable[[Record], R], records: Sequence[Record], called: Sequence[str]
) -> list[R]:
    """Apply a function to each record; a refusal begins with what the record is called."""
    found = []
    for name, record in zip(called, records, strict=True):
        with naming(name):
            found.append(function(record))
    return found


def same_at_levels(records: Sequence[Record], *, names: Sequence[str] | None = None) -> bool:
    """Whether records are of one stimulus at several amplitudes, rather than repeats of it.

    Parameters
    ----------
    records : sequence of Record
        With the same channels.
    names : sequence of str, optional
        What messages call each record, such as its file.

    Returns
    -------
    bool
        True if the inputs are the same but for a factor, and that factor is not 1 for all.

    Examples
    --------
    >>> u = np.sin(np.arange(100.0) ** 2 / 300)
    >>> small, large = (Record.from_arrays({"u": k * u}, {"y": u}, fs=9.0) for k in (1, 3))
    >>> same_at_levels([small, large]), same_at_levels([small, small])
    (True, False)
    """
    aligned = each_named(uniform, records, names_of(records, names))
    changed = False
    for other in aligned[1:]:
        if len(other.inputs) != len(aligned[0].inputs):
            return False
        for one, two in zip(aligned[0].inputs, other.inputs, strict=True):
            length = min(one.values.size, two.values.size)
            first, second = (x.values[:length] - x.values[:length].mean() for x in (one, two))
            power = float(first @ first)
            factor = float(first @ second) / power if power else 0.0
            rest = float(np.linalg.norm(second - factor * first))
            if not factor > 0 or rest > FEW * float(np.linalg.norm(second)):
                return False
            changed = changed or abs(factor - 1) > FEW
    return changed


def check_channels(records: Sequence[Record], called: Sequence[str]) -> None:
    """Refuse records whose channels or units differ from the first one's.

    `called` is what messages call each.
    """
    first, *others = [(*r.inputs, *r.outputs) for r in records]
    for name, own in zip(called[1:], others, strict=True):
        names, known = [c.name for c in own], [c.name for c in first]
        if names != known:
            raise RecordError(
                f"{name} has channels {', '.join(names)} and {called[0]} has "
                f"{', '.join(known)}; give the same channels in the same order"
            )
        for one, other in zip(first, own, strict=True):
            if one.unit and other.unit and one.unit != other.unit:
                raise RecordError(
                    f"{one.name!r} is in {other.unit!r} in {name} and in {one.unit!r} in "
                    f"{called[0]}; units are not converted, give records in the same units"
                )


def check_alike(records: tuple[Record, ...], called: Sequence[str]) -> None:
    """Refuse records that are no repeats: other channels, rates or inputs."""
    check_channels(records, called)
    first = records[0]
    aligned = each_named(uniform, records, called)
    for k, record in enumerate(records[1:], start=1):
        if abs(record.fs / first.fs - 1) > _SAME_RATE:
            raise RecordError(
                f"{called[k]} is at {record.fs:g} Hz and {called[0]} at {first.fs:g} Hz; "
                "resample one"
            )
        for one, other in zip(aligned[0].inputs, aligned[k].inputs, strict=True):
            length = min(one.values.size, other.values.size)
            apart = float(np.std(one.values[:length] - other.values[:length]))
            size = float(np.std(one.values[:length]))
            if not size:
                raise RecordError(
                    f"input {one.name!r} of {called[0]} does not move; leave that record out"
                )
            if apart > FEW * size:
                raise RecordError(
                    f"input {one.name!r} of {called[k]} differs from that of {called[0]} by "
                    f"{100 * apart / size:.3g} % (r.m.s.); repeats need one "
                    "stimulus, from the same start"
                )


def check_apart(records: tuple[Record, ...], called: Sequence[str]) -> None:
    """Refuse one record given twice: it shows nothing of repeatability."""
    known: dict[bytes, str] = {}
    for name, record in zip(called, records, strict=True):
        measured = b"".join(channel.values.tobytes() for channel in record.outputs)
        if measured in known:
            raise RecordError(
                f"{known[measured]} and {name} hold the same samples; one record given twice "
                "is not two repeats, so repeat the test"
            )
        known[measured] = name
