"""The reach of statistics: the lags that they keep, and the rows of the bias."""

from dataclasses import dataclass

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.noise.autoregression import LONGEST

__all__ = ["AHEAD", "Reach"]

AHEAD = 32
"""Samples that an impulse response may begin before its input: a spline's reach, with a margin."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reach:
    """Lags kept, and knots of the bias.

    Examples
    --------
    >>> reach = Reach(lags=100)
    >>> reach.taps, reach.span
    (133, 162)
    """

    lags: int  # longest lag of an impulse response, delay included, in samples
    # samples of a run at which its bias has a value of its own, linear between them and constant
    # outside; one knot is a constant bias
    knots: tuple[int, ...] = (0,)
    # whether products of the input's cube and the output's standstills are kept too, which reveal
    # nonlinearity and held outputs
    beyond: bool = True

    @property
    def taps(self) -> int:
        """Samples of an impulse response, from `AHEAD` before the input on."""
        return self.lags + AHEAD + 1

    @property
    def span(self) -> int:
        """Greatest lag kept between two samples of the input."""
        return self.lags + AHEAD + LONGEST

    @property
    def back(self) -> int:
        """Greatest lag kept at which the output follows the input."""
        return self.lags + LONGEST

    @property
    def forth(self) -> int:
        """Greatest lag kept at which the output precedes the input."""
        return AHEAD + LONGEST

    @property
    def rows(self) -> int:
        """Rows of the bias: one for each knot."""
        return len(self.knots)

    def fixed(self, first: int, count: int) -> Real:
        """Rows of the bias at some samples of a run, (rows, count); 0 before the run begins."""
        t = np.arange(first, first + count)
        if self.rows == 1:
            return np.asarray((t >= 0).astype(np.float64)[None, :])
        hats = [np.interp(t, self.knots, row) for row in np.eye(self.rows)]
        return np.asarray(np.stack(hats) * (t >= 0))
