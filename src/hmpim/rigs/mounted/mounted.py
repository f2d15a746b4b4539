"""A unit under test on a table: the table's encoder is the unit's input."""

from collections.abc import Mapping
from contextlib import ExitStack
from types import TracebackType
from typing import Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from hmpim.errors import ArgumentError, RigError
from hmpim.rigs.block import Block, ChannelSpec, Layout, RunReport, Samples
from hmpim.rigs.clock import Clock
from hmpim.rigs.mounted.carried import CarriedSensor
from hmpim.rigs.protocol import Clocked, LimitsOfAxes, Reporting, Rig, Seeded, Stimuli
from hmpim.rigs.sensor import Sensor

__all__ = ["Mounted", "Unit"]


@runtime_checkable
class Unit(Protocol):
    """Something that is carried: it has data of its own, on a clock of its own.

    A unit may have `report`, to put its stamps right (see `Arrivals`), and `seed`.
    """

    @property
    def name(self) -> str:
        """Name for messages, and of its clock."""
        ...

    def __enter__(self) -> Self:
        """Connect."""
        ...

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
        /,
    ) -> object:
        """Disconnect."""
        ...

    def prepare(self, encoders: Mapping[str, ChannelSpec], /) -> tuple[ChannelSpec, ...]:
        """Get ready, and say what is going to come; nothing moves.

        Parameters
        ----------
        encoders : mapping of axis to ChannelSpec
            What the carrier measures of each axis that moves.
        """
        ...

    def read(self, now: float, moved: Mapping[str, Samples], /) -> Mapping[str, Samples]:
        """Return what has come in from the unit, stamped with its own clock.

        Parameters
        ----------
        now : float
            Time in the run, s.
        moved : mapping of axis to Samples
            What the carrier's encoders have read since the call before. A real unit does not
            look at it; a simulated one is moved by it.
        """
        ...

    def stop(self) -> None:
        """No more data are wanted. Called always."""
        ...


