"""A driver that does not return: it is broken off when its time is over."""

import _thread
import math
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from hmpim.errors import RigError
from hmpim.rigs import Clock

__all__ = ["Deadline"]

_LOOK = 0.1  # s between two looks at the clock
_AGAIN = 1.0  # s after which what goes on all the same is broken off once more


class _Overdue(BaseException):
    """Time is over; no driver takes it for an error of its own and goes on."""


class Deadline:
    """Breaks off what does not return in time; a context manager, entered where that is called.

    In the main thread a wait is broken off wherever Python code waits: for a socket, a serial
    port, a lock. A thread looks at the clock and signals, from the first call on. Compiled code
    that does not return, and anything in another thread, cannot be broken off: `instead` is called
    then.

    Parameters
    ----------
    clock : Clock
        Read by another thread; monotonic.
    instead : callable or None
        Called once, in another thread, where the call cannot be broken off within 1 s.

    Examples
    --------
    >>> import time
    >>> from hmpim.rigs import SystemClock
    >>> with Deadline(SystemClock()) as deadline, deadline.within(0.01, "it did not return"):
    ...     time.sleep(60.0)
    Traceback (most recent call last):
    hmpim.errors.RigError: it did not return
    """

    def __init__(self, clock: Clock, *, instead: Callable[[], object] | None = None) -> None:
        self._clock, self._instead = clock, instead
        self._due = math.inf
        self._busy = self._overdue = self._signalled = False
        self._lock = threading.Lock()
        self._over = threading.Event()
        self._before: Any = None
        self._main = False
        self._thread: threading.Thread | None = None

    def __enter__(self) -> "Deadline":
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        if self._thread is not None:
            self._thread.join(_AGAIN)  # not for ever: what it called instead may hang, too
        if self._main and self._before is not None:
            signal.signal(signal.SIGINT, self._before)

    @contextmanager
    def within(self, seconds: float, message: str) -> Iterator[None]:
        """Break off what is done inside after so many seconds; infinite waits for ever.

        Raises
        ------
        RigError
            With the message, if it was broken off, or returned after it could not be.
        """
        if self._thread is None:
            self._start()
        with self._lock:
            self._busy, self._overdue, self._due = True, False, self._clock.now() + seconds
        try:
            yield
        except _Overdue:
            raise RigError(message) from None
        finally:
            self._due, self._busy = math.inf, False
        if self._overdue:
            raise RigError(message)

    def shorten(self, seconds: float) -> None:
        """Break off what is going on, if anything, after so many seconds from now at the latest."""
        with self._lock:
            if self._busy:
                self._due = min(self._due, self._clock.now() + seconds)

    def _start(self) -> None:
        """Begin to look; a run in which nothing can hang never does."""
        self._main = threading.current_thread() is threading.main_thread()
        if self._main:
            self._before = signal.signal(signal.SIGINT, self._came)
        self._thread = threading.Thread(target=self._watch, daemon=True, name="deadline")
        self._thread.start()

    def _watch(self) -> None:
        last, instead = math.inf, self._instead
        while not self._over.wait(_LOOK):
            now = self._clock.now()
            if not self._busy or now < self._due:
                last = math.inf
                continue
            self._overdue = True
            if last == math.inf or now - last > _AGAIN:
                if instead is not None and (last < math.inf or not self._main):
                    instead()
                    instead = None
                last = now
                self._break_off()

    def _break_off(self) -> None:
        if not self._main:
            return
        self._signalled = True
        if hasattr(signal, "pthread_kill"):
            main = threading.main_thread().ident
            assert main is not None
            signal.pthread_kill(main, signal.SIGINT)
        else:
            _thread.interrupt_main()

    def _came(self, number: int, frame: FrameType | None) -> None:
        """Tell our own signal from a Ctrl-C, which goes where it went before."""
        if self._signalled:
            self._signalled = False
            if self._busy and self._clock.now() >= self._due:
                raise _Overdue
        elif callable(self._before):
            self._before(number, frame)
