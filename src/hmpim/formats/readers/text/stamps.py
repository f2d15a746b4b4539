"""Columns of time: numbers with a unit, dates, clock times, Unix time."""

import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import FormatError, UnitError
from hmpim.formats.readers.text.cells import column_of
from hmpim.record import Finding
from hmpim.units import conversion_factor

__all__ = ["StampColumn", "looks_like_stamp", "stamp_column", "unlikely_seconds"]

Kind = Literal["number", "unix", "date", "clock"]

_CLOCK = r"(?:(?P<h>\d{1,2}):)?(?P<m>\d{1,2}):(?P<s>\d{1,2}(?:[.,]\d{1,9})?)"
_ISO = r"(?P<y>\d{4})[-/.](?P<mo>\d{1,2})[-/.](?P<d>\d{1,2})"
_GERMAN = r"(?P<d>\d{1,2})\.(?P<mo>\d{1,2})\.(?P<y>\d{4})"
_ZONE = r"\s*(?P<zone>Z|UTC|GMT|[+-]\d{2}:?\d{2})?"
_PATTERNS = (
    re.compile(rf"^{_ISO}[T ]+{_CLOCK}{_ZONE}$"),
    re.compile(rf"^{_GERMAN}[T ,]+{_CLOCK}{_ZONE}$"),
)
_CLOCK_ALONE = re.compile(rf"^{_CLOCK}$")
_DAY = 86_400
_NANO = 10**9

_SECOND_IN_DAYS = 1.2e-5
_FIRST_DAY, _LAST_DAY = 1e4, 1e7
"""Days that spreadsheets, MATLAB and astronomers count to our time: 46 000, 740 000, 2 500 000."""

_UNIX = ((1e17, "ns"), (1e14, "us"), (1e11, "ms"))
"""Smallest number that is Unix time in a unit: 1973 in ns, us and ms."""


def looks_like_stamp(cell: str) -> bool:
    """Say whether a cell is a date with a time, or a time of day.

    Examples
    --------
    >>> looks_like_stamp("2026-11-21T12:00:00.5Z"), looks_like_stamp("12:00:00,25")
    (True, True)
    >>> looks_like_stamp("12.5"), looks_like_stamp("start")
    (False, False)
    """
    cell = cell.strip()
    if ":" not in cell or len(cell) > 40:
        return False
    return any(pattern.match(cell) for pattern in (*_PATTERNS, _CLOCK_ALONE))


