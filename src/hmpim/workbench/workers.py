"""Heavy work in processes of its own, so that no page ever waits for another's fit."""

import asyncio
import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import ParamSpec, TypeVar

from hmpim.errors import HmpimError
from hmpim.workbench.processes import process_context

__all__ = ["Latest", "Workers"]

P = ParamSpec("P")
R = TypeVar("R")


class Workers:
    """A few processes that take one piece of work after another.

    Parameters
    ----------
    count : int
        How many; 0 for two, one of them for what is short.
    """

    def __init__(self, count: int = 0) -> None:
        self._count = count or min(2, os.cpu_count() or 1)
        self._pool: ProcessPoolExecutor | None = None
        self._quick: ProcessPoolExecutor | None = None

    def start(self) -> None:
        """Begin the processes before the first work comes."""
        context = process_context()
        self._pool = ProcessPoolExecutor(self._count, mp_context=context, initializer=_ready)
        self._quick = ProcessPoolExecutor(1, mp_context=context, initializer=_ready)
        self._quick.submit(_nothing)
        self._pool.submit(_nothing)

    def stop(self) -> None:
        """End them; what is under way is not awaited."""
        pools, self._pool, self._quick = (self._pool, self._quick), None, None
        for pool in pools:
            if pool is not None:
                for process in list((pool._processes or {}).values()):
                    process.kill()
                pool.shutdown(wait=False, cancel_futures=True)

    async def do(self, work: Callable[P, R], *arguments: P.args, **named: P.kwargs) -> R:
        """Do something that may take long, and return what it gives.

        Raises
        ------
        HmpimError
            What the work raised, or that its process was killed.
        """
        return await self._in(self._pool, work, *arguments, **named)

    async def soon(self, work: Callable[P, R], *arguments: P.args, **named: P.kwargs) -> R:
        """Do something short, in a process that has nothing long to do."""
        return await self._in(self._quick, work, *arguments, **named)

    async def _in(
        self,
        pool: ProcessPoolExecutor | None,
        work: Callable[P, R],
        *arguments: P.args,
        **named: P.kwargs,
    ) -> R:
        if pool is None:
            raise HmpimError("the workbench is not started")
        try:
            return await asyncio.wrap_future(pool.submit(work, *arguments, **named))
        except BrokenProcessPool as error:
            if pool in (self._pool, self._quick):  # else they were begun anew, or are stopped
                self.stop()
                self.start()
            raise HmpimError(
                "the process that worked on it ended, perhaps for lack of memory; try again"
            ) from error


class Latest:
    """Of many wishes only the latest counts: a slider is faster than a design.

    While one is worked on, only the newest of those that come is kept.
    """

    def __init__(self) -> None:
        self._busy = False
        self._next: Callable[[], object] | None = None

    @property
    def newer(self) -> bool:
        """Whether a newer wish waits: what is left of this one need not be done."""
        return self._next is not None

    async def __call__(self, step: Callable[[], object]) -> None:
        """Take a coroutine function; run it now, or after the one that runs."""
        self._next = step
        if self._busy:
            return
        self._busy = True
        try:
            while self._next is not None:
                now, self._next = self._next, None
                result = now()
                if asyncio.iscoroutine(result):
                    await result
        finally:
            self._busy = False


def _ready() -> None:
    """Import what takes long, and leave Ctrl-C to the parent."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    import hmpim.identify
    import hmpim.plots
    import hmpim.stimulus  # noqa: F401


def _nothing() -> None:
    return None
