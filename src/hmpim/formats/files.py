"""One door for all record files: the suffix says which reader."""

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path

from hmpim.errors import FormatError
from hmpim.formats.csv import read_csv
from hmpim.record import Record

__all__ = ["read"]

_READERS = {".csv": read_csv, ".txt": read_csv, ".tsv": read_csv}


def read(
    path: str | PathLike[str],
    *,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    fs: float | None = None,
    time: str | None = None,
    units: Mapping[str, str] | None = None,
) -> Record:
    r"""Read a record from a file.

    Parameters
    ----------
    path : str or path-like
        The file; its suffix says what it is: .csv, .txt or .tsv, see `read_csv`.
    inputs, outputs : sequence of str, optional
        Names of the input and output columns.
    fs : float, optional
        Rate in Hz, needed if there is no time column.
    time : str, optional
        Name of the time column.
    units : mapping of str to str, optional
        Unit by channel name.

    Returns
    -------
    Record

    Raises
    ------
    FormatError
        If there is no such file, no reader for it, or the file is not what it claims to be.
    RecordError
        If the data cannot be used: time that runs backwards, and the like.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> path = pathlib.Path(folder.name, "test.csv")
    >>> _ = path.write_text("time,u [deg],y [deg]\n0,0,0\n0.1,1,0\n0.2,0,1\n")
    >>> record = read(path)
    >>> record.fs, record.inputs[0].name, record.inputs[0].unit
    (10.0, 'u', 'deg')
    >>> folder.cleanup()
    """
    suffix = Path(path).suffix.lower()
    reader = _READERS.get(suffix)
    if reader is None:
        raise FormatError(
            f"{str(path)!r} has the suffix {suffix!r}, which no reader knows; "
            f"give one of {', '.join(_READERS)}"
        )
    return reader(path, inputs=inputs, outputs=outputs, fs=fs, time=time, units=units)
