"""CSV: the response by frequency, measured and modelled, each with its error."""

import csv
import io
from pathlib import Path

import numpy as np

from hmpim.formats.atomic import write_text
from hmpim.formats.models.response import response_of
from hmpim.formats.models.source import Source

__all__ = ["write_csv"]


def write_csv(source: Source, path: Path) -> tuple[Path, ...]:
    """Write the table; lines of comment begin with #."""
    seen = response_of(source)
    text = io.StringIO()
    for line in source.lines():
        text.write(f"# {line}\n")
    text.write("# gain in dB of output unit per input unit; std is sqrt(E|error|^2), same unit\n")
    table = csv.writer(text, lineterminator="\n")
    columns: dict[str, np.ndarray] = {"frequency_hz": seen.frequency}
    for kind, response, std in (
        ("measured", seen.measured, seen.measured_std),
        ("model", seen.model, seen.model_std),
    ):
        columns[f"{kind}_real"] = response.real
        columns[f"{kind}_imag"] = response.imag
        columns[f"{kind}_std"] = std
        columns[f"{kind}_gain_db"] = 20 * np.log10(np.maximum(np.abs(response), 1e-300))
        columns[f"{kind}_phase_deg"] = np.degrees(np.angle(response))
    table.writerow(columns)
    for row in np.stack(list(columns.values()), axis=1).tolist():
        table.writerow("" if value != value else repr(value) for value in row)
    write_text(path, text.getvalue())
    return (path,)
