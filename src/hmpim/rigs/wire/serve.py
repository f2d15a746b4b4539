"""A rig served over a wire, in real time: ticks, datagrams, and a trace of what was done."""

from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import RigError
from hmpim.rigs.clock import Clock
from hmpim.rigs.wire.datagram import State
from hmpim.rigs.wire.farend import FarEnd, Order

__all__ = ["Plant", "Server", "Trace", "serve"]

FloatArray = NDArray[np.float64]

_NANO = 1e9
_OVERDUE = 64  # datagrams that are still taken when a tick is due: a flood must not put it off


class Plant(Protocol):
    """What moves at the far end."""

    def advance(self, order: Order) -> FloatArray:
        """Read the positions, shape (n,), and go on by a tick under an order.

        Raises
        ------
        RigError
            If something trips.
        """
        ...

    def truth(self) -> FloatArray:
        """Where the axes truly are, for the trace, shape (n,)."""
        ...


class Server(Protocol):
    """What brings datagrams from near ends and back."""

    def receive(self, timeout: float) -> tuple[bytes, object] | None:
        """Return the next datagram and who sent it, None if none comes within `timeout` (s)."""
        ...

    def send(self, data: bytes, to: object) -> None:
        """Send one datagram to somebody who has written."""
        ...


class Trace:
    """What the far end did, tick by tick, as CSV; written out about ten times a second.

    Parameters
    ----------
    path : Path
        File to write, replaced if there.
    axes : tuple of str
        Names of the axes.
    every : int
        Ticks between two writings.
    """

    def __init__(self, path: Path, axes: tuple[str, ...], *, every: int) -> None:
        self._file = path.open("w", encoding="utf-8")
        self._every = every
        self._rows: list[str] = []
        columns = [f"{axis}.{what}" for axis in axes for what in ("order", "rate", "true")]
        self._file.write(",".join(("tick", "time", "state", "session", *columns)) + "\n")

    def add(self, tick: int, time: float, farend: FarEnd, order: Order, true: FloatArray) -> None:
        """Add a tick."""
        values = np.column_stack((order.position, order.velocity, true)).ravel().tolist()
        cells = ",".join([f"{value:.9g}" for value in values])
        self._rows.append(f"{tick},{time:.9f},{farend.state.name},{farend.session},{cells}\n")
        if len(self._rows) >= self._every:
            self.flush()

    def flush(self) -> None:
        """Write what is waiting."""
        self._file.write("".join(self._rows))
        self._file.flush()
        self._rows.clear()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
        /,
    ) -> None:
        self.flush()
        self._file.close()


def serve(
    server: Server,
    farend: FarEnd,
    plant: Plant,
    *,
    clock: Clock,
    until: Callable[[], bool],
    trace: Trace | None = None,
) -> None:
    """Serve a rig until told to end; then bring it to rest.

    Parameters
    ----------
    server : Server
        Brings the datagrams.
    farend : FarEnd
        What the rig's controller does with them.
    plant : Plant
        What moves.
    clock : Clock
        The far end's own.
    until : callable
        Asked at each tick; True ends it.
    trace : Trace or None
        Takes each tick.
    """
    assert farend.hello.rate is not None
    period = 1.0 / farend.hello.rate
    begun = clock.now()
    peer: object = None
    tick, ending = 0, False
    while not ending or farend.state in (State.MOVING, State.BRAKING):
        due, overdue = begun + tick * period, 0
        while overdue < _OVERDUE:
            came = server.receive(max(0.0, due - clock.now()))
            now = clock.now()
            if came is None:
                if now >= due:
                    break
                continue
            overdue += now >= due
            data, sender = came
            before = farend.session
            for answer in farend.receive(data, now=round(now * _NANO)):
                server.send(answer, sender)
            if farend.session != before:
                peer = sender
        order = farend.tick()
        try:
            measured = plant.advance(order)
        except Exception as error:  # whatever fails, the rig is brought to rest
            own = isinstance(error, RigError)
            farend.trip(str(error) if own else f"{type(error).__name__}: {error}")
            measured = plant.truth()
        if peer is not None:
            for said in farend.pending():
                server.send(said, peer)
            response = farend.respond(
                measured, sampled=round(due * _NANO), now=round(clock.now() * _NANO)
            )
            if response is not None:
                server.send(response, peer)
        if trace is not None:
            try:
                trace.add(tick, due, farend, order, plant.truth())
            except OSError:  # a full disk; it is said when the trace is closed
                trace = None
        tick += 1
        if not ending and until():
            ending = True
            farend.trip("the server was told to end")
