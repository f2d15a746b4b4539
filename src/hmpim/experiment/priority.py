"""As undisturbed as the system allows: real-time scheduling, and no garbage collection."""

import contextlib
import gc
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["ordinary", "quick_to_switch", "undelayed"]

_PRIORITY = 10  # of 1 to 99: above everything ordinary, below the system's own threads


@contextmanager
def undelayed(*, realtime: bool) -> Iterator[str]:
    """Run with as few pauses as the system allows; yields in words what it allows.

    Parameters
    ----------
    realtime : bool
        Whether to ask for real-time scheduling, where only a permitted process gets it.

    Examples
    --------
    >>> with undelayed(realtime=False) as words:
    ...     print(words)
    ordinary scheduling, as asked
    """
    collecting = gc.isenabled()
    gc.disable()  # a collection of a large heap takes several periods
    before = None
    words = "ordinary scheduling, as asked"
    if realtime:
        before, words = _raise()
    try:
        yield words
    finally:
        if before is not None:
            policy, parameters = before
            os.sched_setscheduler(0, policy, parameters)
        if collecting:
            gc.enable()


@contextmanager
def quick_to_switch(seconds: float | None) -> Iterator[None]:
    """Let another thread of this process keep this one waiting for so many s at most.

    Parameters
    ----------
    seconds : float or None
        None leaves it as it is, which is 5 ms.

    Examples
    --------
    >>> with quick_to_switch(5e-4):
    ...     round(1e3 * sys.getswitchinterval(), 3)
    0.5
    """
    before = sys.getswitchinterval()
    if seconds is not None:
        sys.setswitchinterval(seconds)
    try:
        yield
    finally:
        sys.setswitchinterval(before)


def ordinary() -> None:
    """Give up real-time scheduling in this thread, which has it from the one that began it."""
    if hasattr(os, "sched_setscheduler"):
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def _raise() -> "tuple[tuple[int, os.sched_param] | None, str]":
    if not hasattr(os, "sched_setscheduler"):
        return None, "ordinary scheduling: this system offers no other to Python"
    before = (os.sched_getscheduler(0), os.sched_getparam(0))
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_PRIORITY))
    except OSError as error:
        return None, (
            f"ordinary scheduling: the system does not allow any other ({error.strerror}); on "
            "Linux, give the user an rtprio limit"
        )
    return before, f"real-time scheduling, SCHED_FIFO at priority {_PRIORITY}"
