"""Where each record of a batch is: a file, rows of a Parquet file, a group of an HDF5 file.

Files are found and opened through fsspec, so that a folder may be local or in any store that
fsspec knows. A digest of where a record is, and of the size and time of change of its file, stands
for the record: it is known without reading a sample.
"""

import hashlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any, Literal

import numpy as np

from hmpim.batch.request import Request
from hmpim.errors import ArgumentError
from hmpim.formats.readers.protocol import need

__all__ = ["Address", "File", "addresses_of", "find_files", "opened"]

_PARQUET = (".parquet", ".pq")
_HDF5 = (".h5", ".hdf5", ".hdf")
_NO_RECORDS = (
    ".json", ".toml", ".html", ".htm", ".md", ".py", ".png", ".svg", ".pdf", ".lock", ".yaml",
)  # fmt: skip
"""Suffixes of files that a folder may hold beside its records."""

_OURS = b"hmpim/record/"
_HEAD = 65_536

Form = Literal["file", "rows", "lists", "group", "scattered", "broken"]


@dataclass(frozen=True, slots=True, kw_only=True)
class File:
    """A file and what a listing says of it.

    Parameters
    ----------
    url : str
        Its path, or its address with the protocol where it is not local.
    stamp : str
        Size and time of change, or what a store has in its place.
    """

    url: str
    stamp: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Address:
    """Where one record is.

    Parameters
    ----------
    file : File
        The file that holds it.
    form : {'file', 'rows', 'lists', 'group', 'scattered', 'broken'}
        The whole file, some rows of it, one row of lists, or a group; 'scattered' for rows of a
        record that has others elsewhere, and 'broken' for a file that cannot be opened: what is
        wrong is told when it is read.
    place : str
        Name of the record in its file; empty for a whole file.
    start, stop : int
        Rows of a Parquet file.
    """

    file: File
    form: Form = "file"
    place: str = ""
    start: int = 0
    stop: int = 0

    @property
    def name(self) -> str:
        """What people call it.

        Examples
        --------
        >>> Address(file=File(url="a.parquet", stamp=""), form="rows", place="17").name
        'a.parquet#17'
        """
        return f"{self.file.url}#{self.place}" if self.place else self.file.url

    @property
    def digest(self) -> str:
        """32 hexadecimal digits; others if the file was changed.

        Examples
        --------
        >>> one, other = (Address(file=File(url="a.csv", stamp=s)) for s in ("10 1", "10 2"))
        >>> one.digest == other.digest
        False
        """
        told = f"{self.file.url}\0{self.file.stamp}\0{self.place}\0{self.start}"
        return hashlib.sha256(told.encode()).hexdigest()[:32]


def find_files(paths: Sequence[str], *, without: Path | None = None) -> Iterator[File]:
    """List the files that folders, globs and paths stand for, in order, each once.

    Parameters
    ----------
    paths : sequence of str
        Folders, globs and files, local or with fsspec's protocol.
    without : Path, optional
        A local folder that is left out, with all that is in it: where results are written.

    Raises
    ------
    ArgumentError
        If one of them stands for no file.
    """
    seen: set[str] = set()
    for path in paths:
        found = False
        for file in _listed(str(path), without):
            found = True
            key = hashlib.sha256(file.url.encode()).hexdigest()[:16]
            if key not in seen:
                seen.add(key)
                yield file
        if not found:
            if without is not None and any(_listed(str(path), None)):
                raise ArgumentError(
                    f"{str(path)!r} lies in {str(without)!r}, the folder of the results, which is "
                    "not searched for records; name another folder for the results"
                )
            raise ArgumentError(f"there are no records at {str(path)!r}; check the path")


def _listed(path: str, without: Path | None) -> Iterator[File]:
    fsspec = need("fsspec", extra="batch", what="a batch of records")
    try:
        system, place = fsspec.core.url_to_fs(path)
        folder = system.isdir(place)
        magic = any(sign in place for sign in "*?[") and not system.exists(place)
        # ROS 2 bags are folders; what is in one is one record.
        found = system.glob(place, detail=True) if magic else system.find(place, detail=True)
    except (OSError, ValueError, ImportError) as error:
        raise ArgumentError(f"{path!r} cannot be listed: {' '.join(str(error).split())}") from None
    for name in sorted(found):
        info = found[name]
        pure = PurePosixPath(name)
        if info.get("type") != "file":
            continue
        if (folder or magic) and not _may_be_record(pure, PurePosixPath(place) if folder else pure):
            continue
        if without is not None and _is_local(system) and Path(name).is_relative_to(without):
            continue
        url = name if _is_local(system) else system.unstrip_protocol(name)
        yield File(url=url, stamp=_stamp(info))


