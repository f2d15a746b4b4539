"""Where the time of a command goes, stage by stage."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["Stages"]


class Stages:
    """Times stages, on the wall and of the processor.

    Examples
    --------
    >>> stages = Stages()
    >>> with stages.stage("run"):
    ...     pass
    >>> print(stages.words())
    Time: run 0.0 s (0.0 s of processor); 0.0 s (0.0 s) in all
    """

    def __init__(self) -> None:
        self._spent: dict[str, tuple[float, float]] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time what happens inside."""
        wall, processor = time.perf_counter(), time.process_time()
        try:
            yield
        finally:
            before = self._spent.get(name, (0.0, 0.0))
            self._spent[name] = (
                before[0] + time.perf_counter() - wall,
                before[1] + time.process_time() - processor,
            )

    def words(self) -> str:
        """Say it in a line."""
        parts = [
            f"{name} {wall:.1f} s ({processor:.1f} s of processor)"
            for name, (wall, processor) in self._spent.items()
        ]
        wall = sum(spent[0] for spent in self._spent.values())
        processor = sum(spent[1] for spent in self._spent.values())
        return f"Time: {', '.join(parts)}; {wall:.1f} s ({processor:.1f} s) in all"
