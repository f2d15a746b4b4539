"""MDF 3 and 4, ASAM's format for measurements (extra `mdf`: asammdf)."""

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmpim.formats.readers.logs.log import (
    Column,
    Group,
    Log,
    cut_short,
    list_log,
    per_count,
    take_series,
    unit_of,
)
from hmpim.formats.readers.protocol import Contents, Layout, Reader, need
from hmpim.record import Finding, Series

__all__ = ["MDF", "channels", "parse", "read", "sniff"]


def sniff(head: bytes, path: Path) -> bool:
    """Say whether a file is MDF, finished or not.

    Examples
    --------
    >>> sniff(b"MDF     4.10    ", Path("a.mf4")), sniff(b"u,y", Path("a.mf4"))
    (True, False)
    """
    return head.startswith((b"MDF     ", b"UnFinMF "))


def channels(path: Path, layout: Layout) -> Contents:
    """List the channels of all groups."""
    return list_log(parse, path, layout)


def read(path: Path, names: Sequence[str], layout: Layout) -> tuple[Series, ...]:
    """Read channels by name; one that several groups have is called ``name (group 2)``."""
    return take_series(parse, path, names, layout)


def parse(path: Path, layout: Layout) -> Log:
    """Open a file."""
    asammdf = need("asammdf", extra="mdf", what="an MDF file")
    with path.open("rb") as start:
        unfinished = start.read(8) == b"UnFinMF "
    file = asammdf.MDF(str(path))
    said: tuple[Finding, ...] = ()
    if unfinished:
        said = cut_short("the file was never finished, as if the logger was killed; it ends early")
    names: dict[str, int] = {}
    for group in file.groups:
        for channel in group.channels:
            names[channel.name] = names.get(channel.name, 0) + 1
    groups = [_group(file, k, names) for k in range(len(file.groups))]
    start_time = getattr(file, "start_time", None)
    return Log(
        format=f"MDF {file.version}",
        groups=tuple(g for g in groups if g.columns),
        origin=None if start_time is None else float(start_time.timestamp()),
        findings=said,
    )


MDF = Reader(
    format="MDF", sniff=sniff, channels=channels, read=read, extra="mdf", foreign=True, uses=()
)


def _group(file: Any, place: int, names: dict[str, int]) -> Group:
    group = file.groups[place]
    master = file.masters_db.get(place)
    count = int(group.channel_group.cycles_nr)
    label = getattr(group.channel_group, "acq_name", "") or f"group {place + 1}"
    if not count:
        return Group(name=label, columns=())
    time = np.asarray(file.get_master(place), dtype=np.float64)
    findings: tuple[Finding, ...] = ()
    if time.size < count:
        findings = cut_short(
            f"{label!r} states {count} samples, and the file holds {time.size} of them"
        )
    time_name = group.channels[master].name if master is not None else "time"
    return Group(
        name=f"{place}: {label}",
        columns=tuple(_columns(file, place, master, names, time)),
        time=time if master is not None else None,
        time_name=time_name,
        findings=findings,
    )


def _columns(
    file: Any, place: int, master: int | None, names: dict[str, int], time: NDArray[np.float64]
) -> Iterator[Column]:
    seen: dict[str, int] = {}
    for k, channel in enumerate(file.groups[place].channels):
        if k == master:
            continue
        seen[channel.name] = seen.get(channel.name, 0) + 1
        name = channel.name
        if names[name] > 1:
            twin = f", {seen[name]}" if seen[name] > 1 else ""
            name = f"{name} (group {place + 1}{twin})"
        conversion = channel.conversion
        unit = unit_of(channel.unit or (getattr(conversion, "unit", "") if conversion else ""))
        load = None if _words(file, place, k) else partial(_samples, file, place, k, time.size)
        scale = _scale(conversion, unit)
        yield Column(name=name, unit=unit, samples=time.size, load=load, scale=scale)


_NO_CONVERSION = (None, 0xFFFF)  # of MDF 3; MDF 4 has 0, which is linear there


def _scale(conversion: Any, unit: str) -> str:
    """How counts become samples, in words; empty if they are samples already."""
    if conversion is None:
        return ""
    factor, offset = getattr(conversion, "a", None), getattr(conversion, "b", None)
    if isinstance(factor, float) and isinstance(offset, float):
        return per_count(factor, unit, offset=offset)
    if getattr(conversion, "conversion_type", None) in _NO_CONVERSION or _plain(conversion):
        return ""
    return f"through the formula or table of its conversion{f', in {unit}' if unit else ''}"


def _plain(conversion: Any) -> bool:
    """Whether a conversion of MDF 4 changes nothing."""
    return hasattr(conversion, "val_param_nr") and conversion.conversion_type == 0


def _words(file: Any, place: int, channel: int) -> bool:
    """Whether a channel holds no plain numbers, as its first sample shows."""
    signal = file.get(group=place, index=channel, record_offset=0, record_count=1)
    return signal.samples.dtype.kind not in "biuf" or signal.samples.ndim != 1


def _samples(file: Any, place: int, channel: int, size: int) -> NDArray[Any]:
    """Samples in their unit, NaN where the file says that one is not valid."""
    signal = file.get(group=place, index=channel, ignore_invalidation_bits=True)
    values = np.asarray(signal.samples, dtype=np.float64)
    invalid = getattr(signal, "invalidation_bits", None)
    if invalid is not None and np.shape(invalid) == values.shape:
        values = np.where(np.asarray(invalid, dtype=bool), np.nan, values)
    return values
