"""Series to a record: units checked, runs parted, what is amiss mended and said."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import ArgumentError, FormatError, RecordError, UnitError
from hmpim.formats.readers import Contents, listed
from hmpim.formats.roles import Roles
from hmpim.record import Channel, Finding, Record, Series, rate_of
from hmpim.record.mend import check_runs_on, mend, restarts, stands_still
from hmpim.units import check_unit

__all__ = ["assemble", "check_units", "cut_runs", "timed"]

_APART = 0.05
"""How far a stated rate may be from the stamps': stamps in whole ms at 100 Hz are up to 5 % off."""


def assemble(
    series: Sequence[Series],
    roles: Roles,
    contents: Contents,
    *,
    file: str,
    fs: float | None,
    units: Mapping[str, str],
    findings: Sequence[Finding] = (),
) -> Record:
    """Make a record of series, in the order of `roles.names`.

    Parameters
    ----------
    series : sequence of Series
        One for each name.
    roles : Roles
        Which is which.
    contents : Contents
        What the file states of the test.
    file : str
        Its name, for messages and as the record's source.
    fs : float or None
        Rate in Hz, where the person states it.
    units : mapping of str to str
        Units that the person states.
    findings : sequence of Finding
        What is known of the reading already.

    Raises
    ------
    FormatError
        If the series have no time and no rate is given.
    ArgumentError
        If the rate is given and the file's own time contradicts it.
    RecordError
        If the data cannot be used.
    UnitError
        If a unit is not known.
    """
    if fs is None and any(s.time is None for s in series):
        _refuse_untimed(series, contents, file)
    if series and series[0].values.size < 2:
        count = "one sample" if series[0].values.size else "no samples"
        raise FormatError(f"{file!r} holds {count}; at least 2 are needed")
    said = [f for s in series for f in _declared(s, units)]
    mended = mend([replace(s, unit=_unit(s, units, file)) for s in series], fs=fs)
    by_name = {c.name: c for c in mended.channels}

    def of(names: Sequence[str]) -> tuple[Channel, ...]:
        return tuple(by_name[name] for name in names)

    inputs, outputs = of(roles.inputs), of(roles.outputs)
    stated = contents.fs if fs is None else fs
    rate = float(stated) if stated is not None else rate_of(outputs[0].time)
    if fs is not None and any(s.time is not None for s in series):
        _check_rate(fs, mended.channels, file)
    return Record(
        inputs=inputs,
        outputs=outputs,
        fs=rate,
        band=contents.band,
        intersample=contents.intersample,
        source=file if contents.source is None else contents.source,
        findings=(*contents.findings, *findings, *said, *mended.findings),
        references=of(roles.references),
        auxiliary=of(roles.auxiliary),
        stopping=contents.stopping,
    )


def timed(series: Sequence[Series], *, fs: float | None) -> list[Series]:
    """Return series whose time, where it stands still and a rate is given, is left out.

    Examples
    --------
    >>> still = Series(name="u", values=np.arange(3.0), time=np.zeros(3))
    >>> timed([still], fs=10.0)[0].time is None, timed([still], fs=None)[0].time is None
    (True, False)
    """
    if fs is None:
        return list(series)
    return [
        replace(s, time=None) if s.time is not None and stands_still(s.time) else s for s in series
    ]


def cut_runs(series: Sequence[Series]) -> list[tuple[Series, ...]]:
    """Part series where their time starts again.

    Raises
    ------
    RecordError
        If the clocks of one file do not start again equally often, or one runs backward.

    Examples
    --------
    >>> time = np.concatenate((np.arange(20.0), np.arange(30.0)))
    >>> runs = cut_runs([Series(name="u", values=time, time=time)])
    >>> [run[0].values.size for run in runs]
    [20, 30]
    """
    edges: dict[int, list[int]] = {}
    for s in series:
        if s.time is not None and id(s.time) not in edges:
            starts = restarts(s.time)
            check_runs_on(s.time, starts, of=repr(s.name))
            edges[id(s.time)] = [0, *starts.tolist(), s.time.size]
    counts = {len(places) - 1 for places in edges.values()}
    if len(counts) > 1:
        few, many = min(counts), max(counts)
        raise RecordError(
            f"some clocks of the file start again {many - 1} times and others {few - 1} times; "
            "cut the file where they do"
        )
    count = counts.pop() if counts else 1
    if count == 1:
        return [tuple(series)]
    runs = []
    for k in range(count):
        times: dict[int, NDArray[np.float64]] = {}
        parts = []
        for s in series:
            if s.time is None:
                parts.append(s)
                continue
            part = slice(edges[id(s.time)][k], edges[id(s.time)][k + 1])
            time = times.setdefault(id(s.time), s.time[part])
            parts.append(replace(s, time=time, values=s.values[part]))
        runs.append(tuple(parts))
    return runs


def check_units(units: Mapping[str, str], contents: Contents, file: str) -> None:
    """Refuse units of channels that are not there, and units that are not known.

    Raises
    ------
    ArgumentError
        If a channel is not in the file.
    UnitError
        If a unit is not known.
    """
    names = [c.name for c in contents.channels]
    for name, unit in units.items():
        if name not in names:
            raise ArgumentError(
                f"a unit is given for {name!r}, which is not a column of {file!r}; "
                f"it has {listed(names)}"
            )
        check_unit(unit)


def _refuse_untimed(series: Sequence[Series], contents: Contents, file: str) -> NoReturn:
    untimed = next(s for s in series if s.time is None)
    if contents.time is not None and any(s.time is not None for s in series):
        raise FormatError(
            f"{file!r}: {untimed.name!r} has {untimed.values.size} samples and no time of its own: "
            f"{contents.time!r} has another length; give it its time, or cut both to one length"
        )
    names = listed([c.name for c in contents.channels])
    raise FormatError(
        f"{file!r} has no column time or t among {names}; give the rate with fs=... or "
        "--fs, or name the time column with time=... or --time"
    )


def _check_rate(fs: float, channels: Sequence[Channel], file: str) -> None:
    """Refuse a rate that the file's own time contradicts."""
    rates = [rate_of(c.time) for c in channels]
    if all(abs(rate / fs - 1.0) > _APART for rate in rates):
        raise ArgumentError(
            f"fs = {fs:g} Hz is given, but by its own time stamps {file!r} was sampled at "
            f"{rates[0]:.6g} Hz; leave fs out, or name another column as the time"
        )


def _unit(series: Series, units: Mapping[str, str], file: str) -> str:
    if series.name in units:
        return units[series.name]
    try:
        return check_unit(series.unit)
    except UnitError as error:
        raise UnitError(
            f"{file!r}, column '{series.name} [{series.unit}]': {error}; or say the unit yourself, "
            f"with units={{{series.name!r}: ...}} or --unit {series.name}=..."
        ) from None


def _declared(series: Series, units: Mapping[str, str]) -> list[Finding]:
    """Say so where a person's unit is another than the file's."""
    declared = units.get(series.name)
    if declared is None or not series.unit or declared == series.unit:
        return []
    return [
        Finding(
            code="unit_declared",
            message=(
                f"{series.name!r} is taken in {declared or 'no unit'}, as stated, where the file "
                f"says {series.unit!r}; its numbers are not converted"
            ),
            severity="info",
            parameters=(),
        )
    ]
