"""Tables of text as channels: CSV and what goes by that name."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import FormatError, UnitError
from hmpim.formats.readers.protocol import (
    COMPLEX,
    WORDS,
    ChannelInfo,
    Contents,
    Layout,
    Reader,
    listed,
)
from hmpim.formats.readers.text.cells import is_complex
from hmpim.formats.readers.text.headings import Heading, named
from hmpim.formats.readers.text.instruments import stated_time_unit
from hmpim.formats.readers.text.notes import Notes, read_notes
from hmpim.formats.readers.text.source import is_text, open_source
from hmpim.formats.readers.text.stamps import (
    StampColumn,
    looks_like_stamp,
    stamp_column,
    unlikely_seconds,
)
from hmpim.formats.readers.text.table import Lines, Table, open_table, read_columns
from hmpim.record import Finding, Series
from hmpim.units import conversion_factor

__all__ = ["TEXT", "TIME_NAMES", "channels", "list_table", "read", "read_table", "sniff"]

_TIME_UNITS = ("s", "ms", "us", "ns", "sec", "seconds")

TIME_NAMES = frozenset(
    [
        *("time", "t", "timestamp", "time stamp", "elapsed", "elapsed time", "seconds", "second"),
        *("x_value", "x-axis"),  # LabVIEW, Keysight
        *(f"{name}_{unit}" for name in ("time", "t", "timestamp") for unit in _TIME_UNITS),
        *("zeit", "temps", "tempo", "tiempo", "tid", "tijd", "czas", "čas", "aika"),
        *("время", "时间", "時間"),
    ]
)
"""Names of the column of time, in any case; those of spreadsheets in other languages too."""


def sniff(head: bytes, path: Path) -> bool:
    """Say whether a file is text; see `is_text`."""
    return is_text(head)


def channels(path: Path, layout: Layout) -> Contents:
    """List the columns of a table, without time."""
    return list_table(open_source(path), layout, form="text")


def read(path: Path, names: Sequence[str], layout: Layout) -> tuple[Series, ...]:
    """Read columns of a table by name, on the clock of its column of time."""
    return read_table(open_source(path), names, layout)


TEXT = Reader(format="text", sniff=sniff, channels=channels, read=read, uses=())


def list_table(lines: Lines, layout: Layout, *, form: str) -> Contents:
    """List the columns of a table, wherever its text comes from; `form` names the format."""
    table = open_table(lines)
    notes = read_notes(table.comments, table.headings, file=lines.name)
    headings = notes.headings if notes is not None else table.headings
    clock, stamps, findings = _clock(table, headings, layout, own=notes is not None)
    data = tuple(
        ChannelInfo(name=h.name, unit=h.unit, holds=_holds(table, h))
        for h in headings
        if h is not clock
    )
    time = clock.name if clock is not None else "time" if table.steady is not None else None
    if notes is None:
        return Contents(
            format=form,
            channels=data,
            time=time,
            origin=None if stamps is None else stamps.origin,
            findings=findings,
        )
    return Contents(
        format=form,
        channels=data,
        time=time,
        inputs=notes.names["inputs"],
        outputs=notes.names["outputs"],
        references=notes.names["references"],
        auxiliary=notes.names["auxiliary"],
        fs=notes.fs,
        band=notes.band,
        intersample=notes.intersample,
        source=notes.source,
        findings=(*notes.findings, *findings),
        stopping=notes.stopping,
    )


def read_table(lines: Lines, names: Sequence[str], layout: Layout) -> tuple[Series, ...]:
    """Read columns of a table by name, wherever its text comes from."""
    table = open_table(lines)
    notes: Notes | None = read_notes(table.comments, table.headings, file=lines.name)
    headings = notes.headings if notes is not None else table.headings
    clock, stamps, _ = _clock(table, headings, layout, own=notes is not None)
    by_name = {h.name: h for h in headings if h is not clock}
    chosen = [by_name[name] for name in names]
    columns = read_columns(table, chosen, clock=clock, stamps=stamps, codes=notes is None)
    time: NDArray[np.float64] | None = columns.time
    if time is not None and stamps is not None and stamps.kind == "clock":
        time = _over_midnight(time)
    if time is None and table.steady is not None and columns.values:
        steady = table.steady
        time = np.asarray(steady.start + steady.step * np.arange(columns.values[0].size))
    short = _cut_short(columns.cut_short) if columns.cut_short else ()
    return tuple(
        Series(name=h.name, values=values, time=time, unit=h.unit, findings=short)
        for h, values in zip(chosen, columns.values, strict=True)
    )


def _cut_short(line: int) -> tuple[Finding, ...]:
    message = (
        f"the last line of the file ({line}) is cut short and left out; what came after it is lost"
    )
    return (Finding(code="cut_short", message=message, severity="info", parameters=()),)


def _holds(table: Table, heading: Heading) -> str:
    """What a column holds in place of real numbers; empty for a signal."""
    cells = [cell for cell in table.sample(heading.position) if cell]
    if table.dialect.numeric[heading.position] or not cells:
        return ""
    return COMPLEX if is_complex(cells[0], table.dialect.decimal) else WORDS


def _over_midnight(time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Times of day that run on when a day ends."""
    there = np.flatnonzero(np.isfinite(time))
    days = np.cumsum(np.diff(time[there], prepend=time[there[:1]]) < -43_200)
    out = time.copy()
    out[there] += 86_400.0 * days
    return out


