"""Datagrams over a CAN bus."""

import time
from typing import Any

from hmpim.arguments import check_argument
from hmpim.errors import MissingExtraError, RigError
from hmpim.rigs.wire.framing import Reassembly, can_frames
from hmpim.rigs.wire.transport import OneOtherEnd

__all__ = ["CanClient", "CanServer"]

_THERE, _BACK = 0x140, 0x141


class CanClient:
    """The near end of a CAN bus.

    Parameters
    ----------
    channel : str
        Of the interface, such as can0.
    interface : str
        As python-can names it: 'socketcan', 'pcan', 'virtual', ...
    bitrate : int
        Bits a second. At 1 Mbit/s a bus carries one axis at up to 200 Hz.
    there, back : int
        Identifiers of frames to the rig and from it.
    """

    def __init__(
        self,
        channel: str,
        *,
        interface: str = "socketcan",
        bitrate: int = 1_000_000,
        there: int = _THERE,
        back: int = _BACK,
    ) -> None:
        check_argument("interface", interface, str)
        check_argument("bitrate", bitrate, int)
        self._channel, self._interface, self._bitrate = channel, interface, bitrate
        self._there, self._back = there, back
        self._bus: Any = None
        self._whole = Reassembly()

    @property
    def name(self) -> str:
        """Channel of the bus."""
        return f"can:{self._channel}"

    @property
    def doubt(self) -> str:
        """That nobody is there, or listens at another rate."""
        return f"is it on, and are the channel and the bitrate ({self._bitrate}) right?"

    def open(self) -> None:
        """Open the bus; frames of others are not looked at.

        Raises
        ------
        MissingExtraError
            If python-can is not installed.
        RigError
            If there is no such bus.
        """
        try:
            import can
        except ImportError as error:
            raise MissingExtraError(
                "CAN needs python-can; install it with pip install 'hmpim[can]'"
            ) from error
        try:
            self._bus = can.Bus(
                channel=self._channel,
                interface=self._interface,
                bitrate=self._bitrate,
                can_filters=[{"can_id": self._back, "can_mask": 0x7FF, "extended": False}],
            )
        except (can.CanError, OSError, ValueError) as error:
            raise RigError(f"{self.name} ({self._interface}) cannot be opened: {error}") from error
        self._whole = Reassembly()

    def close(self) -> None:
        """Leave the bus."""
        if self._bus is not None:
            self._bus.shutdown()
            self._bus = None

    def send(self, data: bytes) -> None:
        """Send one datagram, frame by frame; a bus that takes none loses it."""
        assert self._bus is not None
        import can

        for frame in can_frames(data):
            message = can.Message(arbitration_id=self._there, data=frame, is_extended_id=False)
            try:
                self._bus.send(message, timeout=0.01)
            except can.CanError:
                return

    def receive(self, timeout: float) -> bytes | None:
        """Return the next datagram, None if none comes within `timeout` (s)."""
        assert self._bus is not None
        deadline = time.perf_counter() + timeout
        while True:
            left = deadline - time.perf_counter()
            message = self._bus.recv(max(left, 0.0))
            if message is None:
                if left <= 0.0:
                    return None
                continue
            datagram = self._whole.take(bytes(message.data))
            if datagram is not None:
                return datagram


class CanServer(OneOtherEnd):
    """The far end of a CAN bus, for `serve`.

    Parameters
    ----------
    channel, interface, bitrate
        As of `CanClient`.
    """

    def __init__(
        self, channel: str, *, interface: str = "socketcan", bitrate: int = 1_000_000
    ) -> None:
        super().__init__(
            CanClient(channel, interface=interface, bitrate=bitrate, there=_BACK, back=_THERE)
        )
