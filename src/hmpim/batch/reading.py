"""The records at some addresses, each read once; one that cannot be read says why."""

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmpim.batch.addresses import Address, opened
from hmpim.batch.request import Request
from hmpim.errors import FormatError, HmpimError
from hmpim.formats.assemble import assemble, check_units
from hmpim.formats.files import read
from hmpim.formats.readers import ChannelInfo, Contents
from hmpim.formats.readers.logs.clock import is_time
from hmpim.formats.readers.protocol import need
from hmpim.formats.recording import read_recording
from hmpim.formats.roles import choose_roles
from hmpim.record import Record, Series

__all__ = ["Read", "read_records", "reason_of"]

Metadata = Mapping[str, str]

_OURS = b"hmpim/record/"
_HEAD = 65_536


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Read:
    """A record, or why there is none.

    Parameters
    ----------
    address : Address
        Where it is.
    record : Record or None
        What was read.
    reason : str
        Why nothing was read; empty if something was.
    metadata : mapping of str to str
        What the file says of the record beside its samples.
    """

    address: Address
    record: Record | None = None
    reason: str = ""
    metadata: Metadata = field(default_factory=dict)


def read_records(addresses: Sequence[Address], request: Request) -> Iterator[Read]:
    """Read records in order, a file that holds many opened once.

    Parameters
    ----------
    addresses : sequence of Address
        Where they are, those of one file together.
    request : Request
        Which channels are wanted.
    """
    for (_, form), some in groupby(addresses, key=lambda a: (a.file.url, a.form)):
        here = list(some)
        told = 0
        try:
            for read_ in _from_one_file(here, form, request):
                told += 1
                yield read_
        except Exception as error:
            # The file as a whole: each record that has not been read says so.
            yield from (Read(address=a, reason=reason_of(error)) for a in here[told:])


def _from_one_file(addresses: Sequence[Address], form: str, request: Request) -> Iterator[Read]:
    if form in ("rows", "lists"):
        return _from_parquet(addresses, request)
    if form == "group":
        return _from_hdf5(addresses, request)
    return (_from_file(address, request) for address in addresses)


def reason_of(error: BaseException) -> str:
    """One line that says what went wrong; a defect of the code with its type.

    Examples
    --------
    >>> reason_of(FormatError("it is empty")), reason_of(KeyError("u"))
    ('it is empty', "KeyError: 'u'")
    """
    told = " ".join(str(error).split())
    return told if isinstance(error, HmpimError) and told else f"{type(error).__name__}: {told}"


def _from_file(address: Address, request: Request) -> Read:
    try:
        if address.form == "scattered":
            raise FormatError(
                f"rows of the record {address.place!r} stand in several places of the file; sort "
                f"it by its column {request.record_column!r}"
            )
        if "://" not in address.file.url:
            record, metadata = _whole(Path(address.file.url), request)
        else:
            name = PurePosixPath(address.file.url).name
            with tempfile.TemporaryDirectory(prefix="hmpim-") as folder:
                local = Path(folder) / name
                with opened(address.file) as source, local.open("wb") as copy:
                    while block := source.read(2**22):
                        copy.write(block)
                record, metadata = _whole(local, request)
    except (HmpimError, OSError) as error:
        return Read(address=address, reason=reason_of(error))
    return Read(address=address, record=record, metadata=metadata)


def _whole(path: Path, request: Request) -> tuple[Record, Metadata]:
    with path.open("rb") as file:
        ours = _OURS in file.read(_HEAD)
    if ours and path.suffix.lower() in (".h5", ".hdf5"):
        recording = read_recording(path)
        record = recording.record
        if request.inputs or request.outputs:
            record = record.with_roles(
                inputs=request.inputs or [c.name for c in record.inputs],
                outputs=request.outputs or [c.name for c in record.outputs],
            )
        return record, {"rig": recording.rig, "created": recording.created}
    record = read(
        path,
        inputs=request.inputs or None,
        outputs=request.outputs or None,
        fs=request.fs,
        time=request.time,
        units=request.units,
    )
    return record, {}


# --- Parquet ---------------------------------------------------------------------------------


def _from_parquet(addresses: Sequence[Address], request: Request) -> Iterator[Read]:
    parquet = need("pyarrow.parquet", extra="batch", what="a Parquet file")
    with opened(addresses[0].file) as handle:
        whole = parquet.ParquetFile(handle)
        edges = np.cumsum(
            [0, *(whole.metadata.row_group(k).num_rows for k in range(whole.num_row_groups))]
        )
        parts = _Parts(whole, edges)
        for address in addresses:
            try:
                yield _of_rows(address, parts.rows(address.start, address.stop), request)
            except Exception as error:
                yield Read(address=address, reason=reason_of(error))


