"""The pace of a run: each command goes when it is due, and when it went is noted."""

import numpy as np
from numpy.typing import NDArray

from hmpim.rigs import Block, Clock

__all__ = ["Pacer"]


class Pacer:
    """Lets each command go when it is due, and notes when it went.

    Parameters
    ----------
    clock : Clock
        What tells the time.
    fs : float
        Commands a second.
    count : int
        Commands of the whole run.

    Examples
    --------
    >>> from hmpim.rigs import ManualClock
    >>> pacer = Pacer(ManualClock(), fs=10.0, count=3)
    >>> for number in range(3):
    ...     pacer.wait(number)
    >>> pacer.sent.round(9).tolist()
    [0.0, 0.1, 0.2]
    """

    def __init__(self, clock: Clock, *, fs: float, count: int) -> None:
        self._clock = clock
        self._period = 1.0 / fs
        self._start: float | None = None
        self._sent = np.full(count, np.nan)

    @property
    def sent(self) -> NDArray[np.float64]:
        """When each command went, s from the first one's due time; NaN where none was awaited."""
        return self._sent.copy()

    def sent_of(self, block: Block) -> NDArray[np.float64] | None:
        """When each command of a block went, s; None if the rig did not wait for them all."""
        sent = self._sent[block.start : block.stop]
        return sent.copy() if np.all(np.isfinite(sent)) else None

    def note(self, start: int, sent: NDArray[np.float64]) -> None:
        """Note when commands went that another process let go: those from number `start` on."""
        self._sent[start : start + sent.size] = sent

    def now(self) -> float:
        """Seconds from the first command's due time; before the first, from now on."""
        return 0.0 if self._start is None else self._clock.now() - self._start

    def left(self, number: int) -> float:
        """Seconds until command `number` is due, negative if that is past."""
        return 0.0 if self._start is None else number * self._period - self.now()

    def wait(self, number: int) -> None:
        """Return when command `number` is due; the first is due at once."""
        if self._start is None:
            self._start = self._clock.now() - number * self._period
        self._clock.sleep_until(self._start + number * self._period)
        self._sent[number] = self._clock.now() - self._start
