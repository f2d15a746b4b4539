"""What a record file says of the test beside its samples."""

import json
import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError
from importlib.metadata import version as version_of
from typing import Any, get_args

import numpy as np

from hmpim.equality import ByValue
from hmpim.errors import FormatError
from hmpim.formats.recording.text import put_text, put_text_dataset, text_of
from hmpim.record import Finding, Intersample, Stopping
from hmpim.stimulus import Limits
from hmpim.stimulus.limits import QUANTITIES

__all__ = [
    "FORMAT",
    "Heading",
    "State",
    "checksum",
    "read_heading",
    "read_state",
    "write_details",
    "write_heading",
]

FORMAT = "hmpim/record/2"
"""What the attribute `format` of a record file says; the first 64 kB of the file hold it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Heading(ByValue):
    """What is said of a whole recording.

    Parameters
    ----------
    fs : float
        Nominal rate in Hz.
    band : tuple of float or None
        Excited band in Hz.
    intersample : {'zoh', 'foh', 'bandlimited', 'feedforward'} or None
        What the inputs do between samples.
    source : str
        Where the samples come from, for people.
    findings : tuple of Finding
        What was noticed about the record when it was made.
    specification : str
        What was played, as TOML (see `hmpim.formats.stimulus_spec`); empty where that is not
        known.
    rig : str
        On what.
    limits : mapping of str to Limits
        Limits of the rig, by axis; the axis is '' where it has one only.
    stopping : Stopping or None
        That the run was ended because it was sure.
    created, version : str
        When the file was begun (ISO 8601), and by which version of hmpim.
    """

    fs: float
    band: tuple[float, float] | None = None
    intersample: Intersample | None = None
    source: str = ""
    findings: tuple[Finding, ...] = ()
    specification: str = ""
    rig: str = ""
    limits: Mapping[str, Limits] = field(default_factory=dict)
    stopping: Stopping | None = None
    created: str = ""
    version: str = field(default_factory=lambda: installed_version())


def installed_version() -> str:
    """Version of hmpim as it is installed; 'unknown' where it runs from a bare folder.

    Examples
    --------
    >>> installed_version()[0].isdigit() or installed_version() == "unknown"
    True
    """
    try:
        return version_of("hmpim")
    except PackageNotFoundError:
        return "unknown"


def checksum(heading: Heading) -> int:
    """CRC-32 of all that a heading says.

    Examples
    --------
    >>> checksum(Heading(fs=100.0)) == checksum(Heading(fs=100.1))
    False
    """
    said: list[Any] = [
        repr(float(heading.fs)),
        None if heading.band is None else [repr(float(f)) for f in heading.band],
        heading.intersample,
        heading.source,
        [finding.to_dict() for finding in heading.findings],
        heading.specification,
        heading.rig,
        [(axis, repr(limits)) for axis, limits in heading.limits.items()],
        heading.created,
        heading.version,
    ]
    if heading.stopping is not None:  # files of before have none, and keep their checksum
        said.append(heading.stopping.to_dict())
    return zlib.crc32(json.dumps(said).encode())


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """What a file says of itself.

    Parameters
    ----------
    complete : bool
        Whether it was closed after a run that went well.
    ended : str
        Why the run ended early.
    sha256 : str
        Digest of all channels; empty while the file grows.
    """

    complete: bool
    ended: str = ""
    sha256: str = ""


def write_heading(file: Any, heading: Heading, state: State) -> None:
    """Write what is to be an attribute of an empty HDF5 file (h5py.File)."""
    for name, text in (
        ("format", FORMAT),
        ("version", heading.version),
        ("created", heading.created),
        ("source", heading.source),
        ("rig", heading.rig),
        ("intersample", heading.intersample or ""),
        ("ended", state.ended),
        ("sha256", state.sha256),
    ):
        put_text(file, name, text)
    file.attrs["complete"] = np.int8(state.complete)
    file.attrs["fs"] = float(heading.fs)
    file.attrs["heading_crc32"] = np.uint32(checksum(heading))
    if heading.band is not None:
        file.attrs["band"] = np.array(heading.band, dtype=np.float64)


def write_details(file: Any, heading: Heading) -> None:
    """Write what of a heading is a dataset or a group."""
    if heading.findings:
        lines = [json.dumps(finding.to_dict(), ensure_ascii=False) for finding in heading.findings]
        put_text_dataset(file, "findings", lines)
    if heading.stopping is not None:
        put_text_dataset(file, "stopping", json.dumps(heading.stopping.to_dict()))
    if heading.specification:
        put_text_dataset(file, "stimulus", heading.specification)
    for number, (axis, limits) in enumerate(heading.limits.items()):
        group = file.create_group(f"limits/{number}")
        put_text(group, "axis", axis)
        put_text(group, "unit", limits.unit)
        for name in QUANTITIES:
            group.attrs[name] = float(getattr(limits, name))


def read_heading(file: Any) -> tuple[Heading, bool]:
    """Read back what `write_heading` wrote, and whether nothing of it was changed since.

    Raises
    ------
    FormatError
        If the file is of another kind, or of a later version.
    """
    said = text_of(file.attrs.get("format", ""))
    if said != FORMAT:
        raise FormatError(f"its format is {said!r}, and this version reads {FORMAT!r}")
    attributes = file.attrs
    fs = float(attributes["fs"])
    if not (math.isfinite(fs) and fs > 0):
        raise FormatError(f"its rate is {fs} Hz")
    said = text_of(attributes["intersample"])
    intersample = next((known for known in get_args(Intersample) if known == said), None)
    if said and intersample is None:
        raise FormatError(f"its inputs are {said!r} between samples")
    band = attributes.get("band")
    lines = file["findings"].asstr()[()] if "findings" in file else ()
    heading = Heading(
        fs=fs,
        band=None if band is None else (float(band[0]), float(band[1])),
        intersample=intersample,
        source=text_of(attributes["source"]),
        findings=tuple(Finding.from_dict(json.loads(line)) for line in lines),
        specification=file["stimulus"].asstr()[()] if "stimulus" in file else "",
        rig=text_of(attributes["rig"]),
        limits=_read_limits(file),
        stopping=Stopping.from_dict(json.loads(file["stopping"].asstr()[()]))
        if "stopping" in file
        else None,
        created=text_of(attributes["created"]),
        version=text_of(attributes["version"]),
    )
    return heading, checksum(heading) == int(attributes["heading_crc32"])


def read_state(file: Any) -> State:
    """Read back what a file says of itself."""
    return State(
        complete=bool(int(file.attrs["complete"])),
        ended=text_of(file.attrs["ended"]),
        sha256=text_of(file.attrs["sha256"]),
    )


def _read_limits(file: Any) -> dict[str, Limits]:
    groups = [file["limits"][name] for name in sorted(file.get("limits", {}), key=int)]
    return {
        text_of(group.attrs["axis"]): Limits(
            unit=text_of(group.attrs["unit"]),
            **{name: float(group.attrs[name]) for name in QUANTITIES},
        )
        for group in groups
    }
