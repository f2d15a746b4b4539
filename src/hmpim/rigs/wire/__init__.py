"""Rigs over a wire: datagrams, two clocks, the near end as a rig and the far end as a server."""

from hmpim.rigs.wire.can import CanClient, CanServer
from hmpim.rigs.wire.clocks import ClockFit, fit_clocks
from hmpim.rigs.wire.datagram import Command, Datagram, Kind, Response, State, pack, unpack
from hmpim.rigs.wire.farend import FarEnd, Order
from hmpim.rigs.wire.hello import Hello, check_agreement
from hmpim.rigs.wire.rig import WireRig, expected_hello
from hmpim.rigs.wire.sequence import Counts, Sequence
from hmpim.rigs.wire.serial import SerialClient, SerialServer
from hmpim.rigs.wire.serve import Plant, Trace, serve
from hmpim.rigs.wire.served_sensor import SensorPlant, sensor_hello
from hmpim.rigs.wire.transport import Transport, UdpClient, UdpServer, parse_address

__all__ = [
    "CanClient",
    "CanServer",
    "ClockFit",
    "Command",
    "Counts",
    "Datagram",
    "FarEnd",
    "Hello",
    "Kind",
    "Order",
    "Plant",
    "Response",
    "SensorPlant",
    "Sequence",
    "SerialClient",
    "SerialServer",
    "State",
    "Trace",
    "Transport",
    "UdpClient",
    "UdpServer",
    "WireRig",
    "check_agreement",
    "expected_hello",
    "fit_clocks",
    "pack",
    "parse_address",
    "sensor_hello",
    "serve",
    "unpack",
]
