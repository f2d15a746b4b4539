"""Rows of text to numbers, quickly where they are plain and patiently where they are not."""

import csv
import math
import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import FormatError

__all__ = [
    "BLANKS",
    "DECIMAL_COMMA",
    "column_of",
    "is_complex",
    "number",
    "numbers",
    "split_row",
    "split_rows",
    "thousands",
    "without_codes",
]

BLANKS = " "
"""Delimiter that stands for any run of blanks and tabs."""

_MINUS = "\u2212"  # as typesetters and some spreadsheets write it

DECIMAL_COMMA = re.compile(rf"^\s*[-+{_MINUS}]?\d+,\d+([eE][-+{_MINUS}]?\d+)?\s*$")

_THOUSANDS = re.compile(rf"[-+{_MINUS}]?[1-9]\d{{0,2}},\d{{3}}")
_HUNDREDS = re.compile(rf"[-+{_MINUS}]?[1-9]\d{{2}}")
_FEW = 3  # numbers with a comma, from which their form says what it is

# Where a comma is the decimal sign, a point may part thousands: it makes no number.
_COMMA = str.maketrans({",": ".", ".": "_"})

_MISSING = frozenset(
    [
        *("", "-", "--", "---", "?", "*", "na", "n/a", "nan", "-nan", "null", "none", "nil"),
        *("#n/a", "#na", "#num!", "#div/0!", "#value!", "#ref!"),  # spreadsheets
        *("1.#qnan", "1.#ind", "-1.#ind", "nan(ind)"),  # Microsoft's C
    ]
)
_WORDS = {"true": 1.0, "false": 0.0, "1.#inf": math.inf, "-1.#inf": -math.inf}
_SCPI_NAN, _SCPI_INFINITY = 9.91e37, 9.9e37
"""What instruments send where there is no number: SCPI-99, volume 1, section 7.2.1.4."""


def split_row(row: str, delimiter: str) -> list[str]:
    """Cut a row into cells without the blanks around them, quotes heeded.

    Examples
    --------
    >>> split_row('1, "a,b",3', ","), split_row(" 1   2 ", BLANKS)
    (['1', 'a,b', '3'], ['1', '2'])
    """
    if '"' in row:
        return _unquoted([row], delimiter)[0]
    cells = row.split() if delimiter == BLANKS else row.split(delimiter)
    return [cell.strip() for cell in cells]


def _unquoted(rows: Sequence[str], delimiter: str) -> list[list[str]]:
    reader = csv.reader(
        [row.strip() if delimiter == BLANKS else row for row in rows],
        delimiter=delimiter,
        skipinitialspace=True,
    )
    try:
        cut = list(reader)
    except csv.Error as error:  # such as a quote that opens and is never closed
        raise FormatError(f"the row {rows[0][:40]!r} cannot be cut into cells: {error}") from None
    if len(cut) != len(rows):  # a quote that spans lines
        raise FormatError(
            f"a quote opens and is not closed in one of {len(rows)} rows from {rows[0][:40]!r} on; "
            "correct it"
        )
    return [[cell.strip() for cell in cells] for cells in cut]


def split_rows(rows: Sequence[str], delimiter: str) -> list[list[str]]:
    """Cut many rows into cells.

    Examples
    --------
    >>> split_rows(["1;2", "3;4"], ";")
    [['1', '2'], ['3', '4']]
    """
    if any('"' in row for row in rows):
        return _unquoted(rows, delimiter)
    if delimiter == BLANKS:
        return [row.split() for row in rows]
    return [row.split(delimiter) for row in rows]


def number(cell: str, decimal: str) -> float | None:
    """Return the number in a cell, NaN where it stands for a missing one, None for other text.

    Parameters
    ----------
    cell : str
        Text of the cell.
    decimal : {'.', ','}
        What stands before the fraction.

    Examples
    --------
    >>> number("1,5", ","), number("n/a", "."), number("OL", ".") is None, number(" 2e3 ", ".")
    (1.5, nan, True, 2000.0)
    >>> number("\N{MINUS SIGN}2", ".")
    -2.0
    """
    cell = cell.strip().replace(_MINUS, "-")
    plain = cell.translate(_COMMA) if decimal == "," else cell
    try:
        # Python reads 1_000 as a number, which nobody writes in a measurement.
        return None if "_" in plain else float(plain)
    except ValueError:
        lower = cell.casefold()
        if lower in _MISSING:
            return math.nan
        return _WORDS.get(lower)


