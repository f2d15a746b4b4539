"""The worker as we see it: started when first needed, replaced when it dies."""

import atexit
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO, cast

import hmpim.errors
from hmpim.errors import ArgumentError, FormatError, HmpimError
from hmpim.formats.readers.protocol import Contents, Layout, Reader
from hmpim.formats.readers.worker.wire import Arrays, contents_from, receive, send, series_from
from hmpim.record import Series

__all__ = ["MEMORY", "TIME", "addressed", "close_worker", "shielded"]

MEMORY = 4.0
"""GiB of address space that the worker may take, unless ``HMPIM_READER_MEMORY`` says otherwise."""

TIME = 60.0
"""Seconds that a file may take, and 5 more for each MiB; ``HMPIM_READER_TIME`` sets the whole."""

_MODULE = "hmpim.formats.readers.worker.child"
_Answer = tuple[dict[str, Any], Arrays]


def shielded(reader: Reader) -> Reader:
    """Return a reader whose functions run in the worker, if it parses with code of others.

    Parameters
    ----------
    reader : Reader
        Any reader; one that is not `foreign` comes back as it is.
    """
    if not reader.foreign:
        return reader
    return replace(
        reader,
        channels=partial(_channels, reader.format, addressed(reader.channels)),
        read=partial(_read, reader.format, addressed(reader.read)),
    )


def addressed(function: Callable[..., object]) -> str:
    """Return where a function stands, as 'module:name'.

    Raises
    ------
    FormatError
        If it cannot be found there again, so that another process could not run it.

    Examples
    --------
    >>> addressed(shielded)
    'hmpim.formats.readers.worker.pool:shielded'
    >>> addressed(lambda: 0)
    Traceback (most recent call last):
    ...
    hmpim.errors.FormatError: the function '<lambda>' of a foreign reader must stand at the top \
level of a module that can be imported
    """
    module = getattr(function, "__module__", "")
    name = getattr(function, "__qualname__", repr(function))
    if getattr(sys.modules.get(module), name, None) is not function or module == "__main__":
        raise FormatError(
            f"the function {name!r} of a foreign reader must stand at the top level of a module "
            "that can be imported"
        )
    return f"{module}:{name}"


def _channels(form: str, function: str, path: Path, layout: Layout) -> Contents:
    message, _ = _asked(form, function, path, layout, None)
    return contents_from(message["contents"])


def _read(
    form: str, function: str, path: Path, names: Sequence[str], layout: Layout
) -> tuple[Series, ...]:
    message, arrays = _asked(form, function, path, layout, list(names))
    return series_from(message["series"], arrays)


@dataclass(slots=True, kw_only=True)
class _Worker:
    """A process that reads files, what it was asked in all, and since it last died."""

    process: subprocess.Popen[bytes]
    scratch: tempfile.TemporaryDirectory[str]
    owner: int
    limits: tuple[int, float | None]
    requests: int = 0
    asked: int = 0
    peak: int = 0


class _DiedError(Exception):
    """The worker is gone; the message says how."""


class _MemoryError(Exception):
    """The worker has not enough memory for a file."""


_LOCK = threading.Lock()
_STATE: dict[str, _Worker] = {}


def _asked(
    form: str, function: str, path: Path, layout: Layout, names: list[str] | None
) -> _Answer:
    """One answer of the worker; a second is asked of a new one if the first was not fresh."""
    request = {
        "function": function,
        "file": str(path.absolute()),
        "names": names,
        "layout": asdict(layout),
    }
    with _LOCK:
        memory, seconds = limits = _limits()
        allowed = seconds or TIME + 5.0 * _mebibytes(path)
        while True:
            worker = _worker(limits)
            fresh = worker.asked == 0
            try:
                return _one(worker, request, path, form, allowed)
            except (_DiedError, _MemoryError) as error:
                # What an earlier file left behind must not be blamed on this one.
                if fresh:
                    raise FormatError(_told(error, path, form, memory)) from None
            except BaseException as error:
                if not isinstance(error, HmpimError):  # interrupted: it may be in the middle
                    close_worker()
                raise


def _told(error: Exception, path: Path, form: str, memory: int) -> str:
    if isinstance(error, _MemoryError):
        return (
            f"{path.name!r} needs more than the {memory / 2**30:g} GiB that reading a file may "
            f"take; it is damaged, or so large that HMPIM_READER_MEMORY must be raised (in GiB)"
        )
    return f"{path.name!r} cannot be read as {form}: {error}"


