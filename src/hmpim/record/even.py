"""Even samples whose stamps jitter: the likelihood of both clocks, read off the samples themselves.

A logger that stamps what arrives says when a sample came, not when it was taken. A signal is
smooth at the instants where it was taken: there its neighbours predict each sample best, by a
cubic through two on either side. In each short stretch, half the logarithm of the mean square of
the errors of prediction, times the number of samples, is the negative log-likelihood under noise of
the stretch's own size, so that neither a spike nor a jump decides. The stamps are dropped only if
the sum over all channels speaks against them by more than it scatters from stretch to stretch
(Q. H. Vuong, Econometrica 57, 1989: a test between models of which neither contains the other).
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from hmpim.record.channel import Channel
from hmpim.record.clock import Clock, fit_clock, places_of_late

__all__ = ["evenly_sampled"]

_NEIGHBOURS = (-2, -1, 1, 2)
"""Samples that predict the one between them, by a cubic."""

_STRETCH = 10
"""Samples of one stretch."""

_FEWEST = 20
"""Stretches from which their scatter is known well enough."""

_SURE = 4.0
"""Deviations that decide against the stamps: by chance in one of 30 000 records."""

_MANY = 0.01
"""Gaps for each sample, from which they are those between packets."""

_SECTIONS = 8
"""Sections compared: the earliest stamps of each agree unless samples are missing."""

_LASTS = 0.5
"""Intervals, or spreads of the stamps within one, by which those of sections may differ."""


def evenly_sampled(channels: Sequence[Channel], clock: Clock, *, nominal: float) -> Clock | None:
    """Find the even clock of samples whose stamps jitter; None where the stamps are right.

    Parameters
    ----------
    channels : sequence of Channel
        All on one clock.
    clock : Clock
        The uniform clock laid through these stamps.
    nominal : float
        Stated rate in Hz.

    Returns
    -------
    Clock or None
        Without jitter; `index` skips what is missing.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> taken = np.arange(400) / 100
    >>> stamps = taken + 0.002 * rng.random(400)
    >>> y = Channel(name="y", time=stamps, values=np.sin(5 * taken))
    >>> strayed = fit_clock(stamps, nominal=100.0)
    >>> clock = evenly_sampled([y], strayed, nominal=100.0)
    >>> (clock.fs, clock.uniform)
    (100.0, True)
    >>> y = Channel(name="y", time=stamps, values=np.sin(5 * stamps))
    >>> evenly_sampled([y], strayed, nominal=100.0) is None
    True
    """
    time = channels[0].time
    in_packets = clock.mostly_empty and clock.gaps.size > _MANY * time.size
    if not (clock.jittered or in_packets) or time.size < _STRETCH * (_FEWEST + 1):
        return None
    tried = [clock]
    if clock.gaps.size:
        patient = fit_clock(time, nominal=nominal, index=np.arange(time.size))
        if not _none_lasts(patient):
            places = places_of_late(time, nominal=nominal)
            patient = fit_clock(time, nominal=nominal, index=places)
        tried.append(patient)
    tried = [one for one in tried if _none_lasts(one)]
    if not tried:  # samples are missing that cannot be counted
        return None
    stamped = [_left(c.values, time) for c in channels]
    gained = [_gain(channels, one, stamped) for one in tried]
    best = int(np.argmax([gain.sum() for gain in gained]))
    gain = gained[best]
    scatter = float(np.sqrt(gain.size) * gain.std())
    return tried[best].without_jitter if gain.sum() > _SURE * scatter else None


def _gain(
    channels: Sequence[Channel], clock: Clock, stamped: list[NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Log-likelihood of an even clock over that of the stamps, one value for each stretch."""
    place = clock.index.astype(np.float64)
    even = [_left(c.values, place) for c in channels]
    ratio = sum(np.log(before) - np.log(after) for before, after in zip(stamped, even, strict=True))
    return np.asarray(0.5 * _STRETCH * ratio)


def _left(values: NDArray[np.float64], time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean square error of prediction from neighbours, per unit of noise, of each stretch."""
    reach = max(_NEIGHBOURS)
    middle = slice(reach, values.size - reach)

    def moved(x: NDArray[np.float64], by: int) -> NDArray[np.float64]:
        return x[reach + by : x.size - reach + by]

    at = {k: moved(time, k) - time[middle] for k in _NEIGHBOURS}
    weight = {k: np.ones(at[k].size) for k in _NEIGHBOURS}
    for i, k in combinations(_NEIGHBOURS, 2):  # Lagrange's polynomials
        apart = at[i] - at[k]
        weight[i] *= -at[k] / apart
        weight[k] *= at[i] / apart
    left, noise = values[middle].copy(), np.ones(values.size - 2 * reach)
    for k in _NEIGHBOURS:
        left -= weight[k] * moved(values, k)
        noise += weight[k] ** 2
    power = left**2 / noise
    whole = power[: power.size // _STRETCH * _STRETCH].reshape(-1, _STRETCH).mean(axis=1)
    rounding = np.finfo(float).eps * float(np.abs(values).max(initial=0.0))
    return np.asarray(whole + max(rounding**2, float(np.finfo(float).tiny)))


def _none_lasts(clock: Clock) -> bool:
    """Whether no section of a record is delayed against another, as where all gaps are counted."""
    sections = np.array_split(clock.deviation * clock.fs, _SECTIONS)
    early, late = np.array([np.quantile(part, [0.25, 0.75]) for part in sections]).T
    return bool(np.ptp(early) < _LASTS * max(1.0, float(np.median(late - early))))
