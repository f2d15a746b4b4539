"""Tables of text: CSV and what goes by that name."""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import FormatError, UnitError
from hmpim.formats.readers.headings import named
from hmpim.formats.readers.protocol import ChannelInfo, Contents, Layout, Reader
from hmpim.formats.table import Table, read_text, table_of
from hmpim.record import Finding, Role, Series
from hmpim.units import conversion_factor

__all__ = ["KINDS", "MARK", "TEXT", "TIME_NAMES", "channels", "heading_of", "read", "sniff"]

TIME_NAMES = ("time", "t")

MARK = "hmpim/record/1 "
"""What the comment starts with in which `write_csv` notes what a table cannot hold."""

KINDS: dict[str, Role] = {
    "inputs": "input",
    "outputs": "output",
    "references": "reference",
    "auxiliary": "auxiliary",
}
"""Names in that comment, and the role of the channels that they list."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Column:
    """A column with its name, its unit, and its place among the table's columns."""

    name: str
    unit: str
    heading: str
    place: int


def sniff(head: bytes, path: Path) -> bool:
    r"""Say whether a file is text: no NUL in it, unless it is UTF-16.

    Examples
    --------
    >>> sniff(b"time,u,y\n0,1,2\n", Path("a.log")), sniff(b"\x89HDF\r\n\x1a\n\0", Path("a.csv"))
    (True, False)
    """
    return head.startswith((b"\xff\xfe", b"\xfe\xff")) or b"\0" not in head


def channels(path: Path, layout: Layout) -> Contents:
    """List the columns of a table, without time."""
    table, columns, notes = _opened(path)
    clock = _clock(columns, layout, table.name, ours=notes is not None)
    data = tuple(
        ChannelInfo(name=c.name, unit=c.unit, samples=len(table.rows))
        for c in columns
        if c is not clock
    )
    time = None if clock is None else clock.name
    if notes is None:
        return Contents(format="text", channels=data, time=time)
    return Contents(
        format="text",
        channels=data,
        time=time,
        inputs=tuple(c["name"] for c in notes["inputs"]),
        outputs=tuple(c["name"] for c in notes["outputs"]),
        references=tuple(c["name"] for c in notes["references"]),
        auxiliary=tuple(c["name"] for c in notes["auxiliary"]),
        fs=notes["fs"],
        band=notes["band"],
        intersample=notes["intersample"],
        source=notes["source"],
        findings=notes["findings"],
    )


def read(path: Path, names: Sequence[str], layout: Layout) -> tuple[Series, ...]:
    """Read columns of a table by name."""
    table, columns, notes = _opened(path)
    clock = _clock(columns, layout, table.name, ours=notes is not None)
    data = {c.name: c for c in columns if c is not clock}
    chosen = [data[name] for name in names]
    wanted = [*([clock] if clock is not None else []), *chosen]
    numbers = table.numbers([table.columns[c.place] for c in wanted])
    stamps = None
    if clock is not None:
        stamps = _seconds(numbers[:, 0], clock, table.name)
        numbers = numbers[:, 1:]
    return tuple(
        Series(name=c.name, values=numbers[:, k], time=stamps, unit=c.unit)
        for k, c in enumerate(chosen)
    )


TEXT = Reader(format="text", sniff=sniff, channels=channels, read=read)


def _opened(path: Path) -> tuple[Table, list[_Column], dict[str, Any] | None]:
    table = table_of(read_text(path), name=path.name)
    notes = _notes(table)
    return table, _columns(table, notes), notes


def heading_of(name: str, unit: str) -> str:
    """Return the heading of a column that `write_csv` writes.

    Examples
    --------
    >>> heading_of("u", "deg"), heading_of("a,b", "")
    ('u [deg]', '"a,b"')
    """
    name = re.sub(r"[\x00-\x1f\x7f\x85\u2028\u2029\"]+", " ", name).strip() or "channel"
    heading = f"{name} [{unit}]" if unit else name
    return f'"{heading}"' if re.search(r"[,;#]", heading) else heading


def _notes(table: Table) -> dict[str, Any] | None:
    """What `write_csv` noted, if the columns are still those it wrote."""
    for comment in table.comments:
        if not comment.startswith(MARK):
            continue
        try:
            notes: dict[str, Any] = json.loads(comment.removeprefix(MARK))
            notes = {"references": [], "auxiliary": [], "findings": [], **notes}
            headings = [heading_of(str(c["name"]), str(c["unit"])) for c in _noted(notes)]
            if notes["intersample"] not in (None, "zoh", "foh", "bandlimited"):
                raise ValueError(f"intersample {notes['intersample']!r}")
            if notes["band"] is not None:
                low, high = notes["band"]
                notes["band"] = (float(low), float(high))
            notes["fs"], notes["source"] = float(notes["fs"]), str(notes["source"])
            notes["findings"] = tuple(Finding.from_dict(f) for f in notes["findings"])
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise FormatError(
                f"{table.name!r} starts with a spoilt comment {comment[:40]!r} ({error}); "
                "delete that line"
            ) from None
        found = [c.heading for c in table.columns]
        if len(found) == 1 + len(headings) and found[1:] == [h.strip('"') for h in headings]:
            return notes
    return None


def _noted(notes: dict[str, Any]) -> list[dict[str, Any]]:
    """Channels of every kind, in the order of the columns."""
    return [channel for kind in KINDS for channel in notes[kind]]


def _columns(table: Table, notes: dict[str, Any] | None) -> list[_Column]:
    if notes is not None:
        pairs = [("time", "s"), *((c["name"], c["unit"]) for c in _noted(notes))]
    else:
        pairs = [named(c.heading) for c in table.columns]
    columns = [
        _Column(name=name, unit=unit, heading=column.heading, place=place)
        for place, ((name, unit), column) in enumerate(zip(pairs, table.columns, strict=True))
    ]
    names = [c.name for c in columns[1 if notes is not None else 0 :]]
    for name in names:
        if names.count(name) > 1:
            raise FormatError(f"{table.name!r} has two columns {name!r}; give each its own name")
    return columns


def _clock(columns: Sequence[_Column], layout: Layout, file: str, *, ours: bool) -> _Column | None:
    """The column of time; the first one in a table that `write_csv` wrote."""
    if ours and layout.time is None:
        return columns[0]
    listed = ", ".join(c.name for c in columns)
    if layout.time is not None:
        wanted = layout.time
        found = [c for c in columns if wanted in (c.name, c.heading)]
        found = found or [c for c in columns if c.name.casefold() == wanted.casefold()]
        if len(found) != 1:
            raise FormatError(f"{file!r} has no time column {wanted!r}; its columns are {listed}")
        return found[0]
    usual = [c for c in columns if c.name.casefold() in TIME_NAMES]
    if len(usual) > 1:
        raise FormatError(
            f"{file!r} has several time columns ({', '.join(c.name for c in usual)}); "
            "say which with time=... or --time"
        )
    return usual[0] if usual else None


def _seconds(stamps: NDArray[np.float64], clock: _Column, file: str) -> NDArray[np.float64]:
    if clock.unit in ("", "s"):
        return stamps
    try:
        factor = conversion_factor(clock.unit, to="s")
    except UnitError:
        raise UnitError(
            f"{file!r}, column {clock.heading!r}: {clock.unit!r} is no unit of time; "
            "use s, ms or us"
        ) from None
    whole = round(1 / factor) if factor < 1 else 0
    # 1 ms is stored as a rounded 0.001, while a division by 1000 rounds once only.
    return stamps / whole if whole and abs(whole * factor - 1) < 1e-12 else stamps * factor
