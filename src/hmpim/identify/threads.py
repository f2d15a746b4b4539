"""Small matrices gain nothing from several BLAS threads, and lose much on a busy machine.

On a loaded two-core machine a matrix exponential of 8 by 8 took 16 ms with OpenBLAS's own
threads and 0.012 ms with one, so identification asks for one while it runs.
"""

from contextlib import AbstractContextManager
from functools import cache
from typing import Any

from threadpoolctl import ThreadpoolController

__all__ = ["one_thread"]


@cache
def _controller() -> ThreadpoolController:
    return ThreadpoolController()  # looks up the loaded libraries once, about 1 ms


def one_thread() -> AbstractContextManager[Any]:
    """Context in which BLAS uses one thread; restored on leaving.

    Examples
    --------
    >>> with one_thread():
    ...     pass
    """
    limiter: AbstractContextManager[Any] = _controller().limit(limits=1, user_api="blas")
    return limiter
