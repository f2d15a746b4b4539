"""Records of one stimulus done together, where the parameters alone are asked for.

The first records of a stimulus are identified one by one; what they share is learnt from them
(`hmpim.identify.fleet`) and kept in the process for the tasks that follow. A record for which that
does not hold, for whatever reason, is identified one by one as well.
"""

import hashlib
import time
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from hmpim.batch.reading import Read
from hmpim.batch.request import Request
from hmpim.batch.rows import Row, fleet_rows
from hmpim.identify import PairIdentification, excited_band
from hmpim.identify.fleet import Fleet, fit_fleet, learn_fleet
from hmpim.identify.threads import one_thread
from hmpim.record import Record

__all__ = ["identified_together"]

_LEARNT_FROM = 16
_WORTH = 48
"""Records of one stimulus in a task from which it pays to learn what they share."""

_KEPT = 8
_CLOCK = 1e-6
"""Share of a sample by which a stamp may be off a uniform clock."""

_FLEETS: dict[str, Fleet | None] = {}

One = Callable[[Read], tuple[Sequence[Row], PairIdentification | None]]


def identified_together(reads: Sequence[Read], request: Request, one: One) -> Iterator[Row]:
    """Rows of the records of a task, those of one stimulus done together.

    Parameters
    ----------
    reads : sequence of Read
        What was read.
    request : Request
        What is asked.
    one : callable
        Identifies a record by itself; gives its rows, and its pair if it has one.
    """
    groups: dict[str, list[Read]] = {}
    for read in reads:
        groups.setdefault(_stimulus(read, request), []).append(read)
    for key, some in groups.items():
        left = some
        if key and key not in _FLEETS and len(some) >= _WORTH:
            rows: list[Row] = []
            pairs: list[PairIdentification] = []
            for read in some[:_LEARNT_FROM]:
                found, pair = one(read)
                rows += found
                pairs += [pair] if pair is not None else []
            yield from rows
            _keep(key, _learnt(some[0].record, pairs))
            left = some[_LEARNT_FROM:]
        fleet = _FLEETS.get(key)
        if fleet is not None and left:
            yield from _by_fleet(fleet, left, one)
        else:
            for read in left:
                yield from one(read)[0]


def _by_fleet(fleet: Fleet, reads: Sequence[Read], one: One) -> Iterator[Row]:
    begin = time.thread_time()
    records = [read.record for read in reads if read.record is not None]
    channels = (records[0].inputs[0], records[0].outputs[0])
    with one_thread():
        fit = fit_fleet(
            fleet,
            np.stack([record.outputs[0].values for record in records]),
            units=(channels[0].unit, channels[1].unit),
        )
    each = (time.thread_time() - begin) / len(records)
    yield from fleet_rows(reads, fleet, fit, seconds=each)
    for read, sound in zip(reads, fit.sound, strict=True):
        if not sound:
            yield from one(read)[0]


def _learnt(record: Record | None, pairs: Sequence[PairIdentification]) -> Fleet | None:
    assert record is not None
    u = record.inputs[0].values
    band = record.band or excited_band(u, record.fs)
    with one_thread():
        return learn_fleet(u, pairs, fs=record.fs, band=band)


def _keep(key: str, fleet: Fleet | None) -> None:
    while len(_FLEETS) >= _KEPT:
        del _FLEETS[next(iter(_FLEETS))]
    _FLEETS[key] = fleet


def _stimulus(read: Read, request: Request) -> str:
    """Digest of all that a record must share with others; empty for one that shares nothing."""
    record = read.record
    if record is None or len(record.inputs) != 1 or len(record.outputs) != 1:
        return ""
    source, output = record.inputs[0], record.outputs[0]
    if source.values.size != output.values.size or not np.array_equal(source.time, output.time):
        return ""
    if any(finding.severity == "doubt" for finding in record.findings):
        return ""
    uniform = source.time[0] + np.arange(source.values.size) / record.fs
    if np.abs(source.time - uniform).max() * record.fs > _CLOCK:
        return ""
    digest = hashlib.sha256(request.digest.encode())
    told = (record.fs, record.band, record.intersample, source.name, source.unit, output.unit)
    digest.update(repr(told).encode())
    digest.update(source.values.tobytes())
    return digest.hexdigest()
