"""FRC's data logs, ``.wpilog``: a small format, read here.

Source: https://github.com/wpilibsuite/allwpilib/blob/main/wpiutil/doc/datalog.adoc
"""

import json
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import FormatError
from hmpim.formats.readers.logs.clock import seconds_since
from hmpim.formats.readers.logs.log import (
    Column,
    Group,
    Log,
    cut_short,
    list_log,
    take_series,
    unit_of,
)
from hmpim.formats.readers.protocol import Contents, Layout, Reader
from hmpim.record import Finding, Series

__all__ = ["WPILOG", "channels", "parse", "read", "sniff"]

_NUMBERS = {"double": "<f8", "float": "<f4", "int64": "<i8", "boolean": "?"}
_CONTROL = 0
_MOST = 64  # numbers of one array that become channels


def sniff(head: bytes, path: Path) -> bool:
    """Say whether a file is a data log of WPILib.

    Examples
    --------
    >>> sniff(b"WPILOG....", Path("a.wpilog")), sniff(b"u,y", Path("a.wpilog"))
    (True, False)
    """
    return head.startswith(b"WPILOG")


def channels(path: Path, layout: Layout) -> Contents:
    """List the entries."""
    return list_log(parse, path, layout)


def read(path: Path, names: Sequence[str], layout: Layout) -> tuple[Series, ...]:
    """Read entries by name: ``/drive/voltage``, ``/imu[2]``."""
    return take_series(parse, path, names, layout)


@dataclass(slots=True, kw_only=True)
class _Entry:
    """One entry: what it holds, and its records as they lie in the file."""

    name: str
    kind: str
    metadata: str
    stamps: list[int] = field(default_factory=list)
    payloads: list[bytes] = field(default_factory=list)


def parse(path: Path, layout: Layout) -> Log:
    """Open a file; each entry has a clock of its own, in µs."""
    data = path.read_bytes()
    if len(data) < 12:
        raise FormatError(f"{path.name!r} is cut short in its header; copy it again")
    version, extra = struct.unpack_from("<HI", data, 6)
    if version >> 8 != 1:
        raise FormatError(f"{path.name!r} is of version {version >> 8}.{version & 255}; 1 is read")
    entries: dict[int, _Entry] = {}
    ended: list[_Entry] = []
    end = len(data)
    said: tuple[Finding, ...] = ()
    place = 12 + extra
    while place < end:
        record = _record(data, place)
        if record is None:
            lost = end - place
            said = cut_short(f"the last {lost} bytes of the file are no whole record; left out")
            break
        number, stamp, start, place = record
        if number == _CONTROL:
            _control(data[start:place], entries, ended)
        elif number in entries:
            entries[number].stamps.append(stamp)
            entries[number].payloads.append(data[start:place])
    every = [e for e in (*ended, *entries.values()) if e.stamps]
    return Log(format="WPILOG", groups=tuple(_groups(every)), findings=said)


WPILOG = Reader(format="WPILOG", sniff=sniff, channels=channels, read=read, uses=())


def _record(data: bytes, place: int) -> tuple[int, int, int, int] | None:
    """Entry, stamp, start and end of a record; None if it is not all there."""
    bits = data[place]
    sizes = ((bits & 3) + 1, (bits >> 2 & 3) + 1, (bits >> 4 & 7) + 1)
    start = place + 1 + sum(sizes)
    if start > len(data) or bits & 128:
        return None
    values = []
    at = place + 1
    for size in sizes:
        values.append(int.from_bytes(data[at : at + size], "little"))
        at += size
    number, length, stamp = values
    if start + length > len(data) or stamp >= 2**62:
        return None
    return number, stamp, start, start + length


def _control(data: bytes, entries: dict[int, _Entry], ended: list[_Entry]) -> None:
    """Start or end an entry; a record that is damaged changes nothing."""
    if len(data) < 5:
        return
    number = int.from_bytes(data[1:5], "little")
    if data[0] == 0:
        words, at = [], 5
        for _ in range(3):
            if at + 4 > len(data):
                return
            length = int.from_bytes(data[at : at + 4], "little")
            words.append(data[at + 4 : at + 4 + length].decode("utf-8", "replace"))
            at += 4 + length
        name, kind, metadata = words
        if number in entries:
            ended.append(entries[number])
        entries[number] = _Entry(name=name, kind=kind, metadata=metadata)
    elif data[0] == 1 and number in entries:
        ended.append(entries.pop(number))


def _groups(entries: Sequence[_Entry]) -> Iterator[Group]:
    taken: set[str] = set()
    for entry in entries:
        name = entry.name
        while name in taken:  # ended and begun again
            name += "'"
        taken.add(name)
        columns, keep = _columns(entry, name)
        ticks = np.array(entry.stamps, dtype=np.int64)[keep]
        if columns:
            time = seconds_since(ticks, 0, per_second=10**6)
            yield Group(name=name, columns=columns, time=time, time_name="timestamp")


def _columns(entry: _Entry, name: str) -> tuple[tuple[Column, ...], NDArray[np.bool_]]:
    """Channels of an entry, and which of its records they have."""
    kind = entry.kind.removesuffix("[]")
    everything = np.ones(len(entry.payloads), dtype=bool)
    if kind not in _NUMBERS:
        count = len(entry.payloads)
        return (Column(name=name, load=None, samples=count),), everything
    size = np.dtype(_NUMBERS[kind]).itemsize
    lengths = np.array([len(p) for p in entry.payloads])
    usual = int(np.bincount(lengths).argmax()) if entry.kind.endswith("[]") else size
    if not 0 < usual <= _MOST * size or usual % size:
        return (), everything
    keep = lengths == usual
    joined = b"".join(p for p, kept in zip(entry.payloads, keep, strict=True) if kept)
    table = np.frombuffer(joined, dtype=_NUMBERS[kind]).reshape(-1, usual // size)
    labels = [f"{name}[{k}]" for k in range(table.shape[1])] if "[]" in entry.kind else [name]
    unit = _unit(entry.metadata)
    return tuple(
        Column(name=label, unit=unit, samples=len(table), load=partial(_values, table, k))
        for k, label in enumerate(labels)
    ), keep


def _unit(metadata: str) -> str:
    """Unit, where the program that wrote the log states one: ``{"unit": "rad/s"}``."""
    try:
        found = json.loads(metadata) if metadata else {}
    except ValueError:
        return ""
    return unit_of(found.get("unit") or found.get("units")) if isinstance(found, dict) else ""


def _values(table: NDArray[np.generic], place: int) -> NDArray[np.generic]:
    return np.ascontiguousarray(table[:, place])
