"""The samples at some addresses of one file that holds many records, not yet made into records.

A file is opened once for a task, and a row group of Parquet is decoded once: what is handed out are
views of it.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmpim.batch.addresses import Address, File, opened
from hmpim.batch.request import Request
from hmpim.errors import HmpimError
from hmpim.formats.readers.protocol import need

__all__ = ["Metadata", "Samples", "read_samples", "reason_of"]

Real = NDArray[np.float64]
Metadata = Mapping[str, str]

_FOOTERS: dict[File, tuple[Any, NDArray[np.int64]]] = {}
"""Footers of the Parquet files read last, and the first row of each of their groups: a task reads
one group of the thousand that a file may have."""

_KEPT = 4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Samples:
    """Numbers of one record, or why there are none.

    Parameters
    ----------
    address : Address
        Where they are.
    arrays : mapping of str to ndarray
        Channels by name, the time among them.
    units : mapping of str to str
        As the file states them.
    metadata : mapping of str to str
        What the file says of the record beside its samples.
    reason : str
        Why nothing was read; empty if something was.
    """

    address: Address
    arrays: Mapping[str, Real] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    metadata: Metadata = field(default_factory=dict)
    reason: str = ""

    @property
    def fs(self) -> float | None:
        """Rate in Hz that the file states."""
        try:
            return float(self.metadata["fs"]) if self.metadata.get("fs") else None
        except ValueError:
            return None


def reason_of(error: BaseException) -> str:
    """One line that says what went wrong; a defect of the code with its type.

    Examples
    --------
    >>> reason_of(HmpimError("it is empty")), reason_of(KeyError("u"))
    ('it is empty', "KeyError: 'u'")
    """
    told = " ".join(str(error).split())
    return told if isinstance(error, HmpimError) and told else f"{type(error).__name__}: {told}"


def read_samples(addresses: Sequence[Address], request: Request) -> Iterator[Samples]:
    """Read the samples of records that one file holds.

    Parameters
    ----------
    addresses : sequence of Address
        Rows or groups of one file.
    request : Request
        Which channels are wanted.
    """
    if addresses[0].form == "group":
        yield from _from_hdf5(addresses)
    else:
        yield from _from_parquet(addresses, request)


# --- Parquet ---------------------------------------------------------------------------------


def _from_parquet(addresses: Sequence[Address], request: Request) -> Iterator[Samples]:
    parquet = need("pyarrow.parquet", extra="batch", what="a Parquet file")
    file = addresses[0].file
    with opened(file) as handle:
        footer, edges = _FOOTERS.get(file, (None, None))
        whole = parquet.ParquetFile(handle, metadata=footer)
        if edges is None:
            groups = range(whole.num_row_groups)
            edges = np.cumsum([0, *(whole.metadata.row_group(k).num_rows for k in groups)])
            while len(_FOOTERS) >= _KEPT:
                del _FOOTERS[next(iter(_FOOTERS))]
            _FOOTERS[file] = (whole.metadata, edges)
        decoded: _Decoded | None = None
        for address in addresses:
            try:
                first = int(np.searchsorted(edges, address.start, side="right")) - 1
                last = max(int(np.searchsorted(edges, address.stop, side="left")) - 1, first)
                if decoded is None or decoded.groups != (first, last):
                    decoded = None  # before the next is there
                    table = whole.read_row_groups(list(range(first, last + 1)))
                    decoded = _Decoded(
                        table, request, groups=(first, last), listed=address.form == "lists"
                    )
                yield decoded.of(address, address.start - int(edges[first]))
            except Exception as error:
                yield Samples(address=address, reason=reason_of(error))


class _Decoded:
    """Some row groups as arrays: rows of records, or rows of lists that are records."""

    def __init__(
        self, table: Any, request: Request, *, groups: tuple[int, int], listed: bool
    ) -> None:
        self.groups = groups
        self._listed = listed
        self._said: dict[str, Any] = {}
        self._arrays: dict[str, tuple[Real, NDArray[np.int64] | None]] = {}
        self._units: dict[str, str] = {}
        for field_ in table.schema:
            kind, column = str(field_.type), table.column(field_.name)
            cells = "list" in kind
            words = kind in ("string", "large_string") or kind.startswith("dictionary")
            self._units[field_.name] = (
                (field_.metadata or {}).get(b"unit", b"").decode("utf-8", "replace")
            )
            if (listed and not cells) or words:
                self._said[field_.name] = column
            elif field_.name != request.record_column:
                self._arrays[field_.name] = _array_of(column.combine_chunks(), cells)
        self._said.pop(request.record_column, None)

    def of(self, address: Address, first: int) -> Samples:
        """The record that begins at a row."""
        last = first + address.stop - address.start
        arrays = {}
        for name, (values, edges) in self._arrays.items():
            here = (first, last) if edges is None else (int(edges[first]), int(edges[last]))
            arrays[name] = values[here[0] : here[1]]
        return Samples(
            address=address,
            arrays=arrays,
            units=self._units,
            metadata={name: str(column[first].as_py()) for name, column in self._said.items()},
        )


def _array_of(column: Any, cells: bool) -> tuple[Real, NDArray[np.int64] | None]:
    """Numbers of a column, and where each of its cells begins if they are lists."""
    if not cells:
        return _numbers(column), None
    if "fixed_size_list" in str(column.type):
        size = int(column.type.list_size)
        edges = size * np.arange(column.offset, column.offset + len(column) + 1)
    else:
        edges = np.asarray(column.offsets.to_numpy(zero_copy_only=False), dtype=np.int64)
    return _numbers(column.values), edges


def _numbers(column: Any) -> Real:
    return np.asarray(column.to_numpy(zero_copy_only=False), dtype=np.float64)


# --- HDF5 ------------------------------------------------------------------------------------


def _from_hdf5(addresses: Sequence[Address]) -> Iterator[Samples]:
    import h5py

    with opened(addresses[0].file) as handle, h5py.File(handle, "r") as whole:
        for address in addresses:
            try:
                yield _of_group(address, whole[address.place])
            except Exception as error:
                yield Samples(address=address, reason=reason_of(error))


def _of_group(address: Address, group: Any) -> Samples:
    import h5py

    arrays: dict[str, Real] = {}
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
    return Samples(address=address, arrays=arrays, units=units, metadata=metadata)


def _text(value: object) -> str:
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.ravel()[0]
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
