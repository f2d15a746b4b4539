"""Run a Monte Carlo study: some draws a task, each part kept, nothing done twice."""

import hashlib
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from hmpim.batch.montecarlo.draw import one_draw
from hmpim.batch.montecarlo.plan import Plan
from hmpim.batch.parts import write_part
from hmpim.batch.pool import Pool
from hmpim.batch.rows import PARAMETERS
from hmpim.errors import ArgumentError

__all__ = ["Draws", "run_montecarlo"]

_PER_TASK = 20
_ENDS = ("", "_std", "_low", "_high", "_true", "_bound")


@dataclass(frozen=True, slots=True, kw_only=True)
class Draws:
    """Some draws of a study, which one worker does at once.

    Parameters
    ----------
    plan : Plan
        What is drawn.
    start, stop : int
        Numbers of the draws.
    folder : str
        Where the part goes.
    """

    plan: Plan
    start: int
    stop: int
    folder: str

    @property
    def name(self) -> str:
        """Name of the part."""
        told = hashlib.sha256(self.plan.digest.encode()).hexdigest()[:12]
        return f"{told}-{self.start:08d}-{self.stop:08d}.parquet"

    @property
    def path(self) -> Path:
        """Where it writes."""
        return Path(self.folder) / self.name

    def do(self) -> int:
        """Do the draws, unless their part is there; return how many there are."""
        if not self.path.exists():
            import pyarrow as pa

            rows = [one_draw(self.plan, k) for k in range(self.start, self.stop)]
            write_part(pa.Table.from_pylist(rows, schema=_schema(self.plan.varied)), self.path)
        return self.stop - self.start


@cache
def _schema(varied: tuple[str, ...]) -> Any:
    import pyarrow as pa

    words = ("structure_true", "structure", "verdict", "reason")
    fields = [pa.field("draw", pa.int64())]
    fields += [pa.field(name, pa.string()) for name in words]
    fields += [
        pa.field(name, pa.string() if name.endswith(".structure") else pa.float64())
        for name in varied
    ]
    fields += [pa.field(name + end, pa.float64()) for name in PARAMETERS for end in _ENDS]
    return pa.schema(fields)


def run_montecarlo(
    plan: Plan,
    folder: Path,
    *,
    pool: Callable[[], AbstractContextManager[Pool]],
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Any:
    """Do all draws that are not done, and return all of them.

    Parameters
    ----------
    plan : Plan
        What is drawn.
    folder : Path
        Where the parts are kept; made if need be. Those of another plan are left alone.
    pool : callable
        Gives who does the work; asked only if there is some.
    progress : callable
        Told draws done and draws in all.

    Returns
    -------
    pyarrow.Table
        One row a draw, by number: the same whatever the number of workers.

    Raises
    ------
    ArgumentError
        If the folder cannot be made, or a part not written.
    """
    from pyarrow import concat_tables, parquet

    try:
        (folder / "draws").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ArgumentError(f"{str(folder)!r} cannot be made: {error.strerror}") from None
    tasks = [
        Draws(plan=plan, start=k, stop=min(k + _PER_TASK, plan.draws), folder=str(folder / "draws"))
        for k in range(0, plan.draws, _PER_TASK)
    ]
    missing = [task for task in tasks if not task.path.exists()]
    done = plan.draws - sum(task.stop - task.start for task in missing)
    progress(done, plan.draws)
    if missing:
        with pool() as crew:
            under_way = 0
            waiting = iter(missing)
            more = True
            while more or under_way:
                while more and under_way < crew.window:
                    task = next(waiting, None)
                    if task is None:
                        more = False
                        break
                    crew.submit(task)
                    under_way += 1
                if under_way:
                    finished = crew.next()
                    under_way -= 1
                    if finished.done is None:
                        raise ArgumentError(
                            f"draws {finished.task.name} cannot be done: {finished.reason}"
                        )
                    done += finished.done
                    progress(done, plan.draws)
    return concat_tables([parquet.read_table(task.path) for task in tasks])
