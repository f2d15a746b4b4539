"""What goes to a rig and what comes back: blocks of commands, replies, and their layout."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmpim.errors import ArgumentError, RigError
from hmpim.record import ROLES, Finding, Intersample, Role
from hmpim.units import check_unit

__all__ = [
    "Block",
    "ChannelSpec",
    "Layout",
    "Pace",
    "Quantity",
    "Reply",
    "RunReport",
    "Samples",
]

FloatArray = NDArray[np.float64]
Quantity = Literal["position", "velocity", "acceleration"]
"""Which quantity of the motion a channel or a sensor is about."""


class Pace(Protocol):
    """The clock of a run, as a rig sees it."""

    def now(self) -> float:
        """Seconds from the instant at which the first command was due."""
        ...

    def left(self, number: int) -> float:
        """Seconds until command `number` of the run is due; negative if that is past."""
        ...

    def note(self, start: int, sent: FloatArray) -> None:
        """Note when commands went that somebody else let go: those from number `start` on, s."""
        ...

    def wait(self, number: int) -> None:
        """Return when command `number` of the run is due."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Block:
    """Consecutive commands of all axes that move.

    Parameters
    ----------
    axes : tuple of str
        Axes that move, one for each column below.
    start : int
        Number of the first command in the run.
    time : ndarray, shape (n,)
        When each is due, s from the start of the stimulus.
    position, velocity, acceleration : ndarray, shape (n, m)
        Commands, in `units` and their derivatives.
    units : tuple of str
        Of each axis's position.
    last : bool
        Whether the run ends with this block.
    pace : Pace or None
        The clock; None lets `due` go on at once.

    Examples
    --------
    >>> zeros = np.zeros((2, 1))
    >>> block = Block(
    ...     axes=("roll",), start=4, time=np.array([0.4, 0.5]), position=np.ones((2, 1)),
    ...     velocity=zeros, acceleration=zeros, units=("deg",),
    ... )
    >>> len(block), block.of("roll").tolist(), list(block.due())
    (2, [1.0, 1.0], [0, 1])
    """

    axes: tuple[str, ...]
    start: int
    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    units: tuple[str, ...]
    last: bool = False
    pace: Pace | None = None

    def __len__(self) -> int:
        return self.time.size

    @property
    def stop(self) -> int:
        """Number of the command after the last."""
        return self.start + self.time.size

    def of(self, axis: str, quantity: Quantity = "position") -> FloatArray:
        """One quantity of one axis, shape (n,).

        Raises
        ------
        ArgumentError
            If the axis does not move.
        """
        if axis not in self.axes:
            raise ArgumentError(f"axis {axis!r} does not move; those that do are {self.axes}")
        values: FloatArray = getattr(self, quantity)
        return values[:, self.axes.index(axis)]

    def due(self) -> Iterator[int]:
        """Yield 0, 1, ... n - 1, each when its command is due."""
        for k in range(self.time.size):
            if self.pace is not None:
                self.pace.wait(self.start + k)
            yield k


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Samples:
    """Samples of a channel on a clock of its own.

    Parameters
    ----------
    time : array_like, shape (n,)
        Time stamps, s.
    values : array_like, shape (n,)
        In the channel's unit.

    Raises
    ------
    RigError
        If there are not as many of one as of the other.

    Examples
    --------
    >>> Samples(time=[0.0, 0.1], values=[1.0, 2.0]).values.tolist()
    [1.0, 2.0]
    """

    time: FloatArray
    values: FloatArray

    @classmethod
    def joined(cls, parts: Sequence["Samples"]) -> "Samples":
        """Put parts of a channel together, in order.

        Examples
        --------
        >>> part = Samples(time=[0.0], values=[1.0])
        >>> Samples.joined([part, Samples(time=[0.1], values=[2.0])]).time.tolist()
        [0.0, 0.1]
        """
        return cls(
            time=np.concatenate([part.time for part in parts]),
            values=np.concatenate([part.values for part in parts]),
        )

    def __post_init__(self) -> None:
        for name in ("time", "values"):
            object.__setattr__(self, name, np.asarray(getattr(self, name), dtype=np.float64))
        if self.time.ndim != 1 or self.time.shape != self.values.shape:
            raise RigError(
                f"samples of shape {self.values.shape} with time stamps of shape "
                f"{self.time.shape}; give one stamp for each, shape (n,)"
            )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RunReport:
    """What a rig says about a run that is over.

    Parameters
    ----------
    findings : tuple of Finding
        What a person should know; they go into the record.
    clocks : mapping of str to callable
        By the name of a clock (`ChannelSpec.clock`): stamps as delivered (s, shape (n,)) to
        time in the run.

    Examples
    --------
    >>> RunReport().findings
    ()
    """

    findings: tuple[Finding, ...] = ()
    clocks: Mapping[str, Callable[[FloatArray], FloatArray]] = field(default_factory=dict)


