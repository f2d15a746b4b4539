"""A channel in figures before anything is chosen: rate, span, gaps, what is odd."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import RecordError
from hmpim.record.channel import Channel
from hmpim.record.clock import fit_clock
from hmpim.record.mend import backward_words, mend, restarts
from hmpim.record.series import Series
from hmpim.units import check_unit

__all__ = ["Description", "describe"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Description:
    """What there is to know of a channel at a glance.

    Parameters
    ----------
    name, unit : str
        As its file states them.
    samples : int
        Samples, missing ones included.
    rate : float or None
        In Hz; None where there are no stamps, or too few.
    start, stop : float or None
        First and last stamp in s.
    gaps : int
        Places where samples are missing on its clock, or hold no number.
    longest_gap : float
        The longest of them in s; 0 without one.
    missing : int
        Samples that hold no number.
    doubled, backward : int
        Stamps that repeat the one before, and that run backward.
    restarts : int
        How often time starts again.
    jitter : float
        How far stamps stray from a uniform clock, r.m.s., as a share of the interval.
    low, high : float or None
        Smallest and largest value.
    problem : str
        Why the channel cannot be used as it is; empty if it can.
    """

    name: str
    unit: str
    samples: int
    rate: float | None
    start: float | None
    stop: float | None
    gaps: int
    longest_gap: float
    missing: int
    doubled: int
    backward: int
    restarts: int
    jitter: float
    low: float | None
    high: float | None
    problem: str


def describe(series: Series, *, fs: float | None = None) -> tuple[Description, Channel | None]:
    """Describe a series, and return it as a channel if it can be used as it is.

    Parameters
    ----------
    series : Series
        As it was read.
    fs : float, optional
        Rate in Hz of a series without stamps.

    Examples
    --------
    >>> time = np.delete(np.arange(100) / 50.0, [20, 21, 22])
    >>> found, channel = describe(Series(name="y", values=np.sin(time), time=time, unit="deg"))
    >>> round(found.rate, 9), found.samples, found.gaps, round(found.longest_gap, 9)
    (50.0, 97, 1, 0.08)
    >>> channel.name
    'y'
    """
    values = series.values[np.isfinite(series.values)]
    time = series.time
    if time is None and fs is not None:
        time = np.arange(series.values.size) / fs
    starts = np.zeros(0, dtype=np.int64) if time is None else restarts(time)
    reverse = "" if time is None else backward_words(time, starts)
    again, doubled, backward = _odd_stamps(time, 0 if reverse else int(starts.size))
    channel, problem = _channel(series, time, fs, reverse)
    rate, jitter, gaps, longest = _clock_figures(channel)
    stamped = None if time is None else time[np.isfinite(time)]
    if rate is None and stamped is not None and stamped.size > 1:
        steps = np.abs(np.diff(stamped))
        rate = 1.0 / float(np.median(steps[steps > 0])) if (steps > 0).any() else None
    return (
        Description(
            name=series.name,
            unit=series.unit,
            samples=series.values.size,
            rate=rate,
            start=None if stamped is None or not stamped.size else float(stamped.min()),
            stop=None if stamped is None or not stamped.size else float(stamped.max()),
            gaps=gaps,
            longest_gap=longest,
            missing=series.values.size - values.size,
            doubled=doubled,
            backward=backward,
            restarts=again,
            jitter=jitter,
            low=float(values.min()) if values.size else None,
            high=float(values.max()) if values.size else None,
            problem=problem,
        ),
        channel,
    )


def _odd_stamps(time: NDArray[np.float64] | None, again: int) -> tuple[int, int, int]:
    if time is None:
        return 0, 0, 0
    steps = np.diff(time[np.isfinite(time)])
    return again, int(np.count_nonzero(steps == 0)), int(np.count_nonzero(steps < 0)) - again


def _channel(
    series: Series, time: NDArray[np.float64] | None, fs: float | None, reverse: str
) -> tuple[Channel | None, str]:
    if time is None:
        return None, "no time is known; name it with --time, or give the rate with --fs"
    if reverse:
        return None, f"time {reverse}"
    unit = series.unit
    try:
        check_unit(unit)
    except ValueError:
        unit = ""
    try:
        plain = Series(name=series.name, values=series.values, time=time, unit=unit)
        return mend([plain], fs=fs).channels[0], ""
    except RecordError as error:
        return None, str(error)


def _clock_figures(channel: Channel | None) -> tuple[float | None, float, int, float]:
    """Rate, jitter, number of gaps and the longest gap of a channel."""
    if channel is None:
        return None, 0.0, 0, 0.0
    clock = fit_clock(channel.time)
    jitter = float(np.sqrt(np.mean(clock.deviation**2))) * clock.fs if clock.jittered else 0.0
    gaps = clock.gaps
    if not gaps.size:
        return clock.fs, jitter, 0, 0.0
    longest = float((channel.time[gaps + 1] - channel.time[gaps]).max())
    return clock.fs, jitter, int(gaps.size), longest
