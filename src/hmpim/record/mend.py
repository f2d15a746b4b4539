"""From series as files hold them to channels: what is missing, doubled or out of order is said."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.errors import RecordError
from hmpim.record.channel import Channel
from hmpim.record.finding import Finding
from hmpim.record.series import Series

__all__ = [
    "Mended",
    "backward_words",
    "check_runs_on",
    "check_span",
    "mend",
    "restarts",
    "stands_still",
]

_LATE = 8
"""Samples that may follow a stamp that ran ahead before the stamps count as starting again.

A network or a bus delivers a few samples out of order; a clock that was set back, or a second
recording in the same file, goes on from there.
"""

_FAR = 1000.0
"""Lengths of a record beyond its ends at which a stamp is damaged and no time of a sample."""

_STRAYS = 0.01
"""Share of stamps that may lie so far off; more are a clock that was set."""

_LONGEST_CLOCK = 10**7
"""Intervals that a record may span beyond a thousand for each of its samples."""

_NEIGHBOURS = 9
"""Steps between stamps whose median is the usual one there."""

_PAUSE = 3.0
"""Usual steps from which one is a pause; those of a coarsely printed clock are one or two."""

_NEARBY = 101
"""Samples along which a clock that wanders counts as uniform; its ticks then average to 1 %."""

_UNEVEN = 0.05
"""Part of a tick by which a step may miss whole ones."""

_ENOUGH = 20
"""Samples from which stamps that stand still can be told from a coarse clock."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mended:
    """Channels that can be used, and what had to be done for it.

    Parameters
    ----------
    channels : tuple of Channel
        In the order of the series.
    findings : tuple of Finding
        What the reader noticed, then codes 'missing_samples', 'doubled_stamps',
        'backward_stamps', 'missing_stamps', 'stray_stamps'.
    """

    channels: tuple[Channel, ...]
    findings: tuple[Finding, ...]


def mend(series: Sequence[Series], *, fs: float | None = None) -> Mended:
    """Make channels of series: drop what is missing, put stamps in order, and count it.

    * A sample that is NaN or infinite is dropped, which leaves a gap in its channel alone.
    * Stamps that stand still because the clock is printed too coarsely (2 kHz in whole
      milliseconds): the samples are spread on the clock that the stamps are rounded from, which
      may pause or wander.
      If half of the samples or more share stamps (packets), each packet is spread over the time
      since the previous one. Else the first sample of each stamp is kept.
    * Samples out of order, by up to eight places: sorted by stamp.
    * Single stamps a thousand lengths of the record away: left out, as they are damaged.
    * Stamps that start again, or jump so far that nothing can be laid between: refused.

    Parameters
    ----------
    series : sequence of Series
        As they were read.
    fs : float, optional
        Rate in Hz of series without stamps.

    Raises
    ------
    RecordError
        If stamps start again, a series has no stamps and there is no rate, or fewer than two
        samples remain.

    Examples
    --------
    >>> import numpy as np
    >>> time, values = np.array([0.0, 0.1, 0.1, 0.2]), np.array([1.0, 2.0, 2.0, np.nan])
    >>> mended = mend([Series(name="y", values=values, time=time)])
    >>> mended.channels[0].time.tolist(), [f.code for f in mended.findings]
    ([0.0, 0.1], ['doubled_stamps', 'missing_samples'])
    """
    findings: list[Finding] = list(dict.fromkeys(f for s in series for f in s.findings))
    known: dict[int, tuple[NDArray[np.float64], NDArray[np.int64] | None]] = {}
    made: list[Channel] = []
    for s in series:
        if s.time is None:
            if fs is None:
                raise RecordError(f"{s.name!r} has no time stamps; give its rate with fs=...")
            stamps, order = np.arange(s.values.size) / fs, None
            stamps = known.setdefault(-s.values.size, (stamps, None))[0]
        else:
            if id(s.time) not in known:
                sharing = [o for o in series if o.time is s.time]
                known[id(s.time)] = _ordered(s.time, sharing, findings)
            stamps, order = known[id(s.time)]
        values = s.values if order is None else s.values[order]
        made.append(_without_missing(s, stamps, values, findings))
        check_span(made[-1])
    return Mended(channels=tuple(made), findings=tuple(findings))


