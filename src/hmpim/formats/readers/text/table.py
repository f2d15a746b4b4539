"""A table of text: its start understood, its samples still on disk."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import FormatError
from hmpim.formats.readers.protocol import COMPLEX, listed
from hmpim.formats.readers.text.cells import (
    BLANKS,
    DECIMAL_COMMA,
    column_of,
    is_complex,
    number,
    numbers,
    split_row,
    split_rows,
    thousands,
    without_codes,
)
from hmpim.formats.readers.text.dialect import (
    Dialect,
    decimal_in,
    find_dialect,
    is_comment,
    is_row,
    uncommented,
)
from hmpim.formats.readers.text.headings import Heading, find_headings
from hmpim.formats.readers.text.instruments import Steady, known_headings, steady_time
from hmpim.formats.readers.text.stamps import StampColumn, looks_like_stamp

__all__ = ["Columns", "Lines", "Table", "open_table", "read_columns"]

_MARKED = re.compile(r"[-+]?\d{1,3}([,.' ]\d{3})+([.,]\d+)?")
_HEAD = 1500  # lines from which a table is understood
_ENOUGH = 50  # numbers, of which one of equal length is the shortest with a chance of 2 %


class Lines(Protocol):
    """Anything that gives lines of text: a text file, or the sheet of a workbook."""

    @property
    def name(self) -> str:
        """Name of the file, for messages."""
        ...

    def blocks(self) -> Iterator[str]:
        """Yield the text in blocks of whole lines; the last one may lack its end."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """What the start of a text file shows.

    Parameters
    ----------
    lines : Lines
        Where the text comes from.
    start : tuple of str
        Its first lines.
    comments : tuple of str
        Comment lines above the samples, without what marks them.
    dialect : Dialect
        How the table is written.
    headings : tuple of Heading
        Columns that have a name.
    printed : bool
        False if the file has no line of names.
    steady : Steady or None
        Start and step of time, where the file prints those instead of stamps.
    """

    lines: Lines
    start: tuple[str, ...]
    comments: tuple[str, ...]
    dialect: Dialect
    headings: tuple[Heading, ...]
    printed: bool
    steady: Steady | None

    def sample(self, position: int) -> list[str]:
        """Return the cells of one column among the first lines."""
        rows = [line for line in self.start[self.dialect.first :] if is_row(line, self.dialect)]
        return [split_row(row, self.dialect.delimiter)[position] for row in rows]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Columns:
    """Columns that were read.

    Parameters
    ----------
    time : ndarray, shape (n,), or None
        Stamps in s.
    values : tuple of ndarray, each shape (n,)
        One array for each column asked for; NaN where a cell is empty.
    cut_short : int
        Number of the last line, if it is cut short and was left out, else 0.
    """

    time: NDArray[np.float64] | None
    values: tuple[NDArray[np.float64], ...]
    cut_short: int


def open_table(text: Lines) -> Table:
    """Read the first lines of a text and tell how it is written.

    Raises
    ------
    FormatError
        If it is no table of text.
    """
    blocks = text.blocks()
    lines: list[str] = []
    for block in blocks:
        lines.extend(block.removesuffix("\n").split("\n"))
        if len(lines) >= _HEAD:
            break
    beyond = lines[_HEAD:]
    del lines[_HEAD:]
    dialect = find_dialect(lines, name=text.name)
    if dialect.decimal == ".":  # the first row with a fraction decides
        every = chain([lines, beyond], (block.split("\n") for block in blocks))
        marks = (decimal_in(rows, dialect) for rows in every)
        dialect = replace(dialect, decimal=next((mark for mark in marks if mark), "."))
    known = known_headings(lines, dialect)
    headings, printed = (
        (known, True) if known is not None else find_headings(lines, dialect, name=text.name)
    )
    steady = steady_time(lines, dialect, headings)
    if steady is not None:
        headings = tuple(h for h in headings if not _is_steady(h, steady))
    if dialect.first >= len(lines):
        names = listed([h.name for h in headings])
        raise FormatError(f"{text.name!r} has column names ({names}) and no samples; record again")
    comments = tuple(uncommented(line) for line in lines[: dialect.first] if is_comment(line))
    table = Table(
        lines=text,
        start=tuple(lines),
        comments=comments,
        dialect=dialect,
        headings=headings,
        printed=printed,
        steady=steady,
    )
    if dialect.decimal == ",":
        _refuse_thousands(table)
    return table


def _refuse_thousands(table: Table) -> None:
    """Refuse columns in which 1,025 is a thousand times as much as it would be read."""
    for column in table.headings:
        found = thousands(table.sample(column.position))
        if found is not None:
            raise FormatError(
                f"{table.lines.name!r}, column {column.text!r} holds {found[0]!r} and {found[1]!r}:"
                " its commas mark thousands; export the file without such marks"
            )


def _is_steady(heading: Heading, steady: Steady) -> bool:
    name = heading.text.casefold()
    return (
        heading.position == steady.skip
        or name in ("start", "increment")
        or name.startswith(("t0 =", "t0=", "tinc"))
    )


def read_columns(
    table: Table,
    wanted: Sequence[Heading],
    *,
    clock: Heading | None,
    stamps: StampColumn | None,
    codes: bool = True,
) -> Columns:
    """Read columns of a table, block by block.

    Parameters
    ----------
    table : Table
        The table.
    wanted : sequence of Heading
        Columns to read.
    clock : Heading or None
        The column of time.
    stamps : StampColumn or None
        How the column of time is read.
    codes : bool
        Whether the numbers that instruments send for "no number" are taken for such.

    Raises
    ------
    FormatError
        If a row is too short or too long, or a cell is no number; line and column are named.
    """
    every = range(len(wanted))
    parts: list[list[NDArray[np.float64]]] = []
    times: list[NDArray[np.float64]] = []
    cut_short = 0
    for block in _row_blocks(table):
        rows, lines = _bare(block.rows, table.dialect), block.lines
        bad = _first_bad_width(rows, table.dialect)
        if bad is not None:
            if not (block.last and bad == len(rows) - 1 and _is_short(rows[bad], table.dialect)):
                raise FormatError(_said_width(table, rows[bad], lines[bad]))
            cut_short = lines[bad]
            rows, lines = rows[:bad], lines[:bad]
        elif rows and not block.ended and _is_cut(rows[-1], table):
            cut_short = lines[-1]
            rows, lines = rows[:-1], lines[:-1]
        if not rows:
            continue
        time, arrays = _read_rows(table, rows, lines, wanted, clock, stamps)
        times.append(time)
        parts.append(arrays)
    joined = (np.concatenate([p[k] for p in parts]) if parts else np.empty(0) for k in every)
    values = tuple(without_codes(column) if codes else column for column in joined)
    stamped = None if clock is None else np.concatenate(times) if times else np.empty(0)
    return Columns(time=stamped, values=values, cut_short=cut_short)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Block:
    """Rows of samples, with the number of each line; `last` if no more follow.

    `ended` is False if the last row has no end of line.
    """

    rows: list[str]
    lines: Sequence[int]
    last: bool
    ended: bool


def _row_blocks(table: Table) -> Iterator[_Block]:
    blocks = table.lines.blocks()
    line = 1
    ahead = next(blocks, None)
    skip = table.dialect.first
    while ahead is not None:
        text, ahead = ahead, next(blocks, None)
        rows = text.removesuffix("\n").split("\n")
        lines: Sequence[int] = range(line, line + len(rows))
        line += len(rows)
        if skip:
            dropped = min(skip, len(rows))
            rows, lines, skip = rows[dropped:], lines[dropped:], skip - dropped
        odd = (
            "\n\n" in text
            or any(mark in text for mark in "#%/!")
            or any(row.isspace() or not row for row in rows[:1])
            or (rows and not rows[-1].strip())
            or "\n \n" in text
            or "\n\t\n" in text
        )
        if odd:
            kept = [k for k, row in enumerate(rows) if row.strip() and not is_comment(row)]
            rows, lines = [rows[k] for k in kept], [lines[k] for k in kept]
        yield _Block(rows=rows, lines=lines, last=ahead is None, ended=text.endswith("\n"))


def _bare(rows: list[str], dialect: Dialect) -> list[str]:
    """Rows without their quotes, if nothing but whole cells stands in them."""
    if not any('"' in row for row in rows) or dialect.delimiter == BLANKS:
        return rows
    bare = "\n".join(rows).replace('"', "").split("\n")
    as_wide = dialect.width - 1
    return bare if all(row.count(dialect.delimiter) == as_wide for row in bare) else rows


def _first_bad_width(rows: Sequence[str], dialect: Dialect) -> int | None:
    """Place of the first row that has not as many cells as the table has columns."""
    width, delimiter = dialect.width, dialect.delimiter
    if delimiter == BLANKS:
        counts = [len(row.split()) for row in rows]
    else:
        counts = [row.count(delimiter) + 1 for row in rows]
    if counts.count(width) == len(counts):
        return None
    for k, count in enumerate(counts):
        if count == width:
            continue
        cells = split_row(rows[k], delimiter)  # a delimiter within quotes
        if len(cells) < width or any(cells[width:]):
            return k
    return None


def _is_short(row: str, dialect: Dialect) -> bool:
    return len(split_row(row, dialect.delimiter)) < dialect.width


def _is_cut(row: str, table: Table) -> bool:
    """Whether a row without an end of line stops within its last number.

    It does if that is no number, or has fewer digits after the decimal mark than all others.
    """
    dialect = table.dialect
    cells = split_row(row, dialect.delimiter)
    if len(cells) != dialect.width or not dialect.numeric[-1]:
        return False
    if number(cells[-1], dialect.decimal) is None:
        return not looks_like_stamp(cells[-1])
    others = [_after(cell, dialect.decimal) for cell in table.sample(dialect.width - 1)[:-1]]
    return len(others) >= _ENOUGH and _after(cells[-1], dialect.decimal) < min(others)


def _after(cell: str, mark: str) -> int:
    """How many characters stand after the decimal mark."""
    return len(cell.partition(mark)[2])


def _said_width(table: Table, row: str, line: int) -> str:
    count, width = len(split_row(row, table.dialect.delimiter)), table.dialect.width
    message = f"{table.lines.name!r}, line {line} has {count} cells where {width} are needed"
    if table.dialect.delimiter == "," and count in (2 * width - 1, 2 * width):
        return f"{message}: a decimal comma is not a delimiter; export it with decimal points"
    return f"{message}; correct that line, or cut it out"


def _read_rows(
    table: Table,
    rows: Sequence[str],
    lines: Sequence[int],
    wanted: Sequence[Heading],
    clock: Heading | None,
    stamps: StampColumn | None,
) -> tuple[NDArray[np.float64], list[NDArray[np.float64]]]:
    """Stamps and columns of some rows: at once where they are plain, else cell by cell."""
    dialect = table.dialect
    dated = stamps is not None and stamps.kind != "number"
    at_once = [*([clock] if clock is not None and not dated else []), *wanted]
    found = numbers(
        rows,
        delimiter=dialect.delimiter,
        decimal=dialect.decimal,
        columns=[c.position for c in at_once],
    )
    if found is None:
        cut = split_rows(rows, dialect.delimiter)
        flat = list(chain.from_iterable(cells[: dialect.width] for cells in cut))
        arrays = [
            _checked(
                column_of(flat[c.position :: dialect.width], dialect.decimal), table, c, rows, lines
            )
            for c in at_once
        ]
    else:
        arrays = list(found)
    if stamps is None or clock is None:
        return np.empty(0), arrays
    if not dated:
        return stamps.scaled(arrays[0]), arrays[1:]
    cells = [row[clock.position] for row in split_rows(rows, dialect.delimiter)]
    return _checked(stamps.seconds(cells), table, clock, rows, lines), arrays


def _checked(
    read: NDArray[np.float64] | int,
    table: Table,
    column: Heading,
    rows: Sequence[str],
    lines: Sequence[int],
) -> NDArray[np.float64]:
    """Return a column that was read; say which cell is no number where it could not be."""
    if not isinstance(read, int):
        return read
    cell = split_row(rows[read], table.dialect.delimiter)[column.position]
    raise FormatError(_said_cell(table, column, cell, lines[read]))


def _said_cell(table: Table, column: Heading, cell: str, line: int) -> str:
    where = f"{table.lines.name!r}, line {line}, column {column.text!r}"
    cell = cell.strip()
    if table.dialect.decimal == "." and DECIMAL_COMMA.match(cell):
        return f"{where} holds {cell!r}, a decimal comma; export the file with decimal points"
    if table.dialect.decimal == "," and number(cell, ".") is not None:
        return f"{where} holds {cell!r}, where a decimal comma is used elsewhere; write one way"
    if _MARKED.fullmatch(cell):
        return f"{where} holds {cell!r}, with marks for thousands; export the file without them"
    if is_complex(cell, table.dialect.decimal):
        return f"{where} holds {cell[:40]!r}: {COMPLEX}"
    return f"{where} holds {cell[:40]!r}, which is not a number; correct it, or cut that row out"
