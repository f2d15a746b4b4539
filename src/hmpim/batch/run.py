"""Run a batch: tasks given out a few at a time, each part kept as soon as it is done."""

import os
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from itertools import chain, islice
from os import PathLike
from pathlib import Path

from hmpim.arguments import checked
from hmpim.batch.addresses import Address, File, addresses_of, find_files
from hmpim.batch.metadata import Beside, read_metadata
from hmpim.batch.parts import PARTS, Known, open_folder, write_part
from hmpim.batch.pool import Finished, Pool, check_workers, dask_pool, here_pool
from hmpim.batch.pooled import identify_groups
from hmpim.batch.reading import read_records
from hmpim.batch.request import Request
from hmpim.batch.rows import left_out, table_of
from hmpim.batch.table import BatchTable, open_table
from hmpim.batch.work import Done, Task, give_up
from hmpim.errors import ArgumentError
from hmpim.formats.readers.protocol import need

__all__ = ["Cluster", "Progress", "State", "batch", "portion"]

_SHARES = 4
"""Tasks that each worker has at least, so that none is idle while another ends."""

_FEWEST = 3
"""Records to a task at least: one takes as long as a task costs to give out and to write."""


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class Cluster:
    """Who does the work, and in what portions.

    Parameters
    ----------
    scheduler : str or None
        Address of a Dask scheduler, such as ``tcp://host:8786``. None starts one on this
        computer, on loopback.
    workers : int or None
        Processes on this computer; one for each core if None, and 0 for this process itself,
        without Dask.
    per_task : int
        Records that a worker does at once and that make one part; fewer where there are few in all.
    patience : float
        Seconds to wait for a scheduler that went away.

    Examples
    --------
    >>> Cluster().per_task
    100
    """

    scheduler: str | None = None
    workers: int | None = None
    per_task: int = 100
    patience: float = 600.0

    def __post_init__(self) -> None:
        if not 1 <= self.per_task <= 10_000:
            raise ArgumentError(
                f"per_task = {self.per_task} records is not a task size; give 1 to 10000, "
                "usually 50 to 200"
            )
        check_workers(self.workers)


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """How far a batch is.

    Parameters
    ----------
    records, total : int
        Done, earlier runs included, and known of so far, or reckoned from the rows read so far.
    repeated : int
        How many of those done were done by earlier runs.
    failures : int
        Records of this run that have a reason instead of parameters.
    elapsed : float
        Seconds since the first task was given out.
    message : str
        What a person should know just now; empty for nothing.
    """

    records: int
    total: int
    repeated: int
    failures: int
    elapsed: float
    message: str = ""

    @property
    def rate(self) -> float:
        """Records a second in this run."""
        return (self.records - self.repeated) / self.elapsed if self.elapsed > 0 else 0.0

    @property
    def left(self) -> float:
        """Seconds left at this rate; infinite before the first task is back."""
        return (self.total - self.records) / self.rate if self.rate > 0 else float("inf")


Progress = Callable[[State], None]