def _one(
    worker: _Worker, request: dict[str, Any], path: Path, form: str, seconds: float
) -> _Answer:
    process = worker.process
    start = time.monotonic()
    # The worker ends itself in time; this is for one that cannot.
    timer = threading.Timer(seconds + 10.0, process.kill)
    timer.daemon = True
    timer.start()
    worker.requests += 1
    worker.asked += 1
    try:
        send(
            cast(BinaryIO, process.stdin),
            {**request, "seconds": seconds, "id": worker.requests},
            (),
        )
        answer = _answered(worker)
    except BrokenPipeError:
        answer = None
    except ValueError as error:
        close_worker()
        raise _DiedError(f"the reader answered with nonsense ({error})") from None
    finally:
        timer.cancel()
    if answer is not None and "died" not in answer[0]:
        worker.peak = answer[0]["peak"]
        if answer[0].get("error") == "memory":  # it ends itself
            if receive(cast(BinaryIO, process.stdout), limit=0) is None:
                close_worker()
            worker.asked = 0
        _raise(answer[0], path, form)
        return answer
    if answer is None:
        close_worker()
    worker.asked = 0
    if time.monotonic() - start >= seconds:
        raise _DiedError(
            f"it is not done after {seconds:.3g} s; it is damaged, or so large that "
            "HMPIM_READER_TIME must be raised (in s)"
        )
    how = _end(process.wait() if answer is None else answer[0]["died"])
    raise _DiedError(f"the reader {how}; the file is damaged, copy it again")


def _answered(worker: _Worker) -> _Answer | None:
    """The answer to the last request, or word of a death; None where all is gone."""
    while True:
        answer = receive(cast(BinaryIO, worker.process.stdout), limit=worker.limits[0])
        if answer is None or "died" in answer[0] or answer[0]["id"] == worker.requests:
            return answer


def _raise(message: dict[str, Any], path: Path, form: str) -> None:
    """Raise what went wrong over there."""
    kind = message.get("error")
    if kind is None:
        return
    if kind == "memory":
        raise _MemoryError
    if kind == "damaged":
        raise FormatError(
            f"{path.name!r} is damaged, or not the {form} file it starts as "
            f"({message['message']}); copy it again, or export it anew"
        )
    error = getattr(hmpim.errors, kind, FormatError)
    raise error(message["message"])


def _end(code: int) -> str:
    if code >= 0:
        return f"ended by itself with code {code}"
    try:
        return f"crashed ({signal.Signals(-code).name})"
    except ValueError:
        return f"crashed (signal {-code})"


def _worker(limits: tuple[int, float | None]) -> _Worker:
    """The worker there is, or a new one."""
    worker = _STATE.get("worker")
    if worker is not None and worker.owner != os.getpid():  # forked off: it is another's
        _STATE.clear()
        worker = None
    if worker is not None and (worker.limits != limits or worker.process.poll() is not None):
        close_worker()
        worker = None
    if worker is None:
        worker = _started(limits)
        _STATE["worker"] = worker
    return worker


def _started(limits: tuple[int, float | None]) -> _Worker:
    path = [entry or os.getcwd() for entry in sys.path]
    one = dict.fromkeys(
        ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS"), "1"
    )
    scratch = tempfile.TemporaryDirectory(prefix="hmpim-reader-")
    environment = {
        **os.environ,
        **dict.fromkeys(("TMPDIR", "TEMP", "TMP"), scratch.name),
        **one,  # each thread takes address space
        "PYTHONPATH": os.pathsep.join(path),
        "ARROW_DEFAULT_MEMORY_POOL": "system",
        "MPLBACKEND": "Agg",
    }
    settings = json.dumps({"path": path, "memory": limits[0]})
    try:
        process = subprocess.Popen(
            [sys.executable, "-m", _MODULE, settings],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=environment,
        )
    except OSError as error:
        raise FormatError(
            f"the process that reads third-party formats cannot be started: {error}"
        ) from None
    return _Worker(process=process, scratch=scratch, owner=os.getpid(), limits=limits)


def close_worker() -> None:
    """End the worker, if there is one; the next file starts another."""
    worker = _STATE.pop("worker", None)
    if worker is None or worker.owner != os.getpid():
        return
    worker.process.kill()
    for pipe in (worker.process.stdin, worker.process.stdout):
        if pipe is not None:
            try:
                pipe.close()
            except OSError:  # what was still to be written to it
                continue
    worker.process.wait()
    worker.scratch.cleanup()


atexit.register(close_worker)


def _limits() -> tuple[int, float | None]:
    """Bytes of memory, and seconds if a person states them."""
    memory = _number("HMPIM_READER_MEMORY")
    return int((memory or MEMORY) * 2**30), _number("HMPIM_READER_TIME")


def _number(variable: str) -> float | None:
    text = os.environ.get(variable)
    if not text:
        return None
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value < 1e6:
        raise ArgumentError(f"{variable}={text!r} is not a positive number; write it as 8")
    return value


def _mebibytes(path: Path) -> float:
    try:
        return path.stat().st_size / 2**20
    except OSError:
        return 0.0
