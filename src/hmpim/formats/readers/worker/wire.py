"""What goes between us and the worker: JSON and plain numbers, so that nothing can be executed."""

import json
import struct
from collections.abc import Sequence
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from hmpim.formats.readers.protocol import ChannelInfo, Contents
from hmpim.record import Finding, Series

__all__ = ["contents_from", "pack_series", "receive", "send", "series_from"]

_HEAD = struct.Struct("<QQ")
MAX_TEXT = 2**28
"""Bytes that the JSON of one message may have."""

Arrays = tuple[NDArray[np.float64], ...]


def send(pipe: BinaryIO, message: dict[str, Any], arrays: Sequence[NDArray[np.float64]]) -> None:
    """Write one message and its arrays.

    Parameters
    ----------
    pipe : binary file
        Where.
    message : dict
        Plain JSON values.
    arrays : sequence of ndarray, shape (n,)
        Numbers that go with it.
    """
    message = {**message, "sizes": [a.size for a in arrays]}
    plain = [np.ascontiguousarray(a, dtype="<f8") for a in arrays]  # what may fail comes first
    text = json.dumps(message).encode()
    pipe.write(_HEAD.pack(len(text), sum(8 * a.size for a in arrays)))
    pipe.write(text)
    for array in plain:
        pipe.write(array.view(np.uint8).data)
    pipe.flush()


def receive(pipe: BinaryIO, *, limit: int) -> tuple[dict[str, Any], Arrays] | None:
    """Read one message and its arrays; None where the other end is gone.

    Parameters
    ----------
    pipe : binary file
        Where from.
    limit : int
        Bytes that the arrays may have.

    Raises
    ------
    ValueError
        If the message is none.
    """
    head = pipe.read(_HEAD.size)
    if len(head) < _HEAD.size:
        return None
    length, numbers = _HEAD.unpack(head)
    if length > MAX_TEXT or numbers > limit:
        raise ValueError(f"a message of {length} + {numbers} bytes")
    text = pipe.read(length)
    if len(text) < length:
        return None
    message = json.loads(text)
    sizes = message["sizes"]
    if sum(8 * n for n in sizes) != numbers or any(n < 0 for n in sizes):
        raise ValueError("sizes that do not agree")
    arrays = []
    for size in sizes:
        array = np.empty(size)
        view = array.view(np.uint8).data
        got = 0
        while got < len(view):
            part = pipe.read(min(len(view) - got, 2**24))
            if not part:
                return None
            view[got : got + len(part)] = part
            got += len(part)
        arrays.append(array)
    return message, tuple(arrays)


def contents_from(data: dict[str, Any]) -> Contents:
    """Return what `dataclasses.asdict` made plain.

    Examples
    --------
    >>> from dataclasses import asdict
    >>> contents = Contents(format="MDF", channels=(ChannelInfo(name="u", unit="V"),), fs=10.0)
    >>> contents_from(json.loads(json.dumps(asdict(contents)))) == contents
    True
    """
    band = data["band"]
    plain = {
        **data,
        "channels": tuple(ChannelInfo(**c) for c in data["channels"]),
        "findings": tuple(Finding.from_dict(f) for f in data["findings"]),
        "band": None if band is None else (band[0], band[1]),
    }
    plain |= {kind: tuple(data[kind]) for kind in ("inputs", "outputs", "references", "auxiliary")}
    return Contents(**plain)


def pack_series(series: Sequence[Series]) -> tuple[list[dict[str, Any]], list[NDArray[np.float64]]]:
    """Return series as plain values and arrays; a clock that several share goes once."""
    arrays: list[NDArray[np.float64]] = []
    places: dict[int, int] = {}

    def place(array: NDArray[np.float64]) -> int:
        if id(array) not in places:
            places[id(array)] = len(arrays)
            arrays.append(array)
        return places[id(array)]

    plain = [
        {
            "name": s.name,
            "unit": s.unit,
            "values": place(s.values),
            "time": None if s.time is None else place(s.time),
            "findings": [f.to_dict() for f in s.findings],
        }
        for s in series
    ]
    return plain, arrays


def series_from(plain: Sequence[dict[str, Any]], arrays: Arrays) -> tuple[Series, ...]:
    """Return series as `pack_series` took them.

    Examples
    --------
    >>> time = np.arange(3.0)
    >>> pair = [Series(name=n, values=time * k, time=time) for k, n in enumerate("uy")]
    >>> u, y = series_from(*pack_series(pair))
    >>> u.time is y.time, y.values.tolist()
    (True, [0.0, 1.0, 2.0])
    """
    return tuple(
        Series(
            name=p["name"],
            unit=p["unit"],
            values=arrays[p["values"]],
            time=None if p["time"] is None else arrays[p["time"]],
            findings=tuple(Finding.from_dict(f) for f in p["findings"]),
        )
        for p in plain
    )
