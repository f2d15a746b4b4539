"""PX4's ULog (extra `ulog`: pyulog)."""

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmpim.formats.readers.logs.clock import seconds_since
from hmpim.formats.readers.logs.log import Column, Group, Log, cut_short, list_log, take_series
from hmpim.formats.readers.protocol import Contents, Layout, Reader, Stamps, need
from hmpim.record import Finding, Series

__all__ = ["ULOG", "channels", "parse", "read", "sniff"]

_MAGIC = b"\x55\x4c\x6f\x67\x01\x12\x35"
_STAMPS = ("timestamp", "timestamp_sample")


def sniff(head: bytes, path: Path) -> bool:
    r"""Say whether a file is ULog.

    Examples
    --------
    >>> sniff(b"ULog\x01\x12\x35\x01", Path("a.ulg")), sniff(b"u,y", Path("a.ulg"))
    (True, False)
    """
    return head.startswith(_MAGIC)


def channels(path: Path, layout: Layout) -> Contents:
    """List the fields of all messages."""
    return list_log(parse, path, layout)


def read(path: Path, names: Sequence[str], layout: Layout) -> tuple[Series, ...]:
    """Read fields by name: ``vehicle_angular_velocity.xyz[0]``, ``sensor_gyro:1.x``."""
    return take_series(parse, path, names, layout)


def parse(path: Path, layout: Layout) -> Log:
    """Open a file; its messages have one clock, in µs since the start of the system.

    `layout.stamps` chooses between ``timestamp_sample``, when a value was measured ('header',
    'auto' where there is one), and ``timestamp``, when it was published ('log').
    """
    core = need("pyulog.core", extra="ulog", what="a ULog file")
    file = core.ULog(str(path))
    datasets = [d for d in file.data_list if len(d.data.get("timestamp", ()))]
    start = int(file.start_timestamp) if file.start_timestamp else 0
    return Log(
        format="ULog",
        groups=tuple(_group(d, start, layout.stamps) for d in datasets),
        findings=tuple(_said(file, path)),
    )


ULOG = Reader(
    format="ULog",
    sniff=sniff,
    channels=channels,
    read=read,
    extra="ulog",
    foreign=True,
    uses=("stamps",),
)


def _group(dataset: Any, start: int, stamps: Stamps) -> Group:
    name = dataset.name if not dataset.multi_id else f"{dataset.name}:{dataset.multi_id}"
    measured = stamps != "log" and "timestamp_sample" in dataset.data
    clock = "timestamp_sample" if measured else "timestamp"
    ticks = np.asarray(dataset.data[clock])
    if measured and not ticks.any():  # the field is there and was never set
        clock, ticks = "timestamp", np.asarray(dataset.data["timestamp"])
    columns = tuple(
        Column(name=f"{name}.{field}", samples=ticks.size, load=partial(_values, values))
        for field, values in dataset.data.items()
        if field not in _STAMPS
    )
    return Group(
        name=name,
        columns=columns,
        time=seconds_since(ticks, start, per_second=10**6),
        time_name=clock,
    )


def _values(values: NDArray[Any]) -> NDArray[Any]:
    return values


def _said(file: Any, path: Path) -> Iterator[Finding]:
    lost = [d.duration for d in file.dropouts]
    if lost:
        how = (
            f"once, for {lost[0]} ms"
            if len(lost) == 1
            else f"{len(lost)} times, for {sum(lost)} ms in total and {max(lost)} ms at most"
        )
        message = f"the logger dropped data {how}; look for gaps"
        yield Finding(code="dropouts", message=message, severity="info", parameters=())
    if file.file_corruption:
        message = "parts of the file are damaged and were left out; look for gaps"
        yield Finding(code="damaged_parts", message=message, severity="info", parameters=())
    elif not _whole(path.read_bytes()):
        yield from cut_short(
            "the last message of the file is cut short; what came after it is lost"
        )


def _whole(data: bytes) -> bool:
    """Whether the last message is all there; the library leaves it out without a word."""
    place, size = 16, len(data)
    while place + 3 <= size:
        place += 3 + data[place] + 256 * data[place + 1]
    return place == size
