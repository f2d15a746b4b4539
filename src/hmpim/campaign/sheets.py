"""One analysis sheet for each axis: histories, correlations, spectra, Bode plot with its model."""

from pathlib import Path

from hmpim.campaign.pictures import pair_of
from hmpim.campaign.study import Row, Study
from hmpim.formats import load
from hmpim.identify import Identification, RecordSummary
from hmpim.record import Record
from hmpim.report import About, report

__all__ = ["write_sheets"]


def write_sheets(study: Study, folder: Path) -> tuple[tuple[str, str], ...]:
    """Write ``sheets/AXIS.html`` for each axis whose record is there; return names and addresses.

    Parameters
    ----------
    study : Study
        What was found. Of each axis the first case that moves it alone is taken, or its first.
    folder : Path
        Of the campaign, with ``records/CASE.h5``.
    """
    written = []
    for axis in dict.fromkeys(row.axis for row in study.rows):
        rows = [row for row in study.rows if row.axis == axis]
        row = next((row for row in rows if not row.together), rows[0])
        path = folder / "records" / f"{row.case_id}.h5"
        if not path.is_file():
            continue
        record = load(path)
        if not isinstance(record, Record):
            continue
        place = folder / "sheets" / f"{axis}.html"
        place.parent.mkdir(exist_ok=True)
        about = About(
            title=f"{study.plan.name}: {axis}",
            under_test=f"{study.plan.rig.kind}, axis {axis}",
            test=f"{row.test}, {row.rate:g} Hz, {row.load}",
        )
        report(_result(row, record), place, about=about)
        written.append((axis, f"sheets/{axis}.html"))
    return tuple(written)


def _result(row: Row, record: Record) -> Identification:
    """Put a row's figures and its record together again."""
    summary = RecordSummary(fs=record.fs, samples=record.inputs[0].values.size, sha256="")
    return Identification(record=summary, pairs=(pair_of(row),), data=record)
