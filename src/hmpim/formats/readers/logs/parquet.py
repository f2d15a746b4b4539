"""Parquet files, those of LeRobot among them (extra `parquet`: pyarrow).

A column is called by its path: field ``u`` of the structure ``s`` is ``s.u``.
"""

import json
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import FormatError
from hmpim.formats.readers.logs.log import Column, Group, Log, list_log, take_series, unit_of
from hmpim.formats.readers.protocol import Contents, Layout, Reader, need
from hmpim.formats.readers.text import named
from hmpim.record import Series

__all__ = ["PARQUET", "channels", "parse", "read", "sniff"]

_MAGIC = b"PAR1"
_WIDE = 1000  # columns that one list may open into


def sniff(head: bytes, path: Path) -> bool:
    """Say whether a file starts as Parquet does.

    Examples
    --------
    >>> sniff(b"PAR1...", Path("a.parquet")), sniff(b"u,y", Path("a.parquet"))
    (True, False)
    """
    return head.startswith(_MAGIC)


def channels(path: Path, layout: Layout) -> Contents:
    """List the columns."""
    return list_log(parse, path, layout)


def read(path: Path, names: Sequence[str], layout: Layout) -> tuple[Series, ...]:
    """Read columns by name."""
    return take_series(parse, path, names, layout)


def parse(path: Path, layout: Layout) -> Log:
    """Open a file; a column of lists of one length is as many channels."""
    parquet = need("pyarrow.parquet", extra="parquet", what="a Parquet file")
    file = parquet.ParquetFile(path)
    info = _info(path)
    columns: list[Column] = []
    time: NDArray[np.float64] | None = None
    time_name, origin = None, None
    for path_of, field in _leaves(file.schema_arrow):
        columns.extend(_columns(file, path_of, field, info))
        if time is None and str(field.type).startswith("timestamp"):
            time, origin = _instants(file, path_of)
            time_name = path_of
            columns = [c for c in columns if c.name != path_of]
    group = Group(name="", columns=tuple(columns), time=time, time_name=time_name)
    fps = info.get("fps")
    return Log(
        format="Parquet",
        groups=(group,),
        origin=origin,
        fs=float(fps) if isinstance(fps, int | float) and fps > 0 else None,
    )


PARQUET = Reader(
    format="Parquet",
    sniff=sniff,
    channels=channels,
    read=read,
    extra="parquet",
    foreign=True,
    uses=(),
)


def _leaves(fields: Any, owner: str = "") -> Iterator[tuple[str, Any]]:
    """Fields with their paths; those of a structure in place of it."""
    import pyarrow as pa

    for field in fields:
        path = f"{owner}.{field.name}" if owner else field.name
        if pa.types.is_struct(field.type):
            yield from _leaves(field.type, path)
        else:
            yield path, field


def _columns(file: Any, path: str, field: Any, info: dict[str, Any]) -> Iterator[Column]:
    kind = str(field.type)
    metadata = {k.decode(): v.decode("utf-8", "replace") for k, v in (field.metadata or {}).items()}
    stated = unit_of(metadata.get("unit") or metadata.get("units"))
    count = int(file.metadata.num_rows)
    if kind.startswith(("int", "uint", "float", "double", "halffloat", "bool", "decimal")):
        name, unit = (path, stated) if stated else named(path)
        yield Column(name=name, unit=unit, samples=count, load=partial(_flat, file, path))
    elif kind.startswith("duration["):  # its unit stands in its type
        ticks = kind.removeprefix("duration[").removesuffix("]")
        yield Column(name=path, unit=ticks, samples=count, load=partial(_flat, file, path))
    elif "list<" in kind and not kind.count("list<") > 1:
        width = _width(file, path, field)
        if width is None:
            yield Column(name=path, load=None, holds="lists that are not numbers of one length")
            return
        for k, label in enumerate(_labels(path, width, info)):
            load = partial(_element, file, path, k, width)
            yield Column(name=f"{path}[{label}]", unit=stated, samples=count, load=load)
    elif kind == "null":
        yield Column(name=path, load=None, holds="nothing")
    else:
        yield Column(name=path, load=None, holds=f"{kind}, no numbers")


