"""An external tick as the clock of a run, such as an interrupt that is locked to GPS.

Each pulse is a datagram or a byte, and should contain its number (`hmpim.rigs.pulses`), so that a
pulse that is lost, duplicated or late is detected at once. Between two pulses the time comes from
the computer's clock, corrected by the rate measured so far.
"""

import threading
from collections import deque
from collections.abc import Sequence
from types import TracebackType
from typing import Self

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.errors import ArgumentError, RigError
from hmpim.record import Finding
from hmpim.rigs.block import RunReport
from hmpim.rigs.clock import Clock, SystemClock
from hmpim.rigs.pulses import TickSource
from hmpim.rigs.wire.sequence import Sequence as Numbers

__all__ = ["TickClock"]

_AGREE = 20  # pulses in a row that must seem late before one is taken for lost
_GRACE = 0.25  # periods
_EARLY, _NEARLY = 0.97, 0.99  # of a period: from the one on, the other is shown until a pulse
_FEWEST = 100  # pulses before the pace of the computer's clock between two of them is corrected
_RAGGED = 0.05  # share of pulses lost, doubled or out of order, from where on no drift is told
_SPANS = 10  # of equally many pulses; of 20, what disturbs one span reaches into the next
_PART = 1e-5  # by which the drift of one half of the run may differ from that of the other


def _gain(stamps: NDArray[np.float64], came: NDArray[np.float64]) -> tuple[float, float]:
    """Seconds that the computer gains in one of the pulses, and the standard deviation.

    A pulse can only be late. So the line goes through the pulse of each of ten spans that is least
    late; how those scatter about the line is the error.
    """
    late = came - stamps
    least = [part[np.argmin(late[part])] for part in np.array_split(np.arange(late.size), _SPANS)]
    line = scipy.stats.linregress(stamps[least], late[least])
    return float(line.slope), float(line.stderr)


