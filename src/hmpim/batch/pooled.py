"""Records of one unit, or of a fleet, added up where they lie: one identification for each group.

Each task compresses its records to their statistics and adds up those of one group; what travels
has the size of the window, whatever the length of the records. The sum is what one record of the
whole history would give, a bias for each record apart.
"""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path
from typing import Any

from hmpim.batch.addresses import Address, addresses_of, find_files
from hmpim.batch.metadata import Beside, read_metadata
from hmpim.batch.pool import Pool
from hmpim.batch.reading import Read, read_records, reason_of
from hmpim.batch.request import Request
from hmpim.batch.rows import group_rows
from hmpim.errors import ArgumentError
from hmpim.identify import Identification, Statistics, compress, identify
from hmpim.identify.preparation.refusals import check_moves
from hmpim.record import uniform

__all__ = ["Group", "Sums", "identify_groups"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sums:
    """Statistics of some records, by group, and why others are not among them."""

    groups: Mapping[str, tuple[int, Statistics]]
    reasons: tuple[tuple[str, str], ...] = ()

    def __add__(self, other: "Sums") -> "Sums":
        groups, reasons = dict(self.groups), [*self.reasons, *other.reasons]
        for name, (count, statistics) in other.groups.items():
            before, known = groups.get(name, (0, None))
            try:
                total = statistics if known is None else known + statistics
            except ArgumentError as error:  # of another rate, or of other channels
                reasons.append((f"{name}: {count} of its records", reason_of(error)))
            else:
                groups[name] = (before + count, total)
        return Sums(groups=groups, reasons=tuple(reasons))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Group:
    """What the records of one group together say.

    Parameters
    ----------
    name : str
        Value of the column that they share.
    records : int
        How many.
    statistics : Statistics
        Their sum.
    result : Identification
        What was identified.
    seconds : float
        Processor time of that identification.
    """

    name: str
    records: int
    statistics: Statistics
    result: Identification
    seconds: float = 0.0

    def rows(self, column: str, *, whole: bool) -> list[dict[str, Any]]:
        """Return a row for each pair, as of one record.

        Parameters
        ----------
        column : str
            What the records of a group share.
        whole : bool
            Whether all that was found is kept.
        """
        names, units = self.statistics.names, self.statistics.units
        return group_rows(
            self.name,
            self.result,
            units=dict(zip(names, units, strict=True)),
            metadata={column: self.name, "records": str(self.records)},
            seconds=self.seconds,
            whole=whole,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Compress:
    """Some records, compressed and added up by one worker."""

    addresses: tuple[Address, ...]
    request: Request
    by: str
    beside: Beside
    lags: int

    @property
    def name(self) -> str:
        return f"compress-{self.addresses[0].digest}"

    def do(self) -> Sums:
        total = Sums(groups={})
        for read in read_records(self.addresses, self.request):
            total = total + self._one(read)
        return total

    def _one(self, read: Read) -> Sums:
        """The sum of one record, or why there is none."""
        reason = read.reason
        if read.record is not None:
            told = {**read.metadata, **self.beside.of(read.address)}
            try:
                check_moves(uniform(read.record))  # a dead sensor would be a unit's noise
                one = (1, compress(read.record, lags=self.lags))
                return Sums(groups={_group_of(told, self.by): one})
            except Exception as error:  # bad data, or a defect that one record meets: others go on
                reason = reason_of(error)
        return Sums(groups={}, reasons=((read.address.name, reason),))


def _group_of(told: Mapping[str, str], by: str) -> str:
    if by and by not in told:
        known = ", ".join(told) or "none"
        raise ArgumentError(f"it has no metadata {by!r}; it has {known}")
    return told[by] if by else "all"


def identify_groups(
    paths: Sequence[str],
    *,
    lags: int | None = None,
    by: str = "",
    request: Request | None = None,
    pool: Callable[[], AbstractContextManager[Pool]],
    per_task: int = 100,
    progress: Callable[[int], None] = lambda records: None,
    without: Path | None = None,
) -> tuple[tuple[Group, ...], tuple[tuple[str, str], ...]]:
    """Identify each group of records as one, without moving a sample.

    Parameters
    ----------
    paths : sequence of str
        As for `hmpim.batch`.
    lags : int, optional
        Window in samples, the same for all: delay and settling time must fit into it. A fifth of
        the first record that can be read by default.
    by : str
        Column of metadata whose values are the groups, such as a unit's serial number; empty for
        one model of all.
    request : Request, optional
        Which channels.
    pool : callable
        Gives who does the work, such as `hmpim.batch.pool.dask_pool`.
    per_task : int
        Records that a worker adds up at once.
    progress : callable
        Told how many records are added up, after each task.
    without : Path, optional
        Folder in which no records are looked for.

    Returns
    -------
    groups : tuple of Group
        By name.
    reasons : tuple of (str, str)
        Records that are in none, and why.
    """
    asked = request or Request()
    beside = read_metadata(asked.metadata, asked.record_column)
    addresses = chain.from_iterable(
        addresses_of(file, asked) for file in find_files(paths, without=without)
    )
    ahead: list[Address] = []
    window = lags or _window(addresses, asked, ahead)

    def tasks() -> Iterator[_Compress]:
        left = chain(ahead, addresses)
        while some := tuple(islice(left, per_task)):
            yield _Compress(addresses=some, request=asked, by=by, beside=beside, lags=window)

    with pool() as crew:
        total = _added_up(crew, tasks(), progress)
    groups, reasons = [], list(total.reasons)
    for name, (count, statistics) in sorted(total.groups.items()):
        begin = time.thread_time()
        try:
            result = identify(statistics)
        except Exception as error:  # a defect that one group meets: the others go on
            reasons.append((name, reason_of(error)))
            continue
        seconds = time.thread_time() - begin
        groups.append(
            Group(name=name, records=count, statistics=statistics, result=result, seconds=seconds)
        )
    return tuple(groups), tuple(reasons)


def _added_up(crew: Pool, tasks: Iterator[_Compress], progress: Callable[[int], None]) -> Sums:
    """Sums of all tasks, as they come back."""
    total, under_way, count = Sums(groups={}), 0, 0
    ready = next(tasks, None)
    while ready is not None or under_way:
        while ready is not None and under_way < crew.window:
            crew.submit(ready)
            under_way, ready = under_way + 1, next(tasks, None)
        finished = crew.next()
        under_way -= 1
        if finished.done is None:
            raise ArgumentError(f"records cannot be compressed: {finished.reason}")
        count += len(finished.task.addresses)
        total = total + finished.done
        progress(count)
    return total


def _window(addresses: Iterator[Address], request: Request, seen: list[Address]) -> int:
    """A window for all: that of the first record that can be read; `seen` gets what was tried."""
    reason = "there are none"
    for address in addresses:
        seen.append(address)
        for read in read_records([address], request):
            if read.record is not None:
                return compress(read.record).lags
            reason = read.reason
    raise ArgumentError(f"none of {len(seen)} records can be read; the last: {reason}")