def _one(file: Any, path: str) -> Any:
    """One column; of a structure the values at the path."""
    column = file.read(columns=[path]).column(0).combine_chunks()
    outer = file.schema_arrow.names
    place = path if path in outer else max((n for n in outer if path.startswith(f"{n}.")), key=len)
    return column if place == path else _within(column, path.removeprefix(f"{place}."))


def _within(column: Any, path: str) -> Any:
    import pyarrow.compute

    names = [field.name for field in column.type]
    name = max((n for n in names if path == n or path.startswith(f"{n}.")), key=len)
    inner = pyarrow.compute.struct_field(column, name)
    return inner if name == path else _within(inner, path.removeprefix(f"{name}."))


def _flat(file: Any, path: str) -> NDArray[Any]:
    import pyarrow as pa

    column = _one(file, path)
    if pa.types.is_duration(column.type):
        column = column.cast(pa.int64())
    # Whole numbers beyond 2^53 are rounded, as float64 holds them.
    return np.asarray(column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False))


def _instants(file: Any, path: str) -> tuple[NDArray[np.float64], float]:
    """Stamps in s since the first, and when that was."""
    import pyarrow as pa

    column = _one(file, path)
    ticks = column.cast(pa.timestamp("ns")).cast(pa.int64())
    there = ~np.asarray(ticks.is_null())
    plain = np.asarray(ticks.fill_null(0)).astype(np.int64)
    if not there.any():
        raise FormatError(f"the column of time {path!r} is empty")
    base = int(plain[there][0])
    return np.where(there, (plain - base) / 1e9, np.nan), base / 1e9


def _width(file: Any, path: str, field: Any) -> int | None:
    """How many numbers each list has, if all have as many."""
    import pyarrow as pa

    of = field.type.value_type
    if not (pa.types.is_floating(of) or pa.types.is_integer(of)):
        return None
    fixed = getattr(field.type, "list_size", None)
    if fixed is None or fixed < 0:
        lists = _one(file, path)
        offsets = np.asarray(lists.offsets)
        lengths = set(np.diff(offsets).tolist()) - ({0} if lists.null_count else set())
        if len(lengths) != 1:
            return None
        fixed = lengths.pop()
    return int(fixed) if 0 < fixed <= _WIDE else None


def _element(file: Any, path: str, place: int, width: int) -> NDArray[np.float64]:
    import pyarrow as pa

    lists = _one(file, path)
    valid = ~np.asarray(lists.is_null())
    values = np.asarray(lists.flatten().cast(pa.float64()).to_numpy(zero_copy_only=False))
    out = np.full(len(lists), np.nan)
    out[valid] = values.reshape(-1, width)[:, place]
    return out


def _info(path: Path) -> dict[str, Any]:
    """LeRobot's ``meta/info.json`` beside the folder ``data``, if there is one."""
    for folder in list(path.absolute().parents)[:4]:
        place = folder / "meta" / "info.json"
        try:
            if place.is_file() and place.stat().st_size < 2**24:
                found = json.loads(place.read_text(encoding="utf-8"))
                return found if isinstance(found, dict) else {}
        except (OSError, ValueError):
            return {}
    return {}


def _labels(name: str, width: int, info: dict[str, Any]) -> list[str]:
    """Names of the elements: the joints', where LeRobot's info names them."""
    features = info.get("features")
    feature = features.get(name) if isinstance(features, dict) else None
    names = feature.get("names") if isinstance(feature, dict) else None
    if isinstance(names, dict):  # {"motors": [...]}
        names = next((v for v in names.values() if isinstance(v, list)), None)
    plain = isinstance(names, list) and len(names) == width and len(set(map(str, names))) == width
    return [str(n) for n in names] if plain and names else [str(k) for k in range(width)]
