"""The far end of a wire: what a rig's controller does with datagrams, tick by tick.

Pure of sockets and clocks, so that it can be served over anything and tested without waiting::

    IDLE ──HELLO, ARM──► HOMING ──at the start──► ARMED ──first COMMAND──► MOVING
      ▲                                                                      │
      └────BYE──── AT_REST ◄──stands still── BRAKING ◄──STOP, silence, fault─┘

Commands wait for their turn a few ticks, so that swapped ones are put in order and the network's
jitter does not reach the rig. One that has not come is reckoned from the last, and counted. After
the watchdog's silence all axes brake with their full deceleration; earlier where going on would
leave no smooth stop inside the limits.
"""

import secrets
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import RigError
from hmpim.rigs.brake import Brake
from hmpim.rigs.wire.datagram import (
    NONE,
    Command,
    Datagram,
    Kind,
    Response,
    State,
    pack,
    unpack,
)
from hmpim.rigs.wire.hello import Hello, check_agreement
from hmpim.rigs.wire.sequence import Counts, Sequence
from hmpim.stimulus import Limits

__all__ = ["FarEnd", "Order"]

FloatArray = NDArray[np.float64]

_GRACE = 1.0 + 1e-6  # commands stand on limits, and went through units and rounding
_ADAPT = 50  # ticks over which the buffer's depth is looked at
_FLOW = 0.8  # share of these in which a command must have come, for the depth to mean anything
_RECKON = 0.005  # s: so long a missing command is reckoned with its acceleration


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Order:
    """What the rig is to do in a tick, each shape (n,)."""

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


