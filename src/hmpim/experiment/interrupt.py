"""Stopped from outside: Ctrl-C and a polite kill end a run as an exception, never inside a stop."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

__all__ = ["AskedToEnd", "ending_politely", "undisturbed"]

_POLITE = tuple(
    getattr(signal, name) for name in ("SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name)
)


class AskedToEnd(SystemExit):
    """A signal asks the process to end; any other SystemExit is from the software under test."""

    def __init__(self, number: int) -> None:
        super().__init__(128 + number)
        self._signal = signal.Signals(number).name

    def __str__(self) -> str:
        return self._signal


def _in_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()


@contextmanager
def ending_politely() -> Iterator[None]:
    """Turn the signals that ask a process to end into `AskedToEnd`, so that cleanup runs.

    In a thread other than the main one nothing is changed: signals do not come there.

    Examples
    --------
    >>> import os
    >>> try:
    ...     with ending_politely():
    ...         os.kill(os.getpid(), signal.SIGTERM)
    ... except AskedToEnd as ended:
    ...     print(ended.code == 128 + signal.SIGTERM)
    True
    """
    if not _in_main_thread():
        yield
        return

    def end(number: int, _frame: FrameType | None) -> None:
        raise AskedToEnd(number)

    # A signal that is ignored, as with nohup, stays ignored.
    before = {n: signal.getsignal(n) for n in _POLITE if signal.getsignal(n) == signal.SIG_DFL}
    for number in before:
        signal.signal(number, end)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def undisturbed() -> Iterator[None]:
    """Let what must not be broken off finish first; a Ctrl-C that came meanwhile counts then.

    Examples
    --------
    >>> import os
    >>> done = []
    >>> try:
    ...     with undisturbed():
    ...         os.kill(os.getpid(), signal.SIGINT)
    ...         done.append("stopped")
    ... except KeyboardInterrupt:
    ...     done.append("interrupted")
    >>> done
    ['stopped', 'interrupted']
    """
    if not _in_main_thread():
        yield
        return
    came: list[int] = []

    def note(number: int, _frame: FrameType | None) -> None:
        came.append(number)

    numbers = (signal.SIGINT, *_POLITE)
    before = {number: signal.getsignal(number) for number in numbers}
    for number in numbers:
        if before[number] not in (signal.SIG_IGN, None):
            signal.signal(number, note)
    try:
        yield
    finally:
        for number, handler in before.items():
            if handler is not None:
                signal.signal(number, handler)
    if came:
        if came[0] == signal.SIGINT:
            raise KeyboardInterrupt
        raise AskedToEnd(came[0])
