"""WAV: samples of a sound card or of a logger that writes as one."""

import io
import struct
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import FormatError
from hmpim.formats.readers.logs.log import Column, Group, Log, cut_short, list_log, take_series
from hmpim.formats.readers.protocol import Contents, Layout, Reader
from hmpim.record import Finding, Series

__all__ = ["WAV", "channels", "parse", "read", "sniff"]


def sniff(head: bytes, path: Path) -> bool:
    r"""Say whether a file is WAV.

    Examples
    --------
    >>> sniff(b"RIFF\0\0\0\0WAVE", Path("a.wav")), sniff(b"u,y", Path("a.wav"))
    (True, False)
    """
    return head[:4] in (b"RIFF", b"RIFX", b"RF64") and head[8:12] == b"WAVE"


def channels(path: Path, layout: Layout) -> Contents:
    """List the channels: ``1``, ``2`` and so on."""
    return list_log(parse, path, layout)


def read(path: Path, names: Sequence[str], layout: Layout) -> tuple[Series, ...]:
    """Read channels by number."""
    return take_series(parse, path, names, layout)


def parse(path: Path, layout: Layout) -> Log:
    """Open a file; whole numbers are divided by full scale, and that is said."""
    from scipy.io import wavfile

    data = path.read_bytes()
    start, stated, block = _frame(data)
    whole = len(data) if not block else start + (len(data) - start) // block * block
    rate, samples = wavfile.read(
        io.BytesIO(data[:whole] if stated * block > whole - start else data)
    )
    table = np.atleast_2d(np.asarray(samples).T).T
    if not 0 < rate < 1e9 or not table.size:
        raise FormatError(f"{path.name!r} holds no samples, or states a rate of {rate} Hz")
    scale, said = 1.0, []
    if table.dtype.kind in "iu":
        scale = float(2 ** (8 * table.dtype.itemsize - 1))
        message = (
            f"samples are counts divided by {scale:.0f}, so that full scale is 1; say what full "
            "scale is with the unit"
        )
        said.append(Finding(code="scale", message=message, severity="info", parameters=()))
    zero = 128.0 if table.dtype == np.uint8 else 0.0
    count = len(table)
    if stated > count:
        said += cut_short(f"the file states {stated} samples and holds {count} of them")
    columns = tuple(
        Column(name=str(k + 1), samples=count, load=partial(_values, table, k, zero, scale))
        for k in range(table.shape[1])
    )
    time = np.arange(count) / float(rate)
    group = Group(name="samples", columns=columns, time=time, time_name="the rate")
    return Log(format="WAV", groups=(group,), fs=float(rate), findings=tuple(said))


WAV = Reader(format="WAV", sniff=sniff, channels=channels, read=read, foreign=True, uses=())


def _frame(data: bytes) -> tuple[int, int, int]:
    """Where samples start, how many the header states, and bytes of one; 0 where it does not."""
    order = ">" if data[:4] == b"RIFX" else "<"
    place, block = 12, 0
    while place + 8 <= len(data):
        name = data[place : place + 4]
        (size,) = struct.unpack_from(f"{order}I", data, place + 4)
        if name == b"fmt " and place + 22 <= len(data):
            (block,) = struct.unpack_from(f"{order}H", data, place + 20)
        if name == b"data":
            streamed = size in (0, 0xFFFFFFFF)  # the writer did not know it
            return place + 8, 0 if streamed or not block else size // block, block
        place += 8 + size + size % 2
    return 0, 0, 0


def _values(table: NDArray[Any], place: int, zero: float, scale: float) -> NDArray[np.float64]:
    return (table[:, place].astype(np.float64) - zero) / scale
