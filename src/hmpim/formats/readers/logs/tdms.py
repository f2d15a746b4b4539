"""TDMS, LabVIEW's measurement files (extra `tdms`: npTDMS)."""

from collections.abc import Mapping, Sequence
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
from hmpim.formats.readers.text import named
from hmpim.record import Finding, Series

__all__ = ["TDMS", "channels", "parse", "read", "sniff"]


def sniff(head: bytes, path: Path) -> bool:
    """Say whether a file is TDMS.

    Examples
    --------
    >>> sniff(b"TDSm....", Path("a.tdms")), sniff(b"u,y", Path("a.tdms"))
    (True, False)
    """
    return head.startswith(b"TDSm")


def channels(path: Path, layout: Layout) -> Contents:
    """List the channels of all groups."""
    return list_log(parse, path, layout)


def read(path: Path, names: Sequence[str], layout: Layout) -> tuple[Series, ...]:
    """Read channels by name: ``group/channel``."""
    return take_series(parse, path, names, layout)


def parse(path: Path, layout: Layout) -> Log:
    """Open a file; a channel has the clock of its waveform, or its group's channel of time."""
    nptdms = need("nptdms", extra="tdms", what="a TDMS file")
    file = nptdms.TdmsFile.read(str(path))
    status = getattr(file, "file_status", None)
    said: tuple[Finding, ...] = ()
    if status is not None and getattr(status, "incomplete_final_segment", False):
        lost = _lost(status)
        said = cut_short(f"the last part of the file is cut short{lost}; what came after is lost")
    groups: dict[tuple[object, ...], list[Any]] = {}
    for group in file.groups():
        for channel in group.channels():
            increment = channel.properties.get("wf_increment")
            start = channel.properties.get("wf_start_offset", 0.0)
            key = (group.name, len(channel), increment or None, start if increment else 0.0)
            groups.setdefault(key, []).append(channel)
    found = tuple(_group(key, parts) for key, parts in groups.items())
    return Log(format="TDMS", groups=found, findings=said)


TDMS = Reader(
    format="TDMS", sniff=sniff, channels=channels, read=read, extra="tdms", foreign=True, uses=()
)


def _lost(status: Any) -> str:
    """How many samples each channel lacks, in words."""
    parts = [
        f"{expected - got} of {expected} samples"
        for s in (getattr(status, "channel_statuses", None) or {}).values()
        for expected, got in [(int(s.expected_length), int(s.read_length))]
        if expected > got
    ]
    return f" (a channel lacks {max(parts, key=len)} of it)" if parts else ""


def _group(key: tuple[Any, ...], parts: Sequence[Any]) -> Group:
    name, size, increment, start = key
    time = None
    if isinstance(increment, int | float) and increment > 0:
        time = float(start) + float(increment) * np.arange(size)
    return Group(
        name=f"{name}, {size} samples",
        columns=tuple(_column(channel) for channel in parts) if size else (),
        time=time,
        time_name="wf_increment",
    )


def _column(channel: Any) -> Column:
    kind = np.dtype(channel.dtype).kind
    unit = unit_of(channel.properties.get("unit_string") or channel.properties.get("unit"))
    unit = unit or named(channel.name)[1]
    return Column(
        name=f"{channel.group_name}/{channel.name}",
        unit=unit,
        samples=len(channel),
        load=partial(_values, channel) if kind in "biufM" else None,
        scale=_scale(channel.properties, unit),
    )


def _scale(properties: Mapping[str, Any], unit: str) -> str:
    """How counts become samples, in words; empty if they are samples already."""
    kinds = {k: v for k, v in properties.items() if k.endswith("_Scale_Type")}
    if not kinds:
        return ""
    place = "NI_Scale[0]"
    if list(kinds.items()) == [(f"{place}_Scale_Type", "Linear")]:
        factor = properties.get(f"{place}_Linear_Slope", 1.0)
        offset = properties.get(f"{place}_Linear_Y_Intercept", 0.0)
        return per_count(float(factor), unit, offset=float(offset))
    names = ", ".join(dict.fromkeys(str(kind) for kind in kinds.values()))
    return f"through the scales of its properties ({names}){f', in {unit}' if unit else ''}"


def _values(channel: Any) -> NDArray[Any]:
    values = np.asarray(channel[:])
    if values.dtype.kind == "M":  # dates: s since 1970
        return np.asarray(values.astype("datetime64[ns]").astype(np.int64) / 1e9)
    return values
