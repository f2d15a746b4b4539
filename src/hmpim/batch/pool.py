"""Who does the tasks: Dask's workers, on this computer or on a cluster.

On this computer the scheduler lives in this process and each worker in one of its own, on loopback
alone; a worker that dies is started again. On a cluster the scheduler may go away: what was given
to it is given again once it is back, and what was finished meanwhile is found done.
"""

import contextlib
import logging
import os
import queue
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Protocol

from hmpim.errors import ArgumentError, HmpimError
from hmpim.formats.readers.protocol import need

__all__ = ["Finished", "Pool", "check_workers", "dask_pool", "here_pool"]

_AHEAD = 2
"""Tasks for each thread that are given out before the first is back: none waits for its next."""

_LOOK = 1.0
"""Seconds after which it is looked whether scheduler and workers are still there."""

_RESTARTS = 200
"""Workers of this computer started again, beyond which something else is wrong."""

_UNWATCHED = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "500ms",
    "distributed.admin.system-monitor.interval": "5s",
    "distributed.admin.system-monitor.gil.enabled": False,
}
"""What Dask does beside the work of its own cluster, for a dashboard that is not there.

Its profiler alone, which looks at the stack every 10 ms, takes 5 to 8 % of the processor time of
`identify`.
"""

_READY = "hmpim.batch.ready"
"""What a worker imports before it is given anything."""

_ALL_THERE = 10.0
"""Seconds to wait for the other workers of this computer once one is there."""

Say = Callable[[str], None]


class Job(Protocol):
    """Some work that travels: its name, unlike any other's, and how it is done."""

    @property
    def name(self) -> str:
        """Name of the part that it writes."""

    def do(self) -> Any:
        """Do it; what is given back is small."""


def do_job(job: Job) -> Any:
    """Do a job; this is what a worker is told to call."""
    return job.do()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Finished:
    """A task that came back.

    Parameters
    ----------
    task : Job
        Which.
    done : object
        What it gave back; None if its worker died, time and again.
    reason : str
        How it died.
    """

    task: Any
    done: Any
    reason: str = ""


class Pool(Protocol):
    """What does tasks."""

    @property
    def window(self) -> int:
        """How many tasks may be under way at once."""

    def submit(self, task: Job) -> None:
        """Take a task."""

    def next(self) -> Finished:
        """Wait for a task that is finished."""


class _Here:
    """Tasks done in this process, one after the other."""

    window = 1

    def __init__(self) -> None:
        self._waiting: list[Job] = []

    def submit(self, task: Job) -> None:
        self._waiting.append(task)

    def next(self) -> Finished:
        task = self._waiting.pop(0)
        return Finished(task=task, done=task.do())


@contextlib.contextmanager
def here_pool() -> Iterator[Pool]:
    """Do all in this process: for a handful of records, and to look for defects."""
    yield _Here()


