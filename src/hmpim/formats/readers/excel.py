"""Excel workbooks (.xlsx, .xlsm): a sheet is a table, read as one of text is."""

import warnings
import zipfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import date, datetime, time, timedelta
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

from hmpim.errors import FormatError, HmpimError
from hmpim.formats.readers.protocol import Contents, Layout, Reader, listed, need
from hmpim.formats.readers.text import MAX_EXPANDED, list_table, read_table
from hmpim.record import Series

__all__ = ["EXCEL", "Sheet", "channels", "open_sheet", "read", "sniff"]

_T = TypeVar("_T")

_ROWS = 20_000  # rows that make one block


def sniff(head: bytes, path: Path) -> bool:
    r"""Say whether a file is a workbook: a zip archive that holds ``xl/workbook.xml``.

    Examples
    --------
    >>> sniff(b"time,u\n0,1\n", Path("a.xlsx"))
    False
    """
    if not head.startswith(b"PK\x03\x04"):
        return False
    try:
        with zipfile.ZipFile(path) as archive:
            return "xl/workbook.xml" in archive.namelist()
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError):
        return b"[Content_Types].xml" in head or b"xl/" in head


def channels(path: Path, layout: Layout) -> Contents:
    """List the columns of a sheet, without time."""
    return list_table(open_sheet(path, layout), layout, form="Excel")


def read(path: Path, names: Sequence[str], layout: Layout) -> tuple[Series, ...]:
    """Read columns of a sheet by name, on the clock of its column of time."""
    return read_table(open_sheet(path, layout), names, layout)


EXCEL = Reader(
    format="Excel",
    sniff=sniff,
    channels=channels,
    read=read,
    extra="excel",
    foreign=True,
    uses=("sheet",),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sheet:
    """A sheet of a workbook as lines of text, a tab between its cells.

    Parameters
    ----------
    path : Path
        The workbook.
    title : str
        Name of the sheet.
    width : int
        Number of columns.
    """

    path: Path
    title: str
    width: int

    @property
    def name(self) -> str:
        """Name of the file, for messages."""
        return self.path.name

    def blocks(self) -> Iterator[str]:
        """Yield the rows as text, in blocks of whole lines.

        Raises
        ------
        FormatError
            If the workbook is damaged.
        """
        lines: list[str] = []
        for row in _rows(self.path, self.title):
            cells = [_text(value) for value in row[: self.width]]
            cells += [""] * (self.width - len(cells))
            lines.append("\t".join(cells) if any(cells) else "")
            if len(lines) == _ROWS:
                yield "\n".join(lines) + "\n"
                lines = []
        if lines:
            yield "\n".join(lines) + "\n"


def open_sheet(path: Path, layout: Layout) -> Sheet:
    """Choose the sheet: the one asked for, or the only one that holds anything.

    Raises
    ------
    FormatError
        If the workbook is damaged or too large, has no such sheet, or several and none is named.
    MissingExtraError
        If openpyxl is not installed.
    """
    _check_size(path)
    titles = _titles(path)
    if layout.sheet is not None:
        if layout.sheet not in titles:
            raise FormatError(
                f"{path.name!r} has no sheet {layout.sheet!r}; its sheets are {listed(titles)}"
            )
        titles = [layout.sheet]
    widths = {title: _width(path, title) for title in titles}
    filled = [title for title in titles if widths[title]]
    if len(filled) > 1:
        raise FormatError(
            f"{path.name!r} has several sheets ({listed(filled)}); say which with sheet=... or "
            "--sheet"
        )
    if not filled:
        raise FormatError(f"{path.name!r} holds no rows; record again, or name another sheet")
    return Sheet(path=path, title=filled[0], width=widths[filled[0]])


def _check_size(path: Path) -> None:
    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(part.file_size for part in archive.infolist())
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError) as error:
        raise FormatError(f"{path.name!r} is a damaged workbook ({error}); copy it again") from None
    if size > MAX_EXPANDED:
        raise FormatError(
            f"{path.name!r} expands to {size / 2**30:.3g} GiB, more than the limit of "
            f"{MAX_EXPANDED / 2**30:g} GiB for a packed file; export the sheet as CSV"
        )


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """A workbook, open for reading; what goes wrong inside is said in our words."""
    openpyxl = need("openpyxl", extra="excel", what="an Excel file")
    try:
        with path.open("rb") as file:  # by a path, openpyxl would ask for a suffix
            book = _quietly(
                lambda: openpyxl.load_workbook(
                    file, read_only=True, data_only=True, keep_links=False
                )
            )
            try:
                yield book
            finally:
                book.close()
    except HmpimError:
        raise
    except Exception as error:  # code of others
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        raise FormatError(
            f"{path.name!r} is a damaged workbook ({reason}); open it in a spreadsheet and save "
            "it anew"
        ) from None


def _quietly(make: Callable[[], _T]) -> _T:
    """Do something without openpyxl's warnings of styles that it does not know."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return make()


def _titles(path: Path) -> list[str]:
    with _opened(path) as book:
        return [sheet.title for sheet in book.worksheets]


def _width(path: Path, title: str) -> int:
    """Largest number of cells among the first rows."""
    width = 0
    for count, row in enumerate(_rows(path, title)):
        filled = [k for k, value in enumerate(row) if value is not None]
        width = max(width, filled[-1] + 1 if filled else 0)
        if count >= 2000:
            break
    return width


def _rows(path: Path, title: str) -> Iterator[tuple[Any, ...]]:
    with _opened(path) as book:
        sheet = book[title]
        sheet.reset_dimensions()  # some programs write wrong ones
        rows = sheet.iter_rows(values_only=True)
        while part := _quietly(lambda: list(islice(rows, 1000))):
            yield from part


def _text(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, float | int):
        return repr(value)
    if isinstance(value, datetime):
        return value.isoformat(sep=" ")
    if isinstance(value, time):
        return value.isoformat()
    if isinstance(value, timedelta):
        return repr(value.total_seconds())
    if isinstance(value, date):
        return value.isoformat()
    return " ".join(str(value).split())
