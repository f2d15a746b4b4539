"""The bytes of a text file as lines: encoding, gzip, and what must not be swallowed whole."""

import codecs
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from hmpim.errors import FormatError

__all__ = ["MAX_EXPANDED", "MAX_LINE", "Source", "is_text", "open_source", "read_text"]

MAX_EXPANDED = 2**30
"""Bytes that a gzip file may expand to: 1 GiB, as ten million rows of ten columns need."""

MAX_LINE = 2**20
"""Characters that one line may have: 1 Mi, as fifty thousand columns need."""

_BLOCK = 2**22
_HEAD = 2**18
_GZIP = b"\x1f\x8b"
_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32-le"),
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)


def is_text(head: bytes) -> bool:
    r"""Say whether a file that starts with `head` is text, perhaps packed by gzip.

    Examples
    --------
    >>> is_text(b"time,u\n"), is_text("time,u\n".encode("utf-16")), is_text(b"\x89HDF\r\n\x1a\n\0")
    (True, True, False)
    """
    if head.startswith(_GZIP):
        try:
            head = zlib.decompressobj(wbits=31).decompress(head, 4096)
        except zlib.error:
            return True  # a damaged gzip file is said to be one
    return _encoding(head) is not None


def _encoding(head: bytes) -> str | None:
    """Encoding as the mark or the zeros at the start of a file show it; None for binary."""
    for mark, name in _MARKS:
        if head.startswith(mark):
            return name
    if b"\0" not in head:
        return "utf-8"
    if len(head) >= 4:
        odd, even = head[1:256:2], head[0:256:2]
        if b"\0" not in even and odd.count(0) > 0.9 * len(odd):
            return "utf-16-le"
        if b"\0" not in odd and even.count(0) > 0.9 * len(even):
            return "utf-16-be"
    return None


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """A text file, ready to be read in blocks of whole lines.

    Parameters
    ----------
    path : Path
        The file.
    packed : bool
        True if it is packed by gzip.
    encoding : str
        'utf-8', 'utf-16-le', …; 'cp1252' where the text is not UTF-8 and could be of Windows.
    mark : int
        Number of bytes of the mark at the start.
    """

    path: Path
    packed: bool
    encoding: str
    mark: int

    @property
    def name(self) -> str:
        """Name of the file, for messages."""
        return self.path.name

    def blocks(self, *, size: int = _BLOCK) -> Iterator[str]:
        r"""Yield the text in blocks of whole lines, each line but the file's last ended by ``\n``.

        Raises
        ------
        FormatError
            If it cannot be read, expands beyond `MAX_EXPANDED`, holds a NUL or a byte that its
            encoding does not have, or a line beyond `MAX_LINE`.
        """
        decoder = codecs.getincrementaldecoder(self.encoding)("strict")
        rest, line, skip = "", 1, self.mark
        try:
            with self.path.open("rb") as file:
                for data in _pieces(file, self.path.name, packed=self.packed, size=size):
                    text = rest + self._decoded(decoder, data[skip:], line, rest)
                    skip = 0
                    # A carriage return at the end may be the first half of a line's end.
                    held = "\r" if text.endswith("\r") else ""
                    text = _newlines(text.removesuffix(held))
                    cut = text.rfind("\n") + 1
                    block, rest = text[:cut], text[cut:] + held
                    line += block.count("\n")
                    if len(rest) > MAX_LINE:
                        raise FormatError(
                            f"{self.path.name!r}, line {line} has more than {MAX_LINE} "
                            "characters; it is no table of text"
                        )
                    if block:
                        yield block
                rest += self._decoded(decoder, b"", line, rest, final=True)
        except OSError as error:
            raise FormatError(f"{str(self.path)!r} cannot be read: {error.strerror}") from None
        if rest:
            yield _newlines(rest)

    def _decoded(
        self,
        decoder: codecs.IncrementalDecoder,
        data: bytes,
        line: int,
        before: str,
        *,
        final: bool = False,
    ) -> str:
        try:
            text = decoder.decode(data, final)
        except UnicodeDecodeError as error:
            # The decoder's own bytes may hold the rest of the piece before.
            text = error.object[: error.start].decode(self.encoding, "replace")
            at = line + _newlines(before + text).count("\n")
            bad = error.object[error.start]
            raise FormatError(
                f"{self.path.name!r}, line {at} holds the byte 0x{bad:02x}, which is not "
                f"{self.encoding.upper()} text; if it is a table, save it as UTF-8"
            ) from None
        if "\0" in text:
            at = line + _newlines(before + text[: text.index("\0")]).count("\n")
            raise FormatError(
                f"{self.path.name!r}, line {at} holds a NUL; it is a binary file or damaged, "
                "no table of text"
            )
        return text


