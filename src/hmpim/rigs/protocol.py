"""What every unit under test can do: be prepared, play block after block, and stop.

`hmpim.run` owns the clock and calls, in this order::

    with rig:                        # connect
        layout = rig.prepare(stimulus)   # check, arm; nothing moves yet
        for block in blocks:
            reply = rig.play(block)      # send what is due, return what has come in
        rig.stop()                       # always, whatever has failed
"""

from collections.abc import Mapping
from types import TracebackType
from typing import Protocol, Self, runtime_checkable

import numpy as np

from hmpim.rigs.block import Block, Layout, Reply, RunReport
from hmpim.rigs.clock import Clock
from hmpim.stimulus import Limits, Stimulus

__all__ = ["Clocked", "LimitsOfAxes", "Reporting", "Rig", "Seeded", "Stimuli"]

Stimuli = Stimulus | Mapping[str, Stimulus]
"""One stimulus, or one for each axis that moves."""

LimitsOfAxes = Limits | Mapping[str, Limits] | None
"""Limits of every axis alike, or of each; None where none are stated."""


@runtime_checkable
class Rig(Protocol):
    """A unit under test, real or simulated.

    Anything with these is a rig; nothing is inherited. A rig may say ``moves = False`` if it is
    software or a simulation: only then it may leave its limits unstated.

    Examples
    --------
    >>> from hmpim.rigs import Sensor
    >>> isinstance(Sensor(delay=0.15), Rig)
    True
    """

    @property
    def name(self) -> str:
        """Name for messages and records."""
        ...

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes; empty for a rig that takes any one stimulus."""
        ...

    @property
    def limits(self) -> LimitsOfAxes:
        """Limits of the unit. Checked before anything moves; None is refused if it moves."""
        ...

    def __enter__(self) -> Self:
        """Connect. `hmpim.run` enters the rig itself."""
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

    def prepare(self, stimulus: Stimuli, /) -> Layout | None:
        """Check the stimulus and get ready; nothing moves.

        Parameters
        ----------
        stimulus : Stimulus or mapping of axis to Stimulus
            As given to `hmpim.run`; its limits were checked.

        Returns
        -------
        Layout or None
            What will be recorded. None for the commands of each axis as inputs, and one output
            for each, in the stimulus's unit.

        Raises
        ------
        RigError
            If the unit refuses.
        """
        ...

    def play(self, block: Block, /) -> Reply:
        """Send the commands of a block, each when it is due, and return what has come in.

        Parameters
        ----------
        block : Block
            The next commands; ``for k in block.due():`` waits for each.

        Raises
        ------
        RigError
            If the unit fails or has stopped by itself.
        """
        ...

    def stop(self) -> None:
        """Bring everything to rest and disarm. Called always, even where nothing moved yet."""
        ...


@runtime_checkable
class Reporting(Protocol):
    """A rig that has something to say about a run when it is over."""

    def report(self) -> RunReport:
        """Say it; called after `stop`, before the rig is left."""
        ...


@runtime_checkable
class Clocked(Protocol):
    """A rig that waits and stamps by a clock: it is given that of the run before it is entered."""

    def use_clock(self, clock: Clock, /) -> None:
        """Go by this clock from now on."""
        ...


@runtime_checkable
class Seeded(Protocol):
    """A rig with something random in it, drawn from the generator it is given."""

    def seed(self, rng: np.random.Generator, /) -> None:
        """Draw from `rng` in the next run."""
        ...
