"""Parts of a batch on disk: one Parquet file a task, whole or not there.

A part is called by the digests of its records and of what was asked, so that a task that is done
twice writes one file. What is done is known from the parts alone.
"""

import contextlib
import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmpim.batch.addresses import Address
from hmpim.batch.request import Request
from hmpim.errors import ArgumentError, FormatError
from hmpim.formats.atomic import replacing, write_text

__all__ = [
    "PARTS",
    "STAMP",
    "Known",
    "open_folder",
    "part_name",
    "parts_in",
    "read_stamp",
    "write_part",
]

PARTS = "parts"
"""Name of the folder that keeps the parts."""

STAMP = "batch.json"
"""Name of the file that says what was asked."""

_LOCK = ".lock"
_SCHEMA = "hmpim/batch/1"

Keys = NDArray[np.bytes_]


def part_name(addresses: Sequence[Address], request: Request) -> str:
    """Name of the part of these records.

    Examples
    --------
    >>> part_name([], Request())[-8:]
    '.parquet'
    """
    digest = hashlib.sha256(request.digest.encode())
    for address in addresses:
        digest.update(address.digest.encode())
    return f"{digest.hexdigest()[:24]}.parquet"


def write_part(table: Any, path: Path) -> None:
    """Write a part beside its place and move it there.

    Raises
    ------
    ArgumentError
        If it cannot be written: the disk is full, or the folder gone.
    """
    from pyarrow import parquet

    with replacing(path) as place:
        parquet.write_table(table, place, compression="zstd")
        with place.open("rb") as file:
            os.fsync(file.fileno())


def parts_in(folder: Path) -> list[Path]:
    """List the parts of a batch, by name; what is being written beside them is none."""
    return sorted(p for p in (folder / PARTS).glob("*.parquet") if not p.name.startswith("."))


class Known:
    """Which records have rows: 24 bytes a record.

    Parameters
    ----------
    folder : Path
        The batch's folder. A part in it that is not a Parquet file is moved aside, so that its
        records are done again.
    """

    def __init__(self, folder: Path) -> None:
        from pyarrow import parquet

        keys: list[Keys] = [np.empty(0, dtype="S16")]
        self._names: dict[Path, NDArray[np.uint64]] = {}
        for path in parts_in(folder):
            try:
                columns = parquet.read_table(path, columns=["key", "record"])
            except Exception:  # cut short by a power cut, or not ours
                path.rename(path.with_suffix(".damaged"))
                continue
            text = "".join(dict.fromkeys(columns.column("key").to_pylist()))
            keys.append(np.frombuffer(bytes.fromhex(text), dtype="S16"))
            names = dict.fromkeys(columns.column("record").to_pylist())
            self._names[path] = np.array([_hashed(name) for name in names], dtype=np.uint64)
        self._keys = np.unique(np.concatenate(keys))

    def __contains__(self, address: Address) -> bool:
        key = np.frombuffer(bytes.fromhex(address.digest), dtype="S16")[0]
        at = int(np.searchsorted(self._keys, key))
        return at < self._keys.size and bool(self._keys[at] == key)

    def drop(self, addresses: Sequence[Address]) -> None:
        """Take out rows of these records that were made of what is no longer in their files."""
        from pyarrow import compute, parquet

        wanted = np.array([_hashed(a.name) for a in addresses], dtype=np.uint64)
        for path in [p for p, names in self._names.items() if np.isin(wanted, names).any()]:
            table = parquet.read_table(path)
            old = compute.is_in(table.column("record"), _strings([a.name for a in addresses]))
            kept = table.filter(compute.invert(old))
            if kept.num_rows == table.num_rows:
                continue
            if kept.num_rows:
                write_part(kept, path)
            else:
                path.unlink()
                del self._names[path]


def _strings(names: Sequence[str]) -> Any:
    import pyarrow as pa

    return pa.array(names, type=pa.string())


def _hashed(name: str) -> int:
    return int.from_bytes(hashlib.blake2b(name.encode(), digest_size=8).digest(), "little")


@contextlib.contextmanager
def open_folder(
    folder: Path, request: Request, metadata: Sequence[str], *, fresh: bool
) -> Iterator[tuple[str, ...]]:
    """Make a batch's folder, or check that it holds the same batch; nobody else may write.

    Yields
    ------
    tuple of str
        Columns of metadata: those given, or those of the batch that is gone on with.

    Raises
    ------
    ArgumentError
        If it holds a batch of another request, or another process is at it.
    FormatError
        If what it says of itself cannot be read.
    """
    try:
        (folder / PARTS).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ArgumentError(f"{str(folder)!r} cannot be made: {error.strerror}") from None
    with _locked(folder):
        for half in (folder / PARTS).glob(".hmpim-*"):  # of a worker that was killed as it wrote
            half.unlink(missing_ok=True)
        stamp = folder / STAMP
        if fresh:
            for old in parts_in(folder):
                old.unlink()
        elif stamp.exists() and parts_in(folder):
            yield _same(stamp, request)
            return
        told = {
            "schema": _SCHEMA,
            "digest": request.digest,
            "request": request.to_dict(),
            "metadata": list(metadata),
        }
        write_text(stamp, json.dumps(told, indent=1) + "\n")
        yield tuple(metadata)


def read_stamp(folder: Path) -> Mapping[str, Any]:
    """Read what a batch says of itself.

    Raises
    ------
    FormatError
        If there is none, or it cannot be read.
    """
    stamp = folder / STAMP
    try:
        told = json.loads(stamp.read_text(encoding="utf-8"))
        schema = told["schema"]
    except FileNotFoundError:
        raise FormatError(f"{str(folder)!r} holds no batch: there is no {STAMP} in it") from None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise FormatError(f"{stamp} is damaged ({error}); start afresh with --fresh") from None
    if schema != _SCHEMA:
        raise FormatError(f"{stamp} is of schema {schema!r}; this version reads {_SCHEMA!r}")
    return dict(told)


def _same(stamp: Path, request: Request) -> tuple[str, ...]:
    told = read_stamp(stamp.parent)
    if told["digest"] != request.digest:
        before = told["request"]
        now = request.to_dict()
        changed = next((k for k in now if before.get(k) != now[k]), "request")
        raise ArgumentError(
            f"{str(stamp.parent)!r} holds a batch with {changed} = {before.get(changed)!r}, and "
            f"{now.get(changed)!r} is given now; name another folder, or start afresh with "
            "--fresh"
        )
    return tuple(told["metadata"])


@contextlib.contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Keep a second run out of a folder for as long as this one lasts."""
    try:
        import fcntl
    except ImportError:  # Windows
        yield
        return
    with (folder / _LOCK).open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise ArgumentError(
                f"another run is writing to {str(folder)!r}; wait for it, or name another folder"
            ) from None
        yield
