"""ArduPilot's DataFlash logs, ``.bin`` (extra `ardupilot`: pymavlink)."""

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
from hmpim.formats.readers.protocol import Contents, Layout, Reader, need
from hmpim.record import Finding, Series

__all__ = ["ARDUPILOT", "channels", "parse", "read", "sniff"]

_HEAD = b"\xa3\x95"
_FMT = 0x80
_ABOUT = ("FMT", "FMTU", "UNIT", "MULT", "PARM", "MSG", "FILE")
_SIZES = {"h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4", "q": "<i8", "Q": "<u8", "L": "<i4"}
_KINDS = {
    **_SIZES,
    **{"b": "<i1", "B": "<u1", "M": "<u1", "f": "<f4", "d": "<f8", "g": "<f2"},
    **{"c": "<i2", "C": "<u2", "e": "<i4", "E": "<u4"},
    **{"n": "S4", "N": "S16", "Z": "S64", "a": "<i2"},
}


def sniff(head: bytes, path: Path) -> bool:
    r"""Say whether a file starts with a DataFlash description of messages.

    Examples
    --------
    >>> sniff(b"\xa3\x95\x80\x80\x59FMT\0", Path("a.bin")), sniff(b"u,y", Path("a.bin"))
    (True, False)
    """
    return head[:3] == _HEAD + bytes([_FMT])


def channels(path: Path, layout: Layout) -> Contents:
    """List the fields of all messages."""
    return list_log(parse, path, layout)


def read(path: Path, names: Sequence[str], layout: Layout) -> tuple[Series, ...]:
    """Read fields by name: ``RATE.RDes``, ``IMU[1].GyrX``."""
    return take_series(parse, path, names, layout)


def parse(path: Path, layout: Layout) -> Log:
    """Open a file; messages have one clock, in µs since the start of the system.

    pymavlink finds the messages and reads their descriptions, units and multipliers.
    """
    reader = need("pymavlink.DFReader", extra="ardupilot", what="an ArduPilot log")
    file = reader.DFReader_binary(str(path), zero_time_base=True)
    data = np.frombuffer(file.data_map, dtype=np.uint8)
    groups = []
    covered, end = 0, 0
    for kind, form in file.formats.items():
        places = np.asarray(file.offsets[kind], dtype=np.int64)
        places = places[places + form.len <= data.size]
        covered += places.size * form.len
        end = max(end, int(places.max()) + form.len) if places.size else end
        if form.name not in _ABOUT and places.size:
            groups += list(_groups(data, places, form))
    said: tuple[Finding, ...] = ()
    lost = data.size - covered
    if lost > 528:  # the padding of a block of flash memory may be as long
        message = f"{lost} of {data.size} bytes are no messages and were left out; look for gaps"
        said = (Finding(code="damaged_parts", message=message, severity="info", parameters=()),)
    elif _HEAD in data[end:].tobytes():
        said = cut_short("the last message of the file is cut short; what came after it is lost")
    return Log(format="ArduPilot", groups=tuple(groups), findings=said)


ARDUPILOT = Reader(
    format="ArduPilot", sniff=sniff, channels=channels, read=read, extra="ardupilot", foreign=True
)


def _groups(data: NDArray[np.uint8], places: NDArray[np.int64], form: Any) -> Iterator[Group]:
    """A message as a group, or one for each of its instances."""
    layout = _layout(form)
    if layout is None or layout.itemsize + 3 != form.len:
        return
    rows = data[places[:, None] + np.arange(3, form.len)]
    table = np.ascontiguousarray(rows).view(layout)[:, 0]
    clock = next((c for c in ("TimeUS", "TimeMS") if c in form.columns), None)
    if clock is None:
        return
    if form.instance_field is None:
        yield _group(table, form, form.name, clock)
        return
    for number in np.unique(table[form.instance_field]):
        mine = table[table[form.instance_field] == number]
        yield _group(mine, form, f"{form.name}[{number}]", clock)


def _layout(form: Any) -> np.dtype[Any] | None:
    """How a message lies in the file; None if it is described in a way that nobody knows."""
    kinds = [_KINDS.get(letter) for letter in form.format]
    if None in kinds or len(kinds) != len(form.columns) or len(set(form.columns)) != len(kinds):
        return None
    shapes = [(32,) if letter == "a" else () for letter in form.format]
    return np.dtype(list(zip(form.columns, kinds, shapes, strict=True)))


def _group(table: NDArray[Any], form: Any, name: str, clock: str) -> Group:
    columns = []
    for k, field in enumerate(form.columns):
        if field in (clock, form.instance_field):
            continue
        plain = table.dtype[field].kind in "iuf" and not table.dtype[field].shape
        load = partial(_values, table, field, form.msg_mults[k]) if plain else None
        unit = unit_of(form.get_unit(field).replace("degheading", "deg"))
        columns.append(Column(name=f"{name}.{field}", unit=unit, samples=table.size, load=load))
    per_second = 10**6 if clock == "TimeUS" else 1000
    return Group(
        name=name,
        columns=tuple(columns),
        time=seconds_since(table[clock], 0, per_second=per_second),
        time_name=clock,
    )


def _values(table: NDArray[Any], field: str, factor: float | None) -> NDArray[np.float64]:
    """Values with the factor that the format itself has, such as 0.01 of type 'c'."""
    values = table[field].astype(np.float64)
    if factor is None:
        return values
    return values / round(1 / factor) if 0 < factor < 1 else values * factor
