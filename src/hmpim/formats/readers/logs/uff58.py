"""Universal files, dataset 58: time responses (extra `uff`: pyuff)."""

import re
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import FormatError
from hmpim.formats.readers.logs.log import Column, Group, Log, list_log, take_series, unit_of
from hmpim.formats.readers.protocol import Contents, Layout, Reader, need
from hmpim.record import Series

__all__ = ["UFF58", "channels", "parse", "read", "sniff"]

_START = re.compile(rb"\s*-1\s*\r?\n\s{0,5}(15|18|55|58b?|82|151|164|2411|2412|2414|2420)\b")
_TIME_RESPONSE = 1
_DIRECTIONS = {1: "+X", 2: "+Y", 3: "+Z", 4: "+RX", 5: "+RY", 6: "+RZ"}


def sniff(head: bytes, path: Path) -> bool:
    r"""Say whether a file starts as a universal file does.

    Examples
    --------
    >>> sniff(b"    -1\n    58\n", Path("a.uff")), sniff(b"-1\n2\n", Path("a.csv"))
    (True, False)
    """
    return _START.match(head) is not None


def channels(path: Path, layout: Layout) -> Contents:
    """List the time responses."""
    return list_log(parse, path, layout)


def read(path: Path, names: Sequence[str], layout: Layout) -> tuple[Series, ...]:
    """Read time responses by name."""
    return take_series(parse, path, names, layout)


def parse(path: Path, layout: Layout) -> Log:
    """Open a file; a response is called by its first line, or by node and direction."""
    pyuff = need("pyuff", extra="uff", what="a universal file")
    file = pyuff.UFF(str(path))
    kinds = [int(kind) for kind in np.atleast_1d(file.get_set_types())]
    sets = [file.read_sets(k) for k, kind in enumerate(kinds) if kind == 58]
    responses = [s for s in sets if int(s["func_type"]) == _TIME_RESPONSE]
    if not responses:
        raise FormatError(
            f"{path.name!r} holds {len(sets)} functions and no time response (58, function type 1)"
        )
    groups: dict[tuple[float, ...], list[tuple[str, Any]]] = {}
    for name, response in zip(_names(responses), responses, strict=True):
        groups.setdefault(_clock_key(response), []).append((name, response))
    return Log(format="UFF58", groups=tuple(_group(members) for members in groups.values()))


UFF58 = Reader(
    format="UFF58", sniff=sniff, channels=channels, read=read, extra="uff", foreign=True, uses=()
)


def _names(responses: Sequence[Any]) -> list[str]:
    """A name for each: its first line where these differ, else node and direction."""
    first = [" ".join(str(r.get("id1", "")).split()) for r in responses]
    if len(set(first)) == len(first) and all(n and n.upper() != "NONE" for n in first):
        return first
    out: list[str] = []
    for response in responses:
        node, way = int(response.get("rsp_node", 0)), int(response.get("rsp_dir", 0))
        sign = "-" if way < 0 else "+"
        direction = _DIRECTIONS.get(abs(way), "")[1:]
        name = f"{node}{sign}{direction}" if direction else f"{node}"
        count = sum(n == name or n.startswith(f"{name} (") for n in out)
        out.append(f"{name} ({count + 1})" if count else name)
    return out


def _clock_key(response: Any) -> tuple[float, ...]:
    stamps = np.asarray(response["x"], dtype=np.float64)
    return (stamps.size, *((stamps[0], stamps[-1]) if stamps.size else ()))


def _group(members: Sequence[tuple[str, Any]]) -> Group:
    first = members[0][1]
    if unit_of(first.get("abscissa_axis_units_lab")) not in ("s", "", "NONE"):
        label = first.get("abscissa_axis_units_lab")
        raise FormatError(f"a time response is stated over {label!r}, not over s")
    columns = tuple(
        Column(
            name=name,
            unit=_unit(response),
            samples=len(response["data"]),
            load=partial(_values, response),
        )
        for name, response in members
    )
    time = np.asarray(first["x"], dtype=np.float64)
    return Group(name=f"{time.size} samples", columns=columns, time=time, time_name="abscissa")


def _unit(response: Any) -> str:
    unit = unit_of(response.get("ordinate_axis_units_lab"))
    return "" if unit.upper() == "NONE" else unit


def _values(response: Any) -> NDArray[Any]:
    return np.asarray(response["data"])
