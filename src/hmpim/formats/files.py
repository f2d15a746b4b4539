"""One door for all record files: the content says which reader."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path

import numpy as np

from hmpim.errors import ArgumentError, FormatError, UnitError
from hmpim.formats.readers import Contents, Layout, listed, reader_for
from hmpim.formats.roles import Roles, choose_roles
from hmpim.record import Channel, Record, Series, fit_clock
from hmpim.record.mend import mend
from hmpim.units import check_unit

__all__ = ["read"]


def read(
    path: str | PathLike[str],
    *,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    fs: float | None = None,
    time: str | None = None,
    units: Mapping[str, str] | None = None,
    references: Sequence[str] | None = None,
    auxiliary: Sequence[str] | None = None,
) -> Record:
    r"""Read a record from a file of any format that a reader knows.

    The content of the file says what it is, whatever its name. Which channels go in and which
    come out is never guessed from their order.

    Parameters
    ----------
    path : str or path-like
        The file; docs/formats.md lists the formats.
    inputs, outputs : sequence of str, optional
        Names of the input and output channels. Without: those that the file states, else the one
        named u, input, command, stimulus or position, and the one named y, output, measured or
        response, in any case.
    fs : float, optional
        Rate in Hz, needed if there is no time in the file.
    time : str, optional
        Name of the time channel. Without: time or t, in any case. In seconds unless its heading
        says otherwise, as ``time [ms]``.
    units : mapping of str to str, optional
        Unit by channel name; goes before that of the file.
    references, auxiliary : sequence of str, optional
        Names of the channels that say what a loop was asked, and of those that are kept beside
        and never fitted. Without: those that the file states.

    Returns
    -------
    Record

    Raises
    ------
    FormatError
        If there is no such file, no reader for it, or the file is not what it claims to be.
    RecordError
        If the data cannot be used: time that starts again, and the like.
    UnitError
        If a unit is not known.
    MissingExtraError
        If the format needs a package that is not installed; the message names it.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> path = pathlib.Path(folder.name, "test.csv")
    >>> _ = path.write_text("# bench 2\nmeasured;time [ms];command [V]\n0;0;1\n1;5;1\n2;10;1")
    >>> record = read(path)
    >>> record.fs, record.inputs[0].name, record.inputs[0].unit, record.outputs[0].name
    (200.0, 'command', 'V', 'measured')
    >>> folder.cleanup()
    """
    file = Path(path)
    if fs is not None and not (np.isfinite(fs) and fs > 0):
        raise ArgumentError(f"fs = {fs} Hz is not a sampling rate; it must be positive and finite")
    layout = Layout(time=time, fs=fs)
    reader = reader_for(file)
    contents = reader.channels(file, layout)
    _check_units(units or {}, contents, file.name)
    roles = choose_roles(
        contents,
        file.name,
        inputs=inputs,
        outputs=outputs,
        references=references,
        auxiliary=auxiliary,
    )
    series = reader.read(file, roles.names, layout)
    return assemble(series, roles, contents, file=file.name, fs=fs, units=units or {})


def assemble(
    series: Sequence[Series],
    roles: Roles,
    contents: Contents,
    *,
    file: str,
    fs: float | None,
    units: Mapping[str, str],
) -> Record:
    """Make a record of the series of a file, in the order of `roles.names`.

    Raises
    ------
    FormatError
        If the series have no time and no rate is given.
    RecordError
        If the data cannot be used.
    """
    if fs is None and any(s.time is None for s in series):
        names = listed([c.name for c in contents.channels])
        raise FormatError(
            f"{file!r} has no column time or t among {names}; give the rate with fs=... or "
            "--fs, or name the time column with time=... or --time"
        )
    if series and series[0].values.size < 2:
        count = "one sample" if series[0].values.size else "no samples"
        raise FormatError(f"{file!r} holds {count}; at least 2 are needed")
    mended = mend([replace(s, unit=_unit(s, units, file)) for s in series], fs=fs)
    by_name = {c.name: c for c in mended.channels}

    def of(names: Sequence[str]) -> tuple[Channel, ...]:
        return tuple(by_name[name] for name in names)

    inputs, outputs = of(roles.inputs), of(roles.outputs)
    stated = contents.fs if fs is None else fs
    rate = float(stated) if stated is not None else fit_clock(inputs[0].time).fs
    return Record(
        inputs=inputs,
        outputs=outputs,
        fs=rate,
        band=contents.band,
        intersample=contents.intersample,
        source=file if contents.source is None else contents.source,
        findings=(*contents.findings, *mended.findings),
        references=of(roles.references),
        auxiliary=of(roles.auxiliary),
    )


def _check_units(units: Mapping[str, str], contents: Contents, file: str) -> None:
    names = [c.name for c in contents.channels]
    for name, unit in units.items():
        if name not in names:
            raise ArgumentError(
                f"a unit is given for {name!r}, which is not a column of {file!r}; "
                f"it has {listed(names)}"
            )
        check_unit(unit)


def _unit(series: Series, units: Mapping[str, str], file: str) -> str:
    if series.name in units:
        return units[series.name]
    try:
        return check_unit(series.unit)
    except UnitError as error:
        raise UnitError(
            f"{file!r}, column '{series.name} [{series.unit}]': {error}; or say the unit yourself: "
            f"units={{{series.name!r}: ...}}"
        ) from None
