"""Gain and extinction that keep the limits: amplitude first, then the smallest n (Fig. 3)."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import TypeVar

import numpy as np
import scipy

from hmpim.errors import LimitsError
from hmpim.stimulus.exponential import ExponentialSweep
from hmpim.stimulus.lead import join_time
from hmpim.stimulus.limits import QUANTITIES, Limits, three_digits
from hmpim.stimulus.motion import Peaks
from hmpim.stimulus.peaks import ROUGHLY, true_peaks
from hmpim.stimulus.scale import KEEP
from hmpim.stimulus.sweep import Sweep
from hmpim.units import rate_label

__all__ = ["first_instant", "largest_gain", "smallest_extinction", "sweep_peaks"]

_FAR = 0.7
"""An excess from which no n within a step of 0.05 fits: it moves the log of either peak by 0.05
|ln t| at most, and |ln t| stays below 7 between a millisecond and a quarter of an hour."""
_PER_CYCLE = 4  # instants that show an excess to be large

_UNSURE = 3.0 * ROUGHLY  # of an excess: two rough peaks' logs, and what they leave out
STEP = 0.001  # extinction is solved to this
# from here on the acceleration (or the jerk) falls along the sweep, so more n buys nothing
LARGEST = 2.0
LARGEST_WITH_JERK = 3.0

AnySweep = Sweep | ExponentialSweep
S = TypeVar("S", Sweep, ExponentialSweep)


def sweep_peaks(
    sweep: AnySweep, *, start: float | None, jerk: bool = True, exact: bool = True
) -> Peaks:
    """True peaks of a sweep, its singular instant left out.

    Parameters
    ----------
    sweep : Sweep or ExponentialSweep
        Any.
    start : float or None
        From where on, in seconds: the first sample after 0 for the printed waveform, which
        for 0 < n < 1 is unbounded before; None for where a lead joins.
    jerk : bool
        Whether the jerk is wanted. That of the printed waveform, which starts with a velocity
        step, is infinite in any case.
    exact : bool
        As in `true_peaks`.

    Examples
    --------
    >>> sweep = Sweep(band=(0.1, 10.0), duration=10.0, gain=37.385)
    >>> round(sweep_peaks(sweep, start=None).position, 2)
    10.0
    """
    if start is None:
        joined = join_time(sweep, jerk=jerk) if isinstance(sweep, Sweep) else 0.0
        return true_peaks(sweep, start=joined, jerk=jerk, exact=exact)
    if isinstance(sweep, ExponentialSweep) or not 0.0 < sweep.extinction < 1.0:
        return replace(true_peaks(sweep, jerk=False, exact=exact), jerk=math.inf)
    peaks = true_peaks(sweep, start=start, jerk=False, exact=exact)
    at = sweep.motion(np.zeros(1))
    return Peaks(
        position=peaks.position,
        velocity=max(peaks.velocity, float(abs(at.velocity[0]))),
        acceleration=max(peaks.acceleration, float(abs(at.acceleration[0]))),
    )


def first_instant(duration: float, fs: float, *, backwards: bool) -> float:
    """Time in s of the printed sweep's sample that is nearest to its singular instant, 0.

    Run forwards that is 1/fs. Backwards it is how long before the end the last sample is taken.

    Examples
    --------
    >>> first_instant(0.5, 10.0, backwards=True), first_instant(0.525, 10.0, backwards=True)
    (0.1, 0.025)
    """
    steps = duration * fs
    return round(steps - math.ceil(steps - 1e-6) + 1, 9) / fs if backwards else 1.0 / fs


@dataclass(frozen=True, slots=True, kw_only=True)
class _Search:
    """The sweeps of one band and duration, over n, held against limits."""

    make: Callable[[float], AnySweep]
    limits: Limits
    start: float | None

    def peaks(self, n: float, *, exact: bool = True) -> Peaks:
        """Peaks at gain 1."""
        jerk = math.isfinite(self.limits.jerk)
        return sweep_peaks(self.make(n), start=self.start, jerk=jerk, exact=exact)

    def excess(self, n: float, *, exact: bool = True) -> float:
        """Log of the largest share of a derivative's limit, the amplitude being at its limit."""
        peaks = self.peaks(n, exact=exact)
        gain = KEEP * self.limits.position / peaks.position
        share = gain * replace(self.limits, position=math.inf).use(peaks)
        return math.log(share) if share > 0.0 else -math.inf

    def at_least(self, n: float) -> float:
        """What `excess` is at least, from a few instants of each cycle; a tenth of its time.

        The position has its peak in the first quarter of a cycle, where the sine rises as σ₂
        does: between two instants it is below the later sine over the earlier σ₂. That of an
        exponential sweep is below its gain, which is 1.
        """
        sweep = self.make(n)
        jerk = math.isfinite(self.limits.jerk)
        begin, top, moved = 0.0, 1.0, sweep.motion
        if isinstance(sweep, Sweep):
            begin = sweep.time_of_phase(0.5 * math.pi)  # no lead joins later
            t = np.linspace(0.0, begin, 65)
            a, b = sweep.sweep_rate, sweep.start_omega
            phase, sigma = t * (b + 0.5 * a * t), b + 0.5 * a * t**n
            top = float(np.max(np.sin(phase[1:]) / sigma[:-1]))
            moved = moved if jerk else sweep.without_jerk
        count = math.ceil(_PER_CYCLE * sweep.cycles) + 1
        at = moved(np.linspace(max(begin, self.start or 0.0), sweep.duration, count))
        peaks = Peaks(
            position=0.0,
            velocity=float(np.abs(at.velocity).max()),
            acceleration=float(np.abs(at.acceleration).max()),
            jerk=0.0 if at.jerk is None else float(np.abs(at.jerk).max()),
        )
        share = KEEP * self.limits.position / top * self.limits.use(peaks)
        return math.log(share) if share > 0.0 else -math.inf


