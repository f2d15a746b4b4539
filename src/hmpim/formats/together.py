"""One file or several of one test as one set of series: names told apart, clocks held together."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import ArgumentError, FormatError, RecordError
from hmpim.formats.readers import (
    ChannelInfo,
    Contents,
    Layout,
    Reader,
    check_used,
    listed,
    reader_for,
)
from hmpim.formats.roles import find_channel
from hmpim.record import Channel, ClockOffset, Finding, Series, clock_offset
from hmpim.record.mend import mend

__all__ = ["Logs", "open_logs"]

_DELAYS = ("delay", "delay_correlation", "delay_low_frequency", "bandwidth_phase90")
"""Parameters into which an error of the clocks goes in full."""

_ROUGH = 0.1
"""Share of a sample from which the error of an estimated offset makes the delay doubtful."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Log:
    """A file, its reader, and what stands in it."""

    path: Path
    reader: Reader
    layout: Layout
    contents: Contents

    def series(self, names: Sequence[str]) -> tuple[Series, ...]:
        return self.reader.read(self.path, names, self.layout)


@dataclass(frozen=True, slots=True, kw_only=True)
class Logs:
    """Files of one test.

    Parameters
    ----------
    contents : Contents
        Of all of them; a name that several files have is preceded by that of the file.
    logs : tuple
        The files, the first one's clock being that of the test.
    places : mapping of str to tuple of (int, str)
        For each channel, its file and its name there.
    common : str or None
        The channel by which the clocks are held together.
    """

    contents: Contents
    logs: tuple[_Log, ...]
    places: Mapping[str, tuple[int, str]]
    common: str | None

    def read(
        self, names: Sequence[str], offsets: Mapping[str, float | None]
    ) -> tuple[tuple[Series, ...], tuple[Finding, ...]]:
        """Read channels, all on the clock of the first file; say how that was done.

        Parameters
        ----------
        names : sequence of str
            Channels.
        offsets : mapping of str to float or None
            By how much a clock is late, by channel or file; None where it is not known.

        Raises
        ------
        ArgumentError
            If an offset is given for something that is not there.
        RecordError
            If the common channel does not tell the offset.
        """
        self._check(offsets, names)
        found: dict[str, Series] = {}
        findings: list[Finding] = []
        for k, log in enumerate(self.logs):
            mine = [n for n in names if self.places[n][0] == k]
            read = log.series([self.places[n][1] for n in mine]) if mine else ()
            if k and mine:
                read, said = self._on_first_clock(log, read, offsets)
                findings.append(said)
            for name, series in zip(mine, read, strict=True):
                named = replace(series, name=name)
                (found[name],) = _moved([named], offsets[name]) if name in offsets else (named,)
        findings += [_stated(f"The clock of {n!r}", offsets[n]) for n in names if n in offsets]
        return tuple(found[n] for n in names), tuple(findings)

    def _check(self, offsets: Mapping[str, float | None], names: Sequence[str]) -> None:
        files = [name for log in self.logs[1:] for name in (log.path.name, log.path.stem)]
        for name in offsets:
            if name not in names and name not in files:
                known = [*names, *(log.path.name for log in self.logs[1:])]
                raise ArgumentError(
                    f"an offset is given for {name!r}, which is neither a channel of the record "
                    f"nor another file; those are {listed(known)}"
                )

    def _on_first_clock(
        self, log: _Log, series: Sequence[Series], offsets: Mapping[str, float | None]
    ) -> tuple[tuple[Series, ...], Finding]:
        """Series of another file as the first file's clock would stamp them."""
        first, name = self.logs[0], log.path.name
        stated = next((key for key in (name, log.path.stem) if key in offsets), None)
        if stated is not None:
            late = offsets[stated]
            return _moved(series, late), _stated(f"The clock of {name!r}", late)
        dates = (first.contents.origin, log.contents.origin)
        since = 0.0
        if dates[0] is not None and dates[1] is not None:
            since = dates[0] - dates[1]
        moved = _moved(series, since)
        if self.common is None:
            how = "are held together by their dates" if all(d is not None for d in dates) else ""
            return moved, _unknown(f"The clocks of {first.path.name!r} and {name!r}", how)
        (one,), (other,) = first.series([self.common]), log.series([self.common])
        (other,) = _moved([other], since)
        found = clock_offset(_channel(one), _channel(other))
        corrected = _retimed(moved, found.corrected)
        return corrected, _estimated(name, first.path.name, self.common, found, series)


