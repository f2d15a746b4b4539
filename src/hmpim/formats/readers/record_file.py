"""Our own record files, see `hmpim.formats.recording`."""

from collections.abc import Sequence
from pathlib import Path

from hmpim.formats.readers.protocol import ChannelInfo, Contents, Layout, Reader
from hmpim.formats.recording import open_recording
from hmpim.formats.recording.opened import Track, usable
from hmpim.record import Role, Series

__all__ = ["RECORD_FILE", "channels", "read", "sniff"]

_HDF5 = b"\x89HDF\r\n\x1a\n"
_OURS = b"hmpim/record/"


def sniff(head: bytes, path: Path) -> bool:
    r"""Say whether a file is HDF5 and names our format.

    Examples
    --------
    >>> sniff(b"\x89HDF\r\n\x1a\n...hmpim/record/2", Path("run.h5")), sniff(b"u", Path("u.csv"))
    (True, False)
    """
    return head.startswith(_HDF5) and _OURS in head


def channels(path: Path, layout: Layout) -> Contents:
    """List the channels; each block is checked."""
    opened = open_recording(path)
    tracks, findings = usable(opened, path.name)
    heading = opened.heading

    def names(role: Role) -> tuple[str, ...]:
        return tuple(track.series.name for track in tracks if track.role == role)

    return Contents(
        format="hmpim record",
        channels=tuple(_info(track, tracks) for track in tracks),
        inputs=names("input"),
        outputs=names("output"),
        references=names("reference"),
        auxiliary=names("auxiliary"),
        fs=heading.fs,
        band=heading.band,
        intersample=heading.intersample,
        source=heading.source,
        findings=tuple(findings),
        stopping=heading.stopping,
    )


def read(path: Path, names: Sequence[str], layout: Layout) -> tuple[Series, ...]:
    """Read channels by name."""
    tracks = {track.series.name: track.series for track in open_recording(path).tracks}
    return tuple(tracks[name] for name in names)


def _info(track: Track, tracks: Sequence[Track]) -> ChannelInfo:
    """What is said of a channel; its clock is named after the first channel that has it."""
    series = track.series
    first = next(t.series for t in tracks if t.series.time is series.time)
    return ChannelInfo(
        name=series.name, unit=series.unit, samples=series.values.size, clock=first.name
    )


RECORD_FILE = Reader(format="hmpim record", sniff=sniff, channels=channels, read=read, uses=())
