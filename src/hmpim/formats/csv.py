"""CSV with a heading to a record, and back."""

import json
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import ArgumentError, FormatError, RecordError, UnitError
from hmpim.formats.table import Table, read_text, table_of
from hmpim.record import Channel, Record, fit_clock
from hmpim.units import check_unit, conversion_factor

__all__ = ["read_csv", "write_csv"]

TIME_NAMES = ("time", "t")
INPUT_NAMES = ("u", "input", "command", "stimulus", "position")
OUTPUT_NAMES = ("y", "output", "measured", "response")

_MARK = "hmpim/record/1 "
_BRACKETS = re.compile(r"^(?P<name>.*?)\s*\[(?P<unit>[^\[\]]*)\]$")
_PARENTHESES = re.compile(r"^(?P<name>.*?)\s*\((?P<unit>[^()]*)\)$")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Named:
    """A column with its name, its unit, and its place among the table's columns."""

    name: str
    unit: str
    heading: str
    place: int


def read_csv(
    path: str | PathLike[str],
    *,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    fs: float | None = None,
    time: str | None = None,
    units: Mapping[str, str] | None = None,
) -> Record:
    r"""Read a record from a table of text.

    The first line that is neither blank nor a comment ('#') names the columns; comma, semicolon
    or tab stand between them. A unit may follow a name, as ``u [deg]`` or ``u (deg)``. Columns
    that are not asked for are not read. Which columns go in and which come out is never guessed
    from their order.

    Parameters
    ----------
    path : str or path-like
        The file, UTF-8.
    inputs, outputs : sequence of str, optional
        Names of the input and output columns. Without: the one named u, input, command, stimulus
        or position, and the one named y, output, measured or response, in any case.
    fs : float, optional
        Rate in Hz, needed if there is no time column.
    time : str, optional
        Name of the time column. Without: time or t, in any case. In seconds unless its heading
        says otherwise, as ``time [ms]``.
    units : mapping of str to str, optional
        Unit by channel name; goes before that of the heading.

    Returns
    -------
    Record

    Raises
    ------
    FormatError
        If the file cannot be read as such a table; the message names line and column.
    RecordError
        If time does not increase.
    UnitError
        If a unit is not known.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> path = pathlib.Path(folder.name, "test.csv")
    >>> _ = path.write_text("# bench 2\nmeasured;time [ms];command [V]\n0;0;1\n1;5;1\n2;10;1")
    >>> record = read_csv(path)
    >>> record.fs, record.inputs[0].name, record.inputs[0].unit, record.outputs[0].name
    (200.0, 'command', 'V', 'measured')
    >>> folder.cleanup()
    """
    file = Path(path)
    if fs is not None and not (np.isfinite(fs) and fs > 0):
        raise ArgumentError(f"fs = {fs} Hz is not a sampling rate; it must be positive and finite")
    table = table_of(read_text(file), name=file.name)
    notes = _notes(table)
    columns = _named_columns(table, notes, units or {})
    clock = _clock_column(columns, time, fs, table.name)
    if notes is not None:
        inputs = inputs if inputs is not None else [c["name"] for c in notes["inputs"]]
        outputs = outputs if outputs is not None else [c["name"] for c in notes["outputs"]]
        fs = fs if fs is not None else notes["fs"]
    data = [c for c in columns if c is not clock]
    into = _choose("input", inputs, data, INPUT_NAMES, OUTPUT_NAMES, table.name)
    out = _choose("output", outputs, data, OUTPUT_NAMES, INPUT_NAMES, table.name)
    both = sorted({c.name for c in into} & {c.name for c in out})
    if both:
        raise ArgumentError(f"column {both[0]!r} is named as input and as output; it can be one")
    chosen = [*([clock] if clock else []), *into, *out]
    numbers = table.numbers([table.columns[c.place] for c in chosen])
    if numbers.shape[0] < 2:
        raise FormatError(f"{table.name!r} holds one sample; at least 2 are needed")
    if clock is not None:
        stamps = _seconds(numbers[:, 0], clock, table.name)
        _check_increases(stamps, table, clock)
        rate = float(fs) if fs is not None else fit_clock(stamps).fs
        numbers = numbers[:, 1:]
    else:
        assert fs is not None
        rate = float(fs)
        stamps = np.arange(numbers.shape[0]) / rate
    channels = tuple(
        Channel(name=c.name, time=stamps, values=numbers[:, k], unit=c.unit)
        for k, c in enumerate((*into, *out))
    )
    return Record(
        inputs=channels[: len(into)],
        outputs=channels[len(into) :],
        fs=rate,
        band=None if notes is None else notes["band"],
        intersample=None if notes is None else notes["intersample"],
        source=file.name if notes is None else notes["source"],
    )


