"""A scheduler that goes away and comes back: nothing lost, nothing done twice."""

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from dataclasses import dataclass

import pytest

import hmpim
from batch_support import FS, rounded
from hmpim.batch import pool
from hmpim.batch.parts import parts_in
from hmpim.batch.run import Cluster


@dataclass(frozen=True)
class Numbered:
    """A job that says which it is."""

    name: str

    def do(self):
        return self.name


class Promise:
    """A future of a scheduler in this process."""

    def __init__(self):
        self.status, self._told = "pending", lambda future: None

    def add_done_callback(self, told):
        self._told = told

    def ends(self, status, value=None):
        self.status, self._value = status, value
        self._told(self)

    def cancelled(self):
        return self.status == "cancelled"

    def result(self, timeout=None):
        return self._value


class Scheduler:
    """Does jobs when it is told to; one that goes takes the rest with it."""

    status = "running"

    def __init__(self):
        self.given = []

    def nthreads(self):
        return {"worker": 2}

    def submit(self, call, job, **options):
        self.given.append((job, Promise()))
        return self.given[-1][1]

    def does(self, k):
        job, promise = self.given[k]
        promise.ends("finished", job.do())

    def goes(self):
        self.status = "closed"
        for _, promise in self.given:
            if promise.status == "pending":
                promise.ends("cancelled")

    def close(self, timeout=None):
        self.status = "closed"


def test_what_was_under_way_is_given_again_and_no_more(monkeypatch):
    """One job is done before the scheduler goes; it is back at the second attempt."""
    first, second = Scheduler(), Scheduler()
    answers = [first, hmpim.errors.ArgumentError("not there"), second]

    def connect():
        answer = answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer

    monkeypatch.setattr(pool.time, "sleep", lambda seconds: None)
    said = []
    crew = pool._Dask(connect, lambda: None, 60.0, said.append)
    for name in "abc":
        crew.submit(Numbered(name))
    first.does(1)
    done = [crew.next().done]
    monkeypatch.setattr(second, "submit", _at_once(second))
    first.goes()
    done += [crew.next().done, crew.next().done]
    assert done == ["b", "a", "c"]
    assert [job.name for job, _ in second.given] == ["a", "c"]
    assert said[-1] == "the scheduler is back; 2 tasks are given again"
    assert (crew._under_way, answers) == ({}, [])


def _at_once(scheduler):
    """Jobs are done as soon as they are given."""
    give = scheduler.submit

    def submit(call, job, **options):
        promise = give(call, job, **options)
        promise.add_done_callback = lambda told: (
            setattr(promise, "_told", told),
            promise.ends("finished", job.do()),
        )
        return promise

    return submit


def test_patience_ends(monkeypatch):
    """A scheduler that stays away for longer is an error."""
    answers = [Scheduler()]

    def connect():
        if answers:
            return answers.pop()
        raise hmpim.errors.ArgumentError("there is no Dask scheduler at 'tcp://away:1'")

    monkeypatch.setattr(pool.time, "sleep", lambda seconds: None)
    crew = pool._Dask(connect, lambda: None, -1.0, lambda text: None)
    crew.submit(Numbered("a"))
    crew._client.goes()
    with pytest.raises(hmpim.HmpimError, match="no Dask scheduler at 'tcp://away:1'"):
        crew.next()


def test_workers_are_seen_to_while_others_bring_results(monkeypatch):
    """One that died does not wait until the others are idle."""
    scheduler, seen = Scheduler(), []
    crew = pool._Dask(lambda: scheduler, lambda: seen.append(len(seen)), 60.0, lambda text: None)
    monkeypatch.setattr(pool, "_LOOK", 0.0)
    for k in range(3):
        crew.submit(Numbered(str(k)))
        scheduler.does(k)
    assert [crew.next().done for _ in range(3)] == ["0", "1", "2"]
    assert seen == [0, 1, 2]


def test_a_result_that_went_with_its_worker_is_waited_for_while_workers_are_seen_to(monkeypatch):
    """A task is done, and its worker dies before the result is fetched: it is done once more."""
    scheduler, seen = Scheduler(), []
    crew = pool._Dask(lambda: scheduler, lambda: seen.append(len(seen)), 60.0, lambda text: None)
    monkeypatch.setattr(pool, "_LOOK", 0.0)
    crew.submit(Numbered("a"))
    scheduler.does(0)
    (_, promise) = scheduler.given[0]
    promise.status = "pending"
    fetch, asked = promise.result, []

    def result(timeout=None):
        asked.append(timeout)
        if len(asked) < 3:
            raise TimeoutError
        promise.status = "finished"
        return fetch()

    monkeypatch.setattr(promise, "result", result)
    assert crew.next().done == "a"
    assert (asked, seen, crew._under_way) == ([0.0] * 3, [0, 1, 2], {})


def test_workers_without_hmpim_are_named():
    """Asked before a task is given: each would die of it."""

    class Bare(Scheduler):
        def run(self, call, name, on_error):
            assert call(name).work.do_task is not None  # what they are to import is there
            return {"tcp://a": None, "tcp://b": ModuleNotFoundError("No module named 'hmpim'")}

    with pytest.raises(hmpim.HmpimError, match=r"worker tcp://b cannot import .*extra 'batch'"):
        pool._check_workers(Bare())


def started(*words: str) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-m", *words],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


@pytest.mark.study
def test_a_scheduler_of_its_own_comes_back(rows_file, tmp_path):
    """Scheduler and worker are killed together after two records, and started again."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    running: list[subprocess.Popen] = []

    def scheduler_and_worker() -> None:
        listen = ("--host", "127.0.0.1", "--port", str(port), "--no-dashboard")
        running.append(started("distributed.cli.dask_scheduler", *listen))
        worker = (address, "--nthreads", "1", "--no-nanny", "--no-dashboard", "--host", "127.0.0.1")
        running.append(started("distributed.cli.dask_worker", *worker))

    scheduler_and_worker()
    messages, before = [], {}

    def tick(state) -> None:
        if state.message:
            messages.append(state.message)
        if state.records >= 2 and not before:
            before.update({p.name: p.stat().st_mtime_ns for p in parts_in(tmp_path / "out")})
            for process in running[:2]:
                os.kill(process.pid, signal.SIGKILL)
                process.wait()
            scheduler_and_worker()

    try:
        until = time.monotonic() + 60
        while time.monotonic() < until:
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 1):
                break
            time.sleep(0.2)
        table = hmpim.batch(
            rows_file,
            out=tmp_path / "out",
            fs=FS,
            cluster=Cluster(scheduler=address, per_task=1, patience=120.0),
            progress=tick,
        )
    finally:
        for process in running:
            process.kill()
            process.wait()
    assert len(running) == 4
    assert any("is back" in message for message in messages), messages
    assert rounded(table, "scale_factor") == {f"{rows_file}#unit{k}": float(k) for k in range(1, 9)}
    after = {p.name: p.stat().st_mtime_ns for p in parts_in(tmp_path / "out")}
    assert len(table) == len(after) == 8
    assert before.items() <= after.items()  # what was done is not done again
