"""Metadata of records from a table beside them: one row a record."""

import csv
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from hmpim.batch.addresses import Address
from hmpim.errors import FormatError
from hmpim.formats.readers.protocol import need

__all__ = ["Beside", "read_metadata"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Beside:
    """A table of metadata.

    Parameters
    ----------
    columns : tuple of str
        Its columns but the one of names.
    rows : mapping of str to tuple of str
        Values by the name of the record.
    """

    columns: tuple[str, ...] = ()
    rows: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def of(self, address: Address) -> dict[str, str]:
        """What is said of one record: by its whole name, its place, its file, or their ends."""
        place, file = PurePosixPath(address.place), PurePosixPath(address.file.url)
        names = (address.name, address.place, place.name)
        if address.form == "file":
            names = (address.name, file.name, file.stem)
        for name in names:
            if name and name in self.rows:
                return dict(zip(self.columns, self.rows[name], strict=True))
        return {}


def read_metadata(path: str, column: str) -> Beside:
    r"""Read a CSV or Parquet file with one row a record.

    Parameters
    ----------
    path : str
        The file; empty for none.
    column : str
        Column that holds the records' names.

    Raises
    ------
    FormatError
        If it cannot be read, or has no such column.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     place = Path(folder, "units.csv")
    ...     _ = place.write_text("record,serial\na.csv,17\n")
    ...     read_metadata(str(place), "record").rows
    {'a.csv': ('17',)}
    """
    if not path:
        return Beside()
    try:
        if path.lower().endswith((".parquet", ".pq")):
            parquet = need("pyarrow.parquet", extra="batch", what="a Parquet file")
            table = parquet.read_table(path)
            head: Sequence[str] = table.column_names
            columns_ = [[str(v) for v in c.to_pylist()] for c in table.columns]
            body = list(zip(*columns_, strict=True))
        else:
            with Path(path).open(encoding="utf-8-sig", newline="") as file:
                lines = [line for line in csv.reader(file) if line]
            head, body = (lines[0] if lines else []), [tuple(line) for line in lines[1:]]
        if column not in head:
            raise FormatError(
                f"{path!r} has no column {column!r} with the names of the records; its columns "
                f"are {', '.join(head)}"
            )
        at = list(head).index(column)
        names = [line[at] for line in body]
        rows = {line[at]: (*line[:at], *line[at + 1 :]) for line in body}
    except FileNotFoundError:
        raise FormatError(f"there is no file {path!r} with metadata; check the path") from None
    except (OSError, ValueError, IndexError) as error:
        if isinstance(error, FormatError):
            raise
        raise FormatError(f"{path!r} is not a table of metadata: {error}") from None
    if twice := [name for name, count in Counter(names).items() if count > 1]:
        raise FormatError(
            f"{path!r} has {names.count(twice[0])} rows of {twice[0]!r}; leave one, as each "
            "record has one"
        )
    columns = tuple(name for name in head if name != column)
    wrong = next((name for name, values in rows.items() if len(values) != len(columns)), None)
    if wrong is not None:
        raise FormatError(f"{path!r}: the row of {wrong!r} has not as many values as the heading")
    return Beside(columns=columns, rows=rows)