@dataclass(frozen=True, slots=True, kw_only=True)
class StampColumn:
    """How a column of time is read.

    Parameters
    ----------
    kind : {'number', 'unix', 'date', 'clock'}
        Numbers; numbers since 1970; dates with a time; times of day.
    unit : str
        Unit of numbers.
    base : int
        Nanoseconds (dates) or units (Unix time) that are taken off, so that nothing is rounded.
    decimal : {'.', ','}
        What stands before the fraction.
    told_by_size : bool
        True if no unit is stated and the size shows Unix time.
    """

    kind: Kind
    unit: str = "s"
    base: int = 0
    decimal: str = "."
    told_by_size: bool = False

    @property
    def origin(self) -> float | None:
        """Unix time in s at which the column's time is 0; None where that is not known."""
        if self.kind == "date":
            return self.base / _NANO
        if self.kind == "unix":
            return float(self.scaled(np.array([float(self.base)]))[0])
        return None

    def seconds(self, cells: Sequence[str]) -> NDArray[np.float64] | int:
        """Return the stamps in s, shape (n,), NaN where one is missing, or the first bad place.

        Examples
        --------
        >>> column = StampColumn(kind="clock")
        >>> column.seconds(["23:59:59.5", "", "0:00:00.5"])
        array([8.63995e+04,         nan, 5.00000e-01])
        """
        if self.kind == "number":
            values = column_of(cells, self.decimal)
            return values if isinstance(values, int) else self.scaled(values)
        if self.kind == "unix":
            return self._since_base(cells)
        return self._dates(cells)

    def scaled(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Turn numbers in `unit` into s.

        Examples
        --------
        >>> StampColumn(kind="number", unit="ms").scaled(np.array([5.0]))
        array([0.005])
        """
        if self.unit == "s":
            return values
        factor = conversion_factor(self.unit, to="s")
        whole = round(1 / factor) if factor < 1 else 0
        # 1 ms is stored as a rounded 0.001, while a division by 1000 rounds once only.
        exact = whole > 0 and abs(whole * factor - 1) < 1e-12
        return values / whole if exact else values * factor

    def _since_base(self, cells: Sequence[str]) -> NDArray[np.float64] | int:
        try:
            ticks = np.fromiter(map(int, cells), dtype=np.int64, count=len(cells))
            return self.scaled((ticks - self.base).astype(np.float64))
        except (ValueError, OverflowError):
            pass  # fractions, empty cells
        out = np.full(len(cells), np.nan)
        for k, cell in enumerate(cells):
            try:
                whole, _, fraction = cell.strip().partition(self.decimal)
                out[k] = int(whole) - self.base + float(f"0.{fraction or 0}")
            except ValueError:
                single = column_of([cell], self.decimal)
                if isinstance(single, int):
                    return k
                out[k] = single[0] - self.base
        return self.scaled(out)

    def _dates(self, cells: Sequence[str]) -> NDArray[np.float64] | int:
        at_once = _iso_at_once(cells) if self.kind == "date" else None
        if at_once is not None:
            return np.asarray((at_once - self.base) / _NANO)
        out = np.full(len(cells), np.nan)
        for k, cell in enumerate(cells):
            ticks = _nanoseconds(cell, self.kind)
            if ticks is None:
                if isinstance(column_of([cell], "."), int) or cell.strip().isdigit():
                    return k
                continue
            out[k] = (ticks - self.base) / _NANO
        return out


def _iso_at_once(cells: Sequence[str]) -> NDArray[np.int64] | None:
    """Nanoseconds of ISO stamps that all have one zone; None if one has not, or is another."""
    first = _PATTERNS[0].match(cells[0].strip()) if cells else None
    zone = (first["zone"] or "") if first else ""
    if first is None or not all(cell.endswith(zone) for cell in cells):
        return None
    shift = _nanoseconds(cells[0], "date")
    bare = "\n".join(cells).replace(",", ".").replace(f"{zone}\n", "\n").removesuffix(zone)
    if zone[:1] not in "+-" and ("+" in bare or "Z" in bare):
        return None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # a zone of its own in one cell is only warned of
            ticks = np.array(bare.split("\n"), dtype="datetime64[ns]").astype(np.int64)
    except (ValueError, UserWarning):
        return None
    if shift is None or (ticks == np.iinfo(np.int64).min).any():  # an empty cell is "not a time"
        return None
    return np.asarray(ticks + (shift - ticks[0]))


def _nanoseconds(cell: str, kind: Kind) -> int | None:
    cell = cell.strip()
    patterns = (_CLOCK_ALONE,) if kind == "clock" else _PATTERNS
    match = next((m for p in patterns if (m := p.match(cell))), None)
    if match is None:
        return None
    whole, _, fraction = match["s"].replace(",", ".").partition(".")
    minutes = int(match["h"] or 0) * 60 + int(match["m"])
    ticks = (minutes * 60 + int(whole)) * _NANO + int(fraction.ljust(9, "0") or 0)
    if kind == "clock":
        return ticks
    try:
        day = np.datetime64(f"{match['y']}-{int(match['mo']):02d}-{int(match['d']):02d}", "D")
    except ValueError:
        return None
    zone = match["zone"]
    if zone and zone[0] in "+-":
        shift = int(zone[1:3]) * 3600 + int(zone[-2:]) * 60
        ticks -= (shift if zone[0] == "+" else -shift) * _NANO
    return int(day.astype(np.int64)) * _DAY * _NANO + ticks


def unlikely_seconds(name: str, stamps: NDArray[np.float64]) -> tuple[Finding, ...]:
    """Say that stamps without a unit are read in s, where their steps look like ms or days.

    Examples
    --------
    >>> unlikely_seconds("time", np.array([0.0, 5.0, 10.0]))[0].message[:55]
    "'time' states no unit and is read in s: a sample every "
    >>> unlikely_seconds("time", np.array([0.0, 0.005, 0.01]))
    ()
    >>> days = 739686.0 + np.array([0.0, 1e-7, 2e-7])
    >>> "if it is in days" in unlikely_seconds("time", days)[0].message
    True
    """
    stamps = stamps[np.isfinite(stamps)]
    step = float(np.median(np.diff(stamps))) if stamps.size > 1 else 0.0
    if step >= 1.0:
        unit, words = "ms", "ms"
    elif 0.0 < step < _SECOND_IN_DAYS and _FIRST_DAY < stamps[0] < _LAST_DAY:
        unit, words = "d", "days"
    else:
        return ()
    message = (
        f"{name!r} states no unit and is read in s: a sample every {step:g} s; if it is in "
        f"{words}, write '{name} [{unit}]' into the heading, or as --time"
    )
    return (Finding(code="time_unit", message=message, severity="info", parameters=()),)


def _largest(cells: Sequence[str], decimal: str) -> float:
    values = column_of(cells, decimal)
    if isinstance(values, int) or not np.isfinite(values).any():
        return 0.0
    return float(np.abs(values[np.isfinite(values)]).max())


def stamp_column(
    cells: Sequence[str], *, unit: str, decimal: str, heading: str, exact: bool = False
) -> StampColumn:
    """Tell from the first cells of a column of time how it is read.

    Parameters
    ----------
    cells : sequence of str
        The first cells of the column.
    unit : str
        Unit that the heading states; empty where it states none.
    decimal : {'.', ','}
        What stands before the fraction in this file.
    heading : str
        Heading of the column, for messages.
    exact : bool
        True if numbers are to be taken as they are, Unix time or not.

    Raises
    ------
    UnitError
        If the unit is none of time.
    FormatError
        If the cells are neither numbers nor stamps.

    Examples
    --------
    >>> stamp_column(["2026-11-21 12:00:00.5"], unit="", decimal=".", heading="t").kind
    'date'
    >>> stamp_column(["0", "5"], unit="ms", decimal=".", heading="t").unit
    'ms'
    """
    there = [cell.strip() for cell in cells if cell.strip()]
    first = next((c for c in there if looks_like_stamp(c)), None)
    if first is not None:
        kind: Kind = "clock" if _CLOCK_ALONE.match(first) else "date"
        ticks = _nanoseconds(first, kind)
        if ticks is None:
            raise FormatError(
                f"column {heading!r} holds {first!r}, which is not a date; correct it"
            )
        base = 0 if kind == "clock" else ticks // _NANO * _NANO
        return StampColumn(kind=kind, base=base)
    told, largest = False, _largest(there, decimal)
    if not unit:
        for least, name in _UNIX:
            if largest >= least:
                unit, told = name, True
                break
    unit = unit or "s"
    try:
        conversion_factor(unit, to="s")
    except UnitError:
        raise UnitError(
            f"column {heading!r}: {unit!r} is not a unit of time; use s, ms or us"
        ) from None
    since_1970 = told or (unit == "s" and 1e8 <= largest < 1e11)
    if not exact and since_1970 and all(re.fullmatch(r"\d+([.,]\d+)?", c) for c in there):
        base = int(re.split("[.,]", there[0])[0])
        return StampColumn(kind="unix", unit=unit, base=base, decimal=decimal, told_by_size=told)
    return StampColumn(kind="number", unit=unit, decimal=decimal, told_by_size=told)