class _Dask:
    """Tasks done by Dask's workers."""

    def __init__(
        self, connect: Callable[[], Any], tend: Callable[[], None], patience: float, say: Say
    ) -> None:
        self._connect, self._tend = connect, tend
        self._patience, self._say = patience, say
        self._client = connect()
        self._under_way: dict[str, tuple[Job, Any]] = {}
        self._back: queue.SimpleQueue[tuple[str, Any]] = queue.SimpleQueue()
        self._threads, self._looked, self._tended = 1, 0.0, time.monotonic()
        self._turn = 0

    @property
    def window(self) -> int:
        now = time.monotonic()
        if now - self._looked > _LOOK:
            with contextlib.suppress(OSError, TimeoutError):
                self._threads = max(sum(self._client.nthreads().values()), 1)
            self._looked = now
        return _AHEAD * self._threads

    def submit(self, task: Job) -> None:
        self._turn += 1
        key = f"{task.name}-{self._turn}"
        future = self._client.submit(do_job, task, key=key, pure=False)
        self._under_way[key] = (task, future)
        future.add_done_callback(lambda f: self._back.put((key, f)))

    def next(self) -> Finished:
        while True:
            self._look()
            try:
                key, future = self._back.get(timeout=_LOOK)
            except queue.Empty:
                continue
            if key not in self._under_way:
                continue  # of a scheduler that is gone
            if future.cancelled() or future.status in ("cancelled", "lost"):
                self._again()
                continue
            task, _ = self._under_way[key]
            finished = _finished(task, future)
            if finished is None:  # see to the workers, and ask again
                self._back.put((key, future))
                continue
            del self._under_way[key]
            return finished

    def _look(self) -> None:
        """See to the workers and the scheduler now and then, however quickly tasks come back."""
        if time.monotonic() - self._tended < _LOOK:
            return
        self._tend()
        if self._client.status not in ("running", "connecting"):
            self._again()
        self._tended = time.monotonic()

    def _again(self) -> None:
        """Connect anew, and give all that is under way again."""
        self._say("the scheduler is gone; waiting for it to come back")
        with contextlib.suppress(Exception):
            self._client.close(timeout=2)
        until = time.monotonic() + self._patience
        while True:
            try:
                self._client = self._connect()
                break
            except ArgumentError:
                if time.monotonic() > until:
                    raise
                time.sleep(1.0)
        tasks = [task for task, _ in self._under_way.values()]
        self._under_way.clear()
        self._say(f"the scheduler is back; {len(tasks)} tasks are given again")
        for task in tasks:
            self.submit(task)

    def close(self) -> None:
        """Take back what is under way."""
        with contextlib.suppress(Exception):
            self._client.cancel([future for _, future in self._under_way.values()], force=True)
        with contextlib.suppress(Exception):
            self._client.close(timeout=5)


def _finished(task: Job, future: Any) -> Finished | None:
    """What a task came to; None where its worker died with it, so that it is done again."""
    from distributed.scheduler import KilledWorker

    try:
        done = future.result(timeout=_LOOK)
    except TimeoutError as error:
        if future.status != "error":
            return None
        raise ArgumentError(f"a worker cannot do its task: {error}") from error
    except KilledWorker as error:
        died = f"its worker died {error.allowed_failures + 1} times"
        return Finished(task=task, done=None, reason=f"{died} (memory, or code that crashes)")
    except HmpimError:
        raise
    except Exception as error:  # of a worker that cannot run the task at all
        raise ArgumentError(
            f"a worker cannot do its task: {type(error).__name__}: {error}; give it this version "
            "of hmpim with the extra 'batch'"
        ) from error
    return Finished(task=task, done=done)


def check_workers(workers: int | None) -> None:
    """Refuse a number of processes that cannot be started.

    Raises
    ------
    ArgumentError
        If it is negative, or beyond 1024.
    """
    if workers is not None and not 0 <= workers <= 1024:
        raise ArgumentError(f"workers = {workers}; give a number of processes, or 0")


def _nothing() -> None:
    """What a cluster of somebody else asks to be done for it."""


