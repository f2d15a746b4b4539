"""As undisturbed as the system allows: real-time scheduling, and no garbage collection."""

import gc
import os
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["undelayed"]

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