def thousands(cells: Sequence[str]) -> tuple[str, str] | None:
    """Return two cells of a column whose commas mark thousands and no fractions; else None.

    Three digits follow every comma, none before it is a zero alone, and numbers from 100 to 999
    have no comma.

    Examples
    --------
    >>> thousands(["999", "1,025", "2,311", "-1,733"]), thousands(["0,999", "1,025", "2,311"])
    (('1,025', '999'), None)
    """
    marked = [cell for cell in cells if "," in cell]
    plain = next((cell for cell in cells if _HUNDREDS.fullmatch(cell)), None)
    if plain is None or len(marked) < _FEW or not all(map(_THOUSANDS.fullmatch, marked)):
        return None
    return marked[0], plain


def is_complex(cell: str, decimal: str) -> bool:
    """Say whether a cell holds a complex number, as MATLAB or Python writes it.

    Examples
    --------
    >>> is_complex("0.5-1.2i", "."), is_complex("(1e3 + 2j)", "."), is_complex("0,5+1i", ",")
    (True, True, True)
    >>> is_complex("1.5", "."), is_complex("i", "."), is_complex("idle", ".")
    (False, False, False)
    """
    plain = cell.translate(_COMMA) if decimal == "," else cell
    plain = "".join(plain.split()).removeprefix("(").removesuffix(")").casefold()
    if not plain.endswith(("i", "j")) or not any(map(str.isdigit, plain)):
        return False
    try:
        complex(plain[:-1] + "j")
    except ValueError:
        return False
    return True


def numbers(
    rows: Sequence[str], *, delimiter: str, decimal: str, columns: Sequence[int]
) -> NDArray[np.float64] | None:
    """Return columns of plain rows as numbers, shape (len(columns), n); None if one is not plain.

    Plain is a row whose wanted cells are numbers or empty, without quotes.

    Examples
    --------
    >>> numbers(["1,2", "3,4"], delimiter=",", decimal=".", columns=[1]).tolist()
    [[2.0, 4.0]]
    >>> numbers(["1,2", "3,"], delimiter=",", decimal=".", columns=[1]).tolist()
    [[2.0, nan]]
    >>> numbers(["1,2", "3,x"], delimiter=",", decimal=".", columns=[1]) is None
    True
    """
    if decimal == ",":
        rows = "\n".join(rows).translate(_COMMA).split("\n")
    table = _loaded(rows, delimiter, columns)
    if table is None and delimiter != BLANKS:
        table = _loaded(_filled(rows, delimiter), delimiter, columns)
    return table


def _loaded(
    rows: Sequence[str], delimiter: str, columns: Sequence[int]
) -> NDArray[np.float64] | None:
    try:
        table = np.loadtxt(
            rows,
            delimiter=None if delimiter == BLANKS else delimiter,
            usecols=columns,
            comments=None,
            ndmin=2,
        )
    except ValueError:
        return None
    return np.ascontiguousarray(table.T)


def _filled(rows: Sequence[str], delimiter: str) -> list[str]:
    """Rows with "nan" in their empty cells."""
    text = "\n" + "\n".join(rows) + "\n"
    for _ in range(2):  # the second time for every other one of several in a row
        text = text.replace(2 * delimiter, f"{delimiter}nan{delimiter}")
    text = text.replace(f"{delimiter}\n", f"{delimiter}nan\n")
    text = text.replace(f"\n{delimiter}", f"\nnan{delimiter}")
    return text[1:-1].split("\n")


def without_codes(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return numbers with the codes that instruments send for "no number" turned into NaN.

    Examples
    --------
    >>> without_codes(np.array([1.0, 9.91e37, -9.9e37]))
    array([  1.,  nan, -inf])
    """
    huge = np.abs(values) >= 9.8e37
    if huge.any():
        values = values.copy()
        values[values == _SCPI_NAN] = np.nan
        values[values == _SCPI_INFINITY] = np.inf
        values[values == -_SCPI_INFINITY] = -np.inf
    return values


def column_of(cells: Sequence[str], decimal: str) -> NDArray[np.float64] | int:
    """Return a column of cells as numbers, shape (n,), or the place of the first that is none.

    Examples
    --------
    >>> column_of(["1", "", "x"], "."), column_of(["1,5", ""], ",")
    (2, array([1.5, nan]))
    """
    try:
        plain = "\n".join(cells).translate(_COMMA).split("\n") if decimal == "," else cells
        values = np.fromiter(map(float, plain), dtype=np.float64, count=len(cells))
        if not any("_" in cell for cell in plain):
            return values
    except ValueError:
        pass
    out = np.empty(len(cells))
    for k, cell in enumerate(cells):
        value = number(cell, decimal)
        if value is None:
            return k
        out[k] = value
    return out
