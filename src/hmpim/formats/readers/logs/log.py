"""What every log is once its format is forgotten: groups of columns, each with one clock."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import FormatError
from hmpim.formats.readers.logs.clock import clock_column, is_time
from hmpim.formats.readers.protocol import WORDS, ChannelInfo, Contents, Layout, listed
from hmpim.record import Finding, Series
from hmpim.units import read_unit

__all__ = [
    "Column",
    "Group",
    "Log",
    "cut_short",
    "groups_of",
    "list_log",
    "numbers",
    "per_count",
    "take_series",
    "unit_of",
]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Column:
    """One signal of a log.

    Parameters
    ----------
    name : str
        Name by which it is asked for; unique in its log.
    load : function of () to ndarray, or None
        Its samples, shape (n,); None if it holds no real numbers.
    unit : str
        Unit as the log states it.
    samples : int or None
        How many, where that is known without loading them.
    scale : str
        How counts become samples where they do, such as 'as 0.01 degC each'; else empty.
    holds : str
        What it holds where `load` is None, for messages.
    """

    name: str
    load: Callable[[], NDArray[Any]] | None
    unit: str = ""
    samples: int | None = None
    scale: str = ""
    holds: str = WORDS


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Group:
    """Columns that share a clock.

    Parameters
    ----------
    name : str
        Name of the message, topic or table.
    columns : tuple of Column
        Its signals.
    time : ndarray, shape (n,), or None
        Stamps in s; None where a column holds them, or nothing does.
    time_name : str or None
        What they are called in the log.
    findings : tuple of Finding
        What is to be said of each of its channels.
    stamped : {'sender', 'log', ''}
        Who made the stamps, where a format knows both; a delay between the two kinds is off.
    """

    name: str
    columns: tuple[Column, ...]
    time: NDArray[np.float64] | None = None
    time_name: str | None = None
    findings: tuple[Finding, ...] = ()
    stamped: Literal["sender", "log", ""] = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Log:
    """A file.

    Parameters
    ----------
    format : str
        Name of the format, for people.
    groups : tuple of Group
        In the order of the file.
    origin : float or None
        Unix time in s at which its time is 0.
    fs : float or None
        Nominal rate in Hz, where the file states it.
    findings : tuple of Finding
        What is to be said of the file.
    """

    format: str
    groups: tuple[Group, ...]
    origin: float | None = None
    fs: float | None = None
    findings: tuple[Finding, ...] = ()


def groups_of(
    columns: Mapping[tuple[str, int], Sequence[Column]], *, separator: str, outermost: str
) -> tuple[Group, ...]:
    """Make groups of columns; those without time join the nearest owner of equal length with one.

    Parameters
    ----------
    columns : mapping of (str, int) to sequence of Column
        By the path of what they stand in, and by their number of samples.
    separator : str
        What stands between the parts of a path.
    outermost : str
        What the empty path is called.

    Examples
    --------
    >>> t, u = (Column(name=name, load=None) for name in ("log.t", "log.in.u"))
    >>> found = groups_of({("log", 9): [t], ("log.in", 9): [u]}, separator=".", outermost="file")
    >>> [(g.name, [c.name for c in g.columns]) for g in found]
    [('log, 9 samples', ['log.t', 'log.in.u'])]
    """
    timed = {at for at, members in columns.items() if any(is_time(c.name) for c in members)}
    found: dict[tuple[str, int], list[Column]] = {}
    for (owner, size), members in columns.items():
        home = owner
        while home and (home, size) not in timed:
            home = home.rpartition(separator)[0]
        at = (home, size) if (home, size) in timed else (owner, size)
        found.setdefault(at, []).extend(members)
    return tuple(
        Group(name=f"{owner or outermost}, {size} samples", columns=tuple(members))
        for (owner, size), members in found.items()
        if members
    )


Parse = Callable[[Path, Layout], Log]
_LAST: dict[str, tuple[tuple[object, ...], Log]] = {}


def list_log(parse: Parse, path: Path, layout: Layout) -> Contents:
    """List the channels of a log.

    Raises
    ------
    FormatError
        If it holds none, or several columns may be the time.
    """
    log = _parsed(parse, path, layout)
    infos = tuple(
        ChannelInfo(
            name=column.name,
            unit=column.unit,
            samples=column.samples,
            clock=group.name,
            holds=column.holds if column.load is None else "",
        )
        for group in log.groups
        for column in group.columns
    )
    names = {g.time_name for g in log.groups if g.time is not None}
    return Contents(
        format=log.format,
        channels=infos,
        time=names.pop() if len(names) == 1 else "the stamps of each message" if names else None,
        origin=log.origin,
        fs=log.fs,
        findings=log.findings,
    )


def take_series(
    parse: Parse, path: Path, names: Sequence[str], layout: Layout
) -> tuple[Series, ...]:
    """Read channels of a log by name."""
    log = _parsed(parse, path, layout)
    places = {column.name: (group, column) for group in log.groups for column in group.columns}
    mixed = _mixed([places[name][0] for name in names])
    scaled = _scaled([places[name][1] for name in names])
    out = []
    for name in names:
        group, column = places[name]
        if column.load is None:
            raise FormatError(f"{name!r} of {path.name!r} holds {column.holds}")
        values = numbers(column.load())
        time = group.time
        if time is not None and time.size != values.size:
            raise FormatError(
                f"{name!r} of {path.name!r} has {values.size} samples and {time.size} stamps; "
                "the file is damaged"
            )
        out.append(
            Series(
                name=name,
                values=values,
                time=time,
                unit=column.unit,
                findings=(*group.findings, *scaled.get(column.scale, ()), *mixed),
            )
        )
    return tuple(out)


def _scaled(columns: Sequence[Column]) -> dict[str, tuple[Finding, ...]]:
    """What is said of factors, by factor; channels that share it share one line."""
    shared: dict[str, list[str]] = {}
    for column in columns:
        if column.scale:
            shared.setdefault(column.scale, []).append(column.name)
    said: dict[str, tuple[Finding, ...]] = {}
    for scale, names in shared.items():
        message = f"counts of {_first(names)} are read {scale}, as the file states"
        said[scale] = (Finding(code="scale", message=message, severity="info", parameters=()),)
    return said


def _first(names: Sequence[str]) -> str:
    more = f" and {len(names) - 8} others" if len(names) > 8 else ""
    return ", ".join(names[:8]) + more


def _mixed(groups: Sequence[Group]) -> tuple[Finding, ...]:
    """A doubt if some channels have their sender's stamps and others the log's."""
    logged = sorted({g.name for g in groups if g.stamped == "log"})
    sent = sorted({g.name for g in groups if g.stamped == "sender"})
    if not logged or not sent:
        return ()
    message = (
        f"{', '.join(sent)} has its sender's stamps and {', '.join(logged)} only the log's, which "
        "are later by the transport: delay is off by that; take --stamps log for all"
    )
    delays = ("delay", "delay_correlation", "delay_low_frequency", "bandwidth_phase90")
    return (Finding(code="mixed_stamps", message=message, severity="doubt", parameters=delays),)


def _parsed(parse: Parse, path: Path, layout: Layout) -> Log:
    """The log; the last one is kept, as its channels are listed first and read then."""
    stat = path.stat()
    key = (parse, str(path), stat.st_mtime_ns, stat.st_size, layout)
    kept = _LAST.get("log")
    if kept is not None and kept[0] == key:
        return kept[1]
    _LAST.clear()
    log = _timed(parse(path, layout), path.name, layout)
    if not any(group.columns for group in log.groups):
        raise FormatError(f"{path.name!r} holds no channels; record again")
    _check_names(log, path.name)
    _LAST["log"] = (key, log)
    return log


def _timed(log: Log, file: str, layout: Layout) -> Log:
    """The log with time taken from columns, where the format has none of its own."""
    groups, findings, origins = [], list(log.findings), {log.origin} - {None}
    wanted = layout.time
    seen = wanted is None
    for group in log.groups:
        found = clock_column(
            [(c.name, c.unit) for c in group.columns if c.load is not None],
            wanted=wanted,
            bare=group.time is None,
            file=file,
        )
        if found is None:
            groups.append(group)
            continue
        seen = seen or wanted is not None
        place = next(c for c in group.columns if c.name == found.name)
        assert place.load is not None
        time, origin, said = found.seconds(numbers(place.load()))
        if origin is not None:
            origins.add(origin)
        findings += [f for f in said if f not in findings]
        rest = tuple(c for c in group.columns if c is not place)
        groups.append(replace(group, columns=rest, time=time, time_name=found.name))
    if not seen:
        names = listed([c.name for g in log.groups for c in g.columns])
        raise FormatError(f"{file!r} has no time channel {wanted!r}; its channels are {names}")
    if log.origin is None and len(origins) > 1:
        raise FormatError(
            f"the tables of {file!r} count time from different starts; read one of them, or name "
            "its time with --time"
        )
    return replace(
        log, groups=tuple(groups), findings=tuple(findings), origin=next(iter(origins), None)
    )


def _check_names(log: Log, file: str) -> None:
    names = [c.name for g in log.groups for c in g.columns]
    twice = next((n for n in set(names) if names.count(n) > 1), None) if len(names) < 5000 else None
    if twice is not None:
        raise FormatError(f"{file!r} has two channels {twice!r}; it is damaged")


def numbers(values: NDArray[Any]) -> NDArray[np.float64]:
    """Return samples as float64, NaN where one is masked.

    Raises
    ------
    FormatError
        If they are no real numbers.

    Examples
    --------
    >>> numbers(np.ma.masked_array([1, 2], mask=[False, True]))
    array([ 1., nan])
    """
    if isinstance(values, np.ma.MaskedArray):
        filled: NDArray[np.float64] = np.ma.filled(values.astype(np.float64), np.nan)
        return filled
    if values.dtype.kind not in "biuf":
        raise FormatError(f"a channel holds {values.dtype} and no real numbers")
    with np.errstate(invalid="ignore"):  # a NaN of another kind stays one
        return np.ascontiguousarray(values, dtype=np.float64)


def unit_of(text: object) -> str:
    """Return a unit that a log states in a spelling that pint knows, or as it stands there.

    Examples
    --------
    >>> unit_of("°/s"), unit_of("-"), unit_of(None), unit_of("furlongs^")
    ('deg/s', '', '', 'furlongs^')
    """
    if not isinstance(text, str):
        return ""
    plain = " ".join("".join(c if c.isprintable() else " " for c in text).split())[:40]
    if plain in ("", "-", "1", "–", "n/a", "N/A", "none", "None"):
        return ""
    return read_unit(plain) or plain


def per_count(factor: float, unit: str, *, offset: float = 0.0) -> str:
    """Return in words how counts become samples; empty where they are samples already.

    Parameters
    ----------
    factor, offset : float
        What a count is multiplied by, and what is added, in the unit.
    unit : str
        Unit of the samples.

    Examples
    --------
    >>> per_count(0.01, "degC"), per_count(0.5, "V", offset=-2.0), per_count(1.0, "V")
    ('as 0.01 degC each', 'as 0.5 V each minus 2 V', '')
    """
    if factor == 1 and offset == 0:
        return ""
    sign = "plus" if offset > 0 else "minus"
    more = f" {sign} {abs(offset):.6g} {unit}".rstrip() if offset else ""
    return f"as {f'{factor:.6g} {unit}'.strip()} each{more}"


def cut_short(message: str) -> tuple[Finding, ...]:
    """Return what is said where a file ends too early."""
    return (Finding(code="cut_short", message=message, severity="info", parameters=()),)
