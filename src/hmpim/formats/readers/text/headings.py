"""Headings: the names of columns and their units, in brackets, in words or in a second line."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, zip_longest

from hmpim.errors import FormatError
from hmpim.formats.readers.protocol import listed
from hmpim.formats.readers.text.cells import BLANKS, number, split_row
from hmpim.formats.readers.text.dialect import Dialect, is_comment, uncommented
from hmpim.units import read_unit

__all__ = ["Heading", "find_headings", "named"]

_BRACKETS = re.compile(r"^(?P<name>.*?)(?P<space>\s*)\[(?P<unit>[^\[\]]*)\]$")
_PARENTHESES = re.compile(r"^(?P<name>.*?)(?P<space>\s*)\((?P<unit>[^()]*)\)$")
_IN = re.compile(r"^(?:(?P<name>.*\S)\s+)?in (?P<unit>\S+)$")
_ENDINGS = {
    "_us": "us",
    "_ms": "ms",
    "_ns": "ns",
    "_deg": "deg",
    "_rad": "rad",
    "_dps": "deg/s",
    "_deg_s": "deg/s",
    "_rad_s": "rad/s",
    "_deg_per_s": "deg/s",
    "_rad_per_s": "rad/s",
    "_mv": "mV",
    "_mm": "mm",
    "_hz": "Hz",
}
_NO_UNIT = ("", "-", "--", "1", "none")
# Letters that are somebody's name of a channel rather than a year, a barn or a day.
_LETTERS = frozenset("abcdehiklnopqrtuwxyz")
_INDEX = re.compile(r"[\d:, ]+")  # 3, or MATLAB's :,3
_UNIT_LINE = re.compile(r"^[\[(]?(?P<unit>[^\[\]()]*)[\])]?$")


@dataclass(frozen=True, slots=True, kw_only=True)
class Heading:
    """Heading of a column.

    Parameters
    ----------
    text : str
        As printed, without blanks and quotes around it.
    name : str
        Name of the column; unique in its table.
    unit : str
        Unit, or what stands where a unit is expected; empty where there is none.
    position : int
        Place in the row, from 0.
    """

    text: str
    name: str
    unit: str
    position: int


def named(heading: str) -> tuple[str, str]:
    """Cut ``u [deg]``, ``u (deg)``, ``u in V`` or ``u_deg`` in name and unit.

    What is in brackets after a blank is a unit, known or not. What is in parentheses, or follows
    without a blank, may be part of the name: it is a unit only if it is a known one.

    Examples
    --------
    >>> named("u [deg]"), named("y (Volt)"), named("y (filtered)"), named("n [-]")
    (('u', 'deg'), ('y', 'V'), ('y (filtered)', ''), ('n', ''))
    >>> named("axisP[0]"), named("C1 in V"), named("gyro_deg_s"), named("in s")
    (('axisP[0]', ''), ('C1', 'V'), ('gyro_deg_s', 'deg/s'), ('time', 's'))
    >>> named("data(:,1)"), named("data(:,1) [ms]")
    (('data(:,1)', ''), ('data(:,1)', 'ms'))
    """
    match = _BRACKETS.match(heading)
    if match and match["name"]:
        unit = match["unit"].strip()
        if unit in _NO_UNIT and (match["space"] or unit != "1"):
            return match["name"], ""
        known = None if _is_a_name(unit) else read_unit(unit)
        if known is not None:
            return match["name"], known
        return (match["name"], unit) if match["space"] and not unit.isdigit() else (heading, "")
    match = _PARENTHESES.match(heading)
    if match and match["name"]:
        unit = match["unit"].strip()
        if unit in _NO_UNIT:
            return match["name"], ""
        known = None if _is_a_name(unit) else read_unit(unit)
        return (match["name"], known) if known is not None else (heading, "")
    match = _IN.match(heading)
    if match and (known := read_unit(match["unit"])) is not None:
        return match["name"] or "time", known
    lower = heading.casefold()
    for ending in sorted(_ENDINGS, key=len, reverse=True):
        if lower.endswith(ending) and len(heading) > len(ending):
            return heading, _ENDINGS[ending]
    return heading, ""


def _is_a_name(unit: str) -> bool:
    return unit in _LETTERS or _INDEX.fullmatch(unit) is not None


def find_headings(
    lines: Sequence[str], dialect: Dialect, *, name: str
) -> tuple[tuple[Heading, ...], bool]:
    """Find the headings above the first row of samples.

    Parameters
    ----------
    lines : sequence of str
        The start of the file.
    dialect : Dialect
        How it is written.
    name : str
        Name of the file, for messages.

    Returns
    -------
    headings : tuple of Heading
        Columns that have a name, and others of numbers, called 'column 2', …; but for a first one
        that only counts the rows.
        Without a line of names all are called so.
    printed : bool
        False if the file has no line of names.

    Raises
    ------
    FormatError
        If the names are not as many as the columns.

    Examples
    --------
    >>> d = Dialect(delimiter=",", decimal=".", width=2, numeric=(True, True), first=2)
    >>> headings, printed = find_headings(["Time,Channel A", "(ms),(mV)", "0,1"], d, name="a.csv")
    >>> [(h.name, h.unit) for h in headings], printed
    ([('Time', 'ms'), ('Channel A', 'mV')], True)
    """
    above = [line for line in lines[: dialect.first] if line.strip()]
    cells, units = _names_and_units(above, dialect, name)
    if cells is None:
        every = range(dialect.width)
        return tuple(
            Heading(text=f"column {k + 1}", name=f"column {k + 1}", unit="", position=k)
            for k in every
        ), False
    found = []
    for k, cell in enumerate(cells[: dialect.width]):
        if not cell and dialect.numeric[k] and (k or not _is_an_index(lines, dialect)):
            cell = f"column {k + 1}"
        if not cell:
            continue
        short, unit = named(cell)
        if units is not None and units[k]:
            unit = "" if units[k] in _NO_UNIT else read_unit(units[k]) or units[k]
        found.append(Heading(text=cell, name=short, unit=unit, position=k))
    return _with_vertical_units(_told_apart(found), above, dialect), True


def _is_an_index(lines: Sequence[str], dialect: Dialect) -> bool:
    """Whether the first column counts the rows, as pandas writes it."""
    rows = [line for line in lines[dialect.first :] if line.strip()][:3]
    cells = [split_row(row, dialect.delimiter)[0] for row in rows]
    if not all(cell.isdecimal() for cell in cells):
        return False
    return all(int(b) == int(a) + 1 for a, b in pairwise(cells))


def _with_vertical_units(
    headings: tuple[Heading, ...], above: Sequence[str], dialect: Dialect
) -> tuple[Heading, ...]:
    """Units that an oscilloscope or LabVIEW prints in a row of its own, one for each channel."""
    for line in above:
        cells = split_row(line, dialect.delimiter)
        if cells[0].casefold() not in ("vertical units", "y_unit_label"):
            continue
        units = [read_unit(cell) for cell in cells[1:] if cell]
        if not units or len(units) > len(headings) - 1:
            continue
        return (
            headings[0],
            *(
                replace(h, unit=unit) if unit and not h.unit else h
                for h, unit in zip_longest(headings[1:], units)
            ),
        )
    return headings


def _told_apart(headings: Sequence[Heading]) -> tuple[Heading, ...]:
    counts = Counter(h.name for h in headings)
    return tuple(
        h if counts[h.name] == 1 else replace(h, name=f"{h.name} (column {h.position + 1})")
        for h in headings
    )


def _names_and_units(
    above: Sequence[str], dialect: Dialect, name: str
) -> tuple[list[str] | None, list[str] | None]:
    """Cells of the line of names and of the line of units, each None where there is none."""
    plain = [line for line in above if not is_comment(line)]
    for lines in (plain, [line for line in above if is_comment(line)]):
        last = _cells(lines[-1], dialect) if lines else None
        if last is None:
            continue
        before = _cells(lines[-2], dialect) if len(lines) > 1 and _are_units(last) else None
        if before is not None and not _are_units(before):
            return before, [_bare(cell) for cell in last]
        return last, None
    if plain:
        _refuse_width(plain[-1], dialect, name)
    return None, None


def _cells(line: str, dialect: Dialect) -> list[str] | None:
    """Cells of a line of words that is as wide as the table; None if it is not."""
    commented = is_comment(line)
    text = uncommented(line) if commented else line
    for delimiter in (dialect.delimiter, ",", ";", "\t", BLANKS):
        cells = split_row(text, delimiter)
        while len(cells) > dialect.width and not cells[-1]:
            cells.pop()
        short = dialect.width - len(cells)
        if short > 0 and not commented and all(not n for n in dialect.numeric[len(cells) :]):
            cells += [""] * short
        if len(cells) == dialect.width and _are_words(cells, dialect, commented=commented):
            return cells
        if not commented and len(cells) > 1:
            break
    return None


def _are_words(cells: Sequence[str], dialect: Dialect, *, commented: bool) -> bool:
    words = [cell for cell in cells if cell and number(cell, dialect.decimal) is None]
    if commented:
        return len(words) == len(cells) and (len(cells) > 1 or " " not in cells[0])
    return bool(words)


def _are_units(cells: Sequence[str]) -> bool:
    """Whether every cell is a unit, in brackets or not, and one is more than a letter of a name."""
    there = [cell for cell in cells if cell]
    if there and there[0].casefold() == "sequence":  # Rigol: two figures follow the units
        there = [cell for cell in there[1:] if number(cell, ".") is None]
    known = []
    for cell in there:
        bare = _bare(cell)
        if bare in _NO_UNIT:
            continue
        if bare == cell and _is_a_name(bare):
            return False
        if read_unit(bare) is None and bare == cell:
            return False
        known.append(cell)
    return bool(known)


def _bare(cell: str) -> str:
    match = _UNIT_LINE.match(cell)
    return match["unit"].strip() if match else cell


def _refuse_width(line: str, dialect: Dialect, name: str) -> None:
    cells = [cell for cell in split_row(line, dialect.delimiter) if cell]
    if all(number(cell, dialect.decimal) is not None for cell in cells):
        return
    message = (
        f"{name!r} has {len(cells)} column names ({listed(cells)}) above rows of "
        f"{dialect.width} cells"
    )
    if dialect.delimiter == "," and dialect.width in (2 * len(cells), 2 * len(cells) - 1):
        raise FormatError(
            f"{message}: a decimal comma is not a delimiter; export it with decimal points, or "
            "with semicolons between the columns"
        )
    raise FormatError(f"{message}; give every column a name")
