"""What carries datagrams: UDP here; serial lines and CAN in rooms of their own."""

import select
import socket
from types import TracebackType
from typing import Protocol, Self, cast

from hmpim.errors import RigError

__all__ = ["OneOtherEnd", "Transport", "UdpClient", "UdpServer", "listening", "parse_address"]

_LARGEST = 65_507
_BUFFER = 1 << 20  # bytes that the system may keep while nobody reads: a second of five axes


class Transport(Protocol):
    """Something that carries datagrams to one other end and back."""

    @property
    def name(self) -> str:
        """Where the other end is, for messages."""
        ...

    @property
    def doubt(self) -> str:
        """What may be wrong if nothing is heard, as a question."""
        ...

    def open(self) -> None:
        """Connect."""
        ...

    def close(self) -> None:
        """Disconnect; nothing happens if it is not connected."""
        ...

    def send(self, data: bytes) -> None:
        """Send one datagram; it may get lost."""
        ...

    def receive(self, timeout: float) -> bytes | None:
        """Return the next datagram, None if none comes within `timeout` (s)."""
        ...


class OneOtherEnd:
    """The far end, for `serve`, of what has two ends only: there is nobody else to answer.

    Parameters
    ----------
    transport : Transport
        Opened and closed with it.
    """

    def __init__(self, transport: Transport) -> None:
        self._transport = transport

    def __enter__(self) -> Self:
        self._transport.open()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
        /,
    ) -> None:
        self._transport.close()

    def receive(self, timeout: float) -> tuple[bytes, object] | None:
        """Return the next datagram and who sent it: there is one other end."""
        data = self._transport.receive(timeout)
        return None if data is None else (data, self._transport.name)

    def send(self, data: bytes, to: object) -> None:
        """Send one datagram."""
        self._transport.send(data)


def parse_address(text: str) -> tuple[str, int]:
    """Host and port of ``HOST:PORT``; an IPv6 address stands in brackets.

    Raises
    ------
    RigError
        If it is no such address.

    Examples
    --------
    >>> parse_address("127.0.0.1:5005"), parse_address("[::1]:5005")
    (('127.0.0.1', 5005), ('::1', 5005))
    >>> parse_address("somewhere")
    Traceback (most recent call last):
    hmpim.errors.RigError: 'somewhere' is not an address; write HOST:PORT, such as 127.0.0.1:5005
    """
    host, colon, port = text.rpartition(":")
    if not colon or not host or not port.isdecimal() or not 0 <= int(port) <= 65_535:
        raise RigError(f"{text!r} is not an address; write HOST:PORT, such as 127.0.0.1:5005")
    return host.removeprefix("[").removesuffix("]"), int(port)


def _family(host: str) -> socket.AddressFamily:
    return socket.AF_INET6 if ":" in host else socket.AF_INET


def listening(host: str, port: int, *, refused: str, buffer: int = 0) -> socket.socket:
    """Return a socket that listens for datagrams and never waits.

    Parameters
    ----------
    host, port : str, int
        To listen at; port 0 takes any that is free.
    refused : str
        What is said if the address cannot be taken, the system's reason behind it.
    buffer : int
        Bytes that the system may keep while nobody reads; 0 leaves its own number.

    Raises
    ------
    RigError
        If the address cannot be taken.
    """
    try:
        one = socket.socket(_family(host), socket.SOCK_DGRAM)
        if buffer:
            one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer)
        one.bind((host, port))
    except OSError as error:
        raise RigError(f"{refused}: {error}") from error
    one.setblocking(False)
    return one


class UdpClient:
    """The near end of UDP.

    Parameters
    ----------
    host, port : str, int
        Of the far end.
    """

    def __init__(self, host: str, port: int) -> None:
        self._address = (host, port)
        self._socket: socket.socket | None = None

    @property
    def name(self) -> str:
        """Address of the far end."""
        return f"udp://{self._address[0]}:{self._address[1]}"

    @property
    def doubt(self) -> str:
        """That nobody is there."""
        return "is it on, and is the address right?"

    def open(self) -> None:
        """Make a socket that hears the far end alone."""
        try:
            self._socket = socket.socket(_family(self._address[0]), socket.SOCK_DGRAM)
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
            self._socket.connect(self._address)
            self._socket.setblocking(False)
        except OSError as error:
            self.close()
            raise RigError(f"{self.name} cannot be reached: {error}") from error

    def close(self) -> None:
        """Close the socket."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def send(self, data: bytes) -> None:
        """Send one datagram; that nobody listens shows in what does not come back."""
        assert self._socket is not None
        try:
            self._socket.send(data)
        except OSError:  # refused by a host without a listener, or no route: the same as lost
            return

    def receive(self, timeout: float) -> bytes | None:
        """Return the next datagram, None if none comes within `timeout` (s)."""
        assert self._socket is not None
        received = _receive(self._socket, timeout)
        return None if received is None else received[0]


def _receive(one: socket.socket, timeout: float) -> tuple[bytes, object] | None:
    """Take one datagram; the socket's own timeout would be rounded up to whole milliseconds."""
    try:
        if timeout > 0.0 and not select.select([one], [], [], timeout)[0]:
            return None
        return one.recvfrom(_LARGEST)
    except OSError:  # nothing there, or "nobody listens there" of an earlier send
        return None


class UdpServer:
    """The far end of UDP: answers whoever wrote last in the session that is going on.

    Parameters
    ----------
    host, port : str, int
        To listen at; port 0 takes any that is free.

    Raises
    ------
    RigError
        If the address cannot be taken.
    """

    def __init__(self, host: str, port: int) -> None:
        self._socket = listening(
            host, port, refused=f"udp://{host}:{port} cannot be taken", buffer=_BUFFER
        )
        self.peer: object = None

    @property
    def address(self) -> tuple[str, int]:
        """Host and port that it listens at."""
        host, port = self._socket.getsockname()[:2]
        return str(host), int(port)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
        /,
    ) -> None:
        self._socket.close()

    def receive(self, timeout: float) -> tuple[bytes, object] | None:
        """Return the next datagram and who sent it, None if none comes within `timeout` (s)."""
        return _receive(self._socket, timeout)

    def send(self, data: bytes, to: object) -> None:
        """Send one datagram; that the other end is gone does not matter here."""
        try:
            self._socket.sendto(data, cast("tuple[str, int]", to))
        except OSError:
            return
