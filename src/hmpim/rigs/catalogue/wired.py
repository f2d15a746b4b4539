"""Builders of rigs at the other end of a wire."""

from typing import Any

from hmpim.errors import FormatError
from hmpim.rigs.catalogue.description import Description
from hmpim.rigs.catalogue.simulated import made_of, take_options
from hmpim.rigs.wire import Hello, Transport, UdpClient, WireRig, expected_hello, parse_address
from hmpim.rigs.wire.can import CanClient
from hmpim.rigs.wire.serial import SerialClient

__all__ = ["build_can", "build_serial", "build_udp"]

_TIMES = {"answer", "homing", "stale"}


def build_udp(argument: str, description: Description) -> WireRig:
    """Make a rig at ``udp://HOST:PORT``; options are the times in s that it may take.

    Examples
    --------
    >>> from hmpim.rigs.catalogue.description import describe
    >>> build_udp("127.0.0.1:5005", describe({"options": {"answer": 0.5}})).name
    'udp://127.0.0.1:5005'
    """
    host, port = parse_address(argument)
    options = take_options(description, _TIMES, kind="UDP rig")
    return _over(UdpClient(host, port), options, description, kind="UDP rig")


def build_serial(argument: str, description: Description) -> WireRig:
    """Make a rig at ``serial:PORT``; options are `baud`, and the times in s that it may take.

    Examples
    --------
    >>> from hmpim.rigs.catalogue.description import describe
    >>> build_serial("/dev/ttyUSB0", describe({"options": {"baud": 115200}})).name
    'serial:/dev/ttyUSB0'
    """
    _named("serial:PORT", argument)
    options = take_options(description, {"baud", *_TIMES}, kind="serial rig")
    line = made_of(
        SerialClient, {"port": argument, **_some(options, {"baud"})}, kind_name="serial rig"
    )
    return _over(line, options, description, kind="serial rig")


def build_can(argument: str, description: Description) -> WireRig:
    """Make a rig at ``can:CHANNEL``; options are `interface`, `bitrate`, and times in s.

    Examples
    --------
    >>> from hmpim.rigs.catalogue.description import describe
    >>> build_can("can0", describe({"options": {"interface": "virtual"}})).name
    'can:can0'
    """
    _named("can:CHANNEL", argument)
    own = {"interface", "bitrate"}
    options = take_options(description, own | _TIMES, kind="CAN rig")
    bus = made_of(CanClient, {"channel": argument, **_some(options, own)}, kind_name="CAN rig")
    return _over(bus, options, description, kind="CAN rig")


def _named(form: str, argument: str) -> None:
    if not argument:
        raise FormatError(f"{form.partition(':')[0]} alone gives no address; write {form}")


def _some(options: dict[str, Any], names: set[str]) -> dict[str, Any]:
    return {name: value for name, value in options.items() if name in names}


def _over(
    transport: Transport, options: dict[str, Any], description: Description, *, kind: str
) -> WireRig:
    wire = {"transport": transport, "expected": _expected(description)}
    return made_of(WireRig, wire | _some(options, _TIMES), kind_name=kind)


def _expected(description: Description) -> Hello:
    """What the file says must agree with what the far end says."""
    return expected_hello(
        axes=description.axes,
        unit=description.unit,
        rate=description.rate,
        limits=description.stated_limits(),
        watchdog=description.watchdog,
    )
