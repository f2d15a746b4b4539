"""Options by which every command says how a record is read, and which part of it."""

import re
from collections.abc import Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hmpim.errors import ArgumentError, UnitError

if TYPE_CHECKING:
    from hmpim.formats.options import ReadOptions
    from hmpim.record import Record

__all__ = [
    "Auxiliary",
    "Beside",
    "Common",
    "From",
    "Input",
    "Offset",
    "Output",
    "Rate",
    "Sheet",
    "StampChoice",
    "Stamps",
    "Sweep",
    "Time",
    "To",
    "Unit",
    "read_records",
    "reading",
    "refuse_options",
    "say_broken_readers",
    "seconds",
    "units_of",
]


class Stamps(StrEnum):
    """Which stamp counts where each message has two."""

    AUTO = "auto"
    HEADER = "header"
    LOG = "log"


Input = Annotated[
    list[str] | None,
    typer.Option("--input", metavar="NAME", help="Channel of an input; may be repeated."),
]
Output = Annotated[
    list[str] | None,
    typer.Option("--output", metavar="NAME", help="Channel of an output; may be repeated."),
]
Auxiliary = Annotated[
    list[str] | None,
    typer.Option(
        "--auxiliary", metavar="NAME", help="Channel to keep without fitting it; may be repeated."
    ),
]
Rate = Annotated[
    float | None,
    typer.Option("--fs", metavar="HZ", help="Sampling rate, if the file holds no time."),
]
Time = Annotated[
    str | None,
    typer.Option(
        "--time", metavar="NAME", help='Channel of the time; with its unit as "NAME \\[ms]".'
    ),
]
Unit = Annotated[
    list[str] | None,
    typer.Option(
        "--unit",
        metavar="NAME=UNIT",
        help="Unit of a channel, if the file does not state it; may be repeated.",
    ),
]
From = Annotated[
    float | None,
    typer.Option("--from", metavar="S", help="Ignore everything before this time of the file, s."),
]
To = Annotated[
    float | None,
    typer.Option("--to", metavar="S", help="Ignore everything after this time of the file, s."),
]
Sweep = Annotated[
    str | None,
    typer.Option(
        "--sweep",
        metavar="N|all",
        help="Use one of several sweeps in a log, or all of them as repeats.",
    ),
]
Offset = Annotated[
    list[str] | None,
    typer.Option(
        "--offset",
        metavar="NAME=TIME|?",
        help="How late the clock of a channel, or of a --beside file, is, such as y=3.2ms; "
        "? if unknown. May be repeated.",
    ),
]
Beside = Annotated[
    list[Path] | None,
    typer.Option(
        "--beside", metavar="FILE", help="Another file that recorded this test; may be repeated."
    ),
]
Common = Annotated[
    str | None,
    typer.Option(
        "--common",
        metavar="NAME",
        help="Channel that all files contain; it aligns their clocks.",
    ),
]
StampChoice = Annotated[
    Stamps,
    typer.Option(
        "--stamps", help="Time stamp to use if a message has two: the sender's or the log's."
    ),
]
Sheet = Annotated[
    str | None,
    typer.Option("--sheet", metavar="NAME", help="Sheet to read, if the file has several."),
]

_QUANTITY = re.compile(r"^\s*(?P<number>[-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(?P<unit>\S*)\s*$")


def seconds(text: str, option: str) -> float:
    """Read a time such as ``3.2ms``; without a unit it is in s.

    Raises
    ------
    ArgumentError
        If it is none.

    Examples
    --------
    >>> seconds("3.2ms", "--offset"), seconds("-1", "--offset")
    (0.0032, -1.0)
    """
    from hmpim.units import conversion_factor

    match = _QUANTITY.match(text)
    try:
        if match is None:
            raise ValueError(text)
        return float(match["number"]) * conversion_factor(match["unit"] or "s", to="s")
    except (ValueError, UnitError):
        raise ArgumentError(
            f"{option}: {text!r} is not a time; write it as 3.2ms or 0.0032"
        ) from None


def refuse_options(options: Mapping[str, object], why: str) -> None:
    """Refuse the first of options that is given; `why` continues a sentence about it."""
    for option, given in options.items():
        if given is not None:
            raise ArgumentError(f"{option} {why}")


def units_of(given: Sequence[str] | None) -> dict[str, str]:
    """Read ``NAME=UNIT`` options.

    Examples
    --------
    >>> units_of(["y=deg", "u=V"])
    {'y': 'deg', 'u': 'V'}
    """
    return dict(_pair(text, "--unit", "y=deg") for text in given or ())


def reading(
    *,
    start: float | None = None,
    stop: float | None = None,
    sweep: str | None = None,
    offset: Sequence[str] | None = None,
    beside: Sequence[Path] | None = None,
    common: str | None = None,
    stamps: Stamps = Stamps.AUTO,
    sheet: str | None = None,
) -> "ReadOptions":
    """Put the options together.

    Raises
    ------
    ArgumentError
        If one of them cannot be read.

    Examples
    --------
    >>> reading(offset=["y=3.2ms", "scope.csv=?"]).offsets
    {'y': 0.0032, 'scope.csv': None}
    """
    from hmpim.formats.options import ReadOptions

    pairs = dict(_pair(text, "--offset", "y=3.2ms") for text in offset or ())
    number = None
    if sweep is not None and sweep != "all":
        if not sweep.isdigit() or int(sweep) < 1:
            raise ArgumentError(f"--sweep {sweep!r} is neither a number from 1 on nor 'all'")
        number = int(sweep)
    return ReadOptions(
        start=start,
        stop=stop,
        sweep=number,
        offsets={
            name: None if text.strip() in ("?", "unknown") else seconds(text, "--offset")
            for name, text in pairs.items()
        },
        beside=tuple(beside or ()),
        common=common,
        stamps=stamps.value,
        sheet=sheet,
    )


def read_records(
    paths: Sequence[Path],
    *,
    roles: Mapping[str, Sequence[str] | None],
    fs: float | None,
    time: str | None,
    units: Mapping[str, str],
    options: "ReadOptions",
    every: bool,
) -> "list[Record]":
    """Read one record from each file, or every sweep of each.

    Parameters
    ----------
    paths : sequence of Path
        The files.
    roles : mapping of str to sequence of str
        Names of channels by 'inputs', 'outputs', 'references', 'auxiliary'.
    fs, time, units, options
        As `hmpim.read` takes them.
    every : bool
        True for every sweep.
    """
    from hmpim.cli.terminal import working
    from hmpim.formats import read
    from hmpim.formats.files import read_sweeps

    say_broken_readers()
    found: list[Record] = []
    named = {kind: names or None for kind, names in roles.items()}
    for path in paths:
        with working(f"Reading {path}"):
            if every:
                found.extend(
                    read_sweeps(path, fs=fs, time=time, units=units, options=options, **named)
                )
            else:
                found.append(read(path, fs=fs, time=time, units=units, options=options, **named))
    return found


def _pair(text: str, option: str, example: str) -> tuple[str, str]:
    name, equals, value = text.rpartition("=")
    if not equals or not name:
        raise ArgumentError(f"{option} {text!r} is not NAME=...; write it as {option} {example}")
    return name, value


def say_broken_readers() -> None:
    """Name on standard error the readers of others that do not work, and are skipped."""
    from hmpim.cli.terminal import warn
    from hmpim.formats.readers import readers

    for broken in readers().broken:
        warn(f"reader {broken.name} is skipped: {broken.reason}")