def write_csv(record: Record, path: str | PathLike[str]) -> None:
    """Write a record as CSV, so that `read_csv` gives it back bit for bit.

    Names, units, band and rate stand in one comment line of JSON; the headings carry units too,
    for people and for other programs.

    Parameters
    ----------
    record : Record
        All its channels must share one clock.
    path : str or path-like
        File to write; replaced as a whole, or not at all.

    Raises
    ------
    RecordError
        If the channels have clocks of their own, which a table cannot hold.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> path = pathlib.Path(folder.name, "test.csv")
    >>> record = Record.from_arrays({"u": [0, 1 / 3]}, {"y": [0, 2]}, fs=10.0, units={"u": "deg"})
    >>> write_csv(record, path)
    >>> read_csv(path).sha256 == record.sha256
    True
    >>> path.read_text().splitlines()[1:]
    ['time [s],u [deg],y', '0.0,0.0,0.0', '0.1,0.3333333333333333,2.0']
    >>> folder.cleanup()
    """
    channels = (*record.inputs, *record.outputs)
    time = channels[0].time
    for c in channels[1:]:
        if not np.array_equal(c.time, time):
            raise RecordError(
                f"channel {c.name!r} has a clock of its own, and a table has one; "
                "bring the record on one clock first with hmpim.record.uniform"
            )
    notes = {
        "inputs": [{"name": c.name, "unit": c.unit} for c in record.inputs],
        "outputs": [{"name": c.name, "unit": c.unit} for c in record.outputs],
        "fs": record.fs,
        "band": None if record.band is None else [float(f) for f in record.band],
        "intersample": record.intersample,
        "source": record.source,
    }
    lines = [f"# {_MARK}{json.dumps(notes)}", ",".join(["time [s]", *map(_heading, channels)])]
    # float.__repr__ is the shortest text that reads back as the same number.
    columns = [map(repr, array.tolist()) for array in (time, *(c.values for c in channels))]
    lines.extend(map(",".join, zip(*columns, strict=True)))
    file = Path(path)
    draft = file.with_name(f".{file.name}.{os.getpid()}.part")
    try:
        draft.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
        draft.replace(file)
    finally:
        draft.unlink(missing_ok=True)


def _heading(channel: Channel) -> str:
    name = re.sub(r"[\x00-\x1f\x7f\x85\u2028\u2029\"]+", " ", channel.name).strip() or "channel"
    heading = f"{name} [{channel.unit}]" if channel.unit else name
    return f'"{heading}"' if re.search(r"[,;#]", heading) else heading


def _notes(table: Table) -> dict[str, Any] | None:
    """What `write_csv` noted, if the columns are still those it wrote."""
    for comment in table.comments:
        if not comment.startswith(_MARK):
            continue
        try:
            notes: dict[str, Any] = json.loads(comment.removeprefix(_MARK))
            count = 1 + len(notes["inputs"]) + len(notes["outputs"])
            headings = [
                _heading(Channel(name=c["name"], time=_TWO, values=_TWO, unit=c["unit"]))
                for c in (*notes["inputs"], *notes["outputs"])
            ]
            if notes["intersample"] not in (None, "zoh", "foh", "bandlimited"):
                raise ValueError(f"intersample {notes['intersample']!r}")
            if notes["band"] is not None:
                low, high = notes["band"]
                notes["band"] = (float(low), float(high))
            notes["fs"], notes["source"] = float(notes["fs"]), str(notes["source"])
        except (ValueError, KeyError, TypeError) as error:
            raise FormatError(
                f"{table.name!r} starts with a spoilt comment {comment[:40]!r} ({error}); "
                "delete that line"
            ) from None
        found = [c.heading for c in table.columns]
        if len(found) == count and found[1:] == [h.strip('"') for h in headings]:
            return notes
    return None


_TWO = np.arange(2.0)