class TickClock:
    """A clock that pulses turn; a context manager, inside which a thread notes when they come.

    Pulse k is at k/rate. Where pulses hold no number, one that is lost shows in those after it,
    which all seem late by a period; after 20 of them it is counted in.

    Parameters
    ----------
    source : TickSource
        Brings the pulses.
    rate : float
        Pulses a second by their own clock, Hz.
    clock : Clock or None
        Read between two pulses; None for the computer's own.
    patience : float
        Seconds without a pulse after which it is given up.
    """

    def __init__(
        self,
        source: TickSource,
        *,
        rate: float,
        clock: Clock | None = None,
        patience: float = 1.0,
    ) -> None:
        if not rate > 0.0:
            raise ArgumentError(f"rate = {rate!r} Hz of the tick must be positive")
        self._source, self._rate = source, rate
        self._clock: Clock = SystemClock() if clock is None else clock
        self._patience = patience
        self._stamps: list[float] = []  # by the pulses
        self._came: list[float] = []  # by the computer
        self._heard: deque[tuple[Sequence[int | None], float]] = deque()  # by the thread; when
        self._woken, self._over = threading.Event(), threading.Event()
        self._thread: threading.Thread | None = None
        self._count = 0  # periods since the first pulse
        self._late: deque[float] = deque(maxlen=_AGREE)  # periods by which pulses seem late
        self._first = 0  # number of the first pulse
        self._numbers = Numbers()
        self._unnumbered = 0
        self._guessed = 0  # lost, as far as pulses without numbers tell
        self._pace = 1.0  # seconds of the pulses in one of the computer

    def now(self) -> float:
        """Seconds by the pulses; the first one is at 0.

        Raises
        ------
        RigError
            If not one pulse comes.
        """
        self._take(0.0)
        if not self._stamps:
            self._await_one()
        since = self._pace * (self._clock.now() - self._came[-1])
        if since > self._patience:  # they have stopped: a rig must be stopped all the same
            return self._stamps[-1] + since
        # Never quite at the next pulse, which has not come yet; never back. Somewhat early, so
        # that whoever waits for it is there when it comes, even if the one before was seen late.
        share = max(0.0, since) * self._rate
        if share >= _EARLY:  # and always on, so that no two commands have the same time
            share = 1.0 - (1.0 - _NEARLY) * _EARLY / share
        return self._stamps[-1] + share / self._rate

    def sleep_until(self, instant: float) -> None:
        """Wait for the pulse at the instant, or for the computer's clock after the one before."""
        while (left := instant - self.now()) > 1e-9:
            pulse = self._stamps[-1] + 1.0 / self._rate
            if instant < pulse - 1e-9:
                self._clock.sleep_until(self._clock.now() + left / self._pace)
            else:
                self._await_one()

    def report(self) -> RunReport:
        """Say how the computer's clock runs against the pulses, or why that cannot be told."""
        message = (
            f"The run was driven by an external tick of {self._rate:g} Hz{self._ragged()}; "
            f"{self._compared()}."
        )
        finding = Finding(code="tick", message=message, severity="info", parameters=())
        return RunReport(findings=(finding,))

    def __enter__(self) -> Self:
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
        /,
    ) -> None:
        self._over.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        close = getattr(self._source, "close", None)
        if close is not None:
            close()

    def _ragged(self) -> str:
        """What became of the pulses, if not each came once and in its turn."""
        counts = self._numbers.counts
        words = [
            f"{count} {what}"
            for count, what in (
                (counts.lost + self._guessed, "lost"),
                (counts.doubled, "doubled"),
                (counts.swapped, "out of order"),
            )
            if count
        ]
        return f", {' and '.join(words)} of {self._expected()}" if words else ""

    def _expected(self) -> int:
        counts = self._numbers.counts
        return max(self._count + 1, counts.received + counts.lost) if self._stamps else 0

    def _compared(self) -> str:
        """How the computer's clock runs against the pulses, or why that is not told."""
        unknown = "the rate of this computer's clock against it is unknown, as"
        counts = self._numbers.counts
        odd = counts.lost + counts.doubled + counts.swapped
        if len(self._stamps) < _FEWEST:
            return f"{unknown} {len(self._stamps)} pulses are too few, and {_FEWEST} are needed"
        if self._unnumbered:
            return f"{unknown} its pulses hold no numbers, so that a lost one is only guessed at"
        if odd > _RAGGED * self._expected():
            return f"{unknown} more than {100 * _RAGGED:g} % of its pulses are in disorder"
        stamps, came = np.array(self._stamps), np.array(self._came)
        half = stamps.size // 2
        (whole, std), (first, _), (second, _) = (
            _gain(stamps[part], came[part])
            for part in (slice(None), slice(half), slice(half, None))
        )
        if abs(first - second) > max(_PART, abs(whole)):
            return (
                f"{unknown} pulses come too unevenly: the first half of the run says "
                f"{1e6 * first:+.1f} ppm, the second {1e6 * second:+.1f}"
            )
        return f"this computer's clock gains {1e6 * whole:+.1f} ± {1e6 * std:.2g} ppm on it"

    def _await_one(self) -> None:
        begun = self._clock.now()
        while not self._take(0.02):
            if self._clock.now() - begun > self._patience:
                raise RigError(
                    f"no pulse of the external tick came for {self._patience:g} s; is it on, and "
                    "does it come here?"
                )

    def _listen(self) -> None:
        """Note each pulse when it comes, whatever the run is waiting for meanwhile."""
        while not self._over.is_set():
            came = self._source.wait(0.05)
            if came:
                self._heard.append((came, self._clock.now()))
                self._woken.set()

    def _take(self, timeout: float) -> bool:
        """Take what has come; none yet: wait for the first at most so long (s)."""
        if self._thread is None:
            came = self._source.wait(timeout)
            return self._pulses(came, self._clock.now())
        if not self._heard and timeout > 0.0:
            self._woken.wait(timeout)
        self._woken.clear()
        any_came = False
        while self._heard:
            any_came |= self._pulses(*self._heard.popleft())
        return any_came

    def _pulses(self, numbers: Sequence[int | None], now: float) -> bool:
        """Take pulses; False if time did not go on by them."""
        gone_on = [self._pulse(number, now) for number in numbers]
        return any(gone_on)

    def _pulse(self, number: int | None, now: float) -> bool:
        if not self._stamps:
            self._stamps, self._came, self._first = [0.0], [now], number or 0
            self._numbers.arrived(0)
            self._unnumbered += number is None
            return True
        due = self._pace * (now - self._came[0]) * self._rate
        if number is None:
            self._unnumbered += 1
            self._count += 1
            self._late.append(due - self._count)
            self._guess()
        else:
            place = self._place(number)
            if not self._numbers.arrived(place) or place <= self._count:
                return False
            self._count = place
            self._late.append(due - place)
            self._count += self._whole_rounds()
        self._stamps.append(self._count / self._rate)
        self._came.append(now)
        if len(self._stamps) % _FEWEST == 0 and max(self._late, default=1.0) < 0.5:
            span = self._came[-1] - self._came[0]
            self._pace = (self._stamps[-1] - self._stamps[0]) / span
        return True

    def _place(self, number: int) -> int:
        """Periods from the first pulse to this one, whose number may have begun anew."""
        modulus, due = self._source.modulus, self._count + 1
        apart = (number - self._first - due + modulus // 2) % modulus - modulus // 2
        return due + apart

    def _whole_rounds(self) -> int:
        """Periods lost while the numbers went round: all of many pulses are late by as much."""
        rounds = round(min(self._late) / self._source.modulus) if len(self._late) == _AGREE else 0
        if rounds > 0:
            self._late.clear()
        return max(0, rounds) * self._source.modulus

    def _guess(self) -> None:
        """A pulse may come late, but never early: only if all of many are late, one is missing."""
        if len(self._late) == _AGREE:
            missing = round(min(self._late) - _GRACE)
            if missing > 0:
                self._guessed += missing
                self._count += missing
                self._late.clear()
