"""Our own record file: HDF5 that grows as samples come and outlives its writer."""

from hmpim.formats.recording.heading import FORMAT, Heading
from hmpim.formats.recording.opened import Opened, Track, open_recording
from hmpim.formats.recording.recording import Recording, read_recording, save_recording
from hmpim.formats.recording.writer import RecordWriter, check_free

__all__ = [
    "FORMAT",
    "Heading",
    "Opened",
    "RecordWriter",
    "Recording",
    "Track",
    "check_free",
    "open_recording",
    "read_recording",
    "save_recording",
]
