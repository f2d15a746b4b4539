"""Clocks: the computer's own, one turned by hand in tests, and one that goes wrong on purpose."""

import math
import time
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import ArgumentError

__all__ = ["Clock", "ManualClock", "SkewedClock", "SystemClock"]


class Clock(Protocol):
    """A source of time that can also wait."""

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
    """A clock that jumps ahead instead of waiting: a run of an hour takes no time.

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

    def __init__(self, late: NDArray[np.float64] | None = None) -> None:
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


class SkewedClock:
    """Another clock seen through an offset and a drift, as a second computer's would be.

    Parameters
    ----------
    clock : Clock
        The clock behind it.
    offset : float
        What it is ahead by, s.
    drift : float
        Seconds that it gains in a second; more than -1, as no clock runs backwards.

    Raises
    ------
    ArgumentError
        If offset or drift is not a finite number, or the clock would stand still or run backwards.

    Examples
    --------
    >>> behind = ManualClock()
    >>> skewed = SkewedClock(behind, offset=100.0, drift=0.5)
    >>> skewed.sleep_until(103.0)
    >>> behind.now(), skewed.now()
    (2.0, 103.0)
    """

    def __init__(self, clock: Clock, *, offset: float = 0.0, drift: float = 0.0) -> None:
        for name, value, least in (("offset", offset, -math.inf), ("drift", drift, -1.0)):
            if not (math.isfinite(value) and value > least):
                raise ArgumentError(f"clock {name} = {value:g} must be finite and above {least:g}")
        self._clock = clock
        self._offset = offset
        self._rate = 1.0 + drift
        self._origin = clock.now()

    def now(self) -> float:
        """Seconds as this clock shows them."""
        since = self._clock.now() - self._origin
        return self._origin + self._offset + self._rate * since

    def sleep_until(self, instant: float) -> None:
        """Sleep until this clock shows the instant."""
        since = (instant - self._origin - self._offset) / self._rate
        self._clock.sleep_until(self._origin + since)