def _clock(
    table: Table, headings: Sequence[Heading], layout: Layout, *, own: bool
) -> tuple[Heading | None, StampColumn | None, tuple[Finding, ...]]:
    """The column of time, how it is read, and what is to be said of it."""
    file = table.lines.name
    clock: Heading | None
    if own and layout.time is None:  # `write_csv` puts it first, whatever else is called so
        clock, unit = headings[0], "s"
    else:
        clock, unit = _clock_column(table, headings, layout)
    if clock is None:
        return None, None, ()
    unit = unit or clock.unit or stated_time_unit(table.start)
    cells = table.sample(clock.position)
    try:
        stamps = stamp_column(
            cells,
            unit=unit,
            decimal=table.dialect.decimal,
            heading=clock.text,
            exact=own,
        )
    except (FormatError, UnitError) as error:
        raise type(error)(f"{file!r}, {error}") from None
    if not stamps.told_by_size:
        first = np.empty(0) if unit or stamps.kind != "number" else stamps.seconds(cells)
        slow = () if isinstance(first, int) else unlikely_seconds(clock.name, first)
        return clock, stamps, slow
    told = Finding(
        code="time_unit",
        message=(
            f"{clock.name!r} states no unit; its size is that of Unix time in {stamps.unit}, and "
            "it is read so"
        ),
        severity="info",
        parameters=(),
    )
    return clock, stamps, (told,)


def _clock_column(
    table: Table, headings: Sequence[Heading], layout: Layout
) -> tuple[Heading | None, str]:
    file = table.lines.name
    if layout.time is not None:
        wanted = layout.time
        for name, unit in ((wanted, ""), named(wanted)):
            found = [h for h in headings if name in (h.name, h.text)]
            found = found or [h for h in headings if h.name.casefold() == name.casefold()]
            if not table.printed and name.isdigit():
                found = [h for h in headings if h.position == int(name) - 1]
            if len(found) == 1:
                return found[0], unit
        names = listed([h.name for h in headings])
        raise FormatError(f"{file!r} has no time column {wanted!r}; its columns are {names}")
    usual = [h for h in headings if h.name.casefold() in TIME_NAMES]
    if len(usual) > 1:
        plain = [h for h in usual if h.name.casefold() in ("time", "t")]
        usual = plain if len(plain) == 1 else usual
    if len(usual) > 1:
        raise FormatError(
            f"{file!r} has several time columns ({', '.join(h.name for h in usual)}); "
            "say which with time=... or --time"
        )
    if usual or table.steady is not None or layout.fs is not None:
        return (usual[0] if usual else None), ""
    # A first column in s, or of dates, is time whatever it is called.
    dated = [
        h
        for h in headings
        if table.dialect.numeric[h.position]
        and any(looks_like_stamp(cell) for cell in table.sample(h.position)[:3])
    ]
    if len(dated) == 1:
        return dated[0], ""
    first = headings[0] if headings else None
    return (first, "") if first is not None and _is_of_time(first.unit) else (None, "")


def _is_of_time(unit: str) -> bool:
    if not unit:
        return False
    try:
        conversion_factor(unit, to="s")
    except UnitError:
        return False
    return True
