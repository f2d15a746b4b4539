"""HDF5 of any layout: a dataset is called by its path (extra: none, h5py is always there)."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import FormatError
from hmpim.formats.hdf5 import faults_named
from hmpim.formats.readers.logs.log import Column, Log, groups_of, list_log, take_series, unit_of
from hmpim.formats.readers.protocol import COMPLEX, WORDS, Contents, Layout, Reader
from hmpim.record import Finding, Series

__all__ = ["HDF5", "channels", "parse", "read", "sniff"]

_MAGIC = b"\x89HDF\r\n\x1a\n"
_WIDE = 200  # columns that a dataset may open into
_MANY = 20_000  # datasets that are looked at


def sniff(head: bytes, path: Path) -> bool:
    r"""Say whether a file is HDF5, perhaps behind a block of the user's own.

    Examples
    --------
    >>> sniff(b"\x89HDF\r\n\x1a\n", Path("a.h5")), sniff(b"u,y", Path("a.h5"))
    (True, False)
    """
    return head.startswith(_MAGIC) or any(head[k : k + 8] == _MAGIC for k in (512, 1024, 2048))


def channels(path: Path, layout: Layout) -> Contents:
    """List the datasets that hold numbers."""
    return list_log(parse, path, layout)


def read(path: Path, names: Sequence[str], layout: Layout) -> tuple[Series, ...]:
    """Read datasets by path: ``/run/u``, ``/run/imu[2]``, ``/table.y``."""
    return take_series(parse, path, names, layout)


def parse(path: Path, layout: Layout) -> Log:
    """Open a file; datasets of one length beside one another are a group.

    Links to other files are not followed, and datasets that are kept in others not read.
    """
    import h5py

    from hmpim.formats.statistics_files import holds_statistics

    if holds_statistics(path):
        raise FormatError(
            f"{path.name!r} holds statistics of a record and not its samples; hmpim identify and "
            "hmpim compress take it, here give the record itself"
        )
    with faults_named(path), ExitStack() as opened:
        datasets = _datasets(opened.enter_context(h5py.File(path, "r")))
        opened.pop_all()  # the datasets are read later
    groups: dict[tuple[str, int], list[Column]] = {}
    elsewhere: list[str] = []
    for name, dataset in datasets:
        if dataset.external or dataset.is_virtual:
            elsewhere.append(name)
            continue
        size = dataset.shape[0] if dataset.shape else 0
        owner = name.rpartition("/")[0]
        groups.setdefault((owner, size), []).extend(_columns(name, dataset))
    said: tuple[Finding, ...] = ()
    if elsewhere:
        names = ", ".join(elsewhere[:8])
        message = f"{names} keep their numbers in other files, which are not read"
        said = (Finding(code="elsewhere", message=message, severity="info", parameters=()),)
    return Log(format="HDF5", groups=groups_of(groups, separator="/", outermost="/"), findings=said)


HDF5 = Reader(format="HDF5", sniff=sniff, channels=channels, read=read, foreign=True, uses=())


def _datasets(file: Any) -> list[tuple[str, Any]]:
    """Datasets with a length, each once; no link is followed."""
    import h5py

    found: list[tuple[str, Any]] = []

    def visit(name: str, item: Any) -> bool | None:
        if isinstance(item, h5py.Dataset) and len(item.shape or ()) in (1, 2):
            found.append((f"/{name}", item))
        return True if len(found) > _MANY else None

    file.visititems(visit)
    return found


def _columns(name: str, dataset: Any) -> Iterator[Column]:
    unit = unit_of(_attribute(dataset, "units") or _attribute(dataset, "unit"))
    size = int(dataset.shape[0])
    if size < 2:
        return
    if dataset.dtype.names is not None and dataset.ndim == 1:  # a table of one row a sample
        for field in dataset.dtype.names[:_WIDE]:
            kind = dataset.dtype[field]
            plain = kind.kind in "biuf" and not kind.shape
            load = partial(_field, dataset, field) if plain else None
            yield Column(name=f"{name}.{field}", load=load, samples=size, holds=_held(kind))
    elif dataset.dtype.kind not in "biuf":
        yield Column(name=name, load=None, samples=size, holds=_held(dataset.dtype))
    elif dataset.ndim == 1:
        yield Column(name=name, unit=unit, load=partial(_whole, dataset), samples=size)
    elif dataset.shape[1] <= _WIDE:
        for k in range(dataset.shape[1]):
            load = partial(_part, dataset, k)
            label = f"{name}[{k}]" if dataset.shape[1] > 1 else name
            yield Column(name=label, unit=unit, load=load, samples=size)


def _held(kind: Any) -> str:
    """What values of a type are that are no real numbers, in words."""
    if kind.shape:
        return "an array in each row"
    if kind.kind == "c":
        return COMPLEX
    of = (kind.metadata or {}).get("vlen")
    return WORDS if of in (None, str, bytes) else "a list in each row"


def _whole(dataset: Any) -> NDArray[Any]:
    return np.asarray(dataset[()])


def _part(dataset: Any, place: int) -> NDArray[Any]:
    return np.asarray(dataset[:, place])


def _field(dataset: Any, name: str) -> NDArray[Any]:
    return np.asarray(dataset[name])


def _attribute(dataset: Any, name: str) -> object:
    value = dataset.attrs.get(name)
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.ravel()[0]
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else value
