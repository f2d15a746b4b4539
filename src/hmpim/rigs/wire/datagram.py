"""The datagrams between a run and a rig: what every byte means.

All numbers are in network byte order. Every datagram begins with the same 24 bytes::

    offset  size  what
    0       4     "HMPI"
    4       1     version of the protocol, 1
    5       1     kind, see `Kind`
    6       2     number n of axes in the payload; 0 where there are none
    8       4     session, drawn by the near end for each run; 0 before there is one
    12      4     number of this datagram, counted from 0
    16      8     time stamp: nanoseconds of the sender's own clock when it was sent

The rest depends on the kind::

    COMMAND    24 n bytes: position, velocity, acceleration of each axis, IEEE 754 double.
               The number is that of the command in the stimulus.
    RESPONSE   28 bytes and 16 n. The number is that of the tick of the far end.
               0   4  number of the command in force at this tick; 2³² - 1 for none
               4   4  number of the newest command that has arrived; 2³² - 1 for none
               8   1  state, see `State`
               9   1  1 if the command in force was extrapolated, because none had arrived; else 0
               10  2  reserved, 0
               12  8  when the sample was taken, ns of the far end's clock
               20  8  when the newest command arrived, ns of the far end's clock
               28  16 n: position in force and position measured of each axis, double
    others     UTF-8 text; of HELLO and WELCOME a JSON object, see `hmpim.rigs.wire.hello`
"""

import struct
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import RigError

__all__ = ["NONE", "Command", "Datagram", "Kind", "Response", "State", "pack", "unpack"]

FloatArray = NDArray[np.float64]

NONE = 2**32 - 1
"""Stands for no number."""

_MAGIC = b"HMPI"
_VERSION = 1
_HEAD = struct.Struct("!4sBBHIIq")
_RESPONSE = struct.Struct("!IIBBHqq")


class Kind(IntEnum):
    """What a datagram is."""

    HELLO = 1  # near end: who are you? This is what I expect
    WELCOME = 2  # far end: this is what I am
    REFUSED = 3  # far end: no, with the reason
    ARM = 4  # near end: go to the start and get ready
    COMMAND = 5
    RESPONSE = 6
    STOP = 7  # near end: brake and come to rest
    BYE = 8  # near end: the session is over


class State(IntEnum):
    """What the far end is doing."""

    IDLE = 0  # no session
    HOMING = 1  # on its way to the start
    ARMED = 2  # at the start, waiting for the first command
    MOVING = 3
    BRAKING = 4
    AT_REST = 5  # after a stop or a brake
    FAULT = 6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Command:
    """Commands of all axes at one instant, each shape (n,)."""

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Response:
    """What the far end says at a tick; see the table of bytes above.

    Parameters
    ----------
    in_force, newest : int
        Numbers of commands.
    state : State
        What it is doing.
    reckoned : bool
        Whether the command in force was made up for one that had not come.
    sampled, arrived : int
        Nanoseconds of the far end's clock.
    position, measured : ndarray, shape (n,)
        In force, and read.
    """

    in_force: int
    newest: int
    state: State
    reckoned: bool
    sampled: int
    arrived: int
    position: FloatArray
    measured: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Datagram:
    """One datagram.

    Parameters
    ----------
    kind : Kind
        What it is.
    session, number : int
        Unsigned, 32 bits.
    sent : int
        Nanoseconds of the sender's clock.
    command : Command or None
        Of a COMMAND.
    response : Response or None
        Of a RESPONSE.
    text : str
        Of the others.
    """

    kind: Kind
    session: int = 0
    number: int = 0
    sent: int = 0
    command: Command | None = field(default=None)
    response: Response | None = field(default=None)
    text: str = ""


