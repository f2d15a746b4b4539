"""Datagrams over a serial line."""

import time
from collections import deque
from typing import Any

from hmpim.arguments import check_argument
from hmpim.errors import MissingExtraError, RigError
from hmpim.rigs.wire.framing import Deframer, serial_frame
from hmpim.rigs.wire.transport import OneOtherEnd

__all__ = ["SerialClient", "SerialServer", "open_line"]


def open_line(port: str, baud: int) -> Any:
    """Open a serial port.

    Raises
    ------
    MissingExtraError
        If pyserial is not installed.
    RigError
        If there is no such port, or another program has it open.
    """
    try:
        import serial
    except ImportError as error:
        raise MissingExtraError(
            "serial lines need pyserial; install it with pip install 'hmpim[serial]'"
        ) from error
    try:
        return serial.Serial(port, baud, timeout=0, write_timeout=0.1, exclusive=True)
    except (OSError, ValueError) as error:
        raise RigError(f"serial:{port} cannot be opened: {error}") from error


class SerialClient:
    """The near end of a serial line.

    Parameters
    ----------
    port : str
        Of the computer, such as /dev/ttyUSB0 or COM3.
    baud : int
        Bits a second. One axis at 100 Hz takes about 160 kbit/s both ways together.
    """

    def __init__(self, port: str, *, baud: int = 921_600) -> None:
        check_argument("baud", baud, int)
        self._port, self._baud = port, baud
        self._line: Any = None
        self._found: deque[bytes] = deque()
        self._came = 0
        self._deframer = Deframer()

    @property
    def name(self) -> str:
        """Port of the computer."""
        return f"serial:{self._port}"

    @property
    def doubt(self) -> str:
        """That nobody is there, or speaks at another rate: then bytes come, and no datagram."""
        if self._came:
            return (
                f"{self._came} bytes came, and no datagram: is the baud rate ({self._baud}) right?"
            )
        return f"is it on, and are the port and the baud rate ({self._baud}) right?"

    def open(self) -> None:
        """Open the port, and forget what came before."""
        self._line = open_line(self._port, self._baud)
        self._line.reset_input_buffer()
        self._found.clear()
        self._came = 0
        self._deframer = Deframer()

    def close(self) -> None:
        """Close the port."""
        if self._line is not None:
            self._line.close()
            self._line = None

    def send(self, data: bytes) -> None:
        """Send one datagram; that nobody listens shows in what does not come back.

        Raises
        ------
        RigError
            If the port is gone.
        """
        assert self._line is not None
        import serial

        try:
            self._line.write(serial_frame(data))
        except serial.SerialTimeoutException:
            return  # the line is full: as good as lost
        except OSError as error:
            raise RigError(f"{self.name} is disconnected: {error}") from error

    def receive(self, timeout: float) -> bytes | None:
        """Return the next datagram, None if none comes within `timeout` (s).

        Raises
        ------
        RigError
            If the port is gone.
        """
        assert self._line is not None
        deadline = time.perf_counter() + timeout
        while not self._found:
            left = deadline - time.perf_counter()
            try:
                self._line.timeout = max(left, 0.0)
                data = self._line.read(max(1, self._line.in_waiting))
            except OSError as error:
                raise RigError(f"{self.name} is disconnected: {error}") from error
            self._came += len(data)
            self._found.extend(self._deframer.take(data))
            if not self._found and left <= 0.0:
                return None
        return self._found.popleft()


class SerialServer(OneOtherEnd):
    """The far end of a serial line, for `serve`.

    Parameters
    ----------
    port, baud : str, int
        As of `SerialClient`.
    """

    def __init__(self, port: str, *, baud: int = 921_600) -> None:
        super().__init__(SerialClient(port, baud=baud))
