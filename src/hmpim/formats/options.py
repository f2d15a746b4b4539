"""What may be said about reading a file beyond the names of its channels."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike

from hmpim.formats.readers import Stamps

__all__ = ["ReadOptions"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadOptions:
    """How a file is read, and which part of it.

    Parameters
    ----------
    start, stop : float or None
        Only samples between these times, in s of the file's own time.
    sweep : int or None
        Only this motion of the first input, counted from 1 as `hmpim channels` lists them.
    offsets : mapping of str to float or None
        How late a clock is, in s, by the name of a channel or of a file; it is subtracted from
        the stamps. None states that it is unknown, which makes the delay doubtful.
    beside : sequence of path-like
        Other files that recorded the same test.
    common : str or None
        Name of a channel that every file contains, by which their clocks are aligned.
    stamps : {'auto', 'header', 'log'}
        Stamp to use if each message has two: the sender's or the logger's.
    sheet : str or None
        Sheet of a workbook, or table of a file with several.

    Examples
    --------
    >>> ReadOptions(start=2.0, sweep=1).stop is None
    True
    """

    start: float | None = None
    stop: float | None = None
    sweep: int | None = None
    offsets: Mapping[str, float | None] = field(default_factory=dict)
    beside: tuple[str | PathLike[str], ...] = ()
    common: str | None = None
    stamps: Stamps = "auto"
    sheet: str | None = None
