"""One task: some records read, identified, and written as one part."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hmpim.batch.addresses import Address
from hmpim.batch.alike import Together, identified_together
from hmpim.batch.parts import PARTS, part_name, write_part
from hmpim.batch.reading import Read, read_items
from hmpim.batch.request import Request
from hmpim.batch.rows import Row, failed, rows_of, table_of
from hmpim.batch.samples import Samples, reason_of
from hmpim.identify import PairIdentification, identify

__all__ = ["Done", "Task", "do_task", "give_up"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """Records that one worker does at once.

    Parameters
    ----------
    addresses : tuple of Address
        Where they are.
    request : Request
        What is asked of each.
    folder : str
        The batch's folder.
    metadata : tuple of str
        Columns of metadata.
    joined : mapping of str to mapping of str to str
        Metadata by the digest of a record, from a file beside.
    """

    addresses: tuple[Address, ...]
    request: Request
    folder: str
    metadata: tuple[str, ...] = ()
    joined: Mapping[str, Mapping[str, str]]

    @property
    def name(self) -> str:
        """Name of the part that it writes."""
        return part_name(self.addresses, self.request)

    @property
    def path(self) -> Path:
        """Where it writes."""
        return Path(self.folder) / PARTS / self.name

    def do(self) -> "Done":
        """Do it, as `do_task`."""
        return do_task(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Done:
    """What a task did.

    Parameters
    ----------
    records, failures : int
        How many records, and how many of them have a reason instead of parameters.
    reading, identifying, writing : float
        Seconds.
    """

    records: int
    failures: int = 0
    reading: float = 0.0
    identifying: float = 0.0
    writing: float = 0.0


def do_task(task: Task) -> Done:
    """Do a task, unless its part is there; what is wrong with a record becomes its row.

    Raises
    ------
    ArgumentError
        If the part cannot be written.
    """
    if task.path.exists():
        return Done(records=len(task.addresses))
    begin = time.perf_counter()
    items = list(read_items(task.addresses, task.request))
    read_by = time.perf_counter()
    found = _found(task, items)
    done_by = time.perf_counter()
    write_part(_table(found, task), task.path)
    return Done(
        records=len(task.addresses),
        failures=sum(row.get("reason") is not None for row in found.rows),
        reading=read_by - begin,
        identifying=done_by - read_by,
        writing=time.perf_counter() - done_by,
    )


def give_up(task: Task, reason: str) -> Done:
    """Write rows that say why for the records of a task that no worker survived."""
    if not task.path.exists():
        rows = [failed(address, reason, _joined(address, task)) for address in task.addresses]
        write_part(table_of(rows, task.metadata), task.path)
    return Done(records=len(task.addresses), failures=len(task.addresses))


def _found(task: Task, items: Sequence[Read | Samples]) -> Together:
    """What is said of each record, together where that is asked for and pays."""

    def told(item: Read | Samples) -> Mapping[str, str]:
        own = {**item.metadata, **_joined(item.address, task)}
        return {name: own[name] for name in task.metadata if name in own}

    def one(read: Read) -> tuple[Sequence[Row], PairIdentification | None]:
        return _identified(replace(read, metadata=told(read)), task.request)

    return identified_together(items, task.request, one, told=told, metadata=task.metadata)


def _table(found: Together, task: Task) -> Any:
    """One table of all."""
    import pyarrow as pa

    if not found.rows:
        return pa.concat_tables(found.tables)
    return pa.concat_tables([table_of(found.rows, task.metadata), *found.tables])


def _joined(address: Address, task: Task) -> Mapping[str, str]:
    return task.joined.get(address.digest, {})


def _identified(read: Read, request: Request) -> tuple[Sequence[Row], PairIdentification | None]:
    """Rows of one record, and its pair if it has one."""
    if read.record is None:
        return [failed(read.address, read.reason, read.metadata)], None
    begin = time.thread_time()  # of the processor: others may be at work on this computer
    try:
        result = identify(
            read.record,
            intersample=request.intersample,
            structures=request.structures or None,
        )
        seconds = time.thread_time() - begin
        rows = rows_of(read, result, seconds=seconds, whole=request.keep == "results")
    except Exception as error:  # bad data, or a defect that one record meets: the others go on
        return [failed(read.address, reason_of(error), read.metadata)], None
    return rows, result.pairs[0] if len(result.pairs) == 1 else None