def open_logs(
    path: Path, *, layout: Layout, beside: Sequence[Path] = (), common: str | None = None
) -> Logs:
    """Open one file, or several of one test.

    Parameters
    ----------
    path : Path
        The file whose clock is that of the test.
    layout : Layout
        What a person says about it.
    beside : sequence of Path
        Other files of the test.
    common : str, optional
        Name of a channel that all of them hold.

    Raises
    ------
    FormatError
        If a file cannot be read, or does not hold the common channel.
    """
    check_used(layout, path.name, reader_for(path), beside=[reader_for(one) for one in beside])
    logs = [_opened(path, layout)]
    logs += [_opened(other, Layout(stamps=layout.stamps)) for other in beside]
    if common is not None:
        if not beside:
            raise ArgumentError(
                f"common channel {common!r} is given with one file only; give the other with "
                "beside=... or --beside"
            )
        for log in logs:
            if find_channel(common, log.contents) is None:
                raise FormatError(
                    f"{log.path.name!r} has no column {common!r}, which is to align the clocks "
                    f"together; its columns are {listed([c.name for c in log.contents.channels])}"
                )
    places: dict[str, tuple[int, str]] = {}
    infos: list[ChannelInfo] = []
    names = [c.name for log in logs for c in log.contents.channels]
    for k, log in enumerate(logs):
        for info in log.contents.channels:
            name = info.name if names.count(info.name) == 1 else f"{log.path.stem}:{info.name}"
            if name in places:
                raise FormatError(f"two of the files are called {log.path.stem!r}; rename one")
            places[name] = (k, info.name)
            infos.append(replace(info, name=name))
    return Logs(
        contents=logs[0].contents if len(logs) == 1 else _merged(logs[0].contents, infos, places),
        logs=tuple(logs),
        places=places,
        common=common,
    )


def _opened(path: Path, layout: Layout) -> _Log:
    reader = reader_for(path)
    contents = reader.channels(path, layout)
    return _Log(path=path, reader=reader, layout=layout, contents=contents)


def _merged(
    first: Contents, infos: Sequence[ChannelInfo], places: Mapping[str, tuple[int, str]]
) -> Contents:
    """The first file's contents with the channels of all."""
    called = {name: new for new, (k, name) in places.items() if k == 0}

    def renamed(names: Sequence[str]) -> tuple[str, ...]:
        return tuple(called[name] for name in names)

    return replace(
        first,
        channels=tuple(infos),
        inputs=renamed(first.inputs),
        outputs=renamed(first.outputs),
        references=renamed(first.references),
        auxiliary=renamed(first.auxiliary),
    )


def _retimed(
    series: Sequence[Series], change: Callable[[NDArray[np.float64]], NDArray[np.float64]]
) -> tuple[Series, ...]:
    """Series with other stamps; those that shared an array of stamps still do."""
    made: dict[int, NDArray[np.float64]] = {}
    out = []
    for s in series:
        if s.time is None:
            out.append(s)
            continue
        if id(s.time) not in made:
            made[id(s.time)] = change(s.time)
        out.append(replace(s, time=made[id(s.time)]))
    return tuple(out)


def _moved(series: Sequence[Series], late: float | None) -> tuple[Series, ...]:
    return _retimed(series, lambda time: time - late) if late else tuple(series)


def _channel(series: Series) -> Channel:
    if series.time is None:
        raise RecordError(f"{series.name!r} has no time, so its clock cannot be aligned")
    return mend([series]).channels[0]


def _stated(what: str, late: float | None) -> Finding:
    if late is None:
        return _unknown(what, "")
    return Finding(
        code="clock_offset",
        message=f"{what} is stated to be {late:.9g} s late and was moved by that",
        severity="info",
        parameters=(),
    )


def _unknown(what: str, how: str) -> Finding:
    start = f"{what} {how}, and" if how else f"{what} may be off by"
    rest = "what these are off by" if how else "what nobody knows, and that"
    return Finding(
        code="clock_offset",
        message=(
            f"{start} {rest} cannot be distinguished from delay: state it with --offset, or record "
            "one signal on both clocks and name it with --common"
        ),
        severity="doubt",
        parameters=_DELAYS,
    )


def _estimated(
    name: str, first: str, common: str, found: ClockOffset, series: Sequence[Series]
) -> Finding:
    time = next((s.time for s in series if s.time is not None), None)
    span = 0.0 if time is None else float(np.nanmax(time) - np.nanmin(time))
    rough = time is None or found.std > _ROUGH * span / max(time.size - 1, 1)
    return Finding(
        code="clock_offset",
        message=(
            f"The clock of {name!r} is offset by {found.offset:.6f} ± {found.std:.2g} s from that "
            f"of {first!r} and drifts by {1e6 * found.drift:.3g} ± {1e6 * found.drift_std:.2g} "
            f"parts in a million, by {common!r} in both (correlation {found.correlation:.4f}); "
            "the ± of the offset adds to that of the delay"
        ),
        severity="doubt" if rough else "info",
        parameters=_DELAYS,
    )
