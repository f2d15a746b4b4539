"""MATLAB's files of version 5 to 7.3 (extra `mat`: pymatreader)."""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from hmpim.formats.readers.logs.log import Column, Log, groups_of, list_log, take_series, unit_of
from hmpim.formats.readers.protocol import COMPLEX, Contents, Layout, Reader, need
from hmpim.formats.readers.text import named
from hmpim.record import Series

__all__ = ["MAT", "channels", "parse", "read", "sniff"]

_DEEP = 8
_WIDE = 200  # columns that a matrix may open into


def sniff(head: bytes, path: Path) -> bool:
    """Say whether a file starts with MATLAB's words; 7.3 is HDF5 behind them.

    Examples
    --------
    >>> sniff(b"MATLAB 5.0 MAT-file, Platform: GLNXA64", Path("a.mat")), sniff(b"u,y", Path("a"))
    (True, False)
    """
    return head.startswith((b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file", b"MATLAB 7.0 MAT"))


def channels(path: Path, layout: Layout) -> Contents:
    """List the vectors and the columns of matrices."""
    return list_log(parse, path, layout)


def read(path: Path, names: Sequence[str], layout: Layout) -> tuple[Series, ...]:
    """Read them by name: ``u``, ``log.y``, ``data(:,2)``."""
    return take_series(parse, path, names, layout)


def parse(path: Path, layout: Layout) -> Log:
    """Open a file; vectors of one length in one structure are a group."""
    pymatreader = need("pymatreader", extra="mat", what="a MATLAB file")
    with path.open("rb") as file:
        words = file.read(19)
    data = pymatreader.read_mat(str(path))
    groups: dict[tuple[str, int], list[Column]] = {}
    for owner, name, values, unit in _vectors(data, "", 0):
        columns = groups.setdefault((owner, values.shape[0]), [])
        real = values.dtype.kind != "c"
        columns.append(
            Column(
                name=name,
                unit=unit,
                samples=values.shape[0],
                load=partial(_values, values) if real else None,
                holds=COMPLEX,
            )
        )
    return Log(
        format=words[:10].decode("ascii", "replace"),
        groups=groups_of(groups, separator=".", outermost="file"),
    )


MAT = Reader(
    format="MATLAB", sniff=sniff, channels=channels, read=read, extra="mat", foreign=True, uses=()
)


def _values(values: Any) -> Any:
    return values


def _vectors(data: Any, owner: str, depth: int) -> Iterator[tuple[str, str, Any, str]]:
    """Owner, name, values and unit of each vector; a scalar is no signal."""
    if depth > _DEEP or not isinstance(data, Mapping):
        return
    stated = data.get("units")
    units = stated if isinstance(stated, Mapping) else {}
    for key, value in data.items():
        if str(key).startswith("__"):
            continue
        name = f"{owner}.{key}" if owner else str(key)
        if isinstance(value, Mapping):
            yield from _vectors(value, name, depth + 1)
        elif isinstance(value, list) and value and all(isinstance(v, Mapping) for v in value[:50]):
            for k, part in enumerate(value[:50], start=1):  # an array of structures
                yield from _vectors(part, f"{name}({k})", depth + 1)
        else:
            yield from _columns(owner, name, value, unit_of(units.get(key)) or named(str(key))[1])


def _columns(owner: str, name: str, value: Any, unit: str) -> Iterator[tuple[str, str, Any, str]]:
    try:
        array = np.asarray(value) if isinstance(value, np.ndarray | list) else None
    except ValueError:  # a cell array of things of several sizes
        return
    if array is None or array.dtype.kind not in "biufc" or array.size < 2:
        return
    if array.ndim == 2 and 1 in array.shape:
        array = array.ravel()
    if array.ndim == 1:
        yield owner, name, array, unit
    elif array.ndim == 2 and min(array.shape) <= _WIDE:
        # Samples run along the longer side.
        turned = array.shape[0] < array.shape[1]
        rows = array.T if turned else array
        for k in range(rows.shape[1]):
            place = f"({k + 1},:)" if turned else f"(:,{k + 1})"
            yield owner, f"{name}{place}", np.ascontiguousarray(rows[:, k]), unit
