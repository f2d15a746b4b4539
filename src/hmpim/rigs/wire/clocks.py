"""Two clocks that never met: offset and drift from time stamps that went back and forth.

A command leaves the near end at t1 (near clock) and arrives at t2 (far clock); a response leaves
the far end at t3 (far) and arrives at t4 (near). With far = offset + (1 + drift) · near::

    t2 - t1 = offset + drift · t1 + delay there          (never less than the shortest delay)
    t3 - t4 = offset + drift · t4 - delay back           (never more)

The line under all of the first kind and the parallel line above all of the second are found by
linear programming, so that a few late datagrams do not matter. The offset lies between the two
lines; where in between, time stamps cannot tell: one-sided delay looks like offset. The middle is
taken, and half the distance, half the shortest round trip, is stated as what cannot be told.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from hmpim.errors import ArgumentError

__all__ = ["ClockFit", "fit_clocks"]

FloatArray = NDArray[np.float64]

_MOST = 4000  # exchanges used; more are thinned to the fastest in each of as many spans


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockFit:
    """The far clock in terms of the near one.

    Parameters
    ----------
    offset : float
        Far clock minus near clock at near time `origin`, s.
    drift : float
        Seconds that the far clock gains in a second of the near one.
    origin : float
        Near time at which the offset holds, s.
    uncertainty : float
        The offset may be wrong by this much either way, s: half the shortest round trip.

    Examples
    --------
    >>> fit = ClockFit(offset=3.0, drift=1e-4, origin=10.0, uncertainty=1e-5)
    >>> fit.near(np.array([13.0, 14.0001])).round(6).tolist()
    [10.0, 11.0]
    """

    offset: float
    drift: float
    origin: float
    uncertainty: float

    def near(self, far: FloatArray) -> FloatArray:
        """Near time (s) of instants on the far clock (s)."""
        since = (np.asarray(far) - (self.origin + self.offset)) / (1.0 + self.drift)
        return np.asarray(self.origin + since, dtype=np.float64)


def fit_clocks(
    sent: ArrayLike, arrived: ArrayLike, answered: ArrayLike, received: ArrayLike
) -> ClockFit:
    """Find offset and drift of a far clock.

    Parameters
    ----------
    sent, arrived : array_like, shape (n,)
        Of datagrams to the far end: sent on the near clock, arrived on the far one, s.
    answered, received : array_like, shape (m,)
        Of datagrams back: sent on the far clock, received on the near one, s.

    Returns
    -------
    ClockFit

    Raises
    ------
    ArgumentError
        If there are fewer than two of either.

    Examples
    --------
    >>> t = np.arange(100) / 100
    >>> far = lambda near: 5.0 + 1.00005 * near
    >>> fit = fit_clocks(t, far(t + 0.001), far(t + 0.002), t + 0.003)
    >>> [round(x, 6) for x in (fit.drift * 1e6, fit.offset - 5e-5 * fit.origin, fit.uncertainty)]
    [50.0, 5.0, 0.001]
    """
    t1, t2, t3, t4 = (np.asarray(a, dtype=np.float64) for a in (sent, arrived, answered, received))
    if t1.shape != t2.shape or t3.shape != t4.shape or t1.ndim != 1 or t3.ndim != 1:
        raise ArgumentError(
            f"time stamps of shapes {t1.shape}, {t2.shape}, {t3.shape}, {t4.shape}; give as many "
            "arrivals as departures"
        )
    if t1.size < 2 or t3.size < 2:
        raise ArgumentError(
            f"{t1.size} datagrams there and {t3.size} back do not determine the clocks; at least "
            "two of each are needed"
        )
    origin = 0.5 * (float(min(t1.min(), t4.min())) + float(max(t1.max(), t4.max())))
    near_there, there = _fastest(t1 - origin, t2 - t1)
    near_back, back = _fastest(t4 - origin, t4 - t3)
    # Seconds near 1 for the solver: offsets may be decades, delays are microseconds.
    level_there, level_back = float(there.min()), float(back.min())
    span = max(float(np.ptp(near_there)), float(np.ptp(near_back)), 1e-9)
    unit = max(float(np.ptp(there)), float(np.ptp(back)), 1e-9)
    x_there, y_there = near_there / span, (there - level_there) / unit
    x_back, y_back = near_back / span, (back - level_back) / unit
    # Unknown: c_there, c_back, slope. Under all points, as near to them as can be.
    rows = np.concatenate(
        (
            np.column_stack((np.ones_like(x_there), np.zeros_like(x_there), x_there)),
            np.column_stack((np.zeros_like(x_back), np.ones_like(x_back), -x_back)),
        )
    )
    solved = scipy.optimize.linprog(
        -rows.sum(axis=0),
        A_ub=rows,
        b_ub=np.concatenate((y_there, y_back)),
        bounds=[(None, None)] * 3,
        method="highs",
    )
    if not solved.success or solved.x is None:
        raise ArgumentError(
            f"the clocks cannot be determined from these time stamps: {solved.message}"
        )
    c_there, c_back, slope = solved.x
    lowest_there = level_there + unit * float(c_there)
    lowest_back = level_back + unit * float(c_back)
    return ClockFit(
        offset=0.5 * (lowest_there - lowest_back),
        drift=unit * float(slope) / span,
        origin=origin,
        uncertainty=0.5 * (lowest_there + lowest_back),
    )


def _fastest(near: FloatArray, delay: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Thin to the fastest datagram of each span, so that the program stays small."""
    if near.size <= _MOST:
        return near, delay
    edges = np.linspace(0, near.size, _MOST + 1).astype(np.int64)
    best = [int(a + np.argmin(delay[a:b])) for a, b in pairwise(edges)]
    return near[best], delay[best]
