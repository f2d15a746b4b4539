"""The near end's account of a run: samples put in order, what was lost, and the two clocks."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmpim.record import Finding
from hmpim.rigs.block import RunReport, Samples
from hmpim.rigs.wire.clocks import ClockFit, fit_clocks
from hmpim.rigs.wire.datagram import NONE, Datagram, Response, State
from hmpim.rigs.wire.sequence import Counts, Sequence

__all__ = ["Account"]

FloatArray = NDArray[np.float64]

_NANO = 1e-9
_LAG = 0.02  # s: a far end that answers later than this after its tick is behind
_PATIENCE = 16  # responses waited for one that is missing, before it is taken as lost


@dataclass(frozen=True, slots=True, kw_only=True)
class _InRun:
    """Stamps of the far end, shifted as `Account.take` gives them, turned into times in the run."""

    fit: ClockFit
    shift: float
    start: float

    def __call__(self, stamps: FloatArray) -> FloatArray:
        return self.fit.near(stamps + self.shift) - self.start


class Account:
    """Takes responses as they come and gives samples in order.

    Parameters
    ----------
    columns : mapping of axis to int
        Place of each moved axis among the far end's.
    factors : mapping of axis to float
        From the far end's units to the stimulus's.
    """

    def __init__(self, *, columns: Mapping[str, int], factors: Mapping[str, float]) -> None:
        self._columns, self._factors = columns, factors
        self.start: float | None = None
        """Near time (s) at which the first command was due."""
        self.in_force = -1
        """Number of the last command that is known to have been in force."""
        self._sent: dict[int, float] = {}
        self._responses = Sequence()
        self._pending: dict[int, Response] = {}
        self._next: int | None = None
        self._over = False
        self._forth: list[tuple[float, float]] = []  # sent (near), arrived (far)
        self._back: list[tuple[float, float]] = []  # answered (far), received (near)
        self._newest = NONE
        self._reckoned = 0
        self._dropped = 0
        self._shift: float | None = None
        self._lag = 0.0

    @property
    def moved(self) -> bool:
        """Whether the far end has followed a command."""
        return self.in_force >= 0

    def sent(self, number: int, now: float) -> None:
        """Note when a command left, s of the near clock."""
        self._sent[number] = now

    def received(self, datagram: Datagram, now: float) -> None:
        """Take a response that came at `now` (s of the near clock)."""
        response = datagram.response
        assert response is not None
        if not self._responses.arrived(datagram.number):
            return
        self._back.append((_NANO * datagram.sent, now))
        self._lag = max(self._lag, _NANO * (datagram.sent - response.sampled))
        if response.newest not in (self._newest, NONE) and response.newest in self._sent:
            self._newest = response.newest
            self._forth.append((self._sent[response.newest], _NANO * response.arrived))
        if response.in_force != NONE:
            self.in_force = max(self.in_force, response.in_force)
        if self._next is not None and datagram.number < self._next:
            self._dropped += 1  # so late that its place was given up
            return
        self._pending[datagram.number] = response

    def take(self, *, everything: bool = False) -> dict[str, Samples]:
        """Return the samples that are complete, in order, stamped with the far end's clock.

        Stamps are shifted by the offset that the first exchange shows, so that they can be read
        as times in the run; `report` tells the rest.

        Parameters
        ----------
        everything : bool
            Whether to wait no longer for what is missing.
        """
        rows = self._in_order(everything=everything)
        if not rows:
            return {}
        if self._shift is None:
            self._shift = self._first_shift()
        time = np.array([_NANO * row.sampled for row in rows]) - self._shift
        in_force = np.array([row.position for row in rows])
        measured = np.array([row.measured for row in rows])
        samples = {}
        for axis, place in self._columns.items():
            factor = self._factors[axis]
            samples[f"{axis}.command"] = Samples(time=time, values=factor * in_force[:, place])
            samples[f"{axis}.position"] = Samples(time=time, values=factor * measured[:, place])
        return samples

    def report(self, name: str) -> RunReport:
        """Say what became of the datagrams, and how the far clock runs.

        Parameters
        ----------
        name : str
            Of the far end, and of its clock.
        """
        findings = []
        counts = self._responses.counts
        if not counts.clean or self._reckoned or self._dropped:
            findings.append(_datagrams(counts, self._reckoned, self._dropped, len(self._sent)))
        missing = len(self._sent) - 1 - self.in_force
        if missing > 0:
            findings.append(_cut_short(missing, len(self._sent)))
        if self._lag > _LAG:
            findings.append(_lag(self._lag, name))
        clocks: dict[str, Callable[[FloatArray], FloatArray]] = {}
        fit = self._fit()
        if fit is not None:
            findings.append(_clocks(fit, name))
            clocks[name] = _InRun(fit=fit, shift=self._shift or 0.0, start=self.start or 0.0)
        return RunReport(findings=tuple(findings), clocks=clocks)

    def _fit(self) -> ClockFit | None:
        if len(self._forth) < 2 or len(self._back) < 2:
            return None
        forth, back = np.array(self._forth), np.array(self._back)
        return fit_clocks(forth[:, 0], forth[:, 1], back[:, 0], back[:, 1])

    def _first_shift(self) -> float:
        """Far clock minus time in the run, from the first exchange."""
        start = self.start or 0.0
        if self._forth and self._back:
            sent, arrived = self._forth[0]
            answered, received = min(self._back, key=lambda pair: abs(pair[1] - sent))
            return 0.5 * ((arrived - sent) + (answered - received)) + start
        answered, received = self._back[-1]
        return answered - received + start

    def _in_order(self, *, everything: bool) -> list[Response]:
        rows: list[Response] = []
        while self._pending:
            first = min(self._pending)
            if self._next is None and not self._begins(self._pending[first]):
                del self._pending[first]
                continue
            gap = self._next is not None and first > self._next
            if gap and not everything and len(self._pending) < _PATIENCE:
                break
            response = self._pending.pop(first)
            self._next = first + 1
            if response.state is not State.MOVING:
                self._over = True
            if not self._over:
                self._reckoned += response.reckoned
                rows.append(response)
        return rows

    @staticmethod
    def _begins(response: Response) -> bool:
        return response.state is State.MOVING


def _datagrams(counts: Counts, reckoned: int, dropped: int, sent: int) -> Finding:
    words = []
    if reckoned:
        words.append(
            f"{reckoned} of {sent} commands came too late or not at all, and the rig extrapolated "
            "from the last; the input recorded is what was in force"
        )
    if counts.lost or dropped:
        words.append(
            f"{counts.lost + dropped} of {counts.received + counts.lost} samples were lost on the "
            "way back, and are gaps"
        )
    if counts.swapped or counts.doubled:
        words.append(
            f"samples put back in order: {counts.swapped}; samples repeated: {counts.doubled}"
        )
    return Finding(code="datagrams", message="; ".join(words) + ".", severity="info", parameters=())


def _cut_short(missing: int, sent: int) -> Finding:
    return Finding(
        code="cut_short",
        message=f"Of {sent} commands, the samples of the last {missing} never came back.",
        severity="info",
        parameters=(),
    )


def _lag(seconds: float, name: str) -> Finding:
    return Finding(
        code="lag",
        message=(
            f"{name!r} fell behind its own clock by up to {1e3 * seconds:.3g} ms. Its samples are "
            "stamped with the time at which they were due, but a real unit would not have waited: "
            "run it on a quieter computer."
        ),
        severity="info",
        parameters=(),
    )


def _clocks(fit: ClockFit, name: str) -> Finding:
    return Finding(
        code="clocks",
        message=(
            f"The clock of {name!r} is {fit.offset:+.6f} s from ours and gains "
            f"{1e6 * fit.drift:+.2f} ppm; both are taken out. Which direction of the network is "
            "slower cannot be measured, so the offset may be wrong by "
            f"±{1e3 * fit.uncertainty:.3g} ms. Input and output are both stamped by that clock, so "
            "the delay between them does not contain the network's."
        ),
        severity="info",
        parameters=(),
    )
