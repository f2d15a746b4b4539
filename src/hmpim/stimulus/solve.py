"""Gain and extinction that keep the limits: amplitude first, then the smallest n (Fig. 3)."""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from hmpim.errors import LimitsError
from hmpim.stimulus.lead import join_time
from hmpim.stimulus.limits import Limits, three_digits
from hmpim.stimulus.motion import Peaks
from hmpim.stimulus.peaks import true_peaks
from hmpim.stimulus.sweep import Sweep
from hmpim.units import rate_unit

__all__ = ["largest_gain", "smallest_extinction", "sweep_peaks"]

STEP = 0.001  # extinction is solved to this
LARGEST = 2.0  # from here on the acceleration falls along the sweep, so more n buys nothing
_KEEP = 1.0 - 1e-9  # rounding must not carry a sample over a limit


def sweep_peaks(sweep: Sweep, *, start: float | None) -> Peaks:
    """True peaks of a sweep, its singular instant left out.

    Parameters
    ----------
    sweep : Sweep
        Any.
    start : float or None
        From where on, in seconds: the first sample after 0 for the printed waveform, which
        for 0 < n < 1 is unbounded before; None for where a lead joins.

    Examples
    --------
    >>> sweep = Sweep(band=(0.1, 10.0), duration=10.0, gain=37.385)
    >>> round(sweep_peaks(sweep, start=None).position, 2)
    10.0
    """
    if start is None:
        return true_peaks(sweep, start=join_time(sweep))
    if not 0.0 < sweep.extinction < 1.0:
        return true_peaks(sweep)
    peaks = true_peaks(sweep, start=start)
    at = sweep.motion(np.zeros(1))
    return Peaks(
        position=peaks.position,
        velocity=max(peaks.velocity, float(abs(at.velocity[0]))),
        acceleration=max(peaks.acceleration, float(abs(at.acceleration[0]))),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Search:
    """The sweeps of one band and duration, over n, held against limits."""

    band: tuple[float, float]
    duration: float
    limits: Limits
    start: float | None

    def peaks(self, n: float) -> Peaks:
        """Peaks at gain 1."""
        unit = Sweep(band=self.band, duration=self.duration, gain=1.0, extinction=n)
        return sweep_peaks(unit, start=self.start)

    def excess(self, n: float) -> float:
        """Log of rate's or acceleration's share of its limit with the amplitude at its limit."""
        peaks = self.peaks(n)
        gain = _KEEP * self.limits.position / peaks.position
        share = gain * max(
            peaks.velocity / self.limits.velocity,
            peaks.acceleration / self.limits.acceleration,
        )
        return math.log(share) if share > 0.0 else -math.inf


def largest_gain(sweep: Sweep, limits: Limits, *, start: float | None) -> Sweep:
    """The same sweep with the largest gain that keeps all limits.

    Parameters
    ----------
    sweep : Sweep
        Its gain is ignored.
    limits : Limits
        At least one of them finite.
    start : float or None
        As in `sweep_peaks`.

    Examples
    --------
    >>> unit = Sweep(band=(0.1, 10.0), duration=10.0)
    >>> round(largest_gain(unit, Limits(position=10.0), start=None).gain, 2)
    37.38
    """
    use = limits.use(sweep_peaks(replace(sweep, gain=1.0), start=start))
    return replace(sweep, gain=_KEEP / use)


def smallest_extinction(
    band: tuple[float, float], duration: float, limits: Limits, *, start: float | None
) -> float:
    """Smallest n, to 0.001, with which rate and acceleration fit at the full amplitude.

    Parameters
    ----------
    band : tuple of float
        Hz.
    duration : float
        Seconds.
    limits : Limits
        Position reached first, as the paper does; without a position limit n is 0.
    start : float or None
        As in `sweep_peaks`.

    Raises
    ------
    LimitsError
        If no n up to 2 does; the message says which limits would.

    Examples
    --------
    >>> limits = Limits(position=10, velocity=1000, acceleration=40000)
    >>> smallest_extinction((0.1, 10.0), 10.0, limits, start=None)
    0.0
    """
    if math.isinf(limits.position):
        return 0.0
    search = _Search(band=band, duration=duration, limits=limits, start=start)
    grid = np.linspace(0.0, LARGEST, 41)
    values: list[float] = []
    for k, n in enumerate(grid):
        values.append(search.excess(float(n)))
        if values[k] <= 0.0:
            return 0.0 if k == 0 else _first_root(search, float(grid[k - 1]), float(n))
        # a dip between grid points, too short to be seen on them
        if k >= 2 and values[k - 1] < min(values[k - 2], values[k]):
            dip = minimize_scalar(
                search.excess,
                bounds=(float(grid[k - 2]), float(n)),
                method="bounded",
                options={"xatol": 0.1 * STEP},
            )
            if dip.fun <= 0.0:
                return _first_root(search, float(grid[k - 2]), float(dip.x))
    raise LimitsError(_what_would_do(search, float(grid[int(np.argmin(values))])))


def _first_root(search: _Search, low: float, high: float) -> float:
    """Smallest n that fits between `low`, which does not, and `high`, which does."""
    while high - low > 0.01 * STEP:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if search.excess(middle) <= 0.0 else (middle, high)
    for rounded in (math.floor(high / STEP), math.ceil(high / STEP)):
        n = round(rounded * STEP, 9)
        if search.excess(n) <= 0.0:
            return n
    return high  # a dip narrower than the step


def _what_would_do(search: _Search, n: float) -> str:
    limits, unit = search.limits, search.limits.unit
    gap = " " if unit else ""
    position = limits.position * math.exp(-search.excess(n))
    peaks = search.peaks(n)
    gain = limits.position / peaks.position
    velocity, acceleration = gain * peaks.velocity, gain * peaks.acceleration
    needs = []
    if velocity > limits.velocity:
        needs.append(_need(velocity, limits.velocity, rate_unit(unit, 1)))
    if acceleration > limits.acceleration:
        needs.append(_need(acceleration, limits.acceleration, rate_unit(unit, 2)))
    return (
        f"limits are too tight for {search.band[0]:g} to {search.band[1]:g} Hz in "
        f"{search.duration:g} s: the amplitude {limits.position:g}{gap}{unit} needs at least "
        f"{' and '.join(needs)}; allow that, or lower the position limit to "
        f"{three_digits(position, up=False)}{gap}{unit}"
    )


def _need(needed: float, limit: float, unit: str) -> str:
    return f"{three_digits(needed, up=True)} {unit} (the limit is {limit:g})"