Reply = Mapping[str, ArrayLike | Samples] | ArrayLike | None
"""What `play` returns: samples by channel.

A bare array, shape (n,) or (n, m), is one column for each output, on the block's clock; a channel
in a mapping may bring `Samples`, on a clock of its own and as many as have come in. None or an
empty mapping: nothing has come in yet.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelSpec:
    """A channel that a rig will deliver.

    Parameters
    ----------
    name : str
        Unique in the record.
    role : {'input', 'output', 'reference', 'auxiliary'}
        What it is in the record.
    unit : str
        Of its values.
    axis : str or None
        Axis it is about; None for none.
    quantity : {'position', 'velocity', 'acceleration'} or None
        Quantity of that axis's motion, where it is one. A measured position is watched against
        the axis's limits.
    commanded : bool
        True for the command itself, of this axis and quantity: the run fills it in where the rig
        does not return it.
    clock : str
        Name of the clock that stamps its samples, where that is not the run's own;
        `RunReport.clocks` puts the stamps right when the run is over.

    Raises
    ------
    ArgumentError
        If it has no name, or a role that is none.

    Examples
    --------
    >>> ChannelSpec(name="y", role="output", unit="deg").role
    'output'
    """

    name: str
    role: Role
    unit: str = ""
    axis: str | None = None
    quantity: Quantity | None = None
    commanded: bool = False
    clock: str = ""

    def __post_init__(self) -> None:
        check_unit(self.unit)
        if not self.name:
            raise ArgumentError("a channel has no name; give each one its own")
        if self.role not in ROLES:
            raise ArgumentError(f"role = {self.role!r} of {self.name!r}; use {ROLES}")
        if self.commanded and (self.axis is None or self.quantity is None):
            raise ArgumentError(
                f"{self.name!r} is commanded; state the axis and the quantity of the command"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """What a rig will deliver in a run.

    Parameters
    ----------
    channels : tuple of ChannelSpec
        At least one input and one output, names unique.
    intersample : {'zoh', 'foh', 'bandlimited', 'feedforward'} or None
        What the inputs do between samples, where known.
    source : str
        Where the record comes from, for people.

    Raises
    ------
    ArgumentError
        If an input or an output is missing, or a name is used twice.

    Examples
    --------
    >>> y = ChannelSpec(name="y", role="output")
    >>> [c.name for c in Layout(channels=(ChannelSpec(name="u", role="input"), y)).of("output")]
    ['y']
    """

    channels: tuple[ChannelSpec, ...]
    intersample: Intersample | None = None
    source: str = ""

    def __post_init__(self) -> None:
        names = [c.name for c in self.channels]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ArgumentError(f"channel {twice[0]!r} is there twice; give each its own name")
        for role in ("input", "output"):
            if not any(c.role == role for c in self.channels):
                raise ArgumentError(f"no channel of {names} is an {role}; a record needs one")

    def of(self, role: Role) -> tuple[ChannelSpec, ...]:
        """Channels of one role, in order."""
        return tuple(c for c in self.channels if c.role == role)
