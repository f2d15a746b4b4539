"""Text with delimiters to named columns of numbers, and what is wrong with it, by line."""

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import FormatError

__all__ = ["Column", "Table", "read_text", "table_of"]

DELIMITERS = {",": "comma", ";": "semicolon", "\t": "tab"}
_DECIMAL_COMMA = re.compile(r"^\s*[-+]?\d+,\d+([eE][-+]?\d+)?\s*$")


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A column's heading, and where it stands.

    Parameters
    ----------
    heading : str
        As printed, without blanks and quotes around it.
    position : int
        Place in the row, from 0.
    """

    heading: str
    position: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Table:
    """A table of text, not yet turned into numbers.

    Parameters
    ----------
    name : str
        Name of the file, for messages.
    comments : tuple of str
        Comment lines before the heading, without their '#'.
    columns : tuple of Column
        The columns that have a heading.
    delimiter : str
        Comma, semicolon or tab.
    rows : tuple of str
        The lines that hold samples.
    lines : integer ndarray, shape (n,)
        Line number of each row in the file, from 1.
    """

    name: str
    comments: tuple[str, ...]
    columns: tuple[Column, ...]
    delimiter: str
    rows: Sequence[str]
    lines: NDArray[np.int64]

    def numbers(self, columns: Sequence[Column]) -> NDArray[np.float64]:
        """Return the wanted columns as numbers, shape (n, len(columns)).

        Raises
        ------
        FormatError
            If a cell is empty or not a number; its line and column are named.
        """
        wanted = [c.position for c in columns]
        quoted = any('"' in row for row in self.rows)
        try:
            values = np.loadtxt(
                self.rows,
                delimiter=self.delimiter,
                usecols=wanted,
                comments=None,
                ndmin=2,
                quotechar='"' if quoted else None,
            )
        except ValueError as error:
            self._blame(columns)
            raise FormatError(f"{self.name!r} cannot be read as numbers: {error}") from None
        return values

    def _blame(self, columns: Sequence[Column]) -> None:
        """Find the first cell that is no number and say where it stands."""
        for row, line in zip(self.rows, self.lines, strict=True):
            cells = split_row(row, self.delimiter)
            for column in columns:
                cell = cells[column.position].strip()
                try:
                    float(cell)
                except ValueError:
                    where = f"{self.name!r}, line {line}, column {column.heading!r}"
                    if not cell:
                        raise FormatError(
                            f"{where} is empty; cut that row out, or fill it"
                        ) from None
                    if _DECIMAL_COMMA.match(cell):
                        raise FormatError(
                            f"{where} holds {cell!r}, a decimal comma; "
                            "export the file with decimal points"
                        ) from None
                    raise FormatError(
                        f"{where} holds {cell!r}, which is not a number; "
                        "correct it, or cut that row out"
                    ) from None


def read_text(path: Path) -> str:
    """Return the text of a file that is text.

    Raises
    ------
    FormatError
        If there is none, it is a folder, cannot be opened, is binary, or is not UTF-8.

    Examples
    --------
    >>> read_text(Path("nowhere.csv"))
    Traceback (most recent call last):
    hmpim.errors.FormatError: there is no file 'nowhere.csv'; check the path
    """
    if path.is_dir():
        raise FormatError(f"{str(path)!r} is a folder; name the file in it")
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise FormatError(f"there is no file {str(path)!r}; check the path") from None
    except (OSError, ValueError) as error:  # a NUL in the path is a ValueError
        reason = getattr(error, "strerror", None) or error
        raise FormatError(f"{str(path)!r} cannot be opened: {reason}") from None
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise FormatError(f"{path.name!r} is UTF-16 text; save it as UTF-8")
    if b"\0" in data:
        raise FormatError(f"{path.name!r} is a binary file, not a table of text; export it as CSV")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise FormatError(
            f"{path.name!r}, line {line} holds the byte 0x{data[error.start]:02x}, which is not "
            "UTF-8 text; if it is a table, save it as UTF-8, else export it as CSV"
        ) from None


def table_of(text: str, *, name: str) -> Table:
    r"""Find heading, delimiter and rows of a text.

    Lines that are blank, or start with '#', are passed over. A heading may itself stand in the
    last comment before the first row, as numpy.savetxt writes it.

    Parameters
    ----------
    text : str
        The whole file.
    name : str
        Its name, for messages.

    Raises
    ------
    FormatError
        If it is empty, has no heading, no rows, or rows of unequal lengths.

    Examples
    --------
    >>> table = table_of("# a test\ntime;u\n0;1\n1;2\n", name="a.csv")
    >>> [c.heading for c in table.columns], table.numbers(table.columns).tolist()
    (['time', 'u'], [[0.0, 1.0], [1.0, 2.0]])
    """
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    comments: list[str] = []
    first = 0
    for first, line in enumerate(lines):  # noqa: B007  # needed below
        if line.strip() and not line.lstrip().startswith("#"):
            break
        if line.strip():
            comments.append(line.lstrip()[1:].strip())
    else:
        empty = "holds comments only" if comments else "is empty"
        raise FormatError(f"{name!r} {empty}; a line of column names and then samples are needed")
    numbered = [
        (k, line)
        for k, line in enumerate(lines[first:], start=first + 1)
        if line and not line.isspace() and not line.lstrip().startswith("#")
    ]
    heading = numbered[0][1]
    delimiter = _delimiter(heading, name)
    cells = [cell.strip() for cell in split_row(heading, delimiter)]
    if all(_is_number(cell) for cell in cells if cell):
        cells = _heading_in_comment(comments, delimiter, len(cells), name)
        comments.pop()
    else:
        numbered = numbered[1:]
    while cells and not cells[-1]:
        cells.pop()
    width = len(split_row(heading, delimiter))
    columns = tuple(Column(heading=c, position=k) for k, c in enumerate(cells) if c)
    if not numbered:
        raise FormatError(
            f"{name!r} has column names ({', '.join(cells)}) and no samples; record again"
        )
    rows = [line for _, line in numbered]
    numbers = np.array([k for k, _ in numbered], dtype=np.int64)
    _check_widths(rows, numbers, delimiter, width, name)
    return Table(
        name=name,
        comments=tuple(comments),
        columns=columns,
        delimiter=delimiter,
        rows=rows,
        lines=numbers,
    )


def split_row(row: str, delimiter: str) -> list[str]:
    """Cut a row into cells, quotes heeded.

    Examples
    --------
    >>> split_row('1,"a,b",3', ",")
    ['1', 'a,b', '3']
    """
    if '"' not in row:
        return row.split(delimiter)
    try:
        return next(csv.reader([row], delimiter=delimiter, skipinitialspace=True))
    except csv.Error as error:  # such as a quote that opens and is never closed in a long row
        raise FormatError(f"the row {row[:40]!r}... cannot be cut into cells: {error}") from None


def _delimiter(heading: str, name: str) -> str:
    outside_quotes = re.sub(r'"[^"]*"', "", heading)
    # A comma inside a unit, such as [N, m], is rarer than a tab or semicolon between columns.
    for delimiter in ("\t", ";", ","):
        if delimiter in outside_quotes:
            return delimiter
    raise FormatError(
        f"{name!r} starts with {heading.strip()[:60]!r}, in which no "
        f"{', '.join(DELIMITERS.values())} stands between columns; export it as CSV"
    )


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return bool(_DECIMAL_COMMA.match(cell))
    return True


def _heading_in_comment(comments: list[str], delimiter: str, width: int, name: str) -> list[str]:
    if comments:
        cells = [c.strip() for c in split_row(comments[-1], delimiter)]
        if len(cells) == width and not any(_is_number(c) for c in cells):
            return cells
    raise FormatError(
        f"{name!r} starts with numbers where column names are needed; "
        "add a first line such as time,u,y"
    )


def _check_widths(
    rows: list[str], lines: NDArray[np.int64], delimiter: str, width: int, name: str
) -> None:
    counts = np.array([row.count(delimiter) for row in rows], dtype=np.int64) + 1
    for k in np.flatnonzero(counts != width):
        cells = split_row(rows[k], delimiter)
        if len(cells) == width:
            continue  # a delimiter within quotes
        message = f"{name!r}, line {lines[k]} has {len(cells)} cells where {width} are needed"
        if len(cells) == 2 * width - 1 or (delimiter == "," and len(cells) == 2 * width):
            raise FormatError(
                f"{message}: a decimal comma is no delimiter; export it with decimal points"
            )
        if k == len(rows) - 1:
            raise FormatError(
                f"{message}: the file is cut short; delete its last line, or record again"
            )
        raise FormatError(f"{message}; correct that line, or cut it out")
