"""The records at some addresses, each read once; one that cannot be read says why."""

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path, PurePosixPath

from hmpim.batch.addresses import Address, opened
from hmpim.batch.request import Request
from hmpim.batch.samples import Metadata, Samples, read_samples, reason_of
from hmpim.errors import FormatError, HmpimError
from hmpim.formats.assemble import assemble, check_units
from hmpim.formats.files import read
from hmpim.formats.readers import ChannelInfo, Contents
from hmpim.formats.readers.logs.clock import is_time
from hmpim.formats.recording import read_recording
from hmpim.formats.roles import choose_roles
from hmpim.record import Record, Series

__all__ = ["Read", "read_items", "read_records", "reason_of", "recorded"]

_OURS = b"hmpim/record/"
_HEAD = 65_536


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Read:
    """A record, or why there is none.

    Parameters
    ----------
    address : Address
        Where it is.
    record : Record or None
        What was read.
    reason : str
        Why nothing was read; empty if something was.
    metadata : mapping of str to str
        What the file says of the record beside its samples.
    """

    address: Address
    record: Record | None = None
    reason: str = ""
    metadata: Metadata = field(default_factory=dict)


def read_records(addresses: Sequence[Address], request: Request) -> Iterator[Read]:
    """Read records in order, a file that holds many opened once.

    Parameters
    ----------
    addresses : sequence of Address
        Where they are, those of one file together.
    request : Request
        Which channels are wanted.
    """
    for item in read_items(addresses, request):
        yield item if isinstance(item, Read) else recorded(item, request)


def read_items(addresses: Sequence[Address], request: Request) -> Iterator[Read | Samples]:
    """Read as `read_records`, but leave what one file holds of many records as samples.

    Parameters
    ----------
    addresses, request
        As for `read_records`.
    """
    for (_, form), some in groupby(addresses, key=lambda a: (a.file.url, a.form)):
        here = list(some)
        if form not in ("rows", "lists", "group"):
            yield from (_from_file(address, request) for address in here)
            continue
        told = 0
        try:
            for samples in read_samples(here, request):
                told += 1
                yield samples
        except Exception as error:
            # The file as a whole: each record that has not been read says so.
            yield from (Read(address=a, reason=reason_of(error)) for a in here[told:])


def recorded(samples: Samples, request: Request) -> Read:
    """Make a record of samples, or say why there is none.

    Parameters
    ----------
    samples : Samples
        From `read_items`.
    request : Request
        Which channels are wanted.
    """
    address, reason = samples.address, samples.reason
    if not reason:
        try:
            record = _assembled(samples, request)
            return Read(address=address, record=record, metadata=samples.metadata)
        except Exception as error:
            reason = reason_of(error)
    return Read(address=address, reason=reason)


def _from_file(address: Address, request: Request) -> Read:
    try:
        if address.form == "scattered":
            raise FormatError(
                f"rows of the record {address.place!r} stand in several places of the file; sort "
                f"it by its column {request.record_column!r}"
            )
        if "://" not in address.file.url:
            record, metadata = _whole(Path(address.file.url), request)
        else:
            name = PurePosixPath(address.file.url).name
            with tempfile.TemporaryDirectory(prefix="hmpim-") as folder:
                local = Path(folder) / name
                with opened(address.file) as source, local.open("wb") as copy:
                    while block := source.read(2**22):
                        copy.write(block)
                record, metadata = _whole(local, request)
    except (HmpimError, OSError) as error:
        return Read(address=address, reason=reason_of(error))
    return Read(address=address, record=record, metadata=metadata)


def _whole(path: Path, request: Request) -> tuple[Record, Metadata]:
    with path.open("rb") as file:
        ours = _OURS in file.read(_HEAD)
    if ours and path.suffix.lower() in (".h5", ".hdf5"):
        recording = read_recording(path)
        record = recording.record
        if request.inputs or request.outputs:
            record = record.with_roles(
                inputs=request.inputs or [c.name for c in record.inputs],
                outputs=request.outputs or [c.name for c in record.outputs],
            )
        return record, {"rig": recording.rig, "created": recording.created}
    record = read(
        path,
        inputs=request.inputs or None,
        outputs=request.outputs or None,
        fs=request.fs,
        time=request.time,
        units=request.units,
    )
    return record, {}


def _assembled(samples: Samples, request: Request) -> Record:
    """A record of arrays of one file, as `hmpim.read` makes it of a file's channels."""
    arrays, units = samples.arrays, samples.units
    file = PurePosixPath(samples.address.file.url).name
    clock = request.time or next((name for name in arrays if is_time(name)), None)
    if clock is not None and clock not in arrays:
        raise FormatError(
            f"{file!r} has no column {clock!r} for the time; it has {', '.join(arrays)}"
        )
    fs = samples.fs
    contents = Contents(
        format="many",
        channels=tuple(
            ChannelInfo(name=name, unit=units.get(name, "")) for name in arrays if name != clock
        ),
        time=clock,
        fs=fs,
    )
    check_units(request.units, contents, file)
    roles = choose_roles(
        contents,
        file,
        inputs=request.inputs or None,
        outputs=request.outputs or None,
    )
    time = None if clock is None else arrays[clock]
    series = [
        Series(name=name, values=arrays[name], time=time, unit=units.get(name, ""))
        for name in roles.names
    ]
    rate = request.fs if request.fs is not None else fs if clock is None else None
    return assemble(series, roles, contents, file=file, fs=rate, units=request.units)
