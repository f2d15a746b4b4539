"""The pace of a run: each command goes when it is due, and when it went is noted."""

import math

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import RigError
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
    latest : float
        Seconds by which a command may go late.

    Examples
    --------
    >>> from hmpim.rigs import ManualClock
    >>> pacer = Pacer(ManualClock(), fs=10.0, count=3)
    >>> for number in range(3):
    ...     pacer.wait(number)
    >>> pacer.sent.round(9).tolist()
    [0.0, 0.1, 0.2]
    """

    def __init__(self, clock: Clock, *, fs: float, count: int, latest: float = math.inf) -> None:
        self._clock = clock
        self._period, self._latest = 1.0 / fs, latest
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
        """Return when command `number` is due; the first is due at once.

        Raises
        ------
        RigError
            If it is later than it may be: those that are due by now would all go at once.
        """
        if self._start is None:
            self._start = self._clock.now() - number * self._period
        self._clock.sleep_until(self._start + number * self._period)
        now = self._clock.now() - self._start
        late = now - number * self._period
        if late > self._latest:
            raise RigError(
                f"command {number} is {late:.3g} s late, and {self._latest:g} s are allowed: this "
                "computer paused, or the driver is slower than the stimulus's rate; the run was "
                "ended, because all overdue commands would otherwise be sent at once"
            )
        self._sent[number] = now
