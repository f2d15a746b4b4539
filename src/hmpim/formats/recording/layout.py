"""Where everything stands in a record file, and how room for it is made.

A file is laid out whole before the first sample is written: datasets of their full length,
contiguous, filled with NaN. Samples then go to their places in the file as plain bytes. Nothing
of HDF5's own structure changes meanwhile, so that the file can be opened whenever its writer
dies.

The kind of file is that of HDF5 1.8 (2008), which everything since can read. Older kinds have no
checksums on their structure: of 600 such files with up to three bytes flipped, four made HDF5 2.0
crash or hang.
"""

import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hmpim.formats.recording.heading import Heading, State, write_details, write_heading
from hmpim.formats.recording.text import put_text
from hmpim.record import ROLES, Role

__all__ = [
    "BLOCK_SECONDS",
    "GROUPS",
    "LOG_WIDTH",
    "Room",
    "Space",
    "block_length",
    "lay_out",
    "log_line",
    "new_file",
]

BLOCK_SECONDS = 0.25
"""Length of a block, which has a checksum of its own, in seconds at the nominal rate."""

GROUPS: dict[Role, str] = {
    "input": "inputs",
    "output": "outputs",
    "reference": "references",
    "auxiliary": "auxiliary",
}
"""Group of the channels of each role."""

LOG_WIDTH = 240
"""Bytes of a line of the log; a longer one is cut."""

_ERRNO = re.compile(r"errno = (\d+)")

COLUMNS = "first sample, number of samples, CRC-32 of their times, CRC-32 of their values"


@dataclass(frozen=True, slots=True, kw_only=True)
class Space:
    """Room that a channel needs.

    Parameters
    ----------
    name, unit : str
        Of the channel.
    role : {'input', 'output', 'reference', 'auxiliary'}
        Of the channel.
    samples, rows : int
        Samples, and blocks, that there is to be room for.
    shares_time_with : int or None
        Number of an earlier channel that has the very same stamps.
    """

    name: str
    unit: str
    role: Role
    samples: int
    rows: int
    shares_time_with: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Room:
    """Datasets of a channel, as h5py has them."""

    time: Any
    values: Any
    blocks: Any


def block_length(fs: float) -> int:
    """Samples after which a block ends.

    Examples
    --------
    >>> block_length(1000.0), block_length(1.0)
    (250, 1)
    """
    return max(1, round(BLOCK_SECONDS * fs))


def log_line(text: str) -> bytes:
    r"""Return a line of the log as it is written: one line, UTF-8, cut to `LOG_WIDTH` bytes.

    Examples
    --------
    >>> log_line("armed,\n  5 axes"), len(log_line("ä" * 200))
    (b'armed, 5 axes', 240)
    """
    return " ".join(text.split()).encode()[:LOG_WIDTH].decode(errors="ignore").encode()


@contextmanager
def new_file(path: Path) -> Iterator[Any]:
    """Open a new file (h5py.File) at `path`, of the kind that ours are.

    Raises
    ------
    OSError
        If the system takes no more of it; h5py may say that as another error.
    """
    import h5py

    try:
        access = h5py.h5p.create(h5py.h5p.FILE_ACCESS)
        access.set_libver_bounds(h5py.h5f.LIBVER_V18, h5py.h5f.LIBVER_V18)
        plan = h5py.h5p.create(h5py.h5p.FILE_CREATE)
        plan.set_attr_phase_change(64, 48)  # attributes of the root stay in place at the start
        truncate = h5py.h5f.ACC_TRUNC
        with h5py.File(
            h5py.h5f.create(os.fsencode(path), truncate, fcpl=plan, fapl=access)
        ) as file:
            yield file
    except (OSError, RuntimeError, ValueError) as error:
        found = _ERRNO.search(str(error))
        if found is None:
            raise
        number = int(found[1])
        raise OSError(number, os.strerror(number)) from error


def lay_out(
    file: Any,
    heading: Heading,
    spaces: Sequence[Space],
    *,
    state: State,
    log_lines: int,
    reserved: bool,
) -> tuple[list[Room], Any]:
    """Lay out a file that is open and empty.

    Parameters
    ----------
    file : h5py.File
        The file, from `new_file`.
    heading : Heading
        What it says of the test.
    spaces : sequence of Space
        Channels, in order.
    state : State
        What it says of itself.
    log_lines : int
        Lines of the log that there is to be room for.
    reserved : bool
        True takes the room on the disk at once, filled with NaN.

    Returns
    -------
    rooms : list of Room
        In the order of `spaces`.
    log : h5py.Dataset
        Lines of the log.
    """
    # All that belongs to the root first: programs look for the format near the start of a file.
    write_heading(file, heading, state)
    for name in (*GROUPS.values(), "log"):
        file.create_group(name, track_order=True)
    write_details(file, heading)
    taken: dict[Role, list[str]] = {role: [] for role in ROLES}
    rooms: list[Room] = []
    for number, space in enumerate(spaces):
        link = _link(space.name, taken[space.role])
        taken[space.role].append(link.casefold())
        group = file.create_group(f"{GROUPS[space.role]}/{link}")
        for name in ("name", "unit", "role"):
            put_text(group, name, getattr(space, name))
        group.attrs["number"] = number
        if space.shares_time_with is None:
            time = _made(group, "time", (space.samples,), np.nan, reserved=reserved)
            put_text(time, "unit", "s")
        else:
            time = rooms[space.shares_time_with].time
            group["time"] = time  # one dataset under two names
        values = _made(group, "values", (space.samples,), np.nan, reserved=reserved)
        put_text(values, "unit", space.unit)
        blocks = _made(group, "blocks", (space.rows, 4), 0, reserved=reserved)
        put_text(blocks, "columns", COLUMNS)
        rooms.append(Room(time=time, values=values, blocks=blocks))
    return rooms, _made(file["log"], "lines", (log_lines,), b"", reserved=reserved)


def _made(group: Any, name: str, shape: tuple[int, ...], fill: Any, *, reserved: bool) -> Any:
    """A contiguous dataset: 64-bit floats, 64-bit counts, or lines of text."""
    import h5py

    if isinstance(fill, bytes):
        kind: Any = h5py.string_dtype("utf-8", LOG_WIDTH)
    else:
        kind = np.dtype("<f8" if isinstance(fill, float) else "<u8")
    plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plan.set_obj_track_times(False)
    if reserved:
        plan.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
        plan.set_fill_time(h5py.h5d.FILL_TIME_ALLOC)
        if not isinstance(fill, bytes):
            plan.set_fill_value(np.array(fill, dtype=kind))
    space = h5py.h5s.create_simple(shape)
    made = h5py.h5d.create(group.id, name.encode(), h5py.h5t.py_create(kind), space, plan)
    return h5py.Dataset(made)


def _link(name: str, taken: list[str]) -> str:
    """Name of a channel as a path in the file may have it, used once."""
    link = re.sub(r"[/\x00-\x1f]", "_", name).strip()
    if not link.strip("."):
        link = "channel"
    base, number = link, 2
    while link.casefold() in taken:
        link, number = f"{base}_{number}", number + 1
    return link
