"""Files that are complete or absent: written to a temporary file, then moved into place.

Every file that hmpim writes goes through `replacing`. The one exception is the record of a
running test, which grows as it comes (`hmpim.formats.recording`). A process that is killed, or a
disk that is full, never leaves half a file; what a power cut leaves is up to the file system.
"""

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from hmpim.errors import ArgumentError

__all__ = ["check_writable", "replacing", "write_text"]


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a path to write to; move it to `path` when all went well, remove it when not.

    The path given has the suffix of `path`, for writers that choose a format by it. Rights of a
    file that is replaced stay, and a link stays a link. What is not a plain file, such as a
    pipe or ``/dev/stdout``, is given as it is.

    Parameters
    ----------
    path : path-like
        Where the file is wanted. Its folder must exist.

    Raises
    ------
    ArgumentError
        If the folder does not exist or cannot be written to, or the disk is full. What was at
        `path` is then still there.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with replacing(Path(folder) / "a.txt") as place:
    ...         _ = place.write_text("whole")
    ...     [p.name for p in Path(folder).iterdir()]
    ['a.txt']
    """
    wanted = _resolved(path)
    if wanted.exists() and not wanted.is_file():
        yield wanted
        return
    place = wanted.with_name(f".hmpim-{secrets.token_hex(6)}{wanted.suffix}")
    try:
        os.close(os.open(place, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        if wanted.exists():
            place.chmod(wanted.stat().st_mode & 0o777)
        yield place
        place.replace(wanted)
    except OSError as error:
        raise ArgumentError(f"{os.fspath(path)!r} cannot be written: {_reason(error)}") from error
    finally:
        place.unlink(missing_ok=True)


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a text file as a whole: UTF-8, line ends as they are in `text`.

    Parameters
    ----------
    path : path-like
        File to write, replaced if there.
    text : str
        All of it.

    Raises
    ------
    ArgumentError
        If it cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_text(Path(folder) / "a.txt", "whole")
    ...     (Path(folder) / "a.txt").read_text()
    'whole'
    """
    with replacing(path) as place:
        place.write_text(text, encoding="utf-8", newline="")


def check_writable(path: str | os.PathLike[str], *, size: int = 0) -> None:
    """Refuse a file that could not be written, before the work rather than after it.

    Parameters
    ----------
    path : path-like
        Where the file is wanted.
    size : int
        Bytes that it is going to take; 0 where that is not known.

    Raises
    ------
    ArgumentError
        If its folder is missing or cannot be written to, a folder is in its place, or the disk
        has less room than `size` and one part in twenty to spare.

    Examples
    --------
    >>> check_writable("/no/such/folder/run.h5")
    Traceback (most recent call last):
    hmpim.errors.ArgumentError: '/no/such/folder/run.h5': folder ... does not exist; make it first
    """
    wanted = _resolved(path)
    if wanted.exists() and not wanted.is_file():
        return
    probe = wanted.with_name(f".hmpim-{secrets.token_hex(6)}.probe")
    try:
        handle = os.open(probe, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666)
        try:
            os.write(handle, bytes(4096))
            os.fsync(handle)
        finally:
            os.close(handle)
        if wanted.exists() and not os.access(wanted, os.W_OK):
            raise PermissionError(13, "the file there may not be changed")
        free = _free(wanted.parent)
    except OSError as error:
        raise ArgumentError(f"{os.fspath(path)!r} cannot be written: {_reason(error)}") from error
    finally:
        with suppress(OSError):  # a disk that is read only refuses this, too
            probe.unlink(missing_ok=True)
    if free < 1.05 * size:
        raise ArgumentError(
            f"{os.fspath(path)!r} needs {_megabytes(size)}, but its disk has only "
            f"{_megabytes(free)} left; make room, or name another folder"
        )


def _resolved(path: str | os.PathLike[str]) -> Path:
    """The file itself behind links, in a folder that exists."""
    if not str(path):
        raise ArgumentError("'' is not a file; name one")
    try:
        wanted = Path(path).resolve()
        if wanted.is_dir():
            raise ArgumentError(f"{os.fspath(path)!r} is a folder; name a file in it")
        if not wanted.parent.is_dir():
            raise ArgumentError(
                f"{os.fspath(path)!r}: folder {wanted.parent} does not exist; make it first"
            )
    except (OSError, RuntimeError, ValueError) as error:  # too long, links in a ring, a NUL
        if isinstance(error, ArgumentError):
            raise
        raise ArgumentError(f"{os.fspath(path)!r} cannot be written: {error}") from error
    return wanted


def _free(folder: Path) -> int:
    import shutil

    return shutil.disk_usage(folder).free


def _reason(error: OSError) -> str:
    return error.strerror or str(error)


def _megabytes(size: float) -> str:
    return f"{size / 1e6:.3g} MB"
