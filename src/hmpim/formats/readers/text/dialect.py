"""How a table of text is written: what stands between cells, before fractions, above the data."""

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from math import isnan

from hmpim.errors import FormatError
from hmpim.formats.readers.protocol import listed
from hmpim.formats.readers.text.cells import BLANKS, DECIMAL_COMMA, number, split_row
from hmpim.formats.readers.text.stamps import looks_like_stamp

__all__ = ["Dialect", "decimal_in", "find_dialect", "is_comment", "is_row", "uncommented"]

_DELIMITERS = ("\t", ";", ",", "|", BLANKS)
_COMMENTS = ("#", "%", "//", "!")
_SAMPLE = 100  # rows from which the dialect is told
_JSON = re.compile(r"\s*[\[{]\s*[\[{\"]")


@dataclass(frozen=True, slots=True, kw_only=True)
class Dialect:
    """How a table is written.

    Parameters
    ----------
    delimiter : str
        What stands between cells; `BLANKS` for any run of blanks.
    decimal : {'.', ','}
        What stands before the fraction.
    width : int
        Number of cells in a row.
    numeric : tuple of bool
        For each column, whether it holds numbers or stamps.
    first : int
        Index of the first line that holds samples; the number of lines where there is none.
    """

    delimiter: str
    decimal: str
    width: int
    numeric: tuple[bool, ...]
    first: int


def is_comment(line: str) -> bool:
    """Say whether a line is a comment.

    Examples
    --------
    >>> is_comment("# bench 2"), is_comment("  % from MATLAB"), is_comment("1,2")
    (True, True, False)
    """
    return line.lstrip().startswith(_COMMENTS)


def uncommented(line: str) -> str:
    """Return a comment without what marks it as one.

    Examples
    --------
    >>> uncommented("# time,u"), uncommented("// x")
    ('time,u', 'x')
    """
    line = line.strip()
    for mark in _COMMENTS:
        if line.startswith(mark):
            return line.lstrip(mark[0]).strip()
    return line


@dataclass(frozen=True, slots=True, kw_only=True)
class _Trial:
    """How well one way of cutting explains the sample."""

    dialect: Dialect
    score: tuple[float, ...]


