"""An output that is updated more slowly than it is recorded: the data hold of Fig. 1.

Such an output repeats itself, then jumps. An update at time t appears in the first sample at or
after t, so a change at sample c means c - 1 < t <= c. All changes together bound period and phase
from both sides, without noise: the possible values form a small polygon, and its width is the
error.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmpim.identify.arrays import Real, every_of, median
from hmpim.identify.chance import BULK, DEVIATIONS
from hmpim.identify.worth import FEW, MOST, NEARLY, PART

__all__ = ["Hold", "Updates", "detect_hold", "updates"]

_FEWEST = 10
"""Fewest changes, repeats and distinct values: a square wave has two values."""

_ROUNDING = 1e-6
"""Samples by which arithmetic alone may move an update past the sample that shows it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Hold:
    """Clock of a held output."""

    # time between updates, and its standard deviation, s
    period: float
    std: float
    # Time of the first update after the first sample, and its standard deviation, s. If the period
    # is a whole number of samples, the time within a sample is unknown.
    phase: float
    phase_std: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Updates:
    """Samples in which a new value arrives, and how old it is by then."""

    index: NDArray[np.intp]  # (m,): samples, rising
    age: Real  # (m,): samples since the update, 0 <= age < 1
    age_std: float = 0.0  # standard deviation of an error that all ages share, in samples


def updates(hold: Hold, samples: int, fs: float) -> Updates:
    """Return the samples of a record, at a rate in Hz, in which a new value arrives."""
    period, phase = hold.period * fs, hold.phase * fs
    count = max(int(np.floor((samples - 1 - phase) / period)) + 1, 0)
    instant = phase + period * np.arange(count)
    index = np.ceil(instant - _ROUNDING).astype(np.intp)
    inside = (index >= 0) & (index < samples)
    return Updates(
        index=index[inside],
        age=np.maximum(index - instant, 0.0)[inside],
        age_std=hold.phase_std * fs,
    )


def detect_hold(y: Real, fs: float, prediction: Real | None = None) -> Hold | None:
    """Find the clock by which an output, (n,), is updated, if it is slower than `fs` in Hz.

    The prediction of a model without a hold, (n,), distinguishes a held output from an input that
    stands still. None if the output is updated at every sample, changes by no steady clock, or
    takes fewer than ten different values.
    """
    change = np.abs(np.diff(y))
    changed = _changed(y, change)
    runs = np.diff(changed)
    if np.count_nonzero(runs > 1) < _FEWEST or not _is_rich(y, change, changed):
        return None
    shortest = int(np.quantile(runs, FEW, method="lower"))
    if prediction is not None and not _moves_within(changed, prediction):
        return None
    period = _coarse_period(changed, runs, shortest)
    if period is None:
        return None
    return _bounded(changed.astype(np.float64), period, fs)


def _changed(samples: Real, change: Real) -> NDArray[np.intp]:
    """Samples that differ from the previous one by more than rounding, or than usual noise."""
    rounding = float(8 * np.finfo(float).eps * np.max(np.abs(samples)))
    least = rounding
    if np.count_nonzero(change <= rounding) < _FEWEST:  # no repeats: noise came after the hold
        least = DEVIATIONS / BULK * median(change[:: every_of(change.size)])
    return np.flatnonzero(change > least) + 1


def _is_rich(samples: Real, change: Real, changed: NDArray[np.intp]) -> bool:
    """Whether the output takes many values, by changes of many sizes."""
    jump = change[changed - 1]
    # A rounded ramp changes by one step each time; the limit is halfway to two steps.
    if np.mean(jump > (1 + MOST) * np.quantile(jump, FEW)) < FEW:
        return False
    levels = np.sort(samples[changed])
    apart = DEVIATIONS / BULK * median(change) if change.min() > 0 else 0.0
    if 1 + np.count_nonzero(np.diff(levels) > apart) >= _FEWEST:
        return True
    # Noise may join the levels, yet they fill their range rather than crowd at a few values.
    cells = np.histogram(levels, bins=50)[0]
    return bool(np.count_nonzero(cells) >= _FEWEST and np.ptp(levels) > 2 * _FEWEST * apart)


