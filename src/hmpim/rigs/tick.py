"""An external tick as the clock of a run, such as an interrupt that is locked to GPS.

Each pulse is a datagram or a byte; what it holds does not matter. Between two pulses the
computer's clock is read, at the pace that the pulses have shown so far.
"""

import select
import threading
from collections import deque
from types import TracebackType
from typing import Protocol, Self

import numpy as np

from hmpim.errors import ArgumentError, RigError
from hmpim.record import Finding
from hmpim.rigs.block import RunReport
from hmpim.rigs.clock import Clock, SystemClock
from hmpim.rigs.mounted.arrivals import fit_one_way
from hmpim.rigs.wire.transport import listening, parse_address

__all__ = ["SerialTicks", "TickClock", "TickSource", "UdpTicks", "find_ticks"]

_AGREE = 20  # pulses in a row that must seem late before one is taken for lost
_GRACE = 0.25  # periods
_EARLY, _NEARLY = 0.97, 0.99  # of a period: from the one on, the other is shown until a pulse
_FEWEST = 100  # pulses before the pace of the computer's clock between two of them is corrected


class TickSource(Protocol):
    """Where pulses come from."""

    def wait(self, timeout: float) -> int:
        """Return how many pulses have come; none yet: wait for the first at most so long (s)."""
        ...


class UdpTicks:
    """Pulses that are datagrams.

    Parameters
    ----------
    host, port : str, int
        To listen at; port 0 takes any that is free.

    Raises
    ------
    RigError
        If the address cannot be taken.
    """

    def __init__(self, host: str, port: int) -> None:
        self._socket = listening(host, port, refused=f"tick udp://{host}:{port} cannot be heard")

    @property
    def port(self) -> int:
        """Port that it listens at."""
        return int(self._socket.getsockname()[1])

    def wait(self, timeout: float) -> int:
        """Return how many have come."""
        select.select([self._socket], [], [], max(0.0, timeout))
        came = 0
        while True:
            try:
                self._socket.recv(64)
            except BlockingIOError:
                return came
            came += 1

    def close(self) -> None:
        """Listen no more."""
        self._socket.close()


class SerialTicks:
    """Pulses that are bytes on a serial line.

    Parameters
    ----------
    port : str
        Of the computer, such as /dev/ttyS0.
    baud : int
        Bits a second.
    """

    def __init__(self, port: str, *, baud: int = 115_200) -> None:
        from hmpim.rigs.wire.serial import open_line

        self._line = open_line(port, baud)

    def wait(self, timeout: float) -> int:
        """Return how many have come."""
        self._line.timeout = max(0.0, timeout)
        return len(self._line.read(max(1, self._line.in_waiting)))

    def close(self) -> None:
        """Listen no more."""
        self._line.close()


def find_ticks(text: str) -> UdpTicks | SerialTicks:
    """Return the source that ``udp://HOST:PORT`` or ``serial:PORT`` names.

    Raises
    ------
    ArgumentError
        If it is neither.

    Examples
    --------
    >>> find_ticks("sundial")
    Traceback (most recent call last):
    hmpim.errors.ArgumentError: 'sundial' is no tick; write udp://HOST:PORT or serial:PORT
    """
    if text.startswith("udp://"):
        return UdpTicks(*parse_address(text.removeprefix("udp://")))
    if text.startswith("serial:"):
        return SerialTicks(text.removeprefix("serial:"))
    raise ArgumentError(f"{text!r} is no tick; write udp://HOST:PORT or serial:PORT")


class TickClock:
    """A clock that pulses turn; a context manager, inside which a thread notes when they come.

    Pulse k is at k/rate. A pulse that is lost shows in those after it, which all seem late by a
    period; after 20 of them it is counted in.

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
        self._heard: deque[tuple[int, float]] = deque()  # by the thread: how many, and when
        self._woken, self._over = threading.Event(), threading.Event()
        self._thread: threading.Thread | None = None
        self._count = 0  # periods since the first pulse
        self._late: deque[float] = deque(maxlen=_AGREE)  # periods by which pulses seem late
        self._lost = 0
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
        return self._stamps[-1] + (share if share < _EARLY else _NEARLY) / self._rate

    def sleep_until(self, instant: float) -> None:
        """Wait for the pulse at the instant, or for the computer's clock after the one before."""
        while (left := instant - self.now()) > 1e-9:
            pulse = self._stamps[-1] + 1.0 / self._rate
            if instant < pulse - 1e-9:
                self._clock.sleep_until(self._clock.now() + left / self._pace)
            else:
                self._await_one()

    def report(self) -> RunReport:
        """Say how the computer's clock runs against the pulses."""
        if len(self._stamps) < _FEWEST:
            return RunReport()
        lost = f", {self._lost} of {len(self._stamps) + self._lost} lost" if self._lost else ""
        message = (
            f"The run was driven by an external tick of {self._rate:g} Hz{lost}; this computer's "
            f"clock gains {1e6 * self._drift():+.1f} ppm on it."
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

    def _drift(self) -> float:
        """Seconds that the computer gains in one of the pulses: the fastest arrivals tell."""
        return -fit_one_way(np.array(self._stamps), np.array(self._came)).drift

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
            return came > 0 and self._pulse(came, self._clock.now())
        if not self._heard and timeout > 0.0:
            self._woken.wait(timeout)
        self._woken.clear()
        any_came = False
        while self._heard:
            any_came = self._pulse(*self._heard.popleft())
        return any_came

    def _pulse(self, came: int, now: float) -> bool:
        if not self._stamps:
            self._stamps, self._came = [0.0], [now]
            return True
        self._count += came
        # A pulse may come late, but never early: only if all of many are late, one is missing.
        due = self._pace * (now - self._came[0]) * self._rate
        self._late.append(due - self._count)
        if len(self._late) == _AGREE:
            missing = round(min(self._late) - _GRACE)
            if missing > 0:
                self._lost += missing
                self._count += missing
                self._late.clear()
        self._stamps.append(self._count / self._rate)
        self._came.append(now)
        if len(self._stamps) % _FEWEST == 0 and max(self._late, default=1.0) < 0.5:
            span = self._came[-1] - self._came[0]
            self._pace = (self._stamps[-1] - self._stamps[0]) / span
        return True