@contextlib.contextmanager
def dask_pool(
    *,
    scheduler: str | None = None,
    workers: int | None = None,
    patience: float = 600.0,
    say: Say = lambda text: None,
) -> Iterator[Pool]:
    """Have tasks done by a cluster that is there, or by one on this computer.

    Parameters
    ----------
    scheduler : str, optional
        Address of a Dask scheduler; without, one is started here, on loopback.
    workers : int, optional
        Processes on this computer, one thread each; one for each core by default.
    patience : float
        Seconds to wait for a scheduler that went away, and for a first worker.
    say : callable
        Told what a person should know meanwhile.

    Raises
    ------
    ArgumentError
        If there is no such scheduler, it has no workers, or they have no hmpim.
    """
    check_workers(workers)
    distributed = need("distributed", extra="batch", what="a batch of records")
    for name in ("distributed", "distributed.client"):  # Dask gives the second a level of its own
        logging.getLogger(name).setLevel(logging.CRITICAL)
    with contextlib.ExitStack() as stack:
        tend, expected = _nothing, 1
        if scheduler is None:
            stack.enter_context(need("dask", extra="batch", what="a batch").config.set(_UNWATCHED))
            local = stack.enter_context(
                distributed.LocalCluster(
                    n_workers=0,
                    host="127.0.0.1",
                    dashboard_address=None,
                    # Without its dashboard Dask still serves HTTP, at one port for all.
                    scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
                    silence_logs=logging.CRITICAL,
                )
            )
            scheduler = str(local.scheduler_address)
            expected = workers or os.cpu_count() or 1
            crew = _Crew(scheduler, expected)
            stack.callback(crew.stop)
            tend = crew.tend
        where = scheduler

        def connect() -> Any:
            client = _client(distributed, where, tend, patience, expected)
            if tend is _nothing:
                _check_workers(client)
            return client

        pool = _Dask(connect, tend, patience, say)
        stack.callback(pool.close)
        yield pool


def _client(
    distributed: Any, scheduler: str, tend: Callable[[], None], patience: float, expected: int
) -> Any:
    try:
        client = distributed.Client(scheduler, timeout=10, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise ArgumentError(
            f"there is no Dask scheduler at {scheduler!r} ({' '.join(str(error).split())[:100]}); "
            "start one with: dask scheduler"
        ) from None
    until = time.monotonic() + min(patience, 60.0)
    while not client.nthreads():
        tend()
        if time.monotonic() > until:
            client.close()
            raise ArgumentError(
                f"the scheduler {scheduler} has no workers; start some with: dask worker "
                f"{scheduler}"
            )
        time.sleep(0.05)
    until = time.monotonic() + _ALL_THERE
    while len(client.nthreads()) < expected and time.monotonic() < until:
        tend()
        time.sleep(0.05)
    return client


def _check_workers(client: Any) -> None:
    """Have each worker import what it needs: one that cannot would die of its first task."""
    told = client.run(import_module, _READY, on_error="return")
    for address, found in told.items():
        if isinstance(found, Exception):
            client.close()
            raise ArgumentError(
                f"the worker {address} cannot import hmpim ({found}); give it this version with "
                "the extra 'batch'"
            )


class _Crew:
    """Workers of this computer, one process each; one that dies is started again."""

    def __init__(self, scheduler: str, count: int) -> None:
        self._scheduler = scheduler
        self._left = _RESTARTS
        self._processes = [self._start() for _ in range(count)]

    def tend(self) -> None:
        """Start again what died."""
        for k, process in enumerate(self._processes):
            if process.poll() is not None:
                self._left -= 1
                if self._left < 0:
                    raise ArgumentError(
                        f"workers died {_RESTARTS} times, the last with code {process.returncode}; "
                        "look for what kills them (memory, most often)"
                    )
                self._processes[k] = self._start()

    def _start(self) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "distributed.cli.dask_worker", self._scheduler]
        options = {
            "--nthreads": "1",
            "--host": "127.0.0.1",
            "--death-timeout": "20",
            "--preload": _READY,
            "--dashboard-address": "127.0.0.1:0",  # else its HTTP server is there for everybody
        }
        single = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
        logs = {"DASK_LOGGING__DISTRIBUTED": "critical"}
        told = {
            "DASK_" + name.replace(".", "__").replace("-", "_").upper(): str(value)
            for name, value in _UNWATCHED.items()
        }
        return subprocess.Popen(
            [
                *command,
                "--no-nanny",
                "--no-dashboard",
                *(x for pair in options.items() for x in pair),
            ],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env={**os.environ, **single, **logs, **told},
        )

    def stop(self) -> None:
        """End all of them."""
        for process in self._processes:
            process.terminate()
        for process in self._processes:
            try:
                process.wait(timeout=5)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