class Mounted:
    """A unit under test on a carrier, such as a seeker on a motion table.

    The carrier plays. The record has the carrier's commands as inputs, and its encoders and
    the unit's channels as outputs; an encoder is also the input of the unit::

        table = identify(record.with_roles(inputs=["roll.command"], outputs=["roll.position"]))
        unit = identify(record.with_roles(inputs=["roll.position"], outputs=["angle"]))

    Parameters
    ----------
    carrier : Rig
        What moves.
    unit : Unit or Sensor
        What is carried; a `Sensor` is moved by the encoder of the one axis that moves.

    Raises
    ------
    ArgumentError
        If the carrier is no rig, or the unit no unit.

    Examples
    --------
    >>> from hmpim.rigs import MotionTable
    >>> seeker = Sensor(delay=0.01, name="seeker", output_name="angle")
    >>> Mounted(MotionTable(), CarriedSensor(seeker, fs=200.0, clock_offset=0.02)).name
    'seeker on table'
    """

    def __init__(self, carrier: Rig, unit: Unit | Sensor) -> None:
        if not isinstance(carrier, Rig):
            raise ArgumentError(
                f"{carrier!r} is not a rig, so it carries nothing; see hmpim.rigs.Rig"
            )
        if isinstance(unit, Sensor):
            unit = CarriedSensor(unit)
        if not isinstance(unit, Unit):
            raise ArgumentError(
                f"{unit!r} is not a unit that can be carried; see "
                "hmpim.rigs.mounted.Unit, or give a Sensor"
            )
        self._carrier, self._unit = carrier, unit
        self._stack = ExitStack()
        self._encoders: dict[str, ChannelSpec] = {}

    @property
    def name(self) -> str:
        """Both names."""
        return f"{self._unit.name} on {self._carrier.name}"

    @property
    def axes(self) -> tuple[str, ...]:
        """Axes of the carrier."""
        return self._carrier.axes

    @property
    def limits(self) -> LimitsOfAxes:
        """Limits of the carrier."""
        return self._carrier.limits

    @property
    def moves(self) -> bool:
        """Whether the carrier does."""
        return bool(getattr(self._carrier, "moves", True))

    @property
    def follows_commands(self) -> bool:
        """Whether the carrier plays what each block says."""
        return bool(getattr(self._carrier, "follows_commands", self.moves))

    @property
    def watchdog(self) -> float | None:
        """Watchdog of the carrier."""
        watchdog: float | None = getattr(self._carrier, "watchdog", None)
        return watchdog

    def seed(self, rng: np.random.Generator, /) -> None:
        """Draw from generators of one origin in the next run."""
        ours, theirs = rng.spawn(2)
        for rig, own in ((self._carrier, ours), (self._unit, theirs)):
            if isinstance(rig, Seeded):
                rig.seed(own)

    def use_clock(self, clock: Clock, /) -> None:
        """Let both go by the clock of the run, as far as they go by one."""
        for rig in (self._carrier, self._unit):
            if isinstance(rig, Clocked):
                rig.use_clock(clock)

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            self._carrier.__enter__()
            stack.callback(self._carrier.__exit__, None, None, None)
            self._unit.__enter__()
            stack.callback(self._unit.__exit__, None, None, None)
            self._stack = stack.pop_all()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
        /,
    ) -> None:
        self._stack.__exit__(kind, error, trace)

    def prepare(self, stimulus: Stimuli, /) -> Layout:
        """Get both ready, the unit first, since a carrier may move to its start.

        Raises
        ------
        RigError
            If the carrier does not say which channels are its encoders, or two channels have
            one name.
        """
        layout = self._carrier.prepare(stimulus)
        if layout is None:
            raise RigError(
                f"{self._carrier.name!r} does not say what it records; a carrier must return a "
                "Layout whose outputs name their axis and quantity"
            )
        self._encoders = {
            spec.axis: spec
            for spec in layout.of("output")
            if spec.axis is not None and spec.quantity == "position"
        }
        own = self._unit.prepare(self._encoders)
        taken = {spec.name for spec in layout.channels}
        for spec in own:
            if spec.name in taken:
                raise RigError(
                    f"channel {spec.name!r} of {self._unit.name!r} has the name of one of "
                    f"{self._carrier.name!r}; give it another"
                )
        return Layout(
            channels=(*layout.channels, *own),
            intersample=layout.intersample,
            source=f"{self._unit.name} on {layout.source or self._carrier.name}",
        )

    def play(self, block: Block, /) -> Mapping[str, ArrayLike | Samples]:
        """Let the carrier play, and read the unit.

        Raises
        ------
        RigError
            If the carrier returns bare arrays without names.
        """
        reply = self._carrier.play(block)
        if reply is not None and not isinstance(reply, Mapping):
            raise RigError(
                f"{self._carrier.name!r} returns an array; a carrier must return its channels by "
                "name"
            )
        given = dict(reply or {})
        encoded = {axis: spec.name for axis, spec in self._encoders.items() if spec.name in given}
        moved = {axis: _stamped(given[name], block) for axis, name in encoded.items()}
        waited = block.pace is not None and block.pace.now() > 0.0
        now = block.pace.now() if waited and block.pace is not None else float(block.time[-1])
        return {**given, **self._unit.read(now, moved)}

    def stop(self) -> None:
        """Stop the carrier, then the unit."""
        try:
            self._carrier.stop()
        finally:
            self._unit.stop()

    def report(self) -> RunReport:
        """What both have to say."""
        said = [rig.report() for rig in (self._carrier, self._unit) if isinstance(rig, Reporting)]
        return RunReport(
            findings=tuple(finding for one in said for finding in one.findings),
            clocks={name: retime for one in said for name, retime in one.clocks.items()},
        )


def _stamped(given: ArrayLike | Samples, block: Block) -> Samples:
    """Samples of an encoder, at the times of the block where they bring none."""
    if isinstance(given, Samples):
        return given
    return Samples(time=block.time, values=np.asarray(given, dtype=np.float64))
