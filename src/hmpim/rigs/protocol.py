"""What every unit under test can do: play a stimulus and hand back a record."""

from typing import Protocol, runtime_checkable

import numpy as np

from hmpim.record import Record
from hmpim.stimulus import Limits, Stimulus

__all__ = ["Rig"]


@runtime_checkable
class Rig(Protocol):
    """A unit under test, real or simulated.

    Anything with these three is a rig; nothing is inherited.

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
    def limits(self) -> Limits | None:
        """What the unit bears; None where nothing bounds it. Checked before anything moves."""
        ...

    def play(self, stimulus: Stimulus, *, rng: np.random.Generator) -> Record:
        """Apply the stimulus and record what went in and what came out.

        Parameters
        ----------
        stimulus : Stimulus
            What to play; its limits were checked against the rig's.
        rng : numpy.random.Generator
            Source of whatever is random in a simulated unit; a real one ignores it.

        Raises
        ------
        RigError
            If the unit refuses, fails or is stopped.
        """
        ...
