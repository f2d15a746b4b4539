"""The clock of a run: real, or turned by hand in tests; and the pace it sets."""

import time
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

__all__ = ["Clock", "ManualClock", "Pacer", "SystemClock"]


class Clock(Protocol):
    """Something that tells the time and waits."""

    def now(self) -> float:
        """Seconds; they never go back."""
        ...

    def sleep_until(self, instant: float) -> None:
        """Return when `now` is at `instant` (s) or later."""
        ...


class SystemClock:
    """The computer's own clock.

    Examples
    --------
    >>> clock = SystemClock()
    >>> before = clock.now()
    >>> clock.sleep_until(before + 0.001)
    >>> clock.now() - before >= 0.001
    True
    """

    def now(self) -> float:
        """Seconds of the monotonic clock."""
        return time.perf_counter()

    def sleep_until(self, instant: float) -> None:
        """Sleep; at once if the instant is past."""
        while (left := instant - time.perf_counter()) > 0.0:
            time.sleep(left)


class ManualClock:
    """A clock that jumps where it is asked to wait: a run of an hour takes no time.

    Parameters
    ----------
    late : callable or None
        Seconds by which the n-th wait ends late, for tests of irregular timing.

    Examples
    --------
    >>> clock = ManualClock()
    >>> clock.sleep_until(5.0)
    >>> clock.now()
    5.0
    """

    def __init__(self, late: "NDArray[np.float64] | None" = None) -> None:
        self._now = 0.0
        self._late = late
        self._waits = 0

    def now(self) -> float:
        """Seconds since it was made, as turned."""
        return self._now

    def sleep_until(self, instant: float) -> None:
        """Jump to the instant, or somewhat later."""
        late = 0.0
        if self._late is not None and self._late.size:
            late = float(self._late[self._waits % self._late.size])
        self._waits += 1
        self._now = max(self._now, instant + late)

    def advance(self, seconds: float) -> None:
        """Turn it on."""
        self._now += seconds


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

    def now(self) -> float:
        """Seconds from the first command's due time; before the first, from now on."""
        return 0.0 if self._start is None else self._clock.now() - self._start

    def wait(self, number: int) -> None:
        """Return when command `number` is due; the first is due at once."""
        if self._start is None:
            self._start = self._clock.now() - number * self._period
        self._clock.sleep_until(self._start + number * self._period)
        self._sent[number] = self._clock.now() - self._start
