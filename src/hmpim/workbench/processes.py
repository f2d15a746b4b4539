"""How the workbench starts its processes: quickly, and with nothing of its own state in them."""

import multiprocessing
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from multiprocessing.context import ForkServerContext, SpawnContext

__all__ = ["process_context"]

_KNOWN = ("hmpim.workbench.work.conducting", "hmpim.workbench.work.designed",
          "hmpim.workbench.work.driving", "hmpim.workbench.work.runs")  # fmt: skip
"""What is imported once, where processes are copies of one that has imported it."""


def process_context() -> "ForkServerContext | SpawnContext":
    """Return the way in which processes are started.

    Where the system can, one process imports what all need, does nothing else, and is copied for
    each: a run begins at once, and the imports are paid for once. Elsewhere each imports for
    itself.

    Examples
    --------
    >>> process_context().get_start_method() in ("forkserver", "spawn")
    True
    """
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(_KNOWN))
    return context
