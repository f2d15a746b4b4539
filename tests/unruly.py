"""Readers that do what a broken library does, one for each first byte of a file."""

import ctypes
import os
import pickle
import socket
import subprocess
import sys
import time

import numpy as np

from hmpim.errors import FormatError, MissingExtraError
from hmpim.formats.readers import ChannelInfo, Contents, Reader
from hmpim.record import Finding, Series


def channels(path, layout):
    act = path.read_bytes()[:1].decode()
    if act == "h":
        time.sleep(100)
    ACTS.get(act, lambda path: None)(path)
    return Contents(
        format="unruly",
        channels=(ChannelInfo(name="u", unit="V"), ChannelInfo(name=str(os.getpid()))),
        band=(0.1, 20.0),
        inputs=("u",),
    )


def read(path, names, layout):
    clock = np.arange(4.0)
    short = Finding(code="cut_short", message="Cut.", severity="info", parameters=())
    return tuple(
        Series(name=n, values=clock * k + np.nan, time=clock, unit="V", findings=(short,))
        for k, n in enumerate(names)
    )


def _crash(path):
    ctypes.string_at(0)


def _swallow(path):
    kept = [np.ones(2**22) for _ in range(2**12)]  # 128 GiB
    raise AssertionError(len(kept))


def _leave(path):
    os._exit(3)


def _chatter(path):
    print("hello " * 100_000)
    print("hello", file=sys.stderr)
    os.write(1, b"hello")


def _refuse(path):
    raise FormatError("it is of last year")


def _miss(path):
    raise MissingExtraError("run: pip install 'hmpim[none]'")


def _run(path):
    subprocess.run(["true"], check=True)


def _call(path):
    socket.create_connection(("127.0.0.1", 9), timeout=1)


def _write(path):
    path.with_suffix(".new").write_text("x")


class _Evil:
    def __reduce__(self):
        return os.getcwd, ()


def _unpickle(path):
    pickle.loads(pickle.dumps(_Evil()))


def _bug(path):
    raise KeyError("a\nb")


def _quit(path):
    sys.exit(0)


ACTS = {
    "c": _crash,
    "m": _swallow,
    "l": _leave,
    "t": _chatter,
    "r": _refuse,
    "e": _miss,
    "p": _run,
    "n": _call,
    "w": _write,
    "k": _unpickle,
    "b": _bug,
    "q": _quit,
}


UNRULY = Reader(
    format="unruly", sniff=lambda head, path: True, channels=channels, read=read, foreign=True
)