def find_dialect(lines: Sequence[str], *, name: str) -> Dialect:
    r"""Tell from the first lines of a text how it is written.

    Each way of cutting is tried on the last hundred lines that are given; that which makes most
    of the cells numbers, in rows of one width, is taken. If those rows have no fractions, the
    rows above them tell the decimal mark.

    Parameters
    ----------
    lines : sequence of str
        The start of the file, whole lines.
    name : str
        Name of the file, for messages.

    Raises
    ------
    FormatError
        If no line holds anything but words.

    Examples
    --------
    >>> d = find_dialect(["Zeit [s];u", "0,0;1,5", "0,1;2,5"], name="a.csv")
    >>> d.delimiter, d.decimal, d.width, d.first
    (';', ',', 2, 1)
    """
    rows = [(k, line) for k, line in enumerate(lines) if line.strip() and not is_comment(line)]
    if not rows:
        empty = "is empty" if not any(line.strip() for line in lines) else "holds comments only"
        raise FormatError(f"{name!r} {empty}; a line of column names and then samples are needed")
    forced = re.fullmatch(r"\s*\"?sep=(.)\"?\s*", rows[0][1], re.IGNORECASE)
    delimiters = (forced[1],) if forced else _DELIMITERS
    sample = [line for _, line in rows[max(len(rows) - _SAMPLE, (len(rows) + 1) // 3) :]]
    trials = [
        trial
        for rank, delimiter in enumerate(delimiters)
        for decimal in (".", ",")
        if (trial := _tried(rows, sample, delimiter, decimal, rank)) is not None
    ]
    if _JSON.match(rows[0][1]) or (not trials and rows[0][1].lstrip().startswith("{")):
        raise FormatError(
            f"{name!r} holds JSON and no table of samples; export the samples as CSV. A result "
            "that hmpim identify wrote is opened with hmpim report, hmpim export or hmpim.load"
        )
    if not trials and len(rows) == 1:
        cells = next((c for d in delimiters if len(c := _cells(rows[0][1], d)) > 1), None)
        if cells is not None:
            raise FormatError(
                f"{name!r} has column names ({listed(cells)}) and no samples; record again"
            )
    if not trials:
        place, row = rows[len(rows) // 2]
        raise FormatError(
            f"{name!r} holds no rows of numbers: line {place + 1} is {row.strip()[:60]!r}; give a "
            "table with comma, semicolon, tab or blanks between its columns, and numbers such as "
            "-1234.5 or 1e-3"
        )
    dialect = max(trials, key=lambda trial: trial.score).dialect
    if dialect.decimal == "." and decimal_in((line for _, line in rows), dialect) == ",":
        return replace(dialect, decimal=",")
    return dialect


def decimal_in(rows: Iterable[str], dialect: Dialect) -> str | None:
    """Return the decimal mark of some rows: a point if any number has one; None without fractions.

    Examples
    --------
    >>> d = Dialect(delimiter=";", decimal=".", width=2, numeric=(True, True), first=0)
    >>> decimal_in(["0;1", "0,5;1"], d), decimal_in(["0,5;1", "0.5;1"], d)
    (',', '.')
    >>> decimal_in(["u, V;y", "0;1"], d) is None
    True
    """
    found = None
    comma = '"' if dialect.delimiter == "," else ","  # commas within quotes alone
    for row in rows:
        if "." not in row and comma not in row:
            continue
        cells = _cells(row, dialect.delimiter)
        if len(cells) < dialect.width:
            continue
        numbers = [cell for cell, good in zip(cells, dialect.numeric, strict=False) if good]
        if any("." in cell and number(cell, ".") is not None for cell in numbers):
            return "."
        if found is None and any(DECIMAL_COMMA.match(cell) for cell in numbers):
            found = ","
    return found


def _tried(
    rows: Sequence[tuple[int, str]], sample: Sequence[str], delimiter: str, decimal: str, rank: int
) -> _Trial | None:
    try:
        cut = [split_row(line, delimiter) for line in sample]
    except FormatError:
        cut = [line.split(None if delimiter == BLANKS else delimiter) for line in sample]
    counts = Counter(len(cells) for cells in cut)
    heading = len(_cells(rows[0][1], delimiter))
    width = max(counts, key=lambda w: (counts[w], w == heading, w))
    alike = [cells for cells in cut if len(cells) == width]
    kinds = [_column_kind([cells[k] for cells in alike], decimal) for k in range(width)]
    numeric = tuple(share >= 0.5 for share in kinds)
    if not any(numeric):
        return None
    if decimal == "," and not _needs_comma(alike, numeric):
        return None
    named = [cell for k, cell in enumerate(zip(*alike, strict=True)) if any(cell) or numeric[k]]
    dialect = Dialect(delimiter=delimiter, decimal=decimal, width=width, numeric=numeric, first=0)
    first = _first_row(rows, dialect)
    above = [line for k, line in rows if k < first]
    named_above = bool(above) and len(_cells(above[-1], delimiter)) == width
    share = len(alike) / len(cut) * sum(kinds) / max(len(named), 1)
    # Among equals: rows of one width with a heading as wide, then more columns than one.
    score = (round(share, 3), float(named_above), float(width > 1), float(-rank))
    found = Dialect(delimiter=delimiter, decimal=decimal, width=width, numeric=numeric, first=first)
    return _Trial(dialect=found, score=score)


def _cells(line: str, delimiter: str) -> list[str]:
    try:
        return split_row(line, delimiter)
    except FormatError:
        return []


def _column_kind(cells: Sequence[str], decimal: str) -> float:
    """Share of the cells that are there which are numbers or stamps; 1 for an empty column."""
    read = [number(cell, decimal) for cell in cells]
    if all(value is not None and isnan(value) for value in read):
        return 1.0 if any(cells) else 0.0
    there = [(c, v) for c, v in zip(cells, read, strict=True) if v is None or not isnan(v)]
    good = sum(v is not None or looks_like_stamp(c) for c, v in there)
    return good / len(there)


def _needs_comma(rows: Sequence[Sequence[str]], numeric: Sequence[bool]) -> bool:
    """Whether a comma stands in a number at all; else a point is as good."""
    return any(
        "," in cell for cells in rows for cell, good in zip(cells, numeric, strict=True) if good
    )


def _first_row(rows: Sequence[tuple[int, str]], dialect: Dialect) -> int:
    """Index of the first line from which on rows hold samples."""
    good = [is_row(line, dialect) for _, line in rows]
    for place, (k, _) in enumerate(rows):
        near = good[place : place + 5]
        if good[place] and 2 * sum(near) >= len(near):
            return k
    return rows[-1][0] + 1


def is_row(line: str, dialect: Dialect) -> bool:
    """Say whether a line holds samples: every numeric column a number, a stamp or nothing.

    A number with the other decimal mark is one as well: the error then names its row.

    Examples
    --------
    >>> d = Dialect(delimiter=",", decimal=".", width=2, numeric=(True, False), first=0)
    >>> is_row("1,start", d), is_row("time,note", d), is_row(",", d)
    (True, False, False)
    """
    try:
        cells = split_row(line, dialect.delimiter)
    except FormatError:
        return False
    if len(cells) < dialect.width or any(cells[dialect.width :]):
        return False
    found = False
    for cell, numeric in zip(cells, dialect.numeric, strict=False):
        if not numeric:
            continue
        value = number(cell, dialect.decimal)
        if value is None and not (looks_like_stamp(cell) or _is_fraction(cell)):
            return False
        found = found or value is None or not isnan(value)
    return found


def _is_fraction(cell: str) -> bool:
    """Whether it is a number with either decimal mark."""
    return DECIMAL_COMMA.match(cell) is not None or number(cell, ".") is not None
