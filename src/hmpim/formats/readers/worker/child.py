"""What the worker runs: one request after another, under limits that it cannot lift.

``python -m hmpim.formats.readers.worker.child`` reads requests from standard input and answers
on standard output. What reads starts no program, opens no connection, writes nothing but temporary
files, and unpickles nothing.
"""

import contextlib
import errno
import faulthandler
import gc
import importlib
import json
import os
import signal
import sys
import warnings
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import hmpim.errors
from hmpim.formats.readers.protocol import Layout
from hmpim.formats.readers.worker.wire import pack_series, receive, send

__all__ = ["main"]

_FORBIDDEN = (
    *("subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "os.spawn", "os.startfile"),
    *("socket.connect", "socket.bind", "socket.sendto", "socket.getaddrinfo"),
    *("pickle.find_class", "os.remove", "os.rename", "os.chmod", "os.link", "os.symlink"),
)
"""Events of the interpreter that reading a file has no need of."""


def main() -> None:
    """Answer requests until the other end is gone."""
    settings = json.loads(sys.argv[1])
    sys.path[:] = settings["path"]
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # who starts us ends us
    requests, answers = os.dup(0), os.dup(1)
    nothing = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):  # what a library prints goes nowhere
        os.dup2(nothing, stream)
    warnings.simplefilter("ignore")
    if not sys.platform.startswith("linux"):
        _serve(requests, answers, settings["memory"])
        return
    # What reads is a fork of what has imported everything: replacing it takes no time.
    while True:
        life = os.fork()
        if not life:
            _die_with_parent()
            _serve(requests, answers, settings["memory"])
            os._exit(0)
        _, status = os.waitpid(life, 0)
        code = os.waitstatus_to_exitcode(status)
        if code == 0:  # the other end is gone
            return
        try:
            with os.fdopen(answers, "wb", closefd=False) as pipe:
                send(pipe, {"died": code}, ())
        except BrokenPipeError:
            return


def _serve(requests: int, answers: int, memory: int) -> None:
    _limit_memory(memory)
    _forbid()
    pipe, reply = os.fdopen(requests, "rb"), os.fdopen(answers, "wb")
    gc.freeze()  # what is imported stays: no collection need look at it again
    imported = len(sys.modules)
    while (request := receive(pipe, limit=0)) is not None:
        with open(os.devnull, "w") as silent:
            # A thread that needs nothing of Python, so it also ends what never lets Python in.
            faulthandler.dump_traceback_later(request[0]["seconds"], exit=True, file=silent)
            message, arrays = _answer(request[0])
            faulthandler.cancel_dump_traceback_later()
        try:
            send(reply, {**message, "id": request[0]["id"], "peak": _peak()}, arrays)
        except BrokenPipeError:
            return
        if message.get("error") == "memory":
            os._exit(1)  # what a library keeps would be lost for the next file
        del message, arrays
        gc.collect()
        if len(sys.modules) > imported:  # a library that this file needed
            gc.freeze()
            imported = len(sys.modules)


def _die_with_parent() -> None:
    """Ask Linux to end this process when its parent ends."""
    import ctypes

    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)


def _answer(request: dict[str, Any]) -> tuple[dict[str, Any], Sequence[NDArray[np.float64]]]:
    try:
        function = _function(request["function"])
        layout = Layout(**request["layout"])
        path = Path(request["file"])
        if request["names"] is None:
            return {"contents": asdict(function(path, layout))}, ()
        series, arrays = pack_series(function(path, request["names"], layout))
        return {"series": series}, arrays
    except MemoryError:
        return {"error": "memory", "message": ""}, ()
    except hmpim.errors.HmpimError as error:
        return {"error": type(error).__name__, "message": str(error)}, ()
    except RecursionError:
        return {"error": "damaged", "message": "it is nested too deeply"}, ()
    except BaseException as error:  # code of others; SystemExit and what derives from it too
        if _is_memory(error):
            return {"error": "memory", "message": ""}, ()
        return {"error": "damaged", "message": _in_short(error)}, ()


def _is_memory(error: BaseException) -> bool:
    """Whether a library ran out of memory and says so in a class of its own."""
    seen: BaseException | None = error
    while seen is not None:
        words = str(seen)
        if isinstance(seen, MemoryError) or any(said in words for said in _OUT_OF_MEMORY):
            return True
        if isinstance(seen, OSError) and seen.errno == errno.EFBIG:  # a temporary file
            return True
        seen = seen.__cause__ or seen.__context__
    return False


_OUT_OF_MEMORY = ("bad_alloc", "Cannot allocate", "resize buffer")  # C++, POSIX, lz4


def _in_short(error: BaseException) -> str:
    words = " ".join("".join(c if c.isprintable() else " " for c in str(error)).split())
    return f"{type(error).__name__}: {words[:200]}" if words else type(error).__name__


def _function(address: str) -> Any:
    module, _, name = address.partition(":")
    found: Any = importlib.import_module(module)
    for part in name.split("."):
        found = getattr(found, part)
    return found


def _limit_memory(size: int) -> None:
    """Allow so many bytes of address space and in a temporary file, and no dump of them."""
    with contextlib.suppress(ImportError):  # Windows has no such limit
        import resource

        # Linux keeps it; other systems take the call and may not.
        with contextlib.suppress(ValueError, OSError):
            resource.setrlimit(resource.RLIMIT_AS, (size, size))
        with contextlib.suppress(ValueError, OSError):
            resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
        with contextlib.suppress(ValueError, OSError):
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _peak() -> int:
    """Most memory that the process has held, in bytes; 0 where that is not told."""
    try:
        import resource
    except ImportError:
        return 0
    scale = 1 if sys.platform == "darwin" else 1024
    return scale * int(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)


def _forbid() -> None:
    """Refuse what no reader needs; it holds for all code of the process, for good."""
    temporary = os.path.realpath(os.environ["TMPDIR"])

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        if event in _FORBIDDEN and not _temporary(arguments, temporary):
            raise PermissionError(f"a reader may not do {event}")
        if event == "open" and _writes(arguments) and not _temporary(arguments, temporary):
            raise PermissionError(f"a reader may not write {arguments[0]!r}")

    sys.addaudithook(hook)


def _writes(arguments: tuple[Any, ...]) -> bool:
    mode = arguments[1] if len(arguments) > 1 else None
    flags = arguments[2] if len(arguments) > 2 else 0
    if isinstance(mode, str):
        return any(letter in mode for letter in "wax+")
    return isinstance(flags, int) and bool(flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT))


def _temporary(arguments: tuple[Any, ...], folder: str) -> bool:
    place = arguments[0] if arguments else None
    if isinstance(place, bytes):
        place = os.fsdecode(place)
    if isinstance(place, int):  # open already
        return True
    if not isinstance(place, str | os.PathLike):
        return False
    real = os.path.realpath(place)
    return real in (os.devnull, folder) or real.startswith(folder + os.sep)


if __name__ == "__main__":
    main()
