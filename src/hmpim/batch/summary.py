"""A batch in figures: how each parameter is distributed, verdicts, and why records failed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmpim.batch.rows import PARAMETERS
from hmpim.batch.table import BatchTable
from hmpim.identify.result.groups import FIXED_UNITS

__all__ = ["Failure", "ParameterSummary", "Summary", "column", "summary_of", "unit_of"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterSummary:
    """How one parameter is distributed over the rows that have it.

    Parameters
    ----------
    name, unit : str
        Which; the unit is empty for none, or where rows differ.
    count, doubtful : int
        Rows that have it, and how many of them are not to be relied on.
    median, low, high : float
        Median, and the quantiles at 5 and 95 %.
    """

    name: str
    unit: str
    count: int
    doubtful: int
    median: float
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Failure:
    """Why some records have no figures.

    Parameters
    ----------
    reason : str
        The same of all of them.
    count : int
        How many they are.
    first : str
        The first of them, by name.
    """

    reason: str
    count: int
    first: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """A batch in figures.

    Parameters
    ----------
    records : int
        Records with rows, failed ones included.
    parameters : tuple of ParameterSummary
        Those that any row has.
    verdicts : mapping of str to int
        Rows by verdict.
    failures : tuple of Failure
        Why records failed, the most frequent reason first.
    """

    records: int
    parameters: tuple[ParameterSummary, ...]
    verdicts: Mapping[str, int]
    failures: tuple[Failure, ...]


def summary_of(table: BatchTable) -> Summary:
    """Sum a batch up; one column after the other is read.

    Parameters
    ----------
    table : BatchTable
        What was found.
    """
    import pyarrow.compute as pc

    words = table.to_arrow(["key", "record", "verdict", "reason"])
    verdicts = pc.value_counts(words.column("verdict").drop_null()).to_pylist()
    failed = words.filter(pc.is_valid(words.column("reason"))).group_by("reason")
    failures = failed.aggregate([("record", "count"), ("record", "min")]).to_pylist()
    return Summary(
        records=pc.count_distinct(words.column("key")).as_py(),
        parameters=tuple(_distributed(table)),
        verdicts={v["values"]: v["counts"] for v in verdicts},
        failures=tuple(
            Failure(reason=f["reason"], count=f["record_count"], first=f["record_min"])
            for f in sorted(failures, key=lambda f: (-f["record_count"], f["record_min"]))
        ),
    )


def column(table: BatchTable, name: str) -> NDArray[np.float64]:
    """Values of a column of figures, NaN where a row has none, shape (rows,)."""
    flat = table.to_arrow([name]).column(0)
    return np.asarray(flat.to_numpy(zero_copy_only=False), dtype=np.float64)


def unit_of(table: BatchTable, name: str) -> str:
    """Unit of a parameter; empty for none, or where the rows differ."""
    if name in FIXED_UNITS:
        return FIXED_UNITS[name]
    if name == "damping_ratio":
        return ""
    import pyarrow.compute as pc

    units = table.to_arrow(["output_unit", "input_unit"])
    pairs = [pc.unique(units.column(k).drop_null()).to_pylist() for k in range(2)]
    if len(pairs[0]) != 1 or (name == "scale_factor" and len(pairs[1]) != 1):
        return ""
    if name != "scale_factor":
        return str(pairs[0][0])
    return "" if pairs[0] == pairs[1] else f"{pairs[0][0] or '1'}/{pairs[1][0] or '1'}"


def _distributed(table: BatchTable) -> Sequence[ParameterSummary]:
    found = []
    for name in PARAMETERS:
        values = column(table, name)
        there = np.isfinite(values)
        if not there.any():
            continue
        doubtful = table.to_arrow([f"{name}_doubtful"]).column(0).to_pylist()
        low, median, high = np.quantile(values[there], (0.05, 0.5, 0.95))
        found.append(
            ParameterSummary(
                name=name,
                unit=unit_of(table, name),
                count=int(np.count_nonzero(there)),
                doubtful=sum(map(bool, doubtful)),
                median=float(median),
                low=float(low),
                high=float(high),
            )
        )
    return found