def _moves_within(changed: NDArray[np.intp], prediction: Real) -> bool:
    """Whether a prediction moves while the output stands still."""
    motion = np.diff(prediction)
    standing = np.ones(motion.size, dtype=bool)
    standing[changed - 1] = False
    at_updates = float(np.mean(motion[~standing] ** 2))
    return bool(np.mean(motion[standing] ** 2) > PART**2 * at_updates)


def _coarse_period(
    changed: NDArray[np.intp], runs: NDArray[np.intp], shortest: int
) -> float | None:
    """Period in samples that aligns the changes best, refined over longer and longer stretches."""
    # Just below a whole number of samples, a shorter run is rare. From further below, another
    # period aligns the changes as well: 9/5 as 9/4.
    low, high = max(shortest - FEW, 1 + FEW), float(shortest + 1)
    if shortest == 1:  # 5/4 and 5/3 align alike, but nearly all updates are visible
        mean = float(np.mean(runs))
        low, high = max(NEARLY * mean, 1 + FEW), 1.01 * mean
        if high <= low:
            return None
    count = min(200, changed.size)
    stretch = 0
    if changed.size > count:  # where the changes follow each other most closely
        stretch = int(np.argmin(changed[count:] - changed[:-count]))
    while True:
        c = changed[stretch : stretch + count] - changed[stretch]
        finest = 0.1 * low * low / max(float(c[-1]), 1.0)
        trial = np.arange(low, high + finest, finest)
        power = np.array([np.abs(np.exp(2j * np.pi * c / t).mean()) for t in trial])
        best = float(trial[np.argmax(power)])
        expected = best / np.pi * np.sin(np.pi / best)
        if power.max() < NEARLY * expected:
            return None
        if count >= changed.size - stretch:
            return best
        low, high = max(best - 3 * finest, 1 + FEW), best + 3 * finest
        count = min(2 * count, changed.size - stretch)


def _bounded(changed: Real, period: float, fs: float) -> Hold | None:
    """Bound period and phase by all changes; return the middle of the bounds."""
    k, period = _numbered(changed, period)
    interval = _feasible(k, changed, period)
    if interval is None:
        return None
    low, high = interval
    middle = 0.5 * (low + high)
    bounds = [_phase(k, changed, t) for t in np.linspace(low, high, 21)]
    first = 0.5 * sum(_phase(k, changed, middle))
    lowest, highest = min(b[0] for b in bounds), max(b[1] for b in bounds)
    back = np.floor(first / middle + _ROUNDING)  # to the first update in the record
    return Hold(
        period=middle / fs,
        phase=float(first - back * middle) / fs,
        std=float((high - low + 2e-9) / np.sqrt(12.0) / fs),
        phase_std=float(max(highest - first, first - lowest) / np.sqrt(3.0) / fs),
    )


def _numbered(changed: Real, period: float) -> tuple[Real, float]:
    """Number of the update at each change, and the period by least squares."""
    phase = np.angle(np.mean(np.exp(2j * np.pi * changed / period))) * period / (2 * np.pi)
    k = np.rint((changed - phase) / period)
    centred = k - k.mean()
    return k, float(centred @ changed / (centred @ centred))


def _phase(k: Real, changed: Real, period: float) -> tuple[float, float]:
    """Bounds of the phase for a period: change - 1 < phase + k period <= change."""
    rest = changed - k * period
    return float(rest.max()) - 1.0, float(rest.min())


def _feasible(k: Real, changed: Real, period: float) -> tuple[float, float] | None:
    """Range of periods for which a phase exists; the width of its bounds is concave."""

    def width(t: float) -> float:
        low, high = _phase(k, changed, t)
        return high - low + _ROUNDING

    reach = 2.0 / float(np.ptp(k))
    left, right = period - reach, period + reach
    for _ in range(80):  # golden section search for the greatest width
        a, b = left + 0.382 * (right - left), left + 0.618 * (right - left)
        if width(a) < width(b):
            left = a
        else:
            right = b
    best = 0.5 * (left + right)
    if width(best) < 0:
        return None

    def edge(outside: float) -> float:
        inside = best
        for _ in range(60):
            middle = 0.5 * (inside + outside)
            if width(middle) < 0:
                outside = middle
            else:
                inside = middle
        return inside

    return edge(best - 2 * reach), edge(best + 2 * reach)