def largest_gain(sweep: S, limits: Limits, *, start: float | None) -> S:
    """The same sweep with the largest gain that keeps all limits.

    Parameters
    ----------
    sweep : Sweep or ExponentialSweep
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
    unit = replace(sweep, gain=1.0)
    use = limits.use(sweep_peaks(unit, start=start, jerk=math.isfinite(limits.jerk)))
    return replace(sweep, gain=KEEP / use)


def smallest_extinction(
    make: Callable[[float], AnySweep], limits: Limits, *, start: float | None
) -> float:
    """Smallest n, to 0.001, with which all derivatives fit at the full amplitude.

    Parameters
    ----------
    make : callable
        The sweep of gain 1 with a given n.
    limits : Limits
        Position reached first, as the paper does; without a position limit n is 0.
    start : float or None
        As in `sweep_peaks`.

    Raises
    ------
    LimitsError
        If no n up to 2 (3 where the jerk is limited) does; the message says which limits would.

    Examples
    --------
    >>> limits = Limits(position=10, velocity=1000, acceleration=40000)
    >>> make = lambda n: Sweep(band=(0.1, 10.0), duration=10.0, extinction=n)
    >>> smallest_extinction(make, limits, start=None)
    0.0
    """
    if math.isinf(limits.position):
        return 0.0
    search = _Search(make=make, limits=limits, start=start)
    largest = LARGEST if math.isinf(limits.jerk) else LARGEST_WITH_JERK
    grid = np.linspace(0.0, largest, round(20 * largest) + 1)
    values: list[float] = []  # rough ones, made exact where they decide
    for k, n in enumerate(grid):
        values.append(search.at_least(float(n)))
        if values[k] > _FAR:  # no n nearby fits, whatever the excess is exactly
            continue
        values[k] = search.excess(float(n), exact=False)
        if values[k] <= _UNSURE:
            values[k] = search.excess(float(n))
        if values[k] <= 0.0:
            return 0.0 if k == 0 else _first_root(search, float(grid[k - 1]), float(n))
        # a dip between grid points, too short to be seen on them
        if k >= 2 and values[k - 1] < min(values[k - 2], values[k]) + _UNSURE:
            values[k - 2 :] = [search.excess(float(at)) for at in grid[k - 2 : k + 1]]
            if values[k - 1] >= min(values[k - 2], values[k]):
                continue
            dip = scipy.optimize.minimize_scalar(
                search.excess,
                bounds=(float(grid[k - 2]), float(n)),
                method="bounded",
                options={"xatol": 0.1 * STEP},
            )
            if dip.fun <= 0.0:
                return _first_root(search, float(grid[k - 2]), float(dip.x))
    for k in [k for k, least in enumerate(values) if least > _FAR]:
        values[k] = search.excess(float(grid[k]), exact=False)
    near = [float(at) for at in grid[np.array(values) <= min(values) + _UNSURE]]
    raise LimitsError(_what_would_do(search, min(near, key=search.excess)))


def _first_root(search: _Search, low: float, high: float) -> float:
    """Smallest n that fits between `low`, which does not, and `high`, which does."""
    near = 0.01 * STEP
    excess = cache(search.excess)
    root = min(float(scipy.optimize.brentq(excess, low, high, xtol=near)) + near, high)
    for rounded in (math.floor(root / STEP), math.ceil(root / STEP)):
        n = round(rounded * STEP, 9)
        if excess(n) <= 0.0:
            return n
    return root if excess(root) <= 0.0 else high  # a dip narrower than the step


def _what_would_do(search: _Search, n: float) -> str:
    limits, unit = search.limits, search.limits.unit
    gap = " " if unit else ""
    position = limits.position * math.exp(-search.excess(n))
    peaks = search.peaks(n)
    gain = limits.position / peaks.position
    needs = []
    for order, name in enumerate(QUANTITIES[1:], start=1):
        peak, limit = gain * getattr(peaks, name), getattr(limits, name)
        if math.isfinite(limit) and peak > limit:
            needs.append(_need(peak, limit, rate_label(unit, order)))
    sweep = search.make(n)
    return (
        f"limits are too tight for {sweep.band[0]:g} to {sweep.band[1]:g} Hz in "
        f"{sweep.duration:g} s: the amplitude {limits.position:g}{gap}{unit} needs at least "
        f"{' and '.join(needs)}; allow that, or lower the position limit to "
        f"{three_digits(position, up=False)}{gap}{unit}"
    )


def _need(needed: float, limit: float, unit: str) -> str:
    return f"{three_digits(needed, up=True)} {unit} (the limit is {limit:g})"