@checked
def batch(
    paths: str | PathLike[str] | Sequence[str | PathLike[str]],
    *,
    out: str | PathLike[str],
    inputs: Sequence[str] = (),
    outputs: Sequence[str] = (),
    fs: float | None = None,
    request: Request | None = None,
    cluster: Cluster | None = None,
    fresh: bool = False,
    progress: Progress | None = None,
) -> BatchTable:
    """Identify many records, and return one table of what was found.

    Each record becomes a row for each pair of its channels; one that cannot be read or identified
    becomes a row with the reason. Stopped at any time, the same call goes on where it was and
    repeats nothing.

    Parameters
    ----------
    paths : path or sequence of paths
        Folders, globs and files, local or any address that fsspec knows. A Parquet file with a
        column ``record``, or with a list in each cell, and an HDF5 file with a group a record,
        hold many.
    out : path-like
        Folder for the parts; made if need be.
    inputs, outputs : sequence of str
        Names of the channels; without, those that the files state, or the usual names.
    fs : float, optional
        Rate in Hz of records without time.
    request : Request, optional
        Everything else that may be asked; `inputs`, `outputs` and `fs` go before it.
    cluster : Cluster, optional
        Who does the work: one process for each core of this computer by default.
    fresh : bool
        True throws away what `out` holds of an earlier run.
    progress : callable, optional
        Told how far it is, after each task.

    Returns
    -------
    BatchTable
        Read lazily, by pandas or Polars.

    Raises
    ------
    ArgumentError
        If there are no records, `out` holds another batch, or a part cannot be written.
    MissingExtraError
        If the extra `batch` is not installed.

    Examples
    --------
    >>> import tempfile
    >>> from hmpim.formats import save
    >>> from hmpim.record import Record
    >>> import numpy as np
    >>> u = np.sin(np.arange(400) ** 2 / 1e3)
    >>> record = Record.from_arrays({"u": u}, {"y": 2 * u + 0.1}, fs=100.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save(record, f"{folder}/unit1.h5")
    ...     here = Cluster(workers=0)
    ...     table = batch(f"{folder}/unit1.h5", out=f"{folder}/out", cluster=here)
    ...     round(table.to_arrow()["scale_factor"][0].as_py(), 3)
    2.0
    """
    need("pyarrow", extra="batch", what="a batch of records")
    need("fsspec", extra="batch", what="a batch of records")
    given = [paths] if isinstance(paths, (str, PathLike)) else list(paths)
    asked = request or Request()
    asked = replace(
        asked,
        inputs=tuple(inputs) or asked.inputs,
        outputs=tuple(outputs) or asked.outputs,
        fs=asked.fs if fs is None else fs,
    )
    run = _Run(
        folder=Path(out).absolute(),
        request=asked,
        cluster=cluster or Cluster(),
        progress=progress or (lambda state: None),
    )
    if asked.pool_by:
        run.pooled([str(p) for p in given], fresh=fresh)
    else:
        run.all_of([str(p) for p in given], fresh=fresh)
    return open_table(out)