def _named_columns(
    table: Table, notes: dict[str, Any] | None, units: Mapping[str, str]
) -> list[_Named]:
    named = []
    if notes is not None:
        pairs = [("time", "s"), *((c["name"], c["unit"]) for k in _KINDS for c in notes[k])]
    else:
        pairs = [_name_and_unit(c.heading, table.name) for c in table.columns]
    for place, ((name, unit), column) in enumerate(zip(pairs, table.columns, strict=True)):
        named.append(
            _Named(name=name, unit=units.get(name, unit), heading=column.heading, place=place)
        )
    names = [c.name for c in named[1 if notes is not None else 0 :]]
    for name in names:
        if names.count(name) > 1:
            raise FormatError(f"{table.name!r} has two columns {name!r}; give each its own name")
    for name, unit in units.items():
        if name not in names:
            raise ArgumentError(
                f"a unit is given for {name!r}, which is not a column of {table.name!r}; "
                f"it has {', '.join(names)}"
            )
        check_unit(unit)
    return named


_KINDS = ("inputs", "outputs")


def _name_and_unit(heading: str, file: str) -> tuple[str, str]:
    """Cut ``u [deg]`` or ``u (deg)`` in two; what is in parentheses may be part of the name."""
    match = _BRACKETS.match(heading)
    if match and match["name"]:
        unit = match["unit"].strip()
        if unit in ("", "-", "1"):
            return match["name"], ""
        try:
            return match["name"], check_unit(unit)
        except UnitError as error:
            raise UnitError(f"{file!r}, column {heading!r}: {error}") from None
    match = _PARENTHESES.match(heading)
    if match and match["name"]:
        unit = match["unit"].strip()
        if unit in ("", "-", "1"):
            return match["name"], ""
        try:
            return match["name"], check_unit(unit)
        except UnitError:
            return heading, ""
    return heading, ""


def _find(wanted: str, columns: Sequence[_Named]) -> _Named | None:
    """The column called `wanted`, by its name or its whole heading, else in any case."""
    found = [c for c in columns if wanted in (c.name, c.heading)]
    if not found:
        found = [c for c in columns if c.name.casefold() == wanted.casefold()]
    return found[0] if len(found) == 1 else None


def _clock_column(
    columns: Sequence[_Named], time: str | None, fs: float | None, file: str
) -> _Named | None:
    listed = ", ".join(c.name for c in columns)
    if time is not None:
        found = _find(time, columns)
        if found is None:
            raise FormatError(f"{file!r} has no time column {time!r}; its columns are {listed}")
        return found
    named = [c for c in columns if c.name.casefold() in TIME_NAMES]
    if len(named) > 1:
        raise FormatError(
            f"{file!r} has several time columns ({', '.join(c.name for c in named)}); "
            "say which with time=... or --time"
        )
    if not named and fs is None:
        raise FormatError(
            f"{file!r} has no column time or t among {listed}; give the rate with fs=... or "
            "--fs, or name the time column with time=... or --time"
        )
    return named[0] if named else None


def _choose(
    kind: str,
    wanted: Sequence[str] | None,
    columns: Sequence[_Named],
    known: tuple[str, ...],
    others: tuple[str, ...],
    file: str,
) -> list[_Named]:
    """The columns of one kind: those asked for, or the one that has a usual name."""
    listed = ", ".join(c.name for c in columns) or "none beside time"
    if isinstance(wanted, str):
        wanted = [wanted]
    if wanted:
        chosen = []
        for name in wanted:
            found = _find(name, columns)
            if found is None:
                raise FormatError(f"{file!r} has no column {name!r}; its columns are {listed}")
            if found in chosen:
                raise ArgumentError(f"{kind} {name!r} is named twice; name it once")
            chosen.append(found)
        return chosen
    usual = [c for c in columns if c.name.casefold() in known]
    if len(usual) == 1:
        return usual
    if usual:
        raise FormatError(
            f"{file!r} has {len(usual)} columns that may be the {kind} "
            f"({', '.join(c.name for c in usual)}); say which with {kind}s=[...] or --{kind}"
        )
    free = [c.name for c in columns if c.name.casefold() not in others]
    example = free[0] if free else known[0]
    raise FormatError(
        f"{file!r} does not say which column is the {kind}; its columns are {listed}: "
        f"name it with {kind}s=[{example!r}] or --{kind} {example}"
    )


def _seconds(stamps: NDArray[np.float64], clock: _Named, file: str) -> NDArray[np.float64]:
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


def _check_increases(stamps: NDArray[np.float64], table: Table, clock: _Named) -> None:
    back = np.flatnonzero(np.diff(stamps) <= 0)
    if back.size:
        k = int(back[0])
        raise RecordError(
            f"{table.name!r}, line {table.lines[k + 1]}: {clock.name} goes from "
            f"{stamps[k]:.9g} s to {stamps[k + 1]:.9g} s and must increase "
            f"({back.size} such in all); sort the rows, or cut the file there"
        )