def _without_missing(
    series: Series,
    time: NDArray[np.float64],
    values: NDArray[np.float64],
    findings: list[Finding],
) -> Channel:
    there = np.isfinite(values)
    missing = int(values.size - np.count_nonzero(there))
    if missing:
        if values.size - missing < 2:
            raise RecordError(
                f"channel {series.name!r} holds {values.size - missing} numbers in {values.size} "
                "samples; at least 2 are needed"
            )
        runs = int(np.count_nonzero(np.diff(np.concatenate(([True], there)).astype(np.int8)) < 0))
        infinite = int(np.count_nonzero(np.isinf(values)))
        of_them = f" ({infinite} of them infinite)" if infinite else ""
        findings.append(
            Finding(
                code="missing_samples",
                message=(
                    f"{missing} of {values.size} samples of {series.name!r} are missing{of_them}, "
                    f"in {runs} {'place' if runs == 1 else 'places'}; they are gaps of this "
                    "channel"
                ),
                severity="info",
                parameters=(),
            )
        )
        time, values = time[there], values[there]
    return Channel(name=series.name, time=time, values=values, unit=series.unit)


def _ordered(
    time: NDArray[np.float64], sharing: Sequence[Series], findings: list[Finding]
) -> tuple[NDArray[np.float64], NDArray[np.int64] | None]:
    """Stamps that increase, and the samples they belong to (None: all, as they are)."""
    if time.size and np.isfinite(time).all() and np.all(np.diff(time) > 0):
        return time, None
    of = ", ".join(repr(s.name) for s in sharing[:4]) + (" and others" if sharing[4:] else "")
    absent = int(time.size - np.count_nonzero(np.isfinite(time)))
    time = _without_strays(time)
    order = np.flatnonzero(np.isfinite(time))
    strays = time.size - order.size - absent
    for code, count, words in (
        ("missing_stamps", absent, "have no time stamp"),
        ("stray_stamps", strays, "have a stamp far from all others"),
    ):
        if count:
            message = f"{count} of {time.size} samples of {of} {words} and are left out"
            findings.append(Finding(code=code, message=message, severity="info", parameters=()))
    back = int(np.count_nonzero(np.diff(time[order]) < 0))
    if back:
        _check_not_restarted(time[order], of)
        order = order[np.argsort(time[order], kind="stable")]
        findings.append(
            Finding(
                code="backward_stamps",
                message=f"time of {of} runs backward at {back} of {time.size} samples; the samples "
                "are sorted by their stamps",
                severity="info",
                parameters=(),
            )
        )
    first = np.concatenate(([True], np.diff(time[order]) > 0)) if order.size else order > 0
    doubled = int(order.size - np.count_nonzero(first))
    if not doubled:
        return time[order], order
    if stands_still(time[order]):
        raise RecordError(_still_words(time[order], of))
    differ = any(_differs(s.values[order], first) for s in sharing)
    spread = _spread(time[order]) if differ else None
    repeat = f"{doubled} of {time.size} stamps of {of} repeat the one before"
    if spread is not None:
        step = float(np.median(np.diff(spread)))
        message = (
            f"{repeat}, because the clock is printed more coarsely than it runs; the samples are "
            f"spread evenly, {step:.6g} s apart ({1.0 / step:.6g} Hz)"
        )
    elif differ and 2 * doubled >= order.size >= _ENOUGH and doubled < order.size - 1:
        spread = _since_packet_before(time[order])
        message = (
            f"{repeat}, as of samples that arrive in packets; each packet is spread over the time "
            "since the previous one"
        )
    else:
        order = order[first]
        message = f"{repeat}; the first sample of each is kept"
    findings.append(Finding(code="doubled_stamps", message=message, severity="info", parameters=()))
    return (time[order] if spread is None else spread), order


def stands_still(time: NDArray[np.float64]) -> bool:
    """Say whether stamps tell no rate: all are equal, or many samples share two or three.

    Of the first and the last some is missing, and one whole tick has no length of its own.

    Examples
    --------
    >>> stands_still(np.full(3, 7.0)), stands_still(np.array([0.0, 0.1]))
    (True, False)
    >>> stands_still(np.repeat([0.0, 10.0], 500))
    True
    """
    stamps = np.unique(time[np.isfinite(time)])
    return stamps.size < 2 or (stamps.size < 4 and time.size >= _ENOUGH)


def _still_words(time: NDArray[np.float64], of: str) -> str:
    """What is wrong with a time that stands still, and what to do."""
    stamps = np.unique(time)
    wrong = (
        f"time of {of} has {stamps.size} stamps for {time.size} samples, which tell no rate"
        if stamps.size > 1
        else f"time of {of} stands still: all {time.size} samples are stamped {time[0]:.9g} s"
    )
    return (
        f"{wrong}; name the column of the time with --time, or give the rate with --fs "
        "(in Python: time=..., fs=...)"
    )


