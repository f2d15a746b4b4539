"""A rig at the other end of a wire, whatever the wire."""

import math
import secrets
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import ArgumentError, RigError
from hmpim.record import Role
from hmpim.rigs.block import Block, ChannelSpec, Layout, RunReport, Samples
from hmpim.rigs.clock import Clock, SystemClock
from hmpim.rigs.protocol import LimitsOfAxes, Stimuli
from hmpim.rigs.stimuli import stimuli_by_axis
from hmpim.rigs.wire.account import Account
from hmpim.rigs.wire.datagram import Command, Datagram, Kind, State, pack, unpack
from hmpim.rigs.wire.hello import Hello, check_agreement
from hmpim.rigs.wire.transport import Transport
from hmpim.stimulus import Limits
from hmpim.units import conversion_factor

__all__ = ["WireRig"]

FloatArray = NDArray[np.float64]

_NANO = 1e9
_INSTANT = 1e-9  # s: less is rounding, and not worth waiting for
_REASON = 0.1  # s: within this a far end that has stopped says why, unless that is lost
_STANDING = (State.AT_REST, State.ARMED, State.IDLE, State.FAULT)
_STOPPED = (State.BRAKING, State.AT_REST, State.FAULT)


class WireRig:
    """A rig that is spoken to in datagrams.

    Parameters
    ----------
    transport : Transport
        Carries them.
    expected : Hello or None
        What the far end must agree with: axes, units, rate, limits. None for anything.
    clock : Clock or None
        The near end's clock, which must be that of the run; None for the computer's own.
    answer : float
        Seconds in which a far end must answer a question.
    homing : float
        Seconds in which it must have gone to its start, or come to rest.
    stale : float
        Seconds without a response after which the run is given up.
    """

    def __init__(
        self,
        *,
        transport: Transport,
        expected: Hello | None = None,
        clock: Clock | None = None,
        answer: float = 2.0,
        homing: float = 60.0,
        stale: float = 0.25,
    ) -> None:
        for name, seconds in (("answer", answer), ("homing", homing), ("stale", stale)):
            number = isinstance(seconds, int | float) and not isinstance(seconds, bool)
            if not (number and 0.0 < seconds < math.inf):
                raise ArgumentError(f"{name} = {seconds!r} s must be a positive, finite time")
        self._transport = transport
        self._expected = Hello() if expected is None else expected
        self._clock: Clock = SystemClock() if clock is None else clock
        self._answer, self._homing, self._stale = answer, homing, stale
        self._stated: Hello | None = None
        self._session = 0
        self._sent = 0
        self._state = State.IDLE
        self._fault = ""
        self._heard = 0.0
        self._account: Account | None = None

    def use_clock(self, clock: Clock, /) -> None:
        """Take the clock of the run as the near end's."""
        self._clock = clock

    @property
    def name(self) -> str:
        """What the far end calls itself, or where it is."""
        return self._transport.name if self._stated is None else self._stated.name

    @property
    def axes(self) -> tuple[str, ...]:
        """Axes of the far end, or those expected before it is connected."""
        return self._expected.axes if self._stated is None else self._stated.axes

    @property
    def limits(self) -> LimitsOfAxes:
        """Limits that the far end states; None before it is connected."""
        return None if self._stated is None else dict(self._stated.limits)

    @property
    def watchdog(self) -> float | None:
        """Silence in s after which the far end brakes by itself; None if it does not."""
        return self._expected.watchdog if self._stated is None else self._stated.watchdog

    def __enter__(self) -> Self:
        self._transport.open()
        try:
            self._greet()
        except BaseException:
            self._transport.close()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
        /,
    ) -> None:
        try:
            self._say(Kind.BYE)
        finally:
            self._transport.close()

    def prepare(self, stimulus: Stimuli, /) -> Layout:
        """Check the rate and send the far end to its start; it moves there slowly.

        Raises
        ------
        RigError
            If it does not answer, refuses, or does not get there.
        """
        stated = self._there()
        named = stimuli_by_axis(stimulus, stated.axes, name=repr(self.name))
        check_agreement(Hello(rate=next(iter(named.values())).fs), stated)
        self._arm()
        units = dict(zip(stated.axes, stated.units, strict=True))
        order = {axis: stated.axes.index(axis) for axis in named}
        self._account = Account(
            columns=order,
            factors={axis: conversion_factor(units[axis], to=s.unit) for axis, s in named.items()},
        )
        commanded = [
            self._channel(f"{axis}.command", "input", axis, only.unit)
            for axis, only in named.items()
        ]
        measured = [
            self._channel(f"{axis}.position", "output", axis, only.unit)
            for axis, only in named.items()
        ]
        return Layout(
            channels=(*commanded, *measured),
            intersample=stated.intersample,
            source=stated.source or stated.name,
        )

    def _channel(self, name: str, role: Role, axis: str, unit: str) -> ChannelSpec:
        return ChannelSpec(
            name=name, role=role, unit=unit, axis=axis, quantity="position", clock=self.name
        )

    def play(self, block: Block, /) -> dict[str, Samples]:
        """Send each command when it is due; return what the far end has sampled.

        Raises
        ------
        RigError
            If it brakes, trips, or is not heard for too long.
        """
        stated, account = self._there(), self._taken()
        orders = self._orders(block, stated)
        pace = block.pace
        for k in range(len(block)):
            number = block.start + k
            if pace is not None:
                while (left := pace.left(number)) > _INSTANT:
                    self._listen(left)
                pace.wait(number)
            now = self._clock.now()
            if number == 0 or account.start is None:
                account.start, self._heard = now - block.time[k], now
            self._say(Kind.COMMAND, command=_row(orders, k), number=number, now=now)
            account.sent(number, now)
            while self._listen(0.0):
                pass
            self._check_alive(account)
        if block.last:
            self._drain(account, last=block.stop - 1, period=1.0 / (stated.rate or 1.0))
        return account.take(everything=block.last)

    def stop(self) -> None:
        """Tell the far end to brake, until it says that it stands; braking may take its time.

        Raises
        ------
        RigError
            If it cannot be heard: then its watchdog has to stop it.
        """
        if self._stated is None:
            return
        begun = self._clock.now()
        deadline = begun + self._answer
        while self._clock.now() < deadline:
            before = self._heard
            self._say(Kind.STOP)
            self._listen(0.02, strict=False)
            while self._listen(0.0, strict=False):
                pass
            if self._heard > before and self._state in _STANDING:
                return
            if self._heard > before and self._state is State.BRAKING:
                deadline = min(self._heard + self._answer, begun + self._homing)
        watchdog = self.watchdog
        braking = (
            f"its watchdog brakes it after {watchdog:g} s of silence"
            if watchdog
            else "it has no watchdog, so stop it by hand"
        )
        raise RigError(
            f"{self.name!r} at {self._transport.name} was commanded to stop and did not "
            "confirm within "
            f"{deadline - begun:.3g} s that it stands still; {braking}"
        )

    def report(self) -> RunReport:
        """Say what became of the datagrams, and put the far end's stamps right."""
        return self._taken().report(self.name)

    def _there(self) -> Hello:
        if self._stated is None:
            raise RigError(f"{self._transport.name} is not connected; enter it first")
        return self._stated

    def _taken(self) -> Account:
        if self._account is None:
            raise RigError(f"{self.name!r} was not prepared; prepare it first")
        return self._account

    def _say(
        self,
        kind: Kind,
        *,
        text: str = "",
        command: Command | None = None,
        number: int | None = None,
        now: float | None = None,
    ) -> None:
        if number is None:
            number, self._sent = self._sent, self._sent + 1
        now = self._clock.now() if now is None else now
        self._transport.send(
            pack(
                Datagram(
                    kind=kind,
                    session=self._session,
                    number=number,
                    sent=round(now * _NANO),
                    text=text,
                    command=command,
                )
            )
        )

    def _listen(self, timeout: float, *, strict: bool = True) -> bool:
        """Take one datagram if one comes in time; where not `strict`, garbage counts as lost."""
        data = self._transport.receive(timeout)
        if data is None:
            return False
        now = self._clock.now()
        try:
            datagram = unpack(data)
        except RigError:
            if strict:
                raise
            return True
        if datagram.session != self._session:
            return True  # of an earlier run
        if datagram.kind is Kind.REFUSED:
            self._fault = datagram.text
        elif datagram.kind is Kind.WELCOME:
            self._stated = Hello.from_json(datagram.text)
        elif datagram.response is not None:
            self._heard, self._state = now, datagram.response.state
            if self._account is not None:
                self._account.received(datagram, now)
        return True

    def _greet(self) -> None:
        """Say hello until somebody answers."""
        self._session = 1 + secrets.randbelow(2**32 - 2)
        self._stated, self._fault, self._account = None, "", None
        deadline = self._clock.now() + self._answer
        while self._clock.now() < deadline:
            self._say(Kind.HELLO, text=self._expected.to_json())
            again = self._clock.now() + 0.2
            while (left := again - self._clock.now()) > _INSTANT:
                self._listen(left)
                if self._fault:
                    raise RigError(f"{self._transport.name} refuses: {self._fault}")
                if self._stated is not None:
                    check_agreement(self._expected, self._stated)
                    return
        raise RigError(
            f"{self._transport.name} does not answer within {self._answer:g} s; "
            f"{self._transport.doubt}"
        )

    def _arm(self) -> None:
        """Let the far end go to its start, and wait until it is there."""
        begun = self._heard = self._clock.now()
        asked = -np.inf
        while True:
            now = self._clock.now()
            if self._state is not State.HOMING and now - asked > 0.2:
                self._say(Kind.ARM)
                asked = now
            self._listen(0.05)
            if self._fault:
                raise RigError(f"{self.name!r} refuses: {self._fault}")
            if self._state is State.ARMED:
                return
            if now - self._heard > self._answer or now - begun > self._homing:
                raise RigError(
                    f"{self.name!r} did not get ready within {now - begun:.3g} s; it says "
                    f"{self._state.name.lower().replace('_', ' ')}"
                )

    def _orders(self, block: Block, stated: Hello) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Commands of all axes of the far end, in its units; the others stay at their start."""
        columns = np.zeros((3, len(block), len(stated.axes)))
        for k, (axis, unit) in enumerate(zip(block.axes, block.units, strict=True)):
            if axis not in stated.axes:
                raise ArgumentError(f"axis {axis!r} is not known; use one of {stated.axes}")
            place = stated.axes.index(axis)
            factor = conversion_factor(unit, to=stated.units[place])
            columns[0, :, place] = factor * block.position[:, k]
            columns[1, :, place] = factor * block.velocity[:, k]
            columns[2, :, place] = factor * block.acceleration[:, k]
        return columns[0], columns[1], columns[2]

    def _check_alive(self, account: Account) -> None:
        if self._fault:
            raise RigError(f"{self.name!r} stopped by itself: {self._fault}")
        if self._state in _STOPPED and account.moved:
            until = self._clock.now() + _REASON
            while not self._fault and (left := until - self._clock.now()) > _INSTANT:
                self._listen(left, strict=False)
            raise RigError(f"{self.name!r} stopped by itself: {self._fault or 'no reason given'}")
        silent = self._clock.now() - self._heard
        if silent > self._stale:
            raise RigError(
                f"nothing was heard from {self.name!r} for {silent:.3g} s, so the run was ended"
            )

    def _drain(self, account: Account, *, last: int, period: float) -> None:
        """Wait for the sample at which the last command was in force, as long as it goes on.

        Where the last commands are lost, the far end stops by itself and names no fault: all that
        was to be played was played, and `Account.report` says how many are missing.
        """
        patience = max(self._stale, 20 * period)
        reached, since = account.in_force, self._clock.now()
        while account.in_force < last:
            self._listen(patience)
            if self._state is State.AT_REST and not self._fault:
                return
            if self._state is not State.BRAKING or self._fault:
                self._check_alive(account)
            if account.in_force > reached:
                reached, since = account.in_force, self._clock.now()
            elif self._clock.now() - since > patience:
                return  # the last samples were lost; they show as such


def _row(orders: tuple[FloatArray, FloatArray, FloatArray], k: int) -> Command:
    position, velocity, acceleration = orders
    return Command(position=position[k], velocity=velocity[k], acceleration=acceleration[k])


def expected_hello(
    *,
    axes: tuple[str, ...],
    unit: str,
    rate: float | None,
    limits: LimitsOfAxes,
    watchdog: float | None = None,
) -> Hello:
    """Return what a rig file expects of the far end.

    Examples
    --------
    >>> limits = Limits(position=5.0, unit="deg")
    >>> expected_hello(axes=("roll",), unit="deg", rate=500.0, limits=limits).limits["roll"].unit
    'deg'
    """
    if isinstance(limits, Limits):
        limits = dict.fromkeys(axes, limits)
    return Hello(
        axes=axes,
        units=tuple(unit for _ in axes) if unit else (),
        rate=rate,
        limits={} if limits is None else dict(limits),
        watchdog=watchdog,
    )
