"""A record file that grows as samples come; killed at any moment, it can be read.

The file is laid out by HDF5 once, before anything moves (see `hmpim.formats.recording.layout`).
After that each sample goes to its place with a plain write, which the operating system keeps
even if this process dies in the very next instruction. The checksum of the block follows it, so
that a sample that was half written is not taken for one. Neither SWMR nor a flush of HDF5 is
needed, and any program can open the file meanwhile.
"""

import contextlib
import os
import secrets
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Self

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import ArgumentError, HmpimError, RecordError
from hmpim.formats.atomic import check_writable
from hmpim.formats.recording.heading import State
from hmpim.formats.recording.layout import (
    LOG_WIDTH,
    Space,
    block_length,
    lay_out,
    log_line,
    new_file,
)
from hmpim.formats.recording.opened import checksums
from hmpim.formats.recording.recording import heading_of, write_again
from hmpim.rigs import ChannelSpec, Layout, Samples
from hmpim.rigs.protocol import LimitsOfAxes
from hmpim.stimulus import Stimulus

__all__ = ["RecordWriter", "check_free"]

_LOG_LINES = 500
_MARGIN = 1.1  # a unit with a clock of its own may send somewhat more than was expected
"""Share of room beyond what is expected."""


@dataclass(slots=True, kw_only=True)
class _Place:
    """Where the samples of a channel go, and how many are there."""

    time: int
    values: int
    blocks: int
    room: int
    rows: int
    count: int = 0
    row: int = 0
    first: int = 0
    sums: tuple[int, int] = (0, 0)


