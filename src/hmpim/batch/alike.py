"""Records of one stimulus done together.

The first records of a stimulus are identified one by one; what they share is learnt from them
(`hmpim.identify.fleets`) and kept in the process for the tasks that follow. A record for which that
does not hold, for whatever reason, is identified one by one as well. Of records that one file holds
the first alone is made a `Record`: the others are compared with it, sample by sample.
"""

import hashlib
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from contextvars import Context, copy_context
from dataclasses import dataclass, field, replace
from itertools import chain, pairwise
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from hmpim.batch.reading import Read, recorded
from hmpim.batch.request import Request
from hmpim.batch.rows import Row, fleet_table, rows_of
from hmpim.batch.samples import Samples
from hmpim.identify import Identification, PairIdentification, excited_band
from hmpim.identify.fleets.fleet import fit_fleet
from hmpim.identify.fleets.learnt import Fleet, learn_fleet
from hmpim.identify.fleets.whole import Whole, learn_whole, whole_pairs
from hmpim.identify.kept import keeping
from hmpim.identify.result import RecordSummary
from hmpim.identify.threads import one_thread
from hmpim.record import Record, uniform

__all__ = ["One", "Together", "identified_together"]

_LEARNT_FROM = 16
_WORTH = 48
"""Records of one stimulus that a process has met from which it pays to learn what they share."""

_KEPT = 8
_CLOCK = 1e-6
"""Share of a sample by which a stamp may be off a uniform clock."""

_FLEETS: dict[str, Fleet | Whole | None] = {}
"""What records of a stimulus share, by its digest: beyond their parameters if all is kept."""

_FIRST: dict[str, list[PairIdentification | None]] = {}
"""What `identify` said of the first records of a stimulus, by its digest."""

_OF_THREAD = threading.local()
"""The stimulus that a thread met last, by its digest, and what is kept of it."""

