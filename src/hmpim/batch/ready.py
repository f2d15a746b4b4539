"""What a worker imports before it says that it is there, so that its first record takes no longer.

SciPy imports its parts when they are first asked for, which takes as long as ten records.
"""

import gc
from typing import Any

import scipy.interpolate
import scipy.ndimage
import scipy.optimize
import scipy.signal
import scipy.special  # noqa: F401

from hmpim.batch import work  # noqa: F401

__all__ = ["dask_setup"]


def dask_setup(worker: Any) -> None:
    """Called by Dask as a worker of this computer begins.

    What is there by now lives as long as the worker, so that Python's collector need not go through
    it again and again: each time takes as long as two records.
    """
    gc.collect()
    gc.freeze()
