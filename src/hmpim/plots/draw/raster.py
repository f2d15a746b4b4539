"""Numbers as an image: for an SVG, which has no pixels of its own."""

import base64
import struct
import zlib

import numpy as np
from numpy.typing import NDArray

from hmpim.plots.description import Image

__all__ = ["picture_of"]

_VIRIDIS = (
    "440154",
    "472d7b",
    "3b528b",
    "2c728e",
    "21918c",
    "28ae80",
    "5ec962",
    "addc30",
    "fde725",
)


def picture_of(values: NDArray[np.float64], item: Image) -> str:
    """Return values, shape (rows, columns), in an image's palette, as a PNG in a data: address.

    Examples
    --------
    >>> item = Image(values=np.eye(2), x=(0.0, 1.0), y=(0.0, 1.0), low=0.0, high=1.0)
    >>> picture_of(item.values, item)[:22]
    'data:image/png;base64,'
    """
    share = np.clip((values - item.low) / ((item.high - item.low) or 1.0), 0.0, 1.0)
    if item.palette == "grey":
        pixels = np.repeat((255 * share)[..., np.newaxis], 3, axis=2)
    else:
        anchors = np.array([[int(c[k : k + 2], 16) for k in (0, 2, 4)] for c in _VIRIDIS])
        steps = np.linspace(0.0, 1.0, len(anchors))
        pixels = np.stack([np.interp(share, steps, anchors[:, k]) for k in range(3)], axis=2)
    data = base64.b64encode(_png(np.round(pixels).astype(np.uint8))).decode()
    return f"data:image/png;base64,{data}"


def _png(pixels: NDArray[np.uint8]) -> bytes:
    """Return an RGB image as a PNG file (W3C, Portable Network Graphics, 3rd ed., section 5)."""
    high, wide, _ = pixels.shape
    rows = np.concatenate((np.zeros((high, 1), np.uint8), pixels.reshape(high, -1)), axis=1)

    def chunk(name: bytes, data: bytes) -> bytes:
        body = name + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", struct.pack(">IIBBBBB", wide, high, 8, 2, 0, 0, 0))
        + chunk(b"IDAT", zlib.compress(rows.tobytes(), 6))
        + chunk(b"IEND", b"")
    )
