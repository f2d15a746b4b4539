"""What is kept of each record: one row for each pair of channels, or one that says what failed."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from functools import cache
from typing import Any

from hmpim.batch.addresses import Address
from hmpim.batch.reading import Read
from hmpim.identify import Estimate, Identification, PairIdentification, Parameters

__all__ = ["PARAMETERS", "Row", "failed", "rows_of", "schema", "table_of"]

PARAMETERS = tuple(f.name for f in fields(Parameters))
"""Columns of values; each has four more: `NAME_std`, `_low`, `_high` and `_doubtful`."""

_WORDS = (
    "key", "record", "sha256", "input", "output", "input_unit", "output_unit", "structure",
    "intersample", "verdict", "reason",
)  # fmt: skip
_FIGURES = ("fs", "fit_percent", "seconds")

Row = Mapping[str, Any]


@cache
def schema(metadata: tuple[str, ...]) -> Any:
    """Return the Arrow schema of every part of a batch.

    Parameters
    ----------
    metadata : tuple of str
        Columns of metadata; in the table they are called `meta_NAME`.
    """
    import pyarrow as pa

    columns = [pa.field(name, pa.string()) for name in _WORDS]
    columns += [pa.field(name, pa.float64()) for name in _FIGURES]
    columns.append(pa.field("samples", pa.int64()))
    for name in PARAMETERS:
        columns += [pa.field(name + end, pa.float64()) for end in ("", "_std", "_low", "_high")]
        columns.append(pa.field(f"{name}_doubtful", pa.bool_()))
    columns.append(pa.field("warnings", pa.list_(pa.string())))
    columns.append(pa.field("covariance", pa.list_(pa.float64())))
    columns.append(pa.field("result", pa.string()))
    columns += [pa.field(f"meta_{name}", pa.string()) for name in metadata]
    return pa.schema(columns)


def rows_of(
    read: Read, result: Identification, *, seconds: float, whole: bool
) -> list[dict[str, Any]]:
    """One row for each pair of a result.

    Parameters
    ----------
    read : Read
        The record and where it is.
    result : Identification
        What was found.
    seconds : float
        Processor time that it took.
    whole : bool
        Whether all that was found is kept as JSON in `result`, beside the parameters.
    """
    record = read.record
    units = {c.name: c.unit for c in record.channels} if record is not None else {}
    text = json.dumps(result.to_dict(), allow_nan=False) if whole else None
    rows = []
    for k, pair in enumerate(result.pairs):
        row = _common(read.address, read.metadata)
        row |= {
            "sha256": result.record.sha256,
            "input": pair.input,
            "output": pair.output,
            "input_unit": units.get(pair.input, ""),
            "output_unit": units.get(pair.output, ""),
            "structure": pair.structure,
            "intersample": pair.intersample,
            "verdict": pair.verdict,
            "fs": result.record.fs,
            "samples": result.record.samples,
            "fit_percent": pair.fit_percent,
            "seconds": seconds / len(result.pairs),
            "warnings": [warning.code for warning in pair.warnings],
            "result": text if k == 0 else None,
        }
        row |= _figures(pair)
        rows.append(row)
    return rows


def failed(address: Address, reason: str, metadata: Mapping[str, str] | None = None) -> Row:
    """The row of a record that could not be identified."""
    return {**_common(address, metadata or {}), "reason": reason}


def table_of(rows: Iterable[Row], metadata: Sequence[str]) -> Any:
    """Rows as an Arrow table of the batch's schema; columns that a row lacks are null."""
    import pyarrow as pa

    return pa.Table.from_pylist(list(rows), schema=schema(tuple(metadata)))


def _common(address: Address, metadata: Mapping[str, str]) -> dict[str, Any]:
    told = {f"meta_{name}": value for name, value in metadata.items()}
    return {"key": address.digest, "record": address.name, **told}


def _figures(pair: PairIdentification) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name in PARAMETERS:
        estimate: Estimate | None = getattr(pair.parameters, name)
        if estimate is None:
            continue
        low, high = estimate.ci95 or (None, None)
        found[name], found[f"{name}_std"] = estimate.value, estimate.std
        found[f"{name}_low"], found[f"{name}_high"] = low, high
        found[f"{name}_doubtful"] = estimate.verdict != "ok"
    if pair.covariance is not None:
        found["covariance"] = pair.covariance.ravel().tolist()
    return found
