"""Records of one unit, or of a fleet, added up where they lie: one identification for each group.

Each task compresses its records to their statistics and adds up those of one group; what travels
is a few kilobytes for each group, never a sample. The sum is what one record of the whole history
would give, a bias for each record apart.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from itertools import chain, islice
from typing import Any

from hmpim.batch.addresses import Address, addresses_of, find_files
from hmpim.batch.metadata import Beside, read_metadata
from hmpim.batch.pool import Pool
from hmpim.batch.reading import read_records, reason_of
from hmpim.batch.request import Request
from hmpim.errors import ArgumentError
from hmpim.identify import Identification, Statistics, compress, identify

__all__ = ["Group", "Sums", "identify_groups"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sums:
    """Statistics of some records, by group, and why others are not among them."""

    groups: Mapping[str, tuple[int, Statistics]]
    reasons: tuple[tuple[str, str], ...] = ()

    def __add__(self, other: "Sums") -> "Sums":
        groups = dict(self.groups)
        for name, (count, statistics) in other.groups.items():
            if name in groups:
                before, known = groups[name]
                groups[name] = (before + count, known + statistics)
            else:
                groups[name] = (count, statistics)
        return Sums(groups=groups, reasons=(*self.reasons, *other.reasons))


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
    """

    name: str
    records: int
    statistics: Statistics
    result: Identification


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
            told = {**read.metadata, **self.beside.of(read.address)}
            try:
                if read.record is None:
                    raise ArgumentError(read.reason)
                statistics = compress(read.record, lags=self.lags)
                one = {told.get(self.by, "") if self.by else "all": (1, statistics)}
                total = total + Sums(groups=one)
            except Exception as error:  # it is said, and the others go on
                total = total + Sums(groups={}, reasons=((read.address.name, reason_of(error)),))
        return total


def identify_groups(
    paths: Sequence[str],
    *,
    lags: int,
    by: str = "",
    request: Request | None = None,
    pool: Callable[[], AbstractContextManager[Pool]],
    per_task: int = 100,
) -> tuple[tuple[Group, ...], tuple[tuple[str, str], ...]]:
    """Identify each group of records as one, without moving a sample.

    Parameters
    ----------
    paths : sequence of str
        As for `hmpim.batch`.
    lags : int
        Window in samples, the same for all: delay and settling time must fit into it.
    by : str
        Column of metadata whose values are the groups, such as a unit's serial number; empty for
        one model of all.
    request : Request, optional
        Which channels.
    pool : callable
        Gives who does the work, such as `hmpim.batch.pool.dask_pool`.
    per_task : int
        Records that a worker adds up at once.

    Returns
    -------
    groups : tuple of Group
        By name.
    reasons : tuple of (str, str)
        Records that are in none, and why.
    """
    asked = request or Request()
    beside = read_metadata(asked.metadata, asked.record_column)
    addresses = chain.from_iterable(addresses_of(file, asked) for file in find_files(paths))
    total: Any = Sums(groups={})
    with pool() as crew:
        under_way, more = 0, True
        while more or under_way:
            while more and under_way < crew.window:
                some = tuple(islice(addresses, per_task))
                if not some:
                    more = False
                    break
                crew.submit(
                    _Compress(addresses=some, request=asked, by=by, beside=beside, lags=lags)
                )
                under_way += 1
            if under_way:
                finished = crew.next()
                under_way -= 1
                if finished.done is None:
                    raise ArgumentError(f"records cannot be compressed: {finished.reason}")
                total = total + finished.done
    groups = tuple(
        Group(name=name, records=count, statistics=statistics, result=identify(statistics))
        for name, (count, statistics) in sorted(total.groups.items())
    )
    return groups, total.reasons
