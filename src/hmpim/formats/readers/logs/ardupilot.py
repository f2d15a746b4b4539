"""ArduPilot's DataFlash logs, ``.bin``: a small format that describes itself, read here.

Source: https://ardupilot.org/dev/docs/code-overview-adding-a-new-log-message.html
"""

from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
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
    per_count,
    take_series,
    unit_of,
)
from hmpim.formats.readers.protocol import Contents, Layout, Reader
from hmpim.record import Finding, Series

__all__ = ["ARDUPILOT", "channels", "parse", "read", "sniff"]

_HEAD = b"\xa3\x95"
_FMT = 0x80
_FMT_SIZE = 89
_ABOUT = ("FMT", "FMTU", "UNIT", "MULT", "PARM", "MSG", "FILE")
_KINDS = {
    **{"b": "<i1", "B": "<u1", "M": "<u1", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4"},
    **{"q": "<i8", "Q": "<u8", "g": "<f2", "f": "<f4", "d": "<f8"},
    **{"c": "<i2", "C": "<u2", "e": "<i4", "E": "<u4", "L": "<i4"},
    **{"n": "S4", "N": "S16", "Z": "S64", "a": "<i2"},
}
# Types that are counts of a fraction; a multiplier that the log states for them says the same.
_PARTS = {"c": 100, "C": 100, "e": 100, "E": 100, "L": 10_000_000}


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


@dataclass(slots=True, kw_only=True)
class _Form:
    """A message as the log describes it, and where it lies in the file."""

    kind: int
    name: str
    length: int
    letters: str
    columns: tuple[str, ...]
    places: "array[int]" = field(default_factory=lambda: array("q"))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Meanings:
    """What the log says of the fields' units: by kind of message, and what the letters mean."""

    fields: Mapping[int, tuple[str, str]]
    units: Mapping[str, str]
    factors: Mapping[str, float]


def parse(path: Path, layout: Layout) -> Log:
    """Open a file; messages have one clock, in µs since the start of the system."""
    data = path.read_bytes()
    forms = _scan(data)
    bytes_of = np.frombuffer(data, dtype=np.uint8)
    tables = [(form, _table(bytes_of, form)) for form in forms if form.places]
    meanings = _meanings(tables)
    covered = sum(len(form.places) * form.length for form in forms)
    end = max((form.places[-1] + form.length for form in forms if form.places), default=0)
    groups = [
        group
        for form, table in tables
        if form.name not in _ABOUT and table is not None
        for group in _groups(table, form, meanings)
    ]
    said: tuple[Finding, ...] = ()
    lost = len(data) - covered
    if lost > 528:  # the padding of a block of flash memory may be as long
        message = f"{lost} of {len(data)} bytes are no messages and were left out; look for gaps"
        said = (Finding(code="damaged_parts", message=message, severity="info", parameters=()),)
    elif _HEAD in data[end:]:
        said = cut_short("the last message of the file is cut short; what came after it is lost")
    return Log(format="ArduPilot", groups=tuple(groups), findings=said)


ARDUPILOT = Reader(format="ArduPilot", sniff=sniff, channels=channels, read=read, uses=())


def _scan(data: bytes) -> list[_Form]:
    """Find every message; after bytes that are none, look for the next head."""
    first = _Form(
        kind=_FMT,
        name="FMT",
        length=_FMT_SIZE,
        letters="BBnNZ",
        columns=("Type", "Length", "Name", "Format", "Columns"),
    )
    forms = [first]
    known = {_FMT: first}
    place, end = 0, len(data)
    while 0 <= place <= end - 3:
        form = known.get(data[place + 2]) if data[place : place + 2] == _HEAD else None
        if form is None or place + form.length > end:
            place = data.find(_HEAD, place + 1)
            continue
        form.places.append(place)
        if form is first:
            told = _told(data[place + 3 : place + _FMT_SIZE])
            before = known.get(told.kind) if told is not None else None
            if told is not None and told.kind != _FMT and _differs(told, before):
                known[told.kind] = told
                forms.append(told)
        place += form.length
    return _named_apart(forms)


def _told(body: bytes) -> _Form | None:
    """What a description says; None if it says nothing that can be."""
    kind, length = body[0], body[1]
    name, letters, columns = (_words(part) for part in (body[2:6], body[6:22], body[22:86]))
    if length < 4 or not name:
        return None
    return _Form(
        kind=kind,
        name=name,
        length=length,
        letters=letters,
        columns=tuple(columns.split(",")) if columns else (),
    )


def _differs(form: _Form, before: _Form | None) -> bool:
    return before is None or any(
        getattr(form, part) != getattr(before, part)
        for part in ("name", "length", "letters", "columns")
    )


def _named_apart(forms: Sequence[_Form]) -> list[_Form]:
    """Forms of which no two are called the same, as those that were described again are."""
    taken: set[str] = set()
    for form in forms:
        if not form.places:
            continue
        while form.name in taken:
            form.name += "'"
        taken.add(form.name)
    return list(forms)


def _words(data: bytes) -> str:
    return data.split(b"\0", 1)[0].decode("utf-8", "replace")


def _table(data: NDArray[np.uint8], form: _Form) -> NDArray[Any] | None:
    """The messages of a kind as rows; None if they are described in a way that nobody knows."""
    kinds = [_KINDS.get(letter) for letter in form.letters]
    names = form.columns
    if None in kinds or len(kinds) != len(names) or len(set(names)) != len(names) or "" in names:
        return None
    shapes = [(32,) if letter == "a" else () for letter in form.letters]
    layout = np.dtype(list(zip(names, kinds, shapes, strict=True)))
    if layout.itemsize + 3 != form.length:
        return None
    windows = np.lib.stride_tricks.sliding_window_view(data, form.length)
    rows = np.ascontiguousarray(windows[np.asarray(form.places)][:, 3:])
    return rows.view(layout)[:, 0]


def _meanings(tables: Sequence[tuple[_Form, NDArray[Any] | None]]) -> _Meanings:
    """Units and factors by their letters, as the messages FMTU, UNIT and MULT state them."""
    fields: dict[int, tuple[str, str]] = {}
    units: dict[str, str] = {}
    factors: dict[str, float] = {}
    for form, table in tables:
        if table is None:
            continue
        names = set(form.columns)
        if form.name == "FMTU" and {"FmtType", "UnitIds", "MultIds"} <= names:
            for row in table:
                fields[int(row["FmtType"])] = (_letters(row["UnitIds"]), _letters(row["MultIds"]))
        elif form.name == "UNIT" and {"Id", "Label"} <= names:
            units |= {_letter(row["Id"]): _words(bytes(row["Label"])) for row in table}
        elif form.name == "MULT" and {"Id", "Mult"} <= names:
            factors |= {_letter(row["Id"]): float(row["Mult"]) for row in table}
    return _Meanings(fields=fields, units=units, factors=factors)


def _letters(value: Any) -> str:
    return bytes(value).decode("latin-1") if isinstance(value, bytes) else ""


def _letter(value: Any) -> str:
    """A letter that a message holds as its number."""
    return chr(int(value) & 255) if isinstance(value, np.integer) else ""


def _groups(table: NDArray[Any], form: _Form, meanings: _Meanings) -> Iterator[Group]:
    """A message as a group, or one for each of its instances."""
    clock = next((c for c in ("TimeUS", "TimeMS") if c in form.columns), None)
    if clock is None or table.dtype[clock].kind not in "iu" or table.dtype[clock].shape:
        return
    place = meanings.fields.get(form.kind, ("", ""))[0].find("#")
    instance = form.columns[place] if 0 <= place < len(form.columns) else None
    if instance is None or table.dtype[instance].kind not in "iu" or table.dtype[instance].shape:
        yield _group(table, form, form.name, clock, meanings)
        return
    for number in np.unique(table[instance]):
        mine = table[table[instance] == number]
        yield _group(mine, form, f"{form.name}[{number}]", clock, meanings, without=instance)


def _group(
    table: NDArray[Any],
    form: _Form,
    name: str,
    clock: str,
    meanings: _Meanings,
    without: str = "",
) -> Group:
    columns = []
    for k, label in enumerate(form.columns):
        if label in (clock, without):
            continue
        plain = table.dtype[label].kind in "iuf" and not table.dtype[label].shape
        unit = _unit(form.kind, k, meanings)
        parts, factor = _factor(form, k, meanings)
        load = partial(_values, table, label, parts, factor) if plain else None
        columns.append(
            Column(
                name=f"{name}.{label}",
                unit=unit,
                samples=table.size,
                load=load,
                scale=per_count(factor, unit),
            )
        )
    per_second = 10**6 if clock == "TimeUS" else 1000
    return Group(
        name=name,
        columns=tuple(columns),
        time=seconds_since(table[clock], 0, per_second=per_second),
        time_name=clock,
    )


def _unit(kind: int, place: int, meanings: _Meanings) -> str:
    letters = meanings.fields.get(kind, ("", ""))[0]
    label = meanings.units.get(letters[place : place + 1], "")
    for compass in ("heading", "latitude", "longitude"):
        label = label.replace(f"deg{compass}", "deg")
    return unit_of(label)


def _factor(form: _Form, place: int, meanings: _Meanings) -> tuple[int, float]:
    """Counts of which a unit has so many (0: not a whole number), and the unit per count."""
    parts = _PARTS.get(form.letters[place])
    if parts is not None:
        return parts, 1 / parts
    letters = meanings.fields.get(form.kind, ("", ""))[1]
    stated = meanings.factors.get(letters[place : place + 1], 1.0)
    if not 1e-30 < abs(stated) < 1e30:  # 0 stands for none
        return 1, 1.0
    whole = round(1 / stated)
    return (whole if abs(whole * stated - 1) < 1e-9 else 0), stated


def _values(table: NDArray[Any], label: str, parts: int, factor: float) -> NDArray[np.float64]:
    """Values in the unit of the field, divided by a whole number where there is one."""
    with np.errstate(invalid="ignore", over="ignore"):  # a damaged number stays one
        values = np.asarray(table[label].astype(np.float64))
        return values / parts if parts else values * factor
