"""A record file as it is found: whole, still growing, or damaged."""

import hashlib
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import FormatError
from hmpim.formats.hdf5 import faults_named
from hmpim.formats.recording.heading import Heading, State, read_heading, read_state
from hmpim.formats.recording.layout import GROUPS
from hmpim.formats.recording.text import text_of
from hmpim.record import ROLES, Finding, Role, Series

__all__ = ["Opened", "Track", "checksums", "digest_of", "open_recording", "usable"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Track:
    """Samples of a channel, as they were written.

    Parameters
    ----------
    role : {'input', 'output', 'reference', 'auxiliary'}
        What the channel is in the test.
    series : Series
        Its samples; those of damaged blocks are left out.
    """

    role: Role
    series: Series


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Opened:
    """All that a record file holds.

    Parameters
    ----------
    heading : Heading
        What it says.
    tracks : tuple of Track
        Channels, in the order of the record: inputs, outputs, references, auxiliary.
    state : State
        Whether it is complete.
    log : tuple of str
        Lines of the log.
    findings : tuple of Finding
        What is missing: codes 'incomplete', 'damaged_blocks', 'digest'.
    """

    heading: Heading
    tracks: tuple[Track, ...]
    state: State
    log: tuple[str, ...]
    findings: tuple[Finding, ...]


def open_recording(path: Path) -> Opened:
    """Read a record file, and check each block of it.

    Raises
    ------
    FormatError
        If it is no record file, or damaged beyond use.
    """
    with _sane(path):
        import h5py

        with h5py.File(path, "r") as file:
            heading, unchanged = read_heading(file)
            state = read_state(file)
            _check_size(file["log/lines"], path.stat().st_size)
            log = tuple(line for line in file["log/lines"].asstr(errors="replace")[()] if line)
            findings: list[Finding] = []
            known: dict[int, FloatArray] = {}
            groups = _groups(file)
            for dataset in (
                group[name] for group in groups for name in ("time", "values", "blocks")
            ):
                _check_size(dataset, path.stat().st_size)
            tracks = [_track(group, known, findings) for group in groups]
        named = bool(findings) or state.sha256 in ("", digest_of(tracks))
        if not unchanged:
            findings.append(_changed(path.name, "its heading"))
        if not named:
            findings.append(_changed(path.name, "a name, a unit or samples"))
        if not state.complete:
            findings.insert(0, _incomplete(path.name, tracks, state.ended))
    return Opened(
        heading=heading,
        tracks=tuple(tracks),
        state=state,
        log=log,
        findings=tuple(findings),
    )


def usable(opened: Opened, file: str) -> tuple[list[Track], list[Finding]]:
    """Return the channels that a record can be made of, and what is to be said of the file.

    A slow auxiliary channel that has less than two samples is left out.

    Raises
    ------
    FormatError
        If another channel has less than two samples.
    """
    tracks: list[Track] = []
    findings = [*opened.heading.findings, *opened.findings]
    for track in opened.tracks:
        name, count = track.series.name, track.series.values.size
        if count >= 2:
            tracks.append(track)
        elif track.role == "auxiliary":
            findings.append(_info("channel_missing", f"{name!r} has {count} samples: left out"))
        else:
            raise FormatError(f"{file!r} holds {count} samples of {name!r}; at least 2 are needed")
    return tracks, findings


def checksums(
    time: FloatArray, values: FloatArray, before: tuple[int, int] = (0, 0)
) -> tuple[int, int]:
    """CRC-32 of times and values, going on from those of what came before.

    Examples
    --------
    >>> one, two = np.array([1.0]), np.array([2.0, 3.0])
    >>> both = np.concatenate((one, two))
    >>> checksums(two, two, before=checksums(one, one)) == checksums(both, both)
    True
    """
    return zlib.crc32(_bytes(time), before[0]), zlib.crc32(_bytes(values), before[1])


def digest_of(tracks: Sequence[Track]) -> str:
    """Digest over all channels, as `Record.sha256` of the record that they make.

    Examples
    --------
    >>> digest_of([])[:8]
    'e3b0c442'
    """
    digest = hashlib.sha256()
    for track in sorted(tracks, key=lambda t: ROLES.index(t.role)):
        series = track.series
        digest.update(f"{track.role}\0{series.name}\0{series.unit}\0".encode())
        assert series.time is not None
        digest.update(_bytes(series.time))
        digest.update(_bytes(series.values))
    return digest.hexdigest()


def _bytes(values: FloatArray) -> bytes:
    return np.ascontiguousarray(values, dtype="<f8").tobytes()


@contextmanager
def _sane(path: Path) -> Iterator[None]:
    """Whatever a damaged file makes HDF5 say becomes one clear error."""
    with faults_named(path):
        try:
            yield
        except FormatError as error:
            raise FormatError(
                f"{path.name!r} is not a record file that can be read: {error}"
            ) from None


_MOST_PACKED = 2**32
"""Bytes to which a record that someone packed afterwards may unpack."""


def _check_size(dataset: Any, size: int) -> None:
    """Refuse a table that is stated larger than its file: all of it would be held in memory."""
    if int(dataset.nbytes) > max(size, _MOST_PACKED):
        raise FormatError(
            f"{dataset.name} states {dataset.size} numbers, more than {size} bytes can hold"
        )


def _groups(file: Any) -> list[Any]:
    """Groups of the channels, in the order of the record."""
    found = [
        (place, int(group.attrs["number"]), group)
        for place, role in enumerate(ROLES)
        for group in file.get(GROUPS[role], {}).values()
    ]
    if not found:
        raise FormatError("it has no channels")
    return [group for *_, group in sorted(found, key=lambda entry: entry[:2])]


def _track(group: Any, known: dict[int, FloatArray], findings: list[Finding]) -> Track:
    import h5py

    role = next(r for r, name in GROUPS.items() if group.name.startswith(f"/{name}/"))
    name, unit = (text_of(group.attrs[key]) for key in ("name", "unit"))
    address = int(h5py.h5o.get_info(group["time"].id).addr)
    if address not in known:
        known[address] = np.asarray(group["time"][()], dtype=np.float64)
    time = known[address]
    values = np.asarray(group["values"][()], dtype=np.float64)
    blocks = np.asarray(group["blocks"][()])
    if time.ndim != 1 or time.shape != values.shape or blocks.ndim != 2 or blocks.shape[1] != 4:
        raise FormatError(
            f"channel {name!r} has times of shape {time.shape}, values of shape {values.shape} "
            f"and blocks of shape {blocks.shape}"
        )
    stated = group.attrs.get("samples")
    kept, lost = _checked(time, values, blocks, None if stated is None else int(stated))
    if lost:
        findings.append(_damaged(name, lost))
    whole = len(kept) == 1 and kept[0] == (0, time.size)
    if not whole:
        time, values = (
            np.concatenate([np.empty(0), *(a[first:last] for first, last in kept)])
            for a in (time, values)
        )
    return Track(role=role, series=Series(name=name, values=values, time=time, unit=unit))


def _checked(
    time: FloatArray, values: FloatArray, blocks: NDArray[Any], stated: int | None
) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """Spans (first, last + 1) whose checksums are right, and those that are lost."""
    kept: list[tuple[int, int]] = []
    lost: list[tuple[int, int]] = []
    end = 0
    for first, count, time_sum, values_sum in blocks[blocks[:, 1] > 0].tolist():
        last = first + count
        if first < end or last > time.size:
            continue  # a row that is damaged itself; its samples are missed below
        if checksums(time[first:last], values[first:last]) != (time_sum, values_sum):
            continue
        if first > end:
            lost.append((end, first))
        if kept and kept[-1][1] == first:
            kept[-1] = (kept[-1][0], last)
        else:
            kept.append((first, last))
        end = last
    if stated is not None and end < stated:
        lost.append((end, stated))
    return kept, lost


def _damaged(name: str, lost: Sequence[tuple[int, int]]) -> Finding:
    count = sum(last - first for first, last in lost)
    places = "one place" if len(lost) == 1 else f"{len(lost)} places"
    return _info(
        "damaged_blocks",
        f"{count} samples of {name!r}, in {places} from sample {lost[0][0]} on, do not agree with "
        "their checksums and are left out: the file was damaged after it was written",
    )


def _incomplete(file: str, tracks: Sequence[Track], ended: str) -> Finding:
    counts = sorted(track.series.values.size for track in tracks)
    each = f"{counts[0]}" if counts[0] == counts[-1] else f"{counts[0]} to {counts[-1]}"
    last = max(
        (
            float(t.series.time[-1])
            for t in tracks
            if t.series.time is not None and t.series.time.size
        ),
        default=0.0,
    )
    why = (
        f"the run of {file!r} ended early ({ended})"
        if ended
        else f"{file!r} was never closed: its writer was killed, or is still at work"
    )
    return _info(
        "incomplete", f"{why}; {each} samples of each channel, up to {last:.6g} s, are kept"
    )


def _changed(file: str, what: str) -> Finding:
    return _info(
        "digest", f"{file!r} was changed after it was written: the checksum of {what} is another"
    )


def _info(code: str, message: str) -> Finding:
    return Finding(code=code, message=message, severity="info", parameters=())
