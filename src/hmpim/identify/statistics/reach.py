"""How far statistics reach: the lags that they keep, and the rows that stand beside the input."""

from dataclasses import dataclass

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.noise.autoregression import LONGEST

__all__ = ["AHEAD", "Reach"]

AHEAD = 32
"""Samples by which an impulse response may begin before its input: a spline's reach, with room."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reach:
    """Lags kept, and knots of the bias.

    Parameters
    ----------
    lags : int
        Longest lag of an impulse response, delay included, in samples.
    knots : tuple of int
        Samples of a run at which its bias has a value of its own, linear between them and constant
        outside; one knot is a constant bias.
    beyond : bool
        Whether products of the input's cube and the output's standstills are kept too: they tell
        what no linear system does.

    Examples
    --------
    >>> reach = Reach(lags=100)
    >>> reach.taps, reach.span
    (133, 162)
    """

    lags: int
    knots: tuple[int, ...] = (0,)
    beyond: bool = True

    @property
    def taps(self) -> int:
        """Samples of an impulse response, from `AHEAD` before the input on."""
        return self.lags + AHEAD + 1

    @property
    def span(self) -> int:
        """Greatest lag between two samples of the input that is kept."""
        return self.lags + AHEAD + LONGEST

    @property
    def back(self) -> int:
        """Greatest lag at which the output follows the input that is kept."""
        return self.lags + LONGEST

    @property
    def forth(self) -> int:
        """Greatest lag at which it goes before the input that is kept."""
        return AHEAD + LONGEST

    @property
    def rows(self) -> int:
        """Rows of the bias: one for each knot."""
        return len(self.knots)

    def fixed(self, first: int, count: int) -> Real:
        """Rows of the bias at `count` samples of a run from `first` on, shape (rows, count).

        0 before the run begins.
        """
        t = np.arange(first, first + count)
        if self.rows == 1:
            return np.asarray((t >= 0).astype(np.float64)[None, :])
        hats = [np.interp(t, self.knots, row) for row in np.eye(self.rows)]
        return np.asarray(np.stack(hats) * (t >= 0))
