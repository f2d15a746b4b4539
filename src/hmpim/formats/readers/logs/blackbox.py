"""Betaflight's blackbox (extra `betaflight`: betaflight-chirp-core)."""

import struct
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import FormatError
from hmpim.formats.readers.logs.clock import seconds_since
from hmpim.formats.readers.logs.log import Column, Group, Log, cut_short, list_log, take_series
from hmpim.formats.readers.protocol import Contents, Layout, Reader, need
from hmpim.record import Finding, Series

__all__ = ["BLACKBOX", "channels", "parse", "read", "sniff"]

_END = 255
_MARK = b"H Product:Blackbox flight data recorder by Nicholas Sherlock"


def sniff(head: bytes, path: Path) -> bool:
    """Say whether a file starts with a blackbox header.

    Examples
    --------
    >>> sniff(_MARK, Path("a.bbl")), sniff(b"u,y", Path("a.bbl"))
    (True, False)
    """
    return _MARK in head


def channels(path: Path, layout: Layout) -> Contents:
    """List the fields of the main frames."""
    return list_log(parse, path, layout)


def read(path: Path, names: Sequence[str], layout: Layout) -> tuple[Series, ...]:
    """Read fields by name: ``setpoint[0]``, ``gyroADC[0]``."""
    return take_series(parse, path, names, layout)


def parse(path: Path, layout: Layout) -> Log:
    """Open a file; `layout.sheet` is the number of the flight, if it holds several."""
    decoder = need("betaflight_chirp_core.decoder", extra="betaflight", what="a blackbox log")
    data = path.read_bytes()
    flights: dict[int, Any] = {}
    reasons = []
    for number, (start, stop) in enumerate(decoder.split_sessions(data), start=1):
        if layout.sheet not in (None, str(number)):
            continue
        parser = decoder.FlightLogParser(data, start, stop)
        try:
            parser.parse_header()
            parser.parse_data()
        except Exception as error:  # code of others; another flight may be whole
            reasons.append(f"flight {number}: {' '.join(str(error).split())[:120]}")
            continue
        if parser.main_frames:
            flights[number] = parser
    if not flights:
        why = f" ({'; '.join(reasons)})" if reasons else ""
        which = f"no flight {layout.sheet!r}" if layout.sheet is not None else "no flight"
        raise FormatError(f"{path.name!r} holds {which} that can be decoded{why}")
    if len(flights) > 1:
        said = ", ".join(f"{k} ({_seconds(p):.3g} s)" for k, p in list(flights.items())[:20])
        raise FormatError(
            f"{path.name!r} holds {len(flights)} flights: {said}; say which with --sheet"
        )
    ((number, parser),) = flights.items()
    return _log(number, parser)


BLACKBOX = Reader(
    format="blackbox",
    sniff=sniff,
    channels=channels,
    read=read,
    extra="betaflight",
    foreign=True,
    uses=("sheet",),
)


def _seconds(parser: Any) -> float:
    return float((parser.main_frames[-1][1] - parser.main_frames[0][1]) / 1e6)


def _log(number: int, parser: Any) -> Log:
    table = np.array(parser.main_frames, dtype=np.float64)
    names = list(parser.main_field_names)
    if "time" not in names or table.shape[1] != len(names):
        raise FormatError("the log has no field 'time'; it is damaged")
    ticks = table[:, names.index("time")].astype(np.int64)
    scale, findings = _gyro_scale(parser.sys_config)
    columns = []
    for k, name in enumerate(names):
        if name in ("time", "loopIteration"):
            continue
        unit, factor = _unit(name, scale)
        load = partial(_values, table, k, factor)
        columns.append(Column(name=name, unit=unit, samples=len(table), load=load))
    corrupt = int(parser.stats["total_corrupt_frames"])
    desync = sum(int(s["desync"]) for s in parser.stats["frame"].values())
    if corrupt or desync:
        message = f"{corrupt + desync} frames are damaged and were left out; look for gaps"
        findings += (
            Finding(code="damaged_parts", message=message, severity="info", parameters=()),
        )
    if not any(event["event"] == _END for event in parser.events):
        findings += cut_short("the log has no mark of its end; it is cut short, or power was")
    group = Group(
        name=f"flight {number}",
        columns=tuple(columns),
        time=seconds_since(ticks, 0, per_second=10**6),
        time_name="time",
    )
    version = parser.sys_config.get("firmwareVersion") or ""
    kind = str(parser.sys_config.get("firmwareType") or "").capitalize()
    return Log(format=f"blackbox {kind} {version}".strip(), groups=(group,), findings=findings)


def _gyro_scale(config: dict[str, Any]) -> tuple[float | None, tuple[Finding, ...]]:
    """deg/s that one count of the gyro is, as the header states it, and what is said of it.

    The header holds the factor to deg/s as the bits of a float; the decoder turns it into rad/µs.
    """
    if config.get("firmwareType") not in ("betaflight", "cleanflight", "inav", "butterflight"):
        return None, ()
    factor = float(config.get("gyroScale") or 0.0) * 1e6 * 180.0 / np.pi
    factor = struct.unpack("<f", struct.pack("<f", factor))[0]
    if not np.isfinite(factor) or not 0 < factor < 100 or config.get("gyroScale") == 1.0:
        return None, ()
    message = f"gyroADC is multiplied by the {factor:.6g} deg/s per count that the header states"
    said = Finding(code="scale", message=message, severity="info", parameters=())
    return factor, () if factor == 1.0 else (said,)


def _unit(name: str, gyro_scale: float | None) -> tuple[str, float]:
    """Unit and factor of a field; none where the log does not tell."""
    if gyro_scale is not None and name.startswith(("gyroADC[", "gyroUnfilt[")):
        return "deg/s", gyro_scale
    if gyro_scale is not None and name in ("setpoint[0]", "setpoint[1]", "setpoint[2]"):
        return "deg/s", 1.0  # so the firmware defines it
    return "", 1.0


def _values(table: NDArray[np.float64], place: int, factor: float) -> NDArray[np.float64]:
    return table[:, place] * factor
