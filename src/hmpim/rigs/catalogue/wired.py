"""Builders of rigs at the other end of a wire."""

from hmpim.rigs.catalogue.description import Description
from hmpim.rigs.catalogue.simulated import made_of, take_options
from hmpim.rigs.wire import Hello, UdpClient, WireRig, expected_hello, parse_address

__all__ = ["build_udp"]

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
    wire = {"transport": UdpClient(host, port), "expected": _expected(description)}
    return made_of(WireRig, wire | options, kind_name="UDP rig")


def _expected(description: Description) -> Hello:
    """What the file says must agree with what the far end says."""
    return expected_hello(
        axes=description.axes,
        unit=description.unit,
        rate=description.rate,
        limits=description.stated_limits(),
    )