def pack(datagram: Datagram) -> bytes:
    """Return a datagram as bytes.

    Examples
    --------
    >>> bye = Datagram(kind=Kind.BYE, session=7, number=2, sent=5)
    >>> pack(bye).hex(" ", 4)
    '484d5049 01080000 00000007 00000002 00000000 00000005'
    """
    axes, body = 0, datagram.text.encode()
    if datagram.command is not None:
        c = datagram.command
        axes = c.position.size
        body = _interleaved(c.position, c.velocity, c.acceleration)
    elif datagram.response is not None:
        r = datagram.response
        axes = r.position.size
        body = _RESPONSE.pack(r.in_force, r.newest, r.state, r.reckoned, 0, r.sampled, r.arrived)
        body += _interleaved(r.position, r.measured)
    head = _HEAD.pack(
        *(_MAGIC, _VERSION, datagram.kind, axes),
        *(datagram.session, datagram.number, datagram.sent),
    )
    return head + body


def _interleaved(*columns: FloatArray) -> bytes:
    """Doubles in network order: the first of each column, the second of each, and so on."""
    rows = zip(*(column.tolist() for column in columns), strict=True)
    values = [value for row in rows for value in row]
    return struct.pack(f"!{len(values)}d", *values)


def _columns(body: bytes, count: int, *, offset: int = 0) -> list[FloatArray]:
    """Undo `_interleaved`, for `count` columns."""
    values = struct.unpack_from(f"!{(len(body) - offset) // 8}d", body, offset)
    return [np.array(values[k::count]) for k in range(count)]


def unpack(data: bytes) -> Datagram:
    """Read a datagram.

    Raises
    ------
    RigError
        If the bytes are no datagram of this protocol; the message says why.

    Examples
    --------
    >>> again = unpack(pack(Datagram(kind=Kind.REFUSED, text="busy")))
    >>> again.kind.name, again.text
    ('REFUSED', 'busy')
    >>> unpack(b"GET / HTTP/1.1")
    Traceback (most recent call last):
    hmpim.errors.RigError: 14 bytes that are no datagram of hmpim: 474554202f20485454502f31...
    """
    if len(data) < _HEAD.size or data[:4] != _MAGIC:
        raise RigError(
            f"{len(data)} bytes that are no datagram of hmpim: {data[:12].hex()}...; is something "
            "else at that address?"
        )
    _, version, number_of_kind, axes, session, number, sent = _HEAD.unpack_from(data)
    if version != _VERSION:
        raise RigError(
            f"the other end speaks version {version} of the protocol, this one {_VERSION}; "
            "update the older one"
        )
    try:
        kind = Kind(number_of_kind)
    except ValueError:
        raise RigError(f"a datagram of kind {number_of_kind}, which is not known") from None
    body = data[_HEAD.size :]
    command = response = None
    text = ""
    if kind is Kind.COMMAND:
        command = _command(body, axes)
    elif kind is Kind.RESPONSE:
        response = _response(body, axes)
    else:
        text = body.decode(errors="replace")
    return Datagram(
        kind=kind,
        session=session,
        number=number,
        sent=sent,
        command=command,
        response=response,
        text=text,
    )


def _command(body: bytes, axes: int) -> Command:
    if len(body) != 24 * axes:
        raise RigError(f"a command of {len(body)} bytes for {axes} axes; it must have {24 * axes}")
    position, velocity, acceleration = _columns(body, 3)
    return Command(position=position, velocity=velocity, acceleration=acceleration)


def _response(body: bytes, axes: int) -> Response:
    wanted = _RESPONSE.size + 16 * axes
    if len(body) != wanted:
        raise RigError(f"a response of {len(body)} bytes for {axes} axes; it must have {wanted}")
    in_force, newest, state, reckoned, _, sampled, arrived = _RESPONSE.unpack_from(body)
    try:
        known = State(state)
    except ValueError:
        raise RigError(f"a response with state {state}, which is not known") from None
    position, measured = _columns(body, 2, offset=_RESPONSE.size)
    return Response(
        in_force=in_force,
        newest=newest,
        state=known,
        reckoned=bool(reckoned),
        sampled=sampled,
        arrived=arrived,
        position=position,
        measured=measured,
    )