class FarEnd:
    """A rig's side of the wire.

    Parameters
    ----------
    hello : Hello
        What it states: all of it, limits and watchdog included.
    latency : int
        Ticks that a command waits for its turn.

    Raises
    ------
    RigError
        If the hello leaves out what a far end must state.
    """

    def __init__(self, hello: Hello, *, latency: int = 2) -> None:
        if not hello.axes or hello.rate is None or hello.watchdog is None:
            raise RigError("a far end must state its axes, its rate and its watchdog")
        self.hello = hello
        self._count = len(hello.axes)
        self._period = 1.0 / hello.rate
        self._latency = latency
        self._limit = _arrays(hello.axes, hello.limits)
        self.state = State.IDLE
        self.fault = ""
        self._still = np.zeros(self._count)
        self._last = Order(position=self._still, velocity=self._still, acceleration=self._still)
        self._tick = 0
        self._homing: tuple[FloatArray, int, int] | None = None
        self._outbox: list[bytes] = []
        self._forget(session=0)

    @property
    def counts(self) -> Counts:
        """What became of the commands of this session."""
        return self._sequence.counts

    @property
    def late(self) -> int:
        """Commands of this session that came when their turn was over."""
        return self._late

    @property
    def reckoned(self) -> int:
        """Ticks of this session whose command had not come."""
        return self._reckoned

    @property
    def session(self) -> int:
        """Of the run that is going on; 0 for none."""
        return self._session

    def receive(self, data: bytes, *, now: int) -> list[bytes]:
        """Take a datagram that arrived at `now` (ns of this end's clock); return the answers."""
        try:
            datagram = unpack(data)
        except RigError as error:
            return [self._text(Kind.REFUSED, str(error), session=0, now=now)]
        if datagram.kind is Kind.HELLO:
            return [self._greet(datagram, now=now)]
        if datagram.session != self._session or self._session == 0:
            return []  # of an earlier run, or of somebody else
        if datagram.kind is Kind.ARM:
            if self.state in (State.IDLE, State.AT_REST):
                self._forget(session=self._session)  # commands count from 0 each time
                self.state, self._homing = State.HOMING, None
        elif datagram.kind is Kind.COMMAND and datagram.command is not None:
            self._take(datagram.number, datagram.command, now=now)
        elif datagram.kind is Kind.STOP:
            self._brake("")
        elif datagram.kind is Kind.BYE and self.state not in (State.MOVING, State.BRAKING):
            self.state = State.IDLE
            self._forget(session=0)
        return []

    def tick(self) -> Order:
        """Go on by one period; return what is in force in it."""
        self._tick += 1
        self._number_in_force, self._was_reckoned = NONE, False
        if self.state is State.HOMING:
            self._last = self._go_home()
        elif self.state is State.ARMED:
            self._begin()
        if self.state is State.MOVING:
            self._last = self._follow()
        if self.state is State.BRAKING:
            self._last = self._slow_down()
        return self._last

    def respond(self, measured: FloatArray, *, sampled: int, now: int) -> bytes | None:
        """Return the response of this tick; None while there is no session.

        Parameters
        ----------
        measured : ndarray, shape (n,)
            Positions read at this tick, from the start, in the axes' units.
        sampled, now : int
            When they were read, and the time; ns of this end's clock.
        """
        if self._session == 0:
            return None
        response = Response(
            in_force=self._number_in_force,
            newest=self._newest,
            state=self.state,
            reckoned=self._was_reckoned,
            sampled=sampled,
            arrived=self._arrived,
            position=self._last.position,
            measured=measured,
        )
        return pack(
            Datagram(
                kind=Kind.RESPONSE,
                session=self._session,
                number=self._tick % NONE,
                sent=now,
                response=response,
            )
        )

    def pending(self) -> list[bytes]:
        """Return what is to be said beside the responses, such as why it brakes."""
        said = list(self._outbox)
        self._outbox.clear()
        return said

    def trip(self, fault: str) -> None:
        """Brake for a reason of the rig's own; it takes a new session to go on."""
        self._brake(fault)

    def _text(self, kind: Kind, text: str, *, session: int, now: int) -> bytes:
        return pack(Datagram(kind=kind, session=session, sent=now, text=text))

    def _greet(self, datagram: Datagram, *, now: int) -> bytes:
        try:
            expected = Hello.from_json(datagram.text)
            check_agreement(expected, self.hello)
        except RigError as error:
            return self._text(Kind.REFUSED, str(error), session=datagram.session, now=now)
        if datagram.session != self._session or self._session == 0:
            if self.state not in (State.IDLE, State.AT_REST, State.ARMED, State.FAULT):
                busy = f"{self.hello.name!r} is busy with another run ({self.state.name.lower()})"
                return self._text(Kind.REFUSED, busy, session=datagram.session, now=now)
            self._forget(session=datagram.session or 1 + secrets.randbelow(NONE - 1))
            self.state, self.fault = State.AT_REST, ""
        return self._text(Kind.WELCOME, self.hello.to_json(), session=self._session, now=now)

    def _forget(self, *, session: int) -> None:
        """Begin with no commands."""
        self._session = session
        self._sequence = Sequence()
        self._waiting: dict[int, Command] = {}
        self._next: int | None = None
        self._newest, self._arrived = NONE, 0
        self._late = self._reckoned = 0
        self._silent = 0
        self._wait = self._latency
        self._arrivals = 0
        self._depths: list[int] = []
        self._outbox.clear()
        self._brake_from: tuple[Brake, int] | None = None
        self._number_in_force, self._was_reckoned = NONE, False

    def _take(self, number: int, command: Command, *, now: int) -> None:
        if command.position.size != self._count:
            self._brake(
                f"a command for {command.position.size} axes came, and there are {self._count}"
            )
            return
        if not self._sequence.arrived(number):
            return
        if self._newest == NONE or number > self._newest:
            self._newest, self._arrived = number, now
            self._silent = 0
        self._arrivals += 1
        if self._next is not None and number < self._next:
            self._late += 1
            return
        if self.state in (State.ARMED, State.MOVING):
            self._waiting[number] = command

    def _begin(self) -> None:
        """Start to follow once the first command has waited its turn."""
        if not self._waiting:
            return
        if self._wait > 0:
            self._wait -= 1
            return
        self._next = min(self._waiting)
        self.state = State.MOVING

    def _follow(self) -> Order:
        assert self._next is not None
        self._adapt()
        self._silent += 1
        command = self._waiting.pop(self._next, None)
        last = self._last
        if command is None:
            order = self._reckon()
            self._reckoned += 1
            self._was_reckoned = True
        else:
            order = Order(
                position=command.position,
                velocity=command.velocity,
                acceleration=command.acceleration,
            )
            self._number_in_force = self._next
        self._next += 1
        if command is not None and (fault := self._beyond(order)):
            self._brake(fault)
            return last
        assert self.hello.watchdog is not None
        if command is None and (
            self._silent * self._period >= self.hello.watchdog or self._must_brake(order)
        ):
            self._brake("" if not order.velocity.any() else "no command came")
        return last if self.state is State.BRAKING else order

    def _adapt(self) -> None:
        """Shift the turn where all commands come late, or wait ever longer: clocks drift."""
        assert self._next is not None
        self._depths.append(self._newest - self._next)
        if len(self._depths) < _ADAPT:
            return
        depths, self._depths = self._depths, []
        arrivals, self._arrivals = self._arrivals, 0
        if arrivals < _FLOW * _ADAPT:
            return
        if max(depths) < 0:
            self._next += max(depths)
        elif min(depths) > self._latency + 1:
            self._next += 1
            self._waiting = {n: c for n, c in self._waiting.items() if n >= self._next}

    def _reckon(self) -> Order:
        """Go on as the last order was going, its acceleration for a short while."""
        last, dt = self._last, self._period
        fresh = self._silent * dt <= _RECKON
        acceleration = last.acceleration if fresh else self._still
        velocity = np.clip(
            last.velocity + acceleration * dt, -self._limit.velocity, self._limit.velocity
        )
        return Order(
            position=last.position + 0.5 * (last.velocity + velocity) * dt,
            velocity=velocity,
            acceleration=acceleration,
        )

    def _reach(self, order: Order) -> FloatArray:
        with np.errstate(over="ignore"):  # of a damaged command: infinite is beyond every limit
            way = np.square(order.velocity) / (2.0 * self._limit.acceleration)
        return np.asarray(np.abs(order.position) + way)

    def _must_brake(self, order: Order) -> bool:
        """Whether one more tick like this would leave no smooth stop inside the limits."""
        return bool(np.any(self._reach(order) > self._limit.position))

    def _beyond(self, order: Order) -> str:
        """Say which limit an order is beyond; empty if none."""
        rows = (
            ("position", np.abs(order.position), self._limit.position),
            ("velocity", np.abs(order.velocity), self._limit.velocity),
            ("acceleration", np.abs(order.acceleration), self._limit.acceleration),
            ("stopping distance", self._reach(order), self._limit.position),
            (
                "step of the position",
                np.abs(order.position - self._last.position),
                3.0 * self._limit.velocity * self._period
                + 4.0 * self._limit.acceleration * self._period**2,
            ),
        )
        for what, value, limit in rows:
            over = ~(value <= limit * _GRACE)
            if over.any():
                k = int(np.argmax(over))
                return (
                    f"{what} {value[k]:.6g} commanded of {self.hello.axes[k]} is beyond "
                    f"{limit[k]:.6g} {self.hello.units[k]}"
                )
        return ""

    def _brake(self, fault: str) -> None:
        if fault and not self.fault:
            self.fault = fault
            self._outbox.append(self._text(Kind.REFUSED, fault, session=self._session, now=0))
        if self.state in (State.BRAKING, State.AT_REST, State.IDLE, State.FAULT):
            return
        brake = Brake(
            position=self._last.position,
            velocity=self._last.velocity,
            acceleration=self._limit.acceleration,
        )
        self._brake_from = (brake, self._tick)
        self.state = State.BRAKING
        self._waiting.clear()

    def _slow_down(self) -> Order:
        assert self._brake_from is not None
        brake, since = self._brake_from
        seconds = (self._tick - since) * self._period
        position, velocity, acceleration = brake.at(seconds)
        if seconds >= brake.duration:
            self.state = State.FAULT if self.fault else State.AT_REST
        return Order(position=position, velocity=velocity, acceleration=acceleration)

    def _go_home(self) -> Order:
        """Move to the start along a quintic, with a tenth of velocity and acceleration."""
        if self._homing is None:
            away = np.abs(self._last.position)
            # A quintic of length T over d peaks at 15/8 d/T and 10/√3 d/T².
            speed = np.where(np.isfinite(self._limit.velocity), 0.1 * self._limit.velocity, 1.0)
            push = np.where(
                np.isfinite(self._limit.acceleration), 0.1 * self._limit.acceleration, 1.0
            )
            seconds = max(
                float(np.max(1.875 * away / speed)),
                float(np.max(np.sqrt(5.7735 * away / push))),
            )
            ticks = int(np.ceil(seconds / self._period)) if away.any() else 0
            self._homing = (self._last.position, self._tick, ticks)
        begin, since, ticks = self._homing
        done = self._tick - since
        if done >= ticks:
            self.state = State.ARMED
            return Order(position=self._still, velocity=self._still, acceleration=self._still)
        s, T = done / ticks, ticks * self._period
        left = 1.0 - s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
        rate = -30.0 * s * s * (1.0 - s) ** 2 / T
        bend = -60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / T**2
        return Order(position=left * begin, velocity=rate * begin, acceleration=bend * begin)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _LimitArrays:
    """Limits of all axes, each shape (n,)."""

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


def _arrays(axes: tuple[str, ...], limits: Mapping[str, Limits]) -> _LimitArrays:
    bounds = [limits.get(axis, Limits()) for axis in axes]
    return _LimitArrays(
        position=np.array([b.position for b in bounds]),
        velocity=np.array([b.velocity for b in bounds]),
        acceleration=np.array([b.acceleration for b in bounds]),
    )