def _may_be_record(path: PurePosixPath, folder: PurePosixPath) -> bool:
    inside = path.relative_to(folder).parts if path.is_relative_to(folder) else path.parts[-1:]
    hidden = any(part.startswith(".") for part in inside)
    return not hidden and path.suffix.lower() not in _NO_RECORDS


def _is_local(system: Any) -> bool:
    names = system.protocol if isinstance(system.protocol, tuple) else (system.protocol,)
    return "file" in names


def _stamp(info: dict[str, Any]) -> str:
    changed = next(
        (info[k] for k in ("ETag", "etag", "md5Hash", "mtime", "LastModified", "created", "uid")
         if info.get(k) is not None),
        "",
    )  # fmt: skip
    return f"{info.get('size')} {changed}"


def opened(file: File) -> Any:
    """Open a file for reading, as bytes; local or not."""
    fsspec = need("fsspec", extra="batch", what="a batch of records")
    system, place = fsspec.core.url_to_fs(file.url)
    return system.open(place, "rb")


Expect = Callable[[int], None]
"""Told how many records a file holds, as soon as that is known or can be reckoned."""


def addresses_of(
    file: File, request: Request, expect: Expect = lambda count: None
) -> Iterator[Address]:
    """Say which records a file holds; one, unless it is made for many.

    A Parquet file holds many if it has the request's column of records, or lists in the input's
    column; an HDF5 file, if each group below the request's group holds data.

    Parameters
    ----------
    file : File
        Where to look.
    request : Request
        What separates the records of a file.
    expect : callable, optional
        Told how many records it holds, before they are all listed: exactly for lists and groups,
        and by the rows read so far where each record has rows of its own.
    """
    suffix = PurePosixPath(file.url).suffix.lower()
    try:
        if suffix in _PARQUET:
            yield from _in_parquet(file, request, expect)
            return
        if suffix in _HDF5:
            yield from _in_hdf5(file, request, expect)
            return
    except Exception:  # damaged: what is wrong is said in the record's row when it is read
        yield Address(file=file, form="broken")
        return
    yield Address(file=file)


def _in_parquet(file: File, request: Request, expect: Expect) -> Iterator[Address]:
    parquet = need("pyarrow.parquet", extra="batch", what="a Parquet file")
    with opened(file) as handle:
        whole = parquet.ParquetFile(handle)
        names = whole.schema_arrow.names
        if any("list" in str(field.type) for field in whole.schema_arrow):
            expect(whole.metadata.num_rows)
            labels = request.record_column in names
            start = 0
            for k in range(whole.num_row_groups):
                count = whole.metadata.row_group(k).num_rows
                told = range(start, start + count)
                if labels:
                    column = whole.read_row_group(k, columns=[request.record_column])
                    told = column.column(0).to_pylist()
                for row, label in enumerate(told, start=start):
                    yield Address(
                        file=file, form="lists", place=str(label), start=row, stop=row + 1
                    )
                start += count
        elif request.record_column in names:
            yield from _runs_of(file, whole, request.record_column, expect)
        else:
            yield Address(file=file)


def _runs_of(file: File, whole: Any, column: str, expect: Expect) -> Iterator[Address]:
    """Rows that follow one another and belong to one record, through all row groups."""
    label, begin, start = None, 0, 0
    seen: set[object] = set()
    for k in range(whole.num_row_groups):
        values = whole.read_row_group(k, columns=[column]).column(0).combine_chunks()
        codes = values.dictionary_encode()
        index = np.asarray(codes.indices.fill_null(-1))
        names = codes.dictionary.to_pylist()
        edges = np.flatnonzero(np.diff(index)) + 1
        if index.size:
            found = len(seen) + edges.size + 1
            expect(found * whole.metadata.num_rows // (start + index.size))
        for first in (0, *edges.tolist()) if index.size else ():
            here = names[index[first]] if index[first] >= 0 else ""
            if label is None:
                label = here
            elif here != label:
                yield _rows(file, label, begin, start + first, seen)
                label, begin = here, start + first
        start += index.size
    if label is not None:
        yield _rows(file, label, begin, start, seen)


def _rows(file: File, label: object, start: int, stop: int, seen: set[object]) -> Address:
    form: Form = "scattered" if label in seen else "rows"
    seen.add(label)
    return Address(file=file, form=form, place=str(label), start=start, stop=stop)


def _in_hdf5(file: File, request: Request, expect: Expect) -> Iterator[Address]:
    import h5py

    with opened(file) as handle:
        ours = _OURS in handle.read(_HEAD)
        handle.seek(0)
        if ours:
            yield Address(file=file)
            return
        with h5py.File(handle, "r") as whole:
            place = whole[request.group]
            groups = [name for name in place if isinstance(place.get(name), h5py.Group)]
            expect(len(groups))
            for name in groups:
                path = f"{request.group.rstrip('/')}/{name}"
                yield Address(file=file, form="group", place=path)
            if not groups:
                yield Address(file=file)
