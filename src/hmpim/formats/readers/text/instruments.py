"""Peculiarities of instruments' and loggers' CSV that no general rule covers."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from hmpim.formats.readers.text.cells import number, split_row
from hmpim.formats.readers.text.dialect import Dialect
from hmpim.formats.readers.text.headings import Heading

__all__ = ["Steady", "known_headings", "stated_time_unit", "steady_time"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Steady:
    """Time of an instrument that prints its start and its step instead of stamps.

    Parameters
    ----------
    start, step : float
        In s.
    skip : int
        Position of the column that counts the samples, which is no channel; -1 if there is none.
    """

    start: float
    step: float
    skip: int


_T0 = re.compile(r"t0\s*=\s*(?P<start>[-+.\deE]+)\s*s?\s*,\s*tInc\s*=\s*(?P<step>[-+.\deE]+)")


def steady_time(
    lines: Sequence[str], dialect: Dialect, headings: Sequence[Heading]
) -> Steady | None:
    """Return start and step where an oscilloscope of Rigol prints them above the samples.

    Either as ``X,CH1,Start,Increment`` over ``Sequence,Volt,-1.2e-3,2e-6``, or as
    ``CH1V,t0 = -1.2e-3, tInc = 2e-6``.
    """
    above = [line for line in lines[: dialect.first] if line.strip()]
    for line in above:
        match = _T0.search(line)
        if match:
            start, step = number(match["start"], "."), number(match["step"], ".")
            if start is not None and step is not None and step > 0:
                return Steady(start=start, step=step, skip=-1)
    if len(above) < 2:
        return None
    names = [cell.casefold() for cell in split_row(above[-2], dialect.delimiter)]
    facts = split_row(above[-1], dialect.delimiter)
    if "start" not in names or "increment" not in names or facts[0].casefold() != "sequence":
        return None
    places = names.index("start"), names.index("increment")
    if max(places) >= len(facts):
        return None
    start, step = (number(facts[k], dialect.decimal) for k in places)
    if start is None or step is None or not step > 0:
        return None
    return Steady(start=start, step=step, skip=0)


def known_headings(lines: Sequence[str], dialect: Dialect) -> tuple[Heading, ...] | None:
    """Return the headings of tables that print none, or None.

    Tektronix TDS: settings stand in the first three columns, time and volts in the next two.
    """
    if not lines:
        return None
    first = lines[0].strip().strip('"')
    if first.startswith("Record Length,") and dialect.width >= 5 and dialect.first == 0:
        settings = {}
        for line in lines[:25]:
            cells = split_row(line, dialect.delimiter)
            settings[cells[0].casefold()] = cells[1] if len(cells) > 1 else ""
        unit = settings.get("vertical units", "V")
        name = settings.get("source", "CH1") or "CH1"
        return (
            Heading(text="time", name="time", unit="s", position=3),
            Heading(text=name, name=name, unit=unit, position=4),
        )
    return None


def stated_time_unit(lines: Sequence[str]) -> str:
    """Return the unit of time of a logger that does not print it, or nothing.

    Betaflight's blackbox exports ``time`` in microseconds.

    Examples
    --------
    >>> stated_time_unit(['"Product","Blackbox flight data recorder by Nicholas Sherlock"'])
    'us'
    """
    first = lines[0].replace('"', "") if lines else ""
    return "us" if first.startswith("Product,Blackbox flight data recorder") else ""
