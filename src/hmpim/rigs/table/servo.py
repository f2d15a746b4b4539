"""The servo of each axis: a position loop around a rate loop around the torque.

At each tick of the controller::

    rate wanted = position gain · (command - encoder) + velocity command     (PV, PVA), limited
    acceleration wanted = rate gain · (rate wanted - tachometer) + acceleration command
                                                                             (PVA), limited
    torque = inertia · acceleration wanted + the weight held at the start

With P the velocity and acceleration commands count as zero, so that the rate loop brakes. The
torque of one axis knows nothing of the others: what couples them is the mechanics.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmpim.rigs.table.axes import CommandMode

__all__ = ["RESERVE", "Gains", "feedforward"]

FloatArray = NDArray[np.float64]

RESERVE = 1.25
"""The servo's own limiters stand this far above the limits for commands."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Gains:
    """What a servo is set to, axis by axis in the order of `AXES`.

    Parameters
    ----------
    position : ndarray, shape (5,)
        Rate per position error, 1/s.
    rate : ndarray, shape (5,)
        Acceleration per rate error, 1/s.
    inertia : ndarray, shape (5,)
        Torque per acceleration that the servo reckons with, kg·m².
    """

    position: FloatArray
    rate: FloatArray
    inertia: FloatArray

    def __post_init__(self) -> None:
        for name in ("position", "rate", "inertia"):
            array = np.array(getattr(self, name), dtype=np.float64)
            array.setflags(write=False)
            object.__setattr__(self, name, array)


def feedforward(mode: CommandMode) -> tuple[float, float]:
    """Shares of the velocity and the acceleration command that the servo uses.

    Examples
    --------
    >>> feedforward("PV")
    (1.0, 0.0)
    """
    return float(mode in ("PV", "PVA")), float(mode == "PVA")