One = Callable[[Read], tuple[Sequence[Row], PairIdentification | None]]
Told = Callable[[Read | Samples], Mapping[str, str]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Together:
    """What became of the records of a task.

    Parameters
    ----------
    rows : sequence of mapping
        Of the records that were identified one by one.
    tables : sequence of pyarrow.Table
        Of those that were done together.
    """

    rows: Sequence[Row]
    tables: Sequence[Any]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Group:
    """Records of one stimulus."""

    key: str
    record: Record
    like: Samples | None
    """The first of them, as others may be; None where it had to be mended."""
    items: list[Read | Samples] = field(default_factory=list)
    outputs: list[NDArray[np.float64]] = field(default_factory=list)

    def takes(self, samples: Samples) -> bool:
        """Whether samples are as the first but for the output, and that is whole."""
        like, output = self.like, self.record.outputs[0]
        if like is None or like.fs != samples.fs or like.units != samples.units:
            return False
        if like.arrays.keys() != samples.arrays.keys():
            return False
        values = samples.arrays[output.name]
        return (
            all(
                name == output.name or np.array_equal(one, samples.arrays[name])
                for name, one in like.arrays.items()
            )
            and values.size == output.values.size
            and bool(np.isfinite(values).all())
        )

    def add(self, item: Read | Samples, values: NDArray[np.float64]) -> None:
        self.items.append(item)
        self.outputs.append(values)


def identified_together(
    items: Sequence[Read | Samples],
    request: Request,
    one: One,
    *,
    told: Told,
    metadata: Sequence[str] = (),
) -> Together:
    """Identify the records of a task, those of one stimulus together.

    Parameters
    ----------
    items : sequence of Read or Samples
        What was read.
    request : Request
        What is asked.
    one : callable
        Identifies a record by itself; gives its rows, and its pair if it has one.
    told : callable
        Metadata of a record.
    metadata : sequence of str
        Columns of metadata.
    """
    groups, single = _grouped(items, request)
    rows = list(_in_turn(single, one))
    tables: list[Any] = []

    def do(group: _Group) -> None:
        left = list(range(len(group.items)))
        if group.key not in _FLEETS:
            left = _learn_from(group, request, one, rows)
        shared = _FLEETS.get(group.key)
        if isinstance(shared, Whole) and left:
            found, left = _everything(shared, group, left, request, told=told)
            rows.extend(found)
        elif isinstance(shared, Fleet) and left:
            table, left = _by_fleet(shared, group, left, request, told=told, metadata=metadata)
            tables.append(table)
        for i in left:
            rows.extend(one(_read(group.items[i], request))[0])

    for group in groups:
        _kept_of(group.key).run(do, group)
    return Together(rows=rows, tables=tables)


def _kept_of(stimulus: str) -> Context:
    """What this thread keeps of a stimulus (`hmpim.identify.kept`), for the next task as well."""
    if getattr(_OF_THREAD, "stimulus", None) != stimulus:
        with keeping():
            _OF_THREAD.stimulus, _OF_THREAD.kept = stimulus, copy_context()
    return cast(Context, _OF_THREAD.kept)


def _in_turn(reads: Iterable[Read], one: One) -> Iterator[Row]:
    """Identify one after the other, what follows from an input kept while the next has it too."""
    with ExitStack() as scope:
        for read, after in pairwise(chain(reads, [None])):
            assert read is not None
            shared = _same_inputs(read, after)
            if shared:
                scope.enter_context(keeping())
            yield from one(read)[0]
            if not shared:
                scope.close()


def _same_inputs(one: Read, other: Read | None) -> bool:
    if other is None or one.record is None or other.record is None:
        return False
    first, second = ([c.values for c in r.inputs] for r in (one.record, other.record))
    return len(first) == len(second) and all(map(np.array_equal, first, second))


def _grouped(items: Sequence[Read | Samples], request: Request) -> tuple[list[_Group], list[Read]]:
    """Records by their stimulus, and those that share nothing."""
    groups: dict[str, _Group] = {}
    single: list[Read] = []
    for item in items:
        if isinstance(item, Samples):
            known = next((g for g in groups.values() if g.takes(item)), None)
            if known is not None:
                known.add(item, item.arrays[known.record.outputs[0].name])
                continue
        read = _read(item, request)
        key = _stimulus(read, request)
        if not key or read.record is None:
            single.append(read)
            continue
        if key not in groups:
            plain = not read.record.findings and len(groups) < _KEPT
            like = item if plain and isinstance(item, Samples) else None
            groups[key] = _Group(key=key, record=read.record, like=like)
        groups[key].add(read, read.record.outputs[0].values)
    return list(groups.values()), single


def _read(item: Read | Samples, request: Request) -> Read:
    return item if isinstance(item, Read) else recorded(item, request)


def _learn_from(group: _Group, request: Request, one: One, rows: list[Row]) -> list[int]:
    """Identify the first records of a stimulus, learn from them, and return which are left."""
    first = _FIRST.pop(group.key, [])
    count = len(group.items)
    worth = len(first) + count >= _WORTH
    needed = max(_LEARNT_FROM - len(first), 0) if worth else count
    for item in group.items[:needed]:
        found, pair = one(_read(item, request))
        rows += found
        first.append(pair)
    if worth and len(first) >= _LEARNT_FROM:
        pairs = [pair for pair in first[:_LEARNT_FROM] if pair is not None]
        _keep(_FLEETS, group.key, _learnt(group.record, pairs, whole=request.keep == "results"))
    else:
        _keep(_FIRST, group.key, first)
    return list(range(min(needed, count), count))


def _by_fleet(
    fleet: Fleet,
    group: _Group,
    some: list[int],
    request: Request,
    *,
    told: Told,
    metadata: Sequence[str],
) -> tuple[Any, list[int]]:
    """The table of the records that can be done together, and those that cannot."""
    begin = time.thread_time()
    record, items = group.record, [group.items[i] for i in some]
    outputs = np.stack([group.outputs[i] for i in some])
    units = (record.inputs[0].unit, record.outputs[0].unit)
    with one_thread():
        fit = fit_fleet(fleet, outputs, units=units)
    digests = _digests(record, items, outputs, request)
    table = fleet_table(
        [item.address for item in items],
        [told(item) for item in items],
        record,
        fleet,
        fit,
        digests=digests,
        metadata=metadata,
        seconds=(time.thread_time() - begin) / len(items),
    )
    return table, [i for i, sound in zip(some, fit.sound.tolist(), strict=True) if not sound]


def _everything(
    whole: Whole, group: _Group, some: list[int], request: Request, *, told: Told
) -> tuple[list[Row], list[int]]:
    """Rows of the records that can be done together, with all that is said; and the others."""
    begin = time.thread_time()
    record, items = group.record, [group.items[i] for i in some]
    outputs = np.stack([group.outputs[i] for i in some])
    names = (record.inputs[0], record.outputs[0])
    with one_thread():
        fit = fit_fleet(whole.fleet, outputs, units=(names[0].unit, names[1].unit))
        pairs = whole_pairs(
            whole,
            fit,
            outputs,
            names=(names[0].name, names[1].name),
            findings=uniform(record).findings,
        )
    digests = _digests(record, items, outputs, request)
    seconds = (time.thread_time() - begin) / len(items)
    rows: list[Row] = []
    left: list[int] = []
    for i, item, pair, digest in zip(some, items, pairs, digests, strict=True):
        own = item.record if isinstance(item, Read) else record
        if pair is None or own is None or own.findings != record.findings:
            left.append(i)
            continue
        result = Identification(
            record=RecordSummary(
                fs=record.fs, samples=record.samples, sha256=digest, source=own.source
            ),
            pairs=(replace(pair, stopping=own.stopping),),
        )
        read = Read(address=item.address, record=record, metadata=told(item))
        rows += rows_of(read, result, seconds=seconds, whole=True)
    return rows, left


def _digests(
    record: Record,
    items: Sequence[Read | Samples],
    outputs: NDArray[np.float64],
    request: Request,
) -> list[str]:
    """Digest of each record; of those that differ in the output's values alone, all at once."""
    at_once = len(record.channels) == 2
    told = record.sha256_with(outputs) if at_once else [""] * len(items)
    for i, item in enumerate(items):
        if not at_once or isinstance(item, Read):
            own = _read(item, request).record
            assert own is not None
            told[i] = own.sha256
    return told


def _learnt(
    record: Record, pairs: Sequence[PairIdentification], *, whole: bool
) -> Fleet | Whole | None:
    u = record.inputs[0].values
    band = record.band or excited_band(u, record.fs)
    with one_thread():
        fleet = learn_fleet(u, pairs, fs=record.fs, band=band)
        return learn_whole(fleet, pairs) if whole and fleet is not None else fleet


def _keep(known: dict[str, Any], key: str, value: Any) -> None:
    while len(known) >= _KEPT:
        del known[next(iter(known))]
    known[key] = value


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
    names = (source.name, source.unit, output.name, output.unit)
    digest.update(repr((record.fs, record.band, record.intersample, names)).encode())
    digest.update(source.values.tobytes())
    return digest.hexdigest()
