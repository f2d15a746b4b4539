"""A recording: a record, and what it was made with; to a file and back."""

import time as clock
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path

import numpy as np

from hmpim.equality import ByValue
from hmpim.errors import ArgumentError, HmpimError
from hmpim.formats.atomic import replacing
from hmpim.formats.recording.heading import Heading, State
from hmpim.formats.recording.layout import Space, block_length, lay_out, log_line, new_file
from hmpim.formats.recording.opened import (
    Opened,
    Track,
    checksums,
    digest_of,
    open_recording,
    usable,
)
from hmpim.formats.stimulus_spec import stimuli_from_toml, stimulus_to_toml
from hmpim.record import ROLES, Channel, Intersample, Record, Series
from hmpim.record.mend import mend
from hmpim.rigs.protocol import LimitsOfAxes
from hmpim.stimulus import Limits, Stimulus

__all__ = ["Recording", "heading_of", "read_recording", "save_recording", "write_again"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recording(ByValue):
    """A record and what it was made with.

    Parameters
    ----------
    record : Record
        What was recorded; its findings say what is missing.
    stimuli : tuple of Stimulus
        What was played; empty where that is not known.
    rig : str
        On what; empty where that is not known.
    limits : mapping of str to Limits
        Limits of the rig, by axis; the axis is '' where it has one only.
    log : tuple of str
        What happened, line by line.
    complete : bool
        False if the writer was killed, or the run failed.
    created, version : str
        When the file was begun (ISO 8601), and by which version of hmpim.
    """

    record: Record
    stimuli: tuple[Stimulus, ...] = ()
    rig: str = ""
    limits: Mapping[str, Limits] = field(default_factory=dict)
    log: tuple[str, ...] = ()
    complete: bool = True
    created: str = ""
    version: str = ""


def save_recording(
    record: Record,
    path: str | PathLike[str],
    *,
    stimuli: Sequence[Stimulus] = (),
    rig: str = "",
    limits: LimitsOfAxes = None,
    log: Sequence[str] = (),
) -> None:
    """Write a record, and what it was made with, as a record file (HDF5).

    Parameters
    ----------
    record : Record
        What was recorded.
    path : path-like
        File to write; replaced as a whole, or not at all.
    stimuli : sequence of Stimulus
        What was played. One of a waveform that this package does not make is left out; its
        commands are in the record.
    rig : str
        On what.
    limits : Limits, or mapping of axis to Limits, or None
        Limits of the rig.
    log : sequence of str
        What happened, line by line.

    Raises
    ------
    ArgumentError
        If the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> record = Record.from_arrays({"u": [0, 1, 0]}, {"y": [0, 0, 1]}, fs=10.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_recording(record, Path(folder) / "run.h5", rig="bench 2")
    ...     found = read_recording(Path(folder) / "run.h5")
    >>> found.record == record, found.rig
    (True, 'bench 2')
    """
    heading = replace(
        heading_of(
            fs=record.fs,
            band=record.band,
            intersample=record.intersample,
            source=record.source,
            stimuli=stimuli,
            rig=rig,
            limits=limits,
        ),
        findings=record.findings,
        stopping=record.stopping,
    )
    tracks = [
        Track(role=role, series=Series(name=c.name, values=c.values, time=c.time, unit=c.unit))
        for role in ROLES
        for c in record.of(role)
    ]
    _write(Path(path), heading, tracks, log=log)


def read_recording(path: str | PathLike[str]) -> Recording:
    """Read a record file with all that it holds.

    Parameters
    ----------
    path : path-like
        As `save_recording`, `hmpim.save` or a run wrote it. One whose writer was killed is read
        as far as it goes, and the record's findings say so.

    Raises
    ------
    FormatError
        If it is no record file, or holds less than two samples of a channel.
    RecordError
        If its samples make no record.

    Examples
    --------
    >>> read_recording("nowhere.h5")
    Traceback (most recent call last):
    hmpim.errors.FormatError: there is no file 'nowhere.h5'; check the path
    """
    opened = open_recording(Path(path))
    heading = opened.heading
    stimuli: tuple[Stimulus, ...] = ()
    if heading.specification:
        try:
            stimuli = tuple(stimuli_from_toml(heading.specification, name="its stimulus"))
        except HmpimError:  # of a later version, perhaps; the samples can be used without it
            stimuli = ()
    return Recording(
        record=_record(opened, Path(path).name),
        stimuli=stimuli,
        rig=heading.rig,
        limits=heading.limits,
        log=opened.log,
        complete=opened.state.complete,
        created=heading.created,
        version=heading.version,
    )


def write_again(path: Path, *, ended: str) -> None:
    """Write a file that has grown anew: cut to its length, with a digest.

    Raises
    ------
    ArgumentError
        If it cannot be written; the file stays as it is.
    """
    opened = open_recording(path)
    _write(path, opened.heading, opened.tracks, log=opened.log, ended=ended)


def heading_of(
    *,
    fs: float,
    band: tuple[float, float] | None,
    intersample: Intersample | None,
    source: str,
    stimuli: Sequence[Stimulus],
    rig: str,
    limits: LimitsOfAxes,
) -> Heading:
    """Heading of a file begun now."""
    try:
        specification = stimulus_to_toml(tuple(stimuli)) if stimuli else ""
    except ArgumentError:  # a waveform of one's own; its commands are in the record
        specification = ""
    return Heading(
        fs=fs,
        band=band,
        intersample=intersample,
        source=source,
        specification=specification,
        rig=rig,
        limits={"": limits} if isinstance(limits, Limits) else dict(limits or {}),
        created=clock.strftime("%Y-%m-%dT%H:%M:%S%z"),
    )


def _record(opened: Opened, file: str) -> Record:
    """The record of what is there."""
    heading = opened.heading
    tracks, findings = usable(opened, file)
    mended = mend([track.series for track in tracks])
    by_role: dict[str, list[Channel]] = {role: [] for role in ROLES}
    for track, channel in zip(tracks, mended.channels, strict=True):
        by_role[track.role].append(channel)
    return Record(
        inputs=tuple(by_role["input"]),
        outputs=tuple(by_role["output"]),
        fs=heading.fs,
        band=heading.band,
        intersample=heading.intersample,
        source=heading.source,
        findings=(*findings, *mended.findings),
        references=tuple(by_role["reference"]),
        auxiliary=tuple(by_role["auxiliary"]),
        stopping=heading.stopping,
    )


def _write(
    path: Path,
    heading: Heading,
    tracks: Sequence[Track],
    *,
    log: Sequence[str] = (),
    ended: str = "",
) -> None:
    """Write a file in its final length."""
    size = block_length(heading.fs)
    spaces = _spaces(tracks, size)
    lines = [log_line(line) for line in log]
    state = State(complete=not ended, ended=ended, sha256=digest_of(tracks))
    with replacing(path) as place, new_file(place) as file:
        rooms, kept = lay_out(
            file, heading, spaces, state=state, log_lines=len(lines), reserved=False
        )
        if lines:
            kept[...] = lines
        for track, space, room in zip(tracks, spaces, rooms, strict=True):
            series = track.series
            assert series.time is not None
            room.values.parent.attrs["samples"] = series.values.size
            if space.shares_time_with is None:
                room.time[...] = series.time
            room.values[...] = series.values
            room.blocks[...] = [
                (
                    first,
                    series.values[first : first + size].size,
                    *checksums(
                        series.time[first : first + size], series.values[first : first + size]
                    ),
                )
                for first in range(0, series.values.size, size)
            ] or np.zeros((0, 4))


def _spaces(tracks: Sequence[Track], size: int) -> list[Space]:
    spaces: list[Space] = []
    for number, track in enumerate(tracks):
        series = track.series
        shared = next(
            (
                k
                for k in range(number)
                if spaces[k].shares_time_with is None and _alike(tracks[k].series.time, series.time)
            ),
            None,
        )
        spaces.append(
            Space(
                name=series.name,
                unit=series.unit,
                role=track.role,
                samples=series.values.size,
                rows=-(-series.values.size // size),
                shares_time_with=shared,
            )
        )
    return spaces


def _alike(one: object, other: object) -> bool:
    return one is other or bool(np.array_equal(np.asarray(one), np.asarray(other)))
