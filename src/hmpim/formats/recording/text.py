"""Text in HDF5, of fixed length.

Text of variable length, h5py's own choice, stands in a heap that has no checksum: of 5000 files
with up to three bytes flipped, five made HDF5 2.0 hang there.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

__all__ = ["put_text", "put_text_dataset", "text_of"]


def put_text(place: Any, name: str, text: str) -> None:
    """Write an attribute that is text (UTF-8)."""
    import h5py

    data = text.encode()
    kind = h5py.string_dtype("utf-8", max(1, len(data)))
    place.attrs.create(name, np.array(data, dtype=kind), dtype=kind)


def put_text_dataset(place: Any, name: str, text: str | Sequence[str]) -> None:
    """Write a dataset that is one text, or one of a line each."""
    import h5py

    data = [text.encode()] if isinstance(text, str) else [line.encode() for line in text]
    kind = h5py.string_dtype("utf-8", max(1, *map(len, data)))
    values = np.array(data[0] if isinstance(text, str) else data, dtype=kind)
    place.create_dataset(name, data=values, dtype=kind, track_times=False)


def text_of(value: Any) -> str:
    """Return text that was read, of fixed length or not, as a string.

    Raises
    ------
    UnicodeDecodeError
        If it is not UTF-8.

    Examples
    --------
    >>> text_of(np.bytes_("°C".encode())), text_of("deg")
    ('°C', 'deg')
    """
    return value.decode() if isinstance(value, bytes) else str(value)