class _Run:
    """One run over a batch: counts, and what is still to be given out."""

    def __init__(
        self, *, folder: Path, request: Request, cluster: Cluster, progress: Progress
    ) -> None:
        self._folder, self._request, self._cluster = folder, request, cluster
        self._progress = progress
        self._beside = read_metadata(request.metadata, request.record_column)
        self._known = self._records = self._repeated = self._failures = 0
        self._begun = time.monotonic()

    def all_of(self, paths: Sequence[str], *, fresh: bool) -> None:
        """Do all records of these paths that are not done."""
        files = list(find_files(paths, without=self._folder))
        if not files:
            raise ArgumentError(f"there are no records at {', '.join(map(repr, paths))}")
        self._known = len(files)
        addresses = chain.from_iterable(self._counted(file) for file in files)
        first = next(addresses, None)
        if first is None:
            raise ArgumentError(f"the files at {', '.join(map(repr, paths))} hold no records")
        columns = self._columns(first)
        with open_folder(self._folder, self._request, columns, fresh=fresh) as metadata:
            done = Known(self._folder)
            left = self._left(chain([first], addresses), done)
            ahead = deque(islice(left, self._enough))
            if not ahead:
                self._tell()
                return
            with self._pool() as pool:
                self._begun = time.monotonic()
                self._tell()
                self._drive(pool, self._tasks(ahead, left, done, metadata))

    def pooled(self, paths: Sequence[str], *, fresh: bool) -> None:
        """Identify the records of each group as one; a group is a row."""
        if not any(True for _ in find_files(paths, without=self._folder)):
            raise ArgumentError(f"there are no records at {', '.join(map(repr, paths))}")
        asked = self._request
        columns = (asked.pool_by, "records")

        def tell(records: int) -> None:
            self._records = self._known = records
            self._tell()

        with open_folder(self._folder, asked, columns, fresh=fresh):
            groups, reasons = identify_groups(
                paths,
                lags=asked.lags,
                by="" if asked.pool_by == "all" else asked.pool_by,
                request=asked,
                pool=self._pool,
                per_task=self._cluster.per_task,
                progress=tell,
                without=self._folder,
            )
            whole = asked.keep == "results"
            rows = [row for group in groups for row in group.rows(asked.pool_by, whole=whole)]
            rows += [dict(left_out(name, reason)) for name, reason in reasons]
            part = self._folder / PARTS / f"{asked.digest[:24]}.parquet"
            write_part(table_of(rows, columns), part)

    def _pool(self) -> AbstractContextManager[Pool]:
        if self._cluster.workers == 0:
            return here_pool()
        return dask_pool(
            scheduler=self._cluster.scheduler,
            workers=self._cluster.workers,
            patience=self._cluster.patience,
            say=self._tell,
        )

    def _drive(self, pool: Pool, tasks: Iterator[Task]) -> None:
        """Keep the pool busy and no more than that."""
        under_way = 0
        again: list[Task] = []
        more = True
        while more or again or under_way:
            while under_way < pool.window and (more or again):
                task = again.pop() if again else next(tasks, None)
                if task is None:
                    more = False
                    continue
                pool.submit(task)
                under_way += 1
            if not under_way:
                continue
            finished = pool.next()
            under_way -= 1
            if finished.done is not None:
                self._count(finished.done)
            else:
                again += self._after_death(finished)

    def _after_death(self, finished: Finished) -> list[Task]:
        """A task that no worker survives, one record at a time; a record alone is given up."""
        task = finished.task
        if len(task.addresses) == 1:
            self._count(give_up(task, finished.reason))
            return []
        return [replace(task, addresses=(address,)) for address in task.addresses]

    def _count(self, done: Done) -> None:
        self._records += done.records
        self._failures += done.failures
        self._tell()

    def _tell(self, message: str = "") -> None:
        self._progress(
            State(
                records=self._records,
                total=self._known,
                repeated=self._repeated,
                failures=self._failures,
                elapsed=time.monotonic() - self._begun,
                message=message,
            )
        )

    def _counted(self, file: File) -> Iterator[Address]:
        """Records of a file, which counts as one until more is known of it."""
        others, listed = self._known - 1, 0

        def expect(count: int) -> None:
            self._known = others + max(count, listed)

        for address in addresses_of(file, self._request, expect):
            listed += 1
            self._known = max(self._known, others + listed)
            yield address
        self._known = others + listed

    def _columns(self, first: Address) -> tuple[str, ...]:
        """Columns of metadata: those of the table beside, and those of the first record."""
        read = next(read_records([first], self._request), None)
        own = () if read is None else tuple(read.metadata)
        return tuple(dict.fromkeys((*self._beside.columns, *own)))

    @property
    def _crew(self) -> int:
        """Processes at work, as far as that is known before they are there; 0 for this one."""
        if self._cluster.workers is not None:
            return self._cluster.workers
        return os.cpu_count() or 1

    def _left(self, addresses: Iterator[Address], done: Known) -> Iterator[Address]:
        """Those that have no rows yet; the others are counted."""
        for address in addresses:
            if address in done:
                self._repeated += 1
                self._records += 1
            else:
                yield address

    @property
    def _enough(self) -> int:
        """Records from which on all workers have whole tasks to do."""
        return self._cluster.per_task * max(_SHARES * self._crew, 1)

    def _tasks(
        self,
        ahead: deque[Address],
        left: Iterator[Address],
        done: Known,
        metadata: tuple[str, ...],
    ) -> Iterator[Task]:
        """Tasks that become smaller towards the end, so that all workers end at once."""
        while ahead:
            per_task = self._cluster.per_task
            size = portion(len(ahead), per_task=per_task, workers=self._crew)
            some = tuple(ahead.popleft() for _ in range(min(size, len(ahead))))
            ahead.extend(islice(left, self._enough - len(ahead)))
            done.drop(some)
            yield Task(
                addresses=some,
                request=self._request,
                folder=str(self._folder),
                metadata=metadata,
                joined=_joined(self._beside, some),
            )


def portion(known: int, *, per_task: int, workers: int) -> int:
    """Records to a task: fewer than asked for where that leaves workers without one.

    Parameters
    ----------
    known : int
        Records that are left, counted up to what is enough for all workers.
    per_task : int
        Records to a task where there are many.
    workers : int
        Processes at work; 0 for this one alone.

    Examples
    --------
    >>> [portion(n, per_task=100, workers=2) for n in (1, 8, 100, 500, 800)]
    [3, 3, 13, 63, 100]
    """
    if workers == 0:
        return per_task
    return max(min(per_task, _FEWEST), min(per_task, -(-known // (_SHARES * workers))))


def _joined(beside: Beside, addresses: Sequence[Address]) -> dict[str, dict[str, str]]:
    return {a.digest: beside.of(a) for a in addresses} if beside.rows else {}
