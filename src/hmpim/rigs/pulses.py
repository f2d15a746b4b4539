"""Where the pulses of an external tick come from: datagrams, or bytes on a serial line.

A pulse should hold its number, so that one that is lost, doubled or late is known: over UDP four
bytes in network order, one more each time; over a serial line one byte, its number modulo 256.
"""

import select
from collections.abc import Sequence
from typing import Protocol

from hmpim.errors import ArgumentError
from hmpim.rigs.wire.transport import listening, parse_address

__all__ = ["SerialTicks", "TickSource", "UdpTicks", "find_ticks", "pulse_bytes"]


_AGAIN = 2  # a datagram may come twice; what comes three times in a row is no number


def pulse_bytes(number: int) -> bytes:
    """Return what a datagram of this number holds.

    Examples
    --------
    >>> pulse_bytes(258).hex()
    '00000102'
    """
    return (number % (1 << 32)).to_bytes(4, "big")


class TickSource(Protocol):
    """Where pulses come from."""

    @property
    def modulus(self) -> int:
        """Numbers begin at 0 again after so many pulses."""
        ...

    def wait(self, timeout: float) -> Sequence[int | None]:
        """Return the numbers of the pulses that have come, None for one without.

        None yet: wait for the first at most so long (s).
        """
        ...


class UdpTicks:
    """Pulses that are datagrams.

    Parameters
    ----------
    host, port : str, int
        To listen at; port 0 takes any that is free.

    Raises
    ------
    RigError
        If the address cannot be taken.
    """

    modulus = 1 << 32

    def __init__(self, host: str, port: int) -> None:
        self._socket = listening(host, port, refused=f"tick udp://{host}:{port} cannot be heard")
        self._before = (b"", 0)  # what the last held, and how often in a row

    @property
    def port(self) -> int:
        """Port that it listens at."""
        return int(self._socket.getsockname()[1])

    def wait(self, timeout: float) -> Sequence[int | None]:
        """Return the numbers of those that have come."""
        select.select([self._socket], [], [], max(0.0, timeout))
        came: list[int | None] = []
        while True:
            try:
                held = self._socket.recv(64)
            except BlockingIOError:
                return came
            again = self._before[1] + 1 if held == self._before[0] else 1
            self._before = (held, again)
            numbered = len(held) == 4 and again <= _AGAIN
            came.append(int.from_bytes(held, "big") if numbered else None)

    def close(self) -> None:
        """Listen no more."""
        self._socket.close()


class SerialTicks:
    """Pulses that are bytes on a serial line.

    Parameters
    ----------
    port : str
        Of the computer, such as /dev/ttyS0.
    baud : int
        Bits a second.
    """

    modulus = 256

    def __init__(self, port: str, *, baud: int = 115_200) -> None:
        from hmpim.rigs.wire.serial import open_line

        self._line = open_line(port, baud)
        self._before: int | None = None

    def wait(self, timeout: float) -> Sequence[int | None]:
        """Return the numbers of those that have come; a byte that repeats itself is none."""
        self._line.timeout = max(0.0, timeout)
        came: list[int | None] = []
        for number in self._line.read(max(1, self._line.in_waiting)):
            came.append(None if number == self._before else number)
            self._before = number
        return came

    def close(self) -> None:
        """Listen no more."""
        self._line.close()


def find_ticks(text: str) -> UdpTicks | SerialTicks:
    """Return the source that ``udp://HOST:PORT`` or ``serial:PORT`` names.

    Raises
    ------
    ArgumentError
        If it is neither.

    Examples
    --------
    >>> find_ticks("sundial")
    Traceback (most recent call last):
    hmpim.errors.ArgumentError: 'sundial' is not a tick; write udp://HOST:PORT or serial:PORT
    """
    if text.startswith("udp://"):
        return UdpTicks(*parse_address(text.removeprefix("udp://")))
    if text.startswith("serial:"):
        return SerialTicks(text.removeprefix("serial:"))
    raise ArgumentError(f"{text!r} is not a tick; write udp://HOST:PORT or serial:PORT")
