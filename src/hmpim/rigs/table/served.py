"""The table at the far end of a wire."""

import numpy as np
from numpy.typing import NDArray

from hmpim.rigs.table.axes import AXES
from hmpim.rigs.table.simulate import History
from hmpim.rigs.table.table import MotionTable
from hmpim.rigs.wire.farend import Order
from hmpim.rigs.wire.hello import Hello

__all__ = ["TablePlant", "table_hello"]

FloatArray = NDArray[np.float64]


class TablePlant:
    """The simulated table, moved a tick at a time.

    Parameters
    ----------
    table : MotionTable
        What is simulated; orders count from its start, in deg.
    rate : float
        Ticks a second, Hz; they must divide the controller's rate.
    rng : numpy.random.Generator
        Source of the encoders' noise.

    Examples
    --------
    >>> plant = TablePlant(MotionTable(), rate=1000.0, rng=np.random.default_rng(0))
    >>> still = np.zeros(5)
    >>> read = plant.advance(Order(position=still, velocity=still, acceleration=still))
    >>> bool(np.abs(read).max() < 0.01)
    True
    """

    def __init__(self, table: MotionTable, *, rate: float, rng: np.random.Generator) -> None:
        self._table, self._rate, self._rng = table, rate, rng
        self._start = np.degrees(table.start_angles)
        self._motion = table.motion(rate, rng=rng)
        self._true: FloatArray = np.zeros(len(AXES))

    def advance(self, order: Order) -> FloatArray:
        """Read the encoders and follow an order for a tick, deg from the start.

        Raises
        ------
        RigError
            If an axis runs away; the table is then put back to its start.
        """
        try:
            history = self._motion.advance(
                np.radians(self._start + order.position)[None, :],
                np.radians(order.velocity)[None, :],
                np.radians(order.acceleration)[None, :],
            )
        except BaseException:
            self._motion = self._table.motion(self._rate, rng=self._rng)
            raise
        return self._read(history)

    def truth(self) -> FloatArray:
        """Where the axes truly are, deg from the start."""
        return self._true

    def _read(self, history: History) -> FloatArray:
        self._true = history.position[0] - self._start
        return np.asarray(history.encoder[0] - self._start, dtype=np.float64)


def table_hello(table: MotionTable, *, rate: float, watchdog: float) -> Hello:
    """Return what the served table states.

    Examples
    --------
    >>> table_hello(MotionTable(), rate=1000.0, watchdog=0.08).limits["roll"].velocity
    800.0
    """
    return Hello(
        name=table.name,
        axes=AXES,
        units=tuple("deg" for _ in AXES),
        rate=rate,
        limits=table.limits,
        watchdog=watchdog,
        intersample="zoh" if table.mode == "P" else "feedforward",
        source=f"simulated {table.name}, {table.mode}, over a wire",
    )
