"""Which reader reads a file: decided by its content."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path

from hmpim.errors import FormatError
from hmpim.formats.readers import excel, record_file, text
from hmpim.formats.readers.logs import (
    ardupilot,
    blackbox,
    hdf5,
    mat,
    mdf,
    parquet,
    ros,
    tdms,
    uff58,
    ulog,
    wav,
    wpilog,
)
from hmpim.formats.readers.protocol import Reader
from hmpim.formats.readers.worker import addressed, shielded

__all__ = ["BUILT_IN", "GROUP", "HEAD", "BrokenReader", "Found", "reader_for", "readers"]

GROUP = "hmpim.readers"
"""Group of entry points under which a reader of one's own is published."""

HEAD = 65_536
"""Number of bytes at the start of a file by which a format is recognised."""

# The most particular first; text, which anything printable may be, last.
BUILT_IN: tuple[Reader, ...] = (
    record_file.RECORD_FILE,
    mat.MAT,
    hdf5.HDF5,
    parquet.PARQUET,
    mdf.MDF,
    tdms.TDMS,
    ulog.ULOG,
    ardupilot.ARDUPILOT,
    blackbox.BLACKBOX,
    ros.ROS,
    wpilog.WPILOG,
    wav.WAV,
    uff58.UFF58,
    excel.EXCEL,
    text.TEXT,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class BrokenReader:
    """A reader of others that cannot be used.

    Parameters
    ----------
    name : str
        Name of its entry point, and where that leads.
    reason : str
        What went wrong, in one line.
    """

    name: str
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """All readers there are.

    Parameters
    ----------
    usable : tuple of Reader
        In the order in which they are asked: those of others first, then our own.
    broken : tuple of BrokenReader
        Those of others that are skipped.
    """

    usable: tuple[Reader, ...]
    broken: tuple[BrokenReader, ...]


@cache
def readers() -> Found:
    """Return our own readers and those published under ``hmpim.readers``.

    Examples
    --------
    >>> readers().usable[-1].format
    'text'
    """
    usable: list[Reader] = []
    broken: list[BrokenReader] = []
    for entry in sorted(entry_points(group=GROUP), key=lambda e: e.name):
        name = f"{entry.name} ({entry.value})"
        try:
            reader = entry.load()
        except Exception as error:  # code of others
            reason = " ".join(f"{type(error).__name__}: {error}".split())
            broken.append(BrokenReader(name=name, reason=reason))
            continue
        reason = _unusable(reader)
        if reason:
            broken.append(BrokenReader(name=name, reason=reason))
        else:
            usable.append(reader)
    return Found(usable=(*usable, *BUILT_IN), broken=tuple(broken))


def _unusable(reader: object) -> str:
    """Why what an entry point leads to is no reader; empty if it is one."""
    if not isinstance(reader, Reader):
        return f"it is a {type(reader).__name__}, not an hmpim.formats.readers.Reader"
    if reader.foreign:
        try:
            addressed(reader.channels)
            addressed(reader.read)
        except FormatError as error:
            return str(error)
    return ""


def reader_for(path: Path) -> Reader:
    """Return the reader whose format a file is in; a foreign one works in a process apart.

    Raises
    ------
    FormatError
        If there is no such file, it cannot be opened, or no reader knows it.

    Examples
    --------
    >>> reader_for(Path("nowhere.csv"))
    Traceback (most recent call last):
    ...
    hmpim.errors.FormatError: there is no file 'nowhere.csv'; check the path
    """
    head = _head(path)
    if not head:
        raise FormatError(f"{path.name!r} is empty; record again, or check how it was copied")
    found = readers()
    failed = [*found.broken]
    for reader in found.usable:
        try:
            if reader.sniff(head, path):
                return shielded(reader)
        except Exception as error:  # code of others
            reason = f"{type(error).__name__} while looking at the file: {error}"
            failed.append(BrokenReader(name=reader.format, reason=reason))
    raise FormatError(_unknown(path, head, found.usable, failed))


def _head(path: Path) -> bytes:
    if path.is_dir():
        path = path / "metadata.yaml"  # a ROS 2 bag is a folder
        if not path.is_file():
            raise FormatError(f"{str(path.parent)!r} is a folder; name the file in it")
    try:
        with path.open("rb") as file:
            return file.read(HEAD)
    except FileNotFoundError:
        raise FormatError(f"there is no file {str(path)!r}; check the path") from None
    except (OSError, ValueError) as error:  # a NUL in the path is a ValueError
        reason = getattr(error, "strerror", None) or error
        raise FormatError(f"{str(path)!r} cannot be opened: {reason}") from None


def _unknown(
    path: Path, head: bytes, usable: Sequence[Reader], failed: Sequence[BrokenReader]
) -> str:
    formats = ", ".join(sorted({r.format for r in usable}))
    start = head[:8].hex(" ")
    message = (
        f"{path.name!r} is a binary file that starts with the bytes {start}, which no reader "
        f"recognises. The readers cover {formats}: export it as one of these, or install a reader"
    )
    if failed:
        skipped = "; ".join(f"{b.name}: {b.reason}" for b in failed)
        message += f" (skipped, as they do not work: {skipped})"
    return message
