"""A record as CSV, which comes back bit for bit."""

import json
from os import PathLike

import numpy as np

from hmpim.errors import RecordError
from hmpim.formats.atomic import write_text
from hmpim.formats.readers.text import KINDS, MARK, heading_of
from hmpim.record import Record

__all__ = ["write_csv"]


def write_csv(record: Record, path: str | PathLike[str]) -> None:
    """Write a record as CSV, so that `hmpim.read` gives it back bit for bit.

    Names, units, band and rate stand in one comment line of JSON; the headings carry units too,
    for people and for other programs.

    Parameters
    ----------
    record : Record
        All its channels must share one clock.
    path : str or path-like
        File to write; replaced as a whole, or not at all.

    Raises
    ------
    RecordError
        If the channels have clocks of their own, which a table cannot hold.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> path = pathlib.Path(folder.name, "test.csv")
    >>> record = Record.from_arrays({"u": [0, 1 / 3]}, {"y": [0, 2]}, fs=10.0, units={"u": "deg"})
    >>> write_csv(record, path)
    >>> from hmpim.formats import read
    >>> read(path).sha256 == record.sha256
    True
    >>> path.read_text().splitlines()[1:]
    ['time [s],u [deg],y', '0.0,0.0,0.0', '0.1,0.3333333333333333,2.0']
    >>> folder.cleanup()
    """
    channels = record.channels
    time = channels[0].time
    for c in channels[1:]:
        if not np.array_equal(c.time, time):
            raise RecordError(
                f"channel {c.name!r} has a clock of its own, and a table has one; "
                "bring the record on one clock first with hmpim.record.uniform"
            )
    notes = {
        **{
            kind: [{"name": c.name, "unit": c.unit} for c in record.of(role)]
            for kind, role in KINDS.items()
        },
        "fs": record.fs,
        "band": None if record.band is None else [float(f) for f in record.band],
        "intersample": record.intersample,
        "source": record.source,
        "findings": [finding.to_dict() for finding in record.findings],
        "stopping": None if record.stopping is None else record.stopping.to_dict(),
    }
    lines = [
        f"# {MARK}{json.dumps(notes)}",
        ",".join(["time [s]", *(heading_of(c.name, c.unit) for c in channels)]),
    ]
    # float.__repr__ is the shortest text that reads back as the same number.
    columns = [map(repr, array.tolist()) for array in (time, *(c.values for c in channels))]
    lines.extend(map(",".join, zip(*columns, strict=True)))
    write_text(path, "\n".join(lines) + "\n")
