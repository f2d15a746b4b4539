"""Settings of the process for identification: one BLAS thread, and memory kept by the allocator.

Small matrices gain nothing from several BLAS threads, and lose much on a busy machine: on a loaded
two-core machine a matrix exponential of 8 by 8 took 16 ms with OpenBLAS's own threads and 0.012 ms
with one.

A record of 10 000 samples passes some hundred arrays of a megabyte through the allocator. The GNU
C library returns each to the system and maps it again, page by page, until a block as large as
`_BLOCK` has been freed once (mallopt(3), M_MMAP_THRESHOLD). This took a sixth of the time; the
allocator may then keep up to twice such a block.
"""

from contextlib import AbstractContextManager
from functools import cache
from typing import Any

import numpy as np
from threadpoolctl import ThreadpoolController

__all__ = ["one_thread"]

_BLOCK = 31 << 20
"""Bytes: just below the 32 MiB from which the allocator learns nothing."""


@cache
def _controller() -> ThreadpoolController:
    np.empty(_BLOCK, dtype=np.uint8)  # freed at once, and never touched
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