def open_source(path: Path) -> Source:
    """Look at the start of a text file, and say how to read it.

    Raises
    ------
    FormatError
        If it cannot be opened, or is not text.
    """
    try:
        with path.open("rb") as file:
            packed = file.read(2) == _GZIP
            file.seek(0)
            head = next(_pieces(file, path.name, packed=packed, size=_HEAD), b"")
    except OSError as error:
        raise FormatError(f"{str(path)!r} cannot be opened: {error.strerror}") from None
    encoding = _encoding(head)
    if encoding is None:
        raise FormatError(f"{path.name!r} is a binary file, not a table of text; export it as CSV")
    mark = next((len(m) for m, _ in _MARKS if head.startswith(m)), 0)
    if encoding == "utf-8" and not mark and not _decodes(head, "utf-8"):
        # Spreadsheets under Windows write '°' and 'µ' so.
        encoding = "cp1252" if _decodes(head, "cp1252") else "utf-8"
    return Source(path=path, packed=packed, encoding=encoding, mark=mark)


def read_text(path: Path) -> str:
    """Return the whole text of a file that is text.

    Raises
    ------
    FormatError
        If there is none, it is a folder, cannot be opened, or is not text.

    Examples
    --------
    >>> read_text(Path("nowhere.csv"))
    Traceback (most recent call last):
    ...
    hmpim.errors.FormatError: there is no file 'nowhere.csv'; check the path
    """
    if path.is_dir():
        raise FormatError(f"{str(path)!r} is a folder; name the file in it")
    try:
        exists = path.exists()
    except ValueError as error:  # a NUL in the path
        raise FormatError(f"{str(path)!r} cannot be opened: {error}") from None
    if not exists:
        raise FormatError(f"there is no file {str(path)!r}; check the path")
    return "".join(open_source(path).blocks())


def _decodes(data: bytes, encoding: str) -> bool:
    try:
        codecs.getincrementaldecoder(encoding)("strict").decode(data)
    except UnicodeDecodeError:
        return False
    return True


def _newlines(text: str) -> str:
    return text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text


def _pieces(file: BinaryIO, name: str, *, packed: bool, size: int) -> Iterator[bytes]:
    """Yield the bytes, unpacked, in pieces of at most `size`."""
    if not packed:
        while data := file.read(size):
            yield data
        return
    total, ended = 0, False
    unpacker = zlib.decompressobj(wbits=31)
    waiting = file.read(2**16)
    try:
        while waiting:
            data = unpacker.decompress(waiting, size)
            total += len(data)
            if total > MAX_EXPANDED:
                raise FormatError(
                    f"{name!r} expands to more than {MAX_EXPANDED / 2**30:g} GiB, which is the "
                    "limit for a packed file; if you trust it, unpack it first"
                )
            if data:
                yield data
            waiting = unpacker.unconsumed_tail
            ended = unpacker.eof
            if ended:  # another member may follow; anything else after the end is padding
                waiting = unpacker.unused_data or file.read(2**16)
                if not waiting.startswith(_GZIP):
                    return
                unpacker, ended = zlib.decompressobj(wbits=31), False
            elif not waiting:
                waiting = file.read(2**16)
    except zlib.error as error:
        raise FormatError(f"{name!r} is a damaged gzip file ({error}); copy it again") from None
    if not ended:
        raise FormatError(f"{name!r} is a gzip file that is cut short; copy it again")
