"""What a batch found, as one table that is read when it is asked for."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from os import PathLike
from pathlib import Path
from typing import Any

from hmpim.arguments import checked
from hmpim.batch.parts import parts_in, read_stamp
from hmpim.batch.request import Request
from hmpim.errors import ArgumentError
from hmpim.formats.readers.protocol import need
from hmpim.identify import Identification

__all__ = ["BatchTable", "open_table"]


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchTable:
    """Rows of a batch, in Parquet parts; nothing is read before it is asked for.

    Parameters
    ----------
    folder : Path
        The batch's folder.
    request : Request
        What was asked of each record.
    metadata : tuple of str
        Columns of metadata; in the table they are called `meta_NAME`.
    """

    folder: Path
    request: Request
    metadata: tuple[str, ...]

    @property
    def paths(self) -> tuple[Path, ...]:
        """The parts, by name."""
        return tuple(parts_in(self.folder))

    def dataset(self) -> Any:
        """Return a ``pyarrow.dataset.Dataset``: lazy, filtered and projected as it is read."""
        dataset = need("pyarrow.dataset", extra="batch", what="the table of a batch")
        if not self.paths:
            raise ArgumentError(f"{str(self.folder)!r} holds no parts yet; run the batch first")
        return dataset.dataset([str(p) for p in self.paths], format="parquet")

    def scan(self) -> Any:
        """Return a ``polars.LazyFrame`` over all parts."""
        polars = need("polars", extra="polars", what="a Polars table")
        return polars.scan_parquet([str(p) for p in self.paths])

    def to_pandas(self, columns: Sequence[str] | None = None) -> Any:
        """Return a ``pandas.DataFrame``, of all columns or some."""
        need("pandas", extra="batch", what="a pandas table")
        return self.to_arrow(columns).to_pandas()

    def to_arrow(self, columns: Sequence[str] | None = None) -> Any:
        """Return a ``pyarrow.Table``, of all columns or some.

        Raises
        ------
        ArgumentError
            If there is no such column.
        """
        every = self.dataset()
        if columns is None:
            return every.to_table()
        some = [columns] if isinstance(columns, str) else list(columns)
        known = every.schema.names
        for name in some:
            if name not in known:
                alike = get_close_matches(name, known, n=3) or [*known[:3], "…"]
                raise ArgumentError(f"there is no column {name!r}; there is {', '.join(alike)}")
        return every.to_table(columns=some)

    def __repr__(self) -> str:
        return f"BatchTable({len(self)} rows in {str(self.folder)!r})"

    def __len__(self) -> int:
        return int(self.dataset().count_rows()) if self.paths else 0

    def result(self, record: str) -> Identification:
        """Return all that was found of one record, by its name or the end of it.

        Raises
        ------
        ArgumentError
            If there is no such record, it failed, or parameters alone were kept.
        """
        import pyarrow.dataset as ds

        ends = ds.field("record")
        some = self.dataset().to_table(
            columns=["record", "result", "reason"], filter=ends.isin([record])
        )
        if not some.num_rows:
            names = self.to_arrow(["record"]).column(0).to_pylist()
            whole = sorted({name for name in names if name.endswith(record)})
            if not whole:
                raise ArgumentError(f"no record is called {record!r}, nor does a name end so")
            if len(whole) > 1:
                raise ArgumentError(
                    f"the names of {len(whole)} records end in {record!r}: {whole[0]!r}, "
                    f"{whole[1]!r}; give one of them"
                )
            return self.result(whole[0])
        for row in some.to_pylist():
            if row["result"] is not None:
                return Identification.from_dict(json.loads(row["result"]))
            if row["reason"] is not None:
                raise ArgumentError(f"{record!r} was not identified: {row['reason']}")
        raise ArgumentError(f"of {record!r} the parameters alone were kept; ask for results")


@checked
def open_table(folder: str | PathLike[str]) -> BatchTable:
    """Open what `hmpim.batch` wrote.

    Parameters
    ----------
    folder : path-like
        The batch's folder.

    Raises
    ------
    FormatError
        If it holds no batch.

    Examples
    --------
    >>> open_table("nowhere")
    Traceback (most recent call last):
    hmpim.errors.FormatError: 'nowhere' holds no batch: there is no batch.json in it
    """
    place = Path(folder)
    told = read_stamp(place)
    return BatchTable(
        folder=place,
        request=Request.from_dict(told["request"]),
        metadata=tuple(told["metadata"]),
    )
