"""Datagrams over what knows only bytes or short frames: marked, checked, and put together again.

Over a serial line each datagram is followed by its CRC-32 (4 bytes, network byte order), the
whole is stuffed (COBS: no byte of it is 0), and a 0 ends it. Over CAN it goes, with the same CRC,
in frames of up to 8 bytes: the first byte numbers the frame from 0 on, and bit 7 of it marks the
last one. What is damaged or incomplete is dropped, and shows as lost.
"""

import zlib
from collections.abc import Iterator

__all__ = ["Deframer", "Reassembly", "can_frames", "serial_frame"]

_LONGEST = 4096  # bytes kept while no end comes
_MOST_FRAMES = 128  # that one byte numbers, with one bit for the last


def _checked(data: bytes) -> bytes:
    return data + zlib.crc32(data).to_bytes(4, "big")


def _unchecked(data: bytes) -> bytes | None:
    """Without its CRC; None if that is wrong."""
    if len(data) < 5 or zlib.crc32(data[:-4]).to_bytes(4, "big") != data[-4:]:
        return None
    return data[:-4]


def serial_frame(data: bytes) -> bytes:
    r"""Return a datagram as it goes over a serial line.

    Examples
    --------
    >>> frame = serial_frame(bytes(5))
    >>> 0 in frame[:-1], frame[-1], Deframer().take(frame)
    (False, 0, [b'\x00\x00\x00\x00\x00'])
    """
    stuffed = bytearray()
    for part in _checked(data).split(b"\0"):
        while len(part) >= 254:
            stuffed += b"\xff" + part[:254]
            part = part[254:]
        stuffed += bytes([len(part) + 1]) + part
    return bytes(stuffed) + b"\0"


def _unstuffed(stuffed: bytes) -> bytes:
    data, at = bytearray(), 0
    while at < len(stuffed):
        code = stuffed[at]
        data += stuffed[at + 1 : at + code]
        at += code
        if code < 255 and at < len(stuffed):
            data.append(0)
    return bytes(data)


class Deframer:
    """Finds datagrams in the bytes of a serial line.

    Examples
    --------
    >>> found = Deframer()
    >>> found.take(b"noise" + serial_frame(b"one")[:3]), found.take(serial_frame(b"two"))
    ([], [])
    >>> found.take(serial_frame(b"three"))
    [b'three']
    """

    def __init__(self) -> None:
        self._waiting = b""

    def take(self, data: bytes) -> list[bytes]:
        """Take bytes as they came; return the datagrams that are whole."""
        *ended, rest = (self._waiting + data).split(b"\0")
        self._waiting = rest[-_LONGEST:]
        found = (_unchecked(_unstuffed(frame)) for frame in ended if frame)
        return [datagram for datagram in found if datagram is not None]


def can_frames(data: bytes) -> Iterator[bytes]:
    """Yield a datagram as the frames in which it goes over CAN.

    Raises
    ------
    ValueError
        If it is longer than 892 bytes.

    Examples
    --------
    >>> [frame.hex() for frame in can_frames(b"axes")]
    ['006178657329bac9', '81f6']
    """
    whole = _checked(data)
    parts = [whole[k : k + 7] for k in range(0, len(whole), 7)]
    if len(parts) > _MOST_FRAMES:
        raise ValueError(f"{len(data)} bytes are too long for CAN; at most 892 fit")
    for number, part in enumerate(parts):
        last = 0x80 if number == len(parts) - 1 else 0
        yield bytes([number | last]) + part


class Reassembly:
    """Puts the frames of a datagram together again.

    Examples
    --------
    >>> whole = Reassembly()
    >>> [whole.take(frame) for frame in can_frames(b"two frames")]
    [None, b'two frames']
    """

    def __init__(self) -> None:
        self._parts: list[bytes] | None = None

    def take(self, frame: bytes) -> bytes | None:
        """Take a frame; return the datagram that it completes."""
        if not frame:
            return None
        number = frame[0] & 0x7F
        if number == 0:
            self._parts = []
        if self._parts is None or number != len(self._parts):
            self._parts = None  # a frame is missing: wait for the next datagram
            return None
        self._parts.append(frame[1:])
        if not frame[0] & 0x80:
            return None
        whole, self._parts = b"".join(self._parts), None
        return _unchecked(whole)