def _without_strays(time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Stamps with NaN for the few that lie far from all others; the array itself if none do."""
    there = time[np.isfinite(time)]
    if there.size < _ENOUGH:
        return time
    low, high = (float(q) for q in np.quantile(there, [0.05, 0.95]))
    reach = _FAR * (high - low)
    with np.errstate(invalid="ignore", over="ignore"):
        far = (time < low - reach) | (time > high + reach)
    count = int(np.count_nonzero(far))
    if not 0 < count <= max(1, _STRAYS * there.size):
        return time
    return np.where(far, np.nan, time)


def check_span(channel: Channel) -> None:
    """Refuse stamps between which no clock can be laid for want of memory.

    Raises
    ------
    RecordError
        If two stamps lie 10 million samples apart, and a thousand times the record.
    """
    steps = np.diff(channel.time)
    most = _LONGEST_CLOCK + 1000 * channel.time.size
    # Of two intervals the shorter: the mean of both would be the jump itself.
    usual = float(np.quantile(steps, 0.5, method="lower"))
    if float(channel.time[-1] - channel.time[0]) <= most * usual:
        return
    k = int(np.argmax(steps))
    raise RecordError(
        f"time of {channel.name!r} jumps by {steps[k]:.6g} s after sample {k}, where its samples "
        f"lie {usual:.3g} s apart; the stamps are damaged, or the clock was set: cut "
        "the file there"
    )


def _differs(values: NDArray[np.float64], first: NDArray[np.bool_]) -> bool:
    """Whether most samples with the stamp of the one before hold another value than it."""
    again = np.flatnonzero(~first)
    there = again[np.isfinite(values[again]) & np.isfinite(values[again - 1])]
    return bool(there.size and np.mean(values[there] != values[there - 1]) > 0.5)


def _spread(time: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """The clock whose stamps, cut or rounded as they are printed, these are; or None.

    A file of six digits prints ever more coarsely as time goes on, so that each stamp is held
    against the step from it to its neighbours. The clock pauses where samples are missing.
    """
    if time.size < _ENOUGH:
        return None
    stamps, counts = np.unique(time, return_counts=True)
    steps = np.diff(stamps)
    if steps.size < 2:
        return None
    usual = scipy.ndimage.median_filter(steps, _NEIGHBOURS, mode="nearest")
    pause = steps > _PAUSE * usual
    if pause.any() and time.size - stamps.size < _ENOUGH:
        return None  # a logger that stumbled, not a coarse clock
    steps = np.where(pause, usual, steps)
    # Stamps that are shared follow each other by whole ticks; packets come when they are ready.
    whole = steps / scipy.ndimage.minimum_filter(steps, _NEIGHBOURS, mode="nearest")
    shared = (np.maximum(counts[1:], counts[:-1]) > 1) & ~pause
    odd = shared & (np.abs(whole - np.round(whole)) > _UNEVEN)
    if np.count_nonzero(odd) > _STRAYS * np.count_nonzero(shared):
        return None
    tick = np.maximum(np.append(steps[0], steps), np.append(steps, steps[-1]))
    part = np.repeat(np.concatenate(([0], np.cumsum(pause))), counts)
    # Of a clock cut to ticks the mean error is half a tick all along: the slope is free of it, and
    # a constant offset of all channels of a clock moves no delay between them.
    for clock in (_uniform, _wandering):
        with np.errstate(over="ignore", invalid="ignore"):  # of stamps that are damage
            even = np.asarray(time[0] + clock(time - time[0], part))
            near = np.all(np.abs(time - even) <= 1.05 * np.repeat(tick, counts))
            if near and np.all(np.diff(even) > 0):
                return even
    return None


def _uniform(since: NDArray[np.float64], part: NDArray[np.int64]) -> NDArray[np.float64]:
    """The clock of one step that is nearest to the stamps, each part between pauses where it is.

    The step is that between the middles of whole ticks. A line through all samples is bent by the
    first and the last tick of a part, some of which is missing.
    """
    place = np.arange(since.size, dtype=np.float64)
    tick = np.cumsum(np.diff(since, prepend=since[0]) > 0, dtype=np.int64)
    of = part[np.unique(tick, return_index=True)[1]]
    inner = (np.diff(of, prepend=-1) == 0) & (np.diff(of, append=-1) == 0)
    whole = inner[tick]
    middle, stamp = (
        x[whole] - _mean(x[whole], part[whole])[part[whole]]
        for x in (_mean(place, tick)[tick], since)
    )
    place -= _mean(place, part)[part]
    return np.asarray(_mean(since, part)[part] + (middle @ stamp) / (middle @ middle) * place)


def _mean(values: NDArray[np.float64], part: NDArray[np.int64]) -> NDArray[np.float64]:
    """The mean of the values of each part."""
    return np.asarray(np.bincount(part, weights=values) / np.bincount(part))


def _wandering(since: NDArray[np.float64], part: NDArray[np.int64]) -> NDArray[np.float64]:
    """A clock whose step drifts, as of a loop that runs freely: lines along the stamps nearby."""
    edges = np.flatnonzero(np.diff(part)) + 1
    runs = []
    for run in np.split(since, edges):
        window = min(_NEARBY, (run.size - 1) // 2 * 2 + 1)
        runs.append(scipy.signal.savgol_filter(run, window, 1) if window > 1 else run)
    return np.concatenate(runs)


def _since_packet_before(time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Spread each packet over the time since the previous one, at most over its usual duration."""
    stamp, count = np.unique(time, return_counts=True)
    usual = float(stamp[-1] - stamp[0]) / (time.size - count[0])
    before = np.maximum(np.append(-np.inf, stamp[:-1]), stamp - count * usual)
    place = np.arange(time.size) - np.repeat(np.cumsum(count) - count, count)
    share = (place + 1) / np.repeat(count, count)
    return np.asarray(np.repeat(before, count) + share * np.repeat(stamp - before, count))


def _check_not_restarted(time: NDArray[np.float64], of: str) -> None:
    starts = restarts(time)
    check_runs_on(time, starts, of=of)
    if starts.size:
        k = int(starts[0])
        raise RecordError(
            f"time of {of} starts again at sample {k}: {time[k - 1]:.9g} s is followed by "
            f"{time[k]:.9g} s ({starts.size} in all); the file holds several recordings: "
            "choose a sweep with --sweep, or cut the file there"
        )


def check_runs_on(time: NDArray[np.float64], starts: NDArray[np.int64], *, of: str) -> None:
    """Refuse a clock that starts again before it has run on by a sample.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Stamps in s.
    starts : ndarray of int
        Where it starts again, as `restarts` finds it.
    of : str
        Whose clock it is, for the message.

    Raises
    ------
    RecordError
        If it runs backward.
    """
    words = backward_words(time, starts)
    if words:
        raise RecordError(f"time of {of} {words}")


def backward_words(time: NDArray[np.float64], starts: NDArray[np.int64]) -> str:
    """Say how a clock runs backward; empty for one that runs on between its starts.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Stamps in s.
    starts : ndarray of int
        Where it starts again, as `restarts` finds it.

    Examples
    --------
    >>> newest_first = np.arange(20.0)[::-1]
    >>> backward_words(newest_first, restarts(newest_first))
    'runs backward from the first sample (19 s) to the last (0 s); sort the rows by time'
    """
    short = np.flatnonzero(np.diff(starts) < 2)
    if not short.size:
        return ""
    there = time[np.isfinite(time)]
    if np.all(np.diff(there) <= 0):
        return (
            f"runs backward from the first sample ({there[0]:.9g} s) to the last "
            f"({there[-1]:.9g} s); sort the rows by time"
        )
    k = int(starts[short[0]])
    return (
        f"runs backward at {starts.size} of {time.size} samples: {time[k - 1]:.9g} s is followed "
        f"by {time[k]:.9g} s; sort the rows by time, or cut the file there"
    )


def restarts(time: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the places at which time starts again; NaN are passed over.

    A sample that is merely late is followed within eight samples by one that is not.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Stamps in s.

    Examples
    --------
    >>> restarts(np.concatenate((np.arange(20.0), np.arange(15.0)))).tolist()
    [20]
    >>> restarts(np.array([0.0, 1.0, 3.0, 2.0, 4.0])).tolist()
    []
    """
    time = _without_strays(time)
    there = np.flatnonzero(np.isfinite(time))
    stamps = time[there]
    back = np.flatnonzero(np.diff(stamps) < 0) + 1
    back = back[back + _LATE < stamps.size]
    if not back.size:
        return back
    after = np.lib.stride_tricks.sliding_window_view(stamps, _LATE + 1)[back].max(axis=1)
    return np.asarray(there[back[after < stamps[back - 1]]])
