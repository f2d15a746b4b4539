"""What is kept of each record: one row for each pair of channels, or one that says what failed."""

import hashlib
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from functools import cache
from typing import Any

import numpy as np

from hmpim.batch.addresses import Address
from hmpim.batch.reading import Read
from hmpim.identify import Estimate, Identification, Parameters
from hmpim.identify.fleets.fleet import FleetFit
from hmpim.identify.fleets.learnt import Fleet
from hmpim.record import Record

__all__ = [
    "PARAMETERS",
    "Row",
    "failed",
    "fleet_table",
    "group_rows",
    "left_out",
    "rows_of",
    "schema",
    "table_of",
]

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
    common = _common(read.address, read.metadata)
    return _of_pairs(common, result, units, seconds=seconds, whole=whole)


def group_rows(
    name: str,
    result: Identification,
    *,
    units: Mapping[str, str],
    metadata: Mapping[str, str],
    seconds: float,
    whole: bool,
) -> list[dict[str, Any]]:
    """One row for each pair of what a group of records says together.

    Parameters
    ----------
    name : str
        What the group is called.
    result : Identification
        What was found of all its records.
    units : mapping of str to str
        Unit by channel.
    metadata : mapping of str to str
        What is said of it.
    seconds : float
        Processor time that it took.
    whole : bool
        Whether all that was found is kept as JSON.
    """
    common = {"key": _key(name), "record": name, **_told(metadata)}
    return _of_pairs(common, result, units, seconds=seconds, whole=whole)


def left_out(name: str, reason: str) -> Row:
    """The row of a record that is in no group."""
    return {"key": _key(name), "record": name, "reason": reason}


def _of_pairs(
    common: Row,
    result: Identification,
    units: Mapping[str, str],
    *,
    seconds: float,
    whole: bool,
) -> list[dict[str, Any]]:
    text = _json(result) if whole else None
    rows = []
    for k, pair in enumerate(result.pairs):
        row = {
            **common,
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
        row |= _figures(pair.parameters)
        if not whole:  # what the paper's steps give is no parameter of the fit
            row = {k: v for k, v in row.items() if not k.startswith("delay_correlation")}
        if pair.covariance is not None:
            row["covariance"] = pair.covariance.ravel().tolist()
        rows.append(row)
    return rows


def _json(result: Identification) -> str:
    """All that was found, by a writer that is ten times as fast as Python's own."""
    import orjson

    found = result.to_dict()
    if not _is_finite(found):  # it would be written as null
        raise ValueError("a figure is NaN or infinite")
    return orjson.dumps(found, option=orjson.OPT_SERIALIZE_NUMPY).decode()


def _is_finite(value: Any) -> bool:
    """Whether no number among plain JSON values is NaN or infinite."""
    left = [value]
    for one in left:  # which grows as it is gone through
        if isinstance(one, dict):
            left += one.values()
        elif isinstance(one, (list, tuple)):
            if not _are_finite(one):
                left += one
        elif isinstance(one, float) and not math.isfinite(one):
            return False
    return True


def _are_finite(values: Sequence[Any]) -> bool:
    """Whether values are numbers with a finite sum, as those of which one is not never have."""
    try:
        return math.isfinite(sum(values))
    except TypeError:
        return False


def failed(address: Address, reason: str, metadata: Mapping[str, str] | None = None) -> Row:
    """The row of a record that could not be identified."""
    return {**_common(address, metadata or {}), "reason": reason}


def table_of(rows: Iterable[Row], metadata: Sequence[str]) -> Any:
    """Rows as an Arrow table of the batch's schema; columns that a row lacks are null."""
    import pyarrow as pa

    return pa.Table.from_pylist(list(rows), schema=schema(tuple(metadata)))


def _common(address: Address, metadata: Mapping[str, str]) -> dict[str, Any]:
    return {"key": address.digest, "record": address.name, **_told(metadata)}


def _told(metadata: Mapping[str, str]) -> Row:
    return {f"meta_{name}": value for name, value in metadata.items()}


def _key(name: str) -> str:
    return hashlib.sha256(name.encode()).hexdigest()[:32]


def fleet_table(
    addresses: Sequence[Address],
    told: Sequence[Mapping[str, str]],
    record: Record,
    fleet: Fleet,
    fit: FleetFit,
    *,
    digests: Sequence[str],
    metadata: Sequence[str],
    seconds: float,
) -> Any:
    """An Arrow table of the records that a fit of all together tells of; the others are left out.

    Parameters
    ----------
    addresses : sequence of Address
        Where the records are, in the order of the fit.
    told : sequence of mapping of str to str
        Metadata of each.
    record : Record
        One of them: the others differ in the output's values alone.
    fleet : Fleet
        What they share.
    fit : FleetFit
        Their parameters.
    digests : sequence of str
        `Record.sha256` of each.
    metadata : sequence of str
        Columns of metadata.
    seconds : float
        Processor time for each.
    """
    import pyarrow as pa

    keep = np.flatnonzero(fit.sound)
    some, count = keep.tolist(), int(keep.size)
    source, output = record.inputs[0], record.outputs[0]
    codes = [finding.code for finding in record.findings]
    columns: dict[str, Any] = {
        "key": [addresses[i].digest for i in some],
        "record": [addresses[i].name for i in some],
        "sha256": [digests[i] for i in some],
        "intersample": [fit.intersample[i] for i in some],
        "fit_percent": fit.fit_percent[keep],
        "warnings": [[*codes, *fit.codes[i]] for i in some],
        **{f"meta_{name}": [told[i].get(name) for i in some] for name in metadata},
    }
    common = {
        "input": source.name, "output": output.name, "input_unit": source.unit,
        "output_unit": output.unit, "structure": fleet.structure.name, "verdict": "ok",
        "fs": fleet.fs, "samples": record.samples, "seconds": seconds,
    }  # fmt: skip
    columns |= {name: [value] * count for name, value in common.items()}
    for name, column in fit.columns.items():
        absent = np.isnan(column.value[keep])
        for end in ("value", "std", "low", "high"):
            values = getattr(column, end)[keep]
            label = name if end == "value" else f"{name}_{end}"
            columns[label] = pa.array(values, mask=~np.isfinite(values))
        columns[f"{name}_doubtful"] = pa.array(np.zeros(count, dtype=bool), mask=absent)
    whole = schema(tuple(metadata))
    return pa.table(
        [
            pa.array(columns[field.name], type=field.type)
            if field.name in columns
            else pa.nulls(count, field.type)
            for field in whole
        ],
        schema=whole,
    )


def _figures(parameters: Parameters) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name in PARAMETERS:
        estimate: Estimate | None = getattr(parameters, name)
        if estimate is None:
            continue
        low, high = estimate.ci95 or (None, None)
        found[name], found[f"{name}_std"] = estimate.value, estimate.std
        found[f"{name}_low"], found[f"{name}_high"] = low, high
        found[f"{name}_doubtful"] = estimate.verdict != "ok"
    return found
