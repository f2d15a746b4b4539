"""A process apart in which the formats of others are parsed: it may crash, we do not.

`shielded` makes a reader's functions run there, `wire` is what goes through the pipes,
`child` is what the process runs.
"""

from hmpim.formats.readers.worker.pool import MEMORY, TIME, addressed, close_worker, shielded

__all__ = ["MEMORY", "TIME", "addressed", "close_worker", "shielded"]
