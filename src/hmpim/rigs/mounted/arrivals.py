"""Offset and drift of the clock of a unit that only sends: its stamps against arrival times.

Such a unit stamps each sample by its own clock, and we record when the sample arrived. With
unit = offset + (1 + drift) · run::

    arrived = (stamp - offset) / (1 + drift) + transit time          (never less than the shortest)

The line below all arrivals gives drift and offset, up to the shortest transit time, which cannot
be distinguished from an offset with one direction alone. State it if you know it; otherwise it
counts as 0.
"""

import math
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.record import Finding
from hmpim.rigs.block import RunReport

__all__ = ["Arrivals", "OneWayFit", "fit_one_way"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class OneWayFit:
    """Stamps of a clock turned into times in the run.

    Parameters
    ----------
    offset : float
        That clock minus time in the run, at time `origin` of the run, s.
    drift : float
        Seconds that it gains in a second.
    origin : float
        Time in the run, s.

    Examples
    --------
    >>> OneWayFit(offset=3.0, drift=1e-4, origin=10.0)(np.array([13.0, 14.0001])).round(9).tolist()
    [10.0, 11.0]
    """

    offset: float
    drift: float
    origin: float

    def __call__(self, stamps: FloatArray) -> FloatArray:
        """Time in the run of stamps (s)."""
        since = (np.asarray(stamps) - (self.origin + self.offset)) / (1.0 + self.drift)
        return np.asarray(self.origin + since, dtype=np.float64)


def fit_one_way(stamps: FloatArray, arrived: FloatArray, *, on_the_way: float = 0.0) -> OneWayFit:
    """Find offset and drift of a clock from what it sends.

    Parameters
    ----------
    stamps, arrived : ndarray, shape (n,)
        When samples were taken, by that clock, and when they came, in the run; s.
    on_the_way : float
        Shortest time between the two, s, if it is known.

    Returns
    -------
    OneWayFit
        Of the edge under the middle of all points: the line under them all that is nearest to
        them on average.

    Examples
    --------
    >>> run = np.arange(1000) / 100
    >>> late = 0.002 + 0.003 * np.random.default_rng(0).random(1000)
    >>> fit = fit_one_way(0.02 + 1.00005 * run, run + late, on_the_way=0.002)
    >>> round(fit.offset, 4), round(1e6 * fit.drift)
    (0.0202, 50)
    """
    middle, level = float(np.mean(stamps)), float(np.mean(arrived - stamps))
    x, y = stamps - middle, arrived - stamps - level
    slope, least = _lowest(x, y)
    # arrived = stamp + level + least + slope · (stamp - middle)
    origin = middle + level + least - on_the_way
    return OneWayFit(offset=middle - origin, drift=1.0 / (1.0 + slope) - 1.0, origin=origin)


def _lowest(x: FloatArray, y: FloatArray) -> tuple[float, float]:
    """Slope and height at 0 of the edge under the points (x, y) that spans x = 0."""
    if x.size < 3 or np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
        return 0.0, float(y.min())
    scaled = np.column_stack((x / np.ptp(x), y / np.ptp(y)))
    try:
        hull = scipy.spatial.ConvexHull(scaled)
    except scipy.spatial.QhullError:  # all on one line
        slope = float(np.polyfit(x, y, 1)[0])
        return slope, float((y - slope * x).min())
    for simplex, (_, up, _) in zip(hull.simplices, hull.equations, strict=True):
        a, b = sorted(simplex.tolist(), key=lambda k: float(x[k]))
        if up < 0.0 and x[a] <= 0.0 <= x[b] and x[b] > x[a]:
            slope = float((y[b] - y[a]) / (x[b] - x[a]))
            return slope, float(y[a] - slope * x[a])
    return 0.0, float(y.min())


class Arrivals:
    """Stamps of a unit and when they came, noted as a run goes on.

    Parameters
    ----------
    clock : str
        Name of the unit's clock, as in its channels.
    on_the_way : float or None
        Shortest time that a sample takes to us, s; None where it is not known.

    Examples
    --------
    >>> heard = Arrivals("seeker", on_the_way=0.001)
    >>> heard.add(np.array([5.0, 6.0, 7.0]), np.array([0.001, 1.001, 2.001]))
    >>> heard.report().clocks["seeker"](np.array([6.5])).round(9).tolist()
    [1.5]
    """

    def __init__(self, clock: str, *, on_the_way: float | None = None) -> None:
        self._clock, self._on_the_way = clock, on_the_way
        self._stamps: list[FloatArray] = []
        self._arrived: list[FloatArray] = []

    def add(self, stamps: FloatArray, arrived: FloatArray) -> None:
        """Note samples: when they were taken, by the unit's clock, and when they came, s."""
        self._stamps.append(np.atleast_1d(stamps))
        self._arrived.append(np.atleast_1d(arrived))

    def report(self) -> RunReport:
        """Put the stamps right, and say what was done."""
        stamps, arrived = (
            np.concatenate([np.empty(0), *parts]) for parts in (self._stamps, self._arrived)
        )
        if stamps.size < 2:
            return RunReport()
        fit = fit_one_way(stamps, arrived, on_the_way=self._on_the_way or 0.0)
        return RunReport(findings=(self._said(fit),), clocks={self._clock: fit})

    def _said(self, fit: OneWayFit) -> Finding:
        offset = fit.offset - fit.drift * fit.origin  # at the start of the run
        known = self._on_the_way is not None and math.isfinite(self._on_the_way)
        way = (
            f"Its samples arrive after {1e3 * (self._on_the_way or 0.0):.3g} ms or more, as stated."
            if known
            else "The shortest time in which its samples arrive cannot be measured from stamps "
            "that come one way, so it counts as part of the unit's delay; state it if you know it."
        )
        return Finding(
            code="clocks",
            message=(
                f"The clock of {self._clock!r} is {offset:+.6f} s from the run's and gains "
                f"{1e6 * fit.drift:+.2f} ppm; both are taken out. {way}"
            ),
            severity="info",
            parameters=(),
        )