class RecordWriter:
    """Write a record file sample by sample.

    A context manager: left in the ordinary way, the file is complete; left by an exception, it
    keeps what was written and says why it ended. What stood at `path` before is replaced when
    the first samples come.

    Parameters
    ----------
    path : path-like
        File to write, ending in .h5 or .hdf5.
    layout : Layout
        Channels to come.
    fs : float
        Nominal rate in Hz.
    samples : int
        Samples of each channel to be expected; room for them is taken on the disk at once. If
        more come, the file grows.
    band : tuple of float, optional
        Excited band in Hz.
    stimuli : sequence of Stimulus
        What is played.
    rig : str
        On what.
    limits : Limits, or mapping of axis to Limits, or None
        Limits of the rig.

    Raises
    ------
    ArgumentError
        If the file cannot be written there, another process writes it, or the disk has no room.

    Examples
    --------
    >>> import tempfile
    >>> from hmpim.formats import load
    >>> layout = Layout(
    ...     channels=(ChannelSpec(name="u", role="input"), ChannelSpec(name="y", role="output"))
    ... )
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "run.h5"
    ...     with RecordWriter(path, layout, fs=10.0, samples=4) as writer:
    ...         for k in range(4):
    ...             sample = Samples(time=[k / 10], values=[float(k)])
    ...             writer.append({"u": sample, "y": sample})
    ...     load(path).outputs[0].values.tolist()
    [0.0, 1.0, 2.0, 3.0]
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        layout: Layout,
        *,
        fs: float,
        samples: int,
        band: tuple[float, float] | None = None,
        stimuli: Sequence[Stimulus] = (),
        rig: str = "",
        limits: LimitsOfAxes = None,
    ) -> None:
        self._path = Path(path)
        if self._path.suffix.lower() not in (".h5", ".hdf5"):
            raise ArgumentError(f"{str(path)!r} is to be a record file; let it end in .h5")
        self._channels = layout.channels
        self._heading = heading_of(
            fs=fs,
            band=band,
            intersample=layout.intersample,
            source=layout.source,
            stimuli=stimuli,
            rig=rig,
            limits=limits,
        )
        self._block = block_length(fs)
        room = max(2 * self._block, int(_MARGIN * samples) + 1)
        # Twice: closed, it is written anew in its final length beside the one that grew.
        check_writable(self._path, size=2 * 16 * room * len(self._channels) + 1_000_000)
        self._target = self._path.resolve()
        check_free(self._target)
        self._draft: Path | None = self._beside()
        self._file, self._places, self._log_at = self._laid_out(
            self._draft, [room] * len(self._channels)
        )
        self._lines = 0

    @property
    def samples(self) -> int:
        """Samples of the channel that has most."""
        return max(place.count for place in self._places.values())

    def append(self, samples: Mapping[str, Samples]) -> None:
        """Write samples; when this returns, the death of this process cannot lose them.

        Parameters
        ----------
        samples : mapping of str to Samples
            By channel; a channel may be missing, and each has its own times.

        Raises
        ------
        ArgumentError
            If there is no such channel, or the file is closed.
        RecordError
            If the disk takes no more; what was written before is kept.
        """
        self._check_open()
        unknown = [name for name in samples if name not in self._places]
        if unknown:
            raise ArgumentError(
                f"channel {unknown[0]!r} is not in this record; it has {', '.join(self._places)}"
            )
        try:
            if self._draft is not None and any(part.time.size for part in samples.values()):
                check_free(self._target)
                os.replace(self._draft, self._target)
                self._draft = None
            for name, part in samples.items():
                if part.time.size:
                    self._write(name, part.time, part.values)
        except OSError as error:
            raise RecordError(
                f"{self._path.name!r} accepts no more samples "
                f"({error.strerror or error}); what was "
                "written before is kept"
            ) from error

    def log(self, line: str) -> None:
        """Keep a line of text with the record, such as a fault and its time.

        The first 500 lines are kept, each up to 240 bytes.
        """
        self._check_open()
        if self._lines >= _LOG_LINES:
            return
        with contextlib.suppress(OSError):  # a full disk must not keep a rig from being stopped
            _put(self._file, self._log_at + self._lines * LOG_WIDTH, log_line(line))
        self._lines += 1

    def close(self, *, ended: str = "") -> None:
        """Finish the file: cut to its length, with a digest, marked complete.

        Parameters
        ----------
        ended : str
            Why the run ended early; the file then stays marked incomplete.

        Raises
        ------
        RecordError
            If not one sample was written; what stood in its place before is then still there.
        ArgumentError
            If the file cannot be finished. It stays as it grew, incomplete, and can be read.
        """
        if self._file.closed:
            return
        if self._draft is not None:
            self._file.close()
            self._draft.unlink(missing_ok=True)
            if not ended:
                raise RecordError(f"not one sample was written to {self._path.name!r}")
            return
        os.fsync(self._file.fileno())
        self._file.close()
        write_again(self._target, ended=ended)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
        /,
    ) -> None:
        if kind is None:
            self.close()
            return
        with contextlib.suppress(HmpimError):  # what went wrong before is what counts
            self.close(ended=f"{kind.__name__}: {error}".rstrip(": "))

    def _check_open(self) -> None:
        if self._file.closed:
            raise ArgumentError(f"{self._path.name!r} is closed; no more can be written to it")

    def _beside(self) -> Path:
        return self._target.with_name(f".hmpim-{secrets.token_hex(6)}{self._target.suffix}")

    def _laid_out(
        self, path: Path, rooms: Sequence[int]
    ) -> tuple[BinaryIO, dict[str, _Place], int]:
        """Make a file with room for so many samples of each channel, all of it on the disk."""
        spaces = [
            _space(spec, room, self._block)
            for spec, room in zip(self._channels, rooms, strict=True)
        ]
        try:
            with new_file(path) as file:
                made, log = lay_out(
                    file,
                    self._heading,
                    spaces,
                    state=State(complete=False),
                    log_lines=_LOG_LINES,
                    reserved=True,
                )
                file.flush()
                log_at = log.id.get_offset()
                places = {
                    space.name: _Place(
                        time=room.time.id.get_offset(),
                        values=room.values.id.get_offset(),
                        blocks=room.blocks.id.get_offset(),
                        room=space.samples,
                        rows=space.rows,
                    )
                    for space, room in zip(spaces, made, strict=True)
                }
            return _held(path.open("r+b", buffering=0)), places, log_at
        except OSError as error:
            path.unlink(missing_ok=True)
            reason = error.strerror or error
            raise ArgumentError(f"{str(self._path)!r} cannot be written: {reason}") from error

    def _write(self, name: str, time: NDArray[np.float64], values: NDArray[np.float64]) -> None:
        place = self._places[name]
        if place.count + time.size > place.room or place.row >= place.rows:
            self._grow(name, place.count + time.size)
            place = self._places[name]
        times, samples = (np.ascontiguousarray(a, dtype="<f8") for a in (time, values))
        _put(self._file, place.time + 8 * place.count, times.tobytes())
        _put(self._file, place.values + 8 * place.count, samples.tobytes())
        place.count += time.size
        place.sums = checksums(times, samples, before=place.sums)
        row = np.array([place.first, place.count - place.first, *place.sums], dtype="<u8")
        _put(self._file, place.blocks + 32 * place.row, row.tobytes())
        if place.count - place.first >= self._block:
            place.row, place.first, place.sums = place.row + 1, place.count, (0, 0)

    def _grow(self, name: str, needed: int) -> None:
        """Move to a file with more room; the old one is whole until the new one takes its place."""
        rooms = [
            max(2 * place.room, 2 * needed) if key == name else place.room
            for key, place in self._places.items()
        ]
        draft = self._beside()
        file, places, log_at = self._laid_out(draft, rooms)
        for key, old in self._places.items():
            new = places[key]
            _copy(self._file, old.time, file, new.time, 8 * old.count)
            _copy(self._file, old.values, file, new.values, 8 * old.count)
            _copy(self._file, old.blocks, file, new.blocks, 32 * min(old.rows, old.row + 1))
            new.count, new.row, new.first, new.sums = old.count, old.row, old.first, old.sums
        _copy(self._file, self._log_at, file, log_at, LOG_WIDTH * self._lines)
        os.replace(draft, self._target)
        self._file.close()
        self._file, self._places, self._log_at = file, places, log_at


def _held(file: BinaryIO) -> BinaryIO:
    """Hold a file that grows, as a reader holds it: who would write it as well is refused."""
    if sys.platform != "win32":  # which does not replace a file that is open
        import fcntl

        with contextlib.suppress(OSError):  # a file system without locks
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    return file


def check_free(path: Path) -> None:
    """Refuse to replace a file that another run writes: its samples would go nowhere.

    Raises
    ------
    ArgumentError
        If another process, or this one, has it open.
    """
    if sys.platform == "win32" or not path.is_file():
        return
    import fcntl

    with contextlib.suppress(FileNotFoundError, PermissionError), path.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise ArgumentError(
                f"{str(path)!r} is being written by another run, or open in another program; name "
                "another file"
            ) from None
        except OSError:  # a file system without locks
            return


def _space(spec: ChannelSpec, room: int, block: int) -> Space:
    rows = room // block + 2
    return Space(name=spec.name, unit=spec.unit, role=spec.role, samples=room, rows=rows)


def _put(file: BinaryIO, place: int, data: bytes) -> None:
    """Write all of `data` at a place."""
    file.seek(place)
    left = memoryview(data)
    while left:
        left = left[file.write(left) :]


def _copy(source: BinaryIO, start: int, target: BinaryIO, place: int, size: int) -> None:
    source.seek(start)
    target.seek(place)
    left = size
    while left > 0:
        part = source.read(min(left, 1 << 20))
        if not part:
            raise OSError(5, "the file has become shorter than what was written to it")
        _put(target, place + size - left, part)
        left -= len(part)
