"""Readers of files that others wrote, chosen by content.

A reader of your own is a `Reader`; publish it as an entry point of the group ``hmpim.readers``.
"""

from hmpim.formats.readers.protocol import (
    ChannelInfo,
    Contents,
    Layout,
    Reader,
    Stamps,
    check_used,
    listed,
    need,
)
from hmpim.formats.readers.registry import BrokenReader, Found, reader_for, readers

__all__ = [
    "BrokenReader",
    "ChannelInfo",
    "Contents",
    "Found",
    "Layout",
    "Reader",
    "Stamps",
    "check_used",
    "listed",
    "need",
    "reader_for",
    "readers",
]