class _Parts:
    """Rows of a Parquet file; the row groups that hold the last rows asked for are kept."""

    def __init__(self, whole: Any, edges: NDArray[np.int64]) -> None:
        self._whole, self._edges = whole, edges
        self._kept: dict[int, Any] = {}

    def rows(self, start: int, stop: int) -> Any:
        """Rows from start to stop as an Arrow table."""
        first = int(np.searchsorted(self._edges, start, side="right")) - 1
        last = int(np.searchsorted(self._edges, stop, side="left")) - 1
        wanted = range(first, last + 1)
        self._kept = {k: v for k, v in self._kept.items() if k in wanted}
        for k in wanted:
            if k not in self._kept:
                self._kept[k] = self._whole.read_row_group(k)
        import pyarrow as pa

        some = [self._kept[k] for k in wanted]
        joined = some[0] if len(some) == 1 else pa.concat_tables(some)
        return joined.slice(start - int(self._edges[first]), stop - start)


def _of_rows(address: Address, table: Any, request: Request) -> Read:
    """One record of rows, or of one row whose cells are lists."""
    names: list[str] = []
    arrays: dict[str, NDArray[np.float64]] = {}
    metadata: dict[str, str] = {}
    for field_ in table.schema:
        column = table.column(field_.name)
        kind = str(field_.type)
        listed = "list" in kind
        if (
            (address.form == "lists" and not listed)
            or kind in ("string", "large_string")
            or kind.startswith("dictionary")
        ):
            metadata[field_.name] = str(column[0].as_py())
        elif field_.name != request.record_column:
            names.append(field_.name)
            flat = column.combine_chunks()
            flat = flat.flatten() if listed else flat
            arrays[field_.name] = np.asarray(flat.to_numpy(zero_copy_only=False), dtype=np.float64)
    metadata.pop(request.record_column, None)
    units = {
        f.name: (f.metadata or {}).get(b"unit", b"").decode("utf-8", "replace")
        for f in table.schema
    }
    fs = _number(metadata.get("fs"))
    record = _assembled(address, arrays, units, request, fs=fs)
    return Read(address=address, record=record, metadata=metadata)


def _number(text: str | None) -> float | None:
    try:
        return float(text) if text else None
    except ValueError:
        return None


# --- HDF5 ------------------------------------------------------------------------------------


def _from_hdf5(addresses: Sequence[Address], request: Request) -> Iterator[Read]:
    import h5py

    with opened(addresses[0].file) as handle, h5py.File(handle, "r") as whole:
        for address in addresses:
            try:
                yield _of_group(address, whole[address.place], request)
            except Exception as error:
                yield Read(address=address, reason=reason_of(error))


def _of_group(address: Address, group: Any, request: Request) -> Read:
    import h5py

    arrays: dict[str, NDArray[np.float64]] = {}
    units: dict[str, str] = {}
    for name in group:
        dataset = group[name]
        if not isinstance(dataset, h5py.Dataset) or dataset.ndim != 1:
            continue
        if dataset.dtype.kind not in "biuf":
            continue
        arrays[name] = np.asarray(dataset[()], dtype=np.float64)
        units[name] = _text(dataset.attrs.get("unit", dataset.attrs.get("units", "")))
    metadata = {name: _text(value) for name, value in group.attrs.items()}
    record = _assembled(address, arrays, units, request, fs=_number(metadata.get("fs")))
    return Read(address=address, record=record, metadata=metadata)


def _text(value: object) -> str:
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.ravel()[0]
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


# --- both ------------------------------------------------------------------------------------


def _assembled(
    address: Address,
    arrays: Mapping[str, NDArray[np.float64]],
    units: Mapping[str, str],
    request: Request,
    *,
    fs: float | None,
) -> Record:
    """A record of arrays of one file, as `hmpim.read` makes it of a file's channels."""
    file = PurePosixPath(address.file.url).name
    clock = request.time or next((name for name in arrays if is_time(name)), None)
    if clock is not None and clock not in arrays:
        raise FormatError(
            f"{file!r} has no column {clock!r} for the time; it has {', '.join(arrays)}"
        )
    contents = Contents(
        format="many",
        channels=tuple(
            ChannelInfo(name=name, unit=units.get(name, "")) for name in arrays if name != clock
        ),
        time=clock,
        fs=fs,
    )
    check_units(request.units, contents, file)
    roles = choose_roles(
        contents,
        file,
        inputs=request.inputs or None,
        outputs=request.outputs or None,
    )
    time = None if clock is None else arrays[clock]
    series = [
        Series(name=name, values=arrays[name], time=time, unit=units.get(name, ""))
        for name in roles.names
    ]
    rate = request.fs if request.fs is not None else fs if clock is None else None
    return assemble(series, roles, contents, file=file, fs=rate, units=request.units)
