"""One uniform clock for all channels of a record, which is what identification needs."""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from hmpim.errors import RecordError
from hmpim.record.clock import Clock, fit_clock
from hmpim.record.finding import Finding
from hmpim.record.quality import clock_findings
from hmpim.record.record import Channel, Intersample, Record

__all__ = ["Aligned", "Signal", "uniform"]

_T = TypeVar("_T", bound=np.generic)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Signal:
    """One channel on the common clock.

    Parameters
    ----------
    name : str
        Name of the channel.
    values : ndarray, shape (n,)
        Samples in `unit`; filled in where `valid` is False.
    valid : bool ndarray, shape (n,)
        False inside gaps.
    unit : str
        Unit of the values.
    """

    name: str
    values: NDArray[np.float64]
    valid: NDArray[np.bool_]
    unit: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Aligned:
    """All channels of a record on one uniform clock.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds, on the record's own clock.
    fs : float
        Rate in Hz.
    inputs, outputs : tuple of Signal
        The channels, in the record's order.
    findings : tuple of Finding
        What was found when the record was read, then what had to be repaired here: 'gaps',
        'jitter', 'rate', 'resampled'. Empty if nothing.
    """

    time: NDArray[np.float64]
    fs: float
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    findings: tuple[Finding, ...]

    @property
    def start(self) -> float:
        """Time of the first sample in s."""
        return float(self.time[0])

    @property
    def samples(self) -> int:
        """Number of samples of each channel."""
        return self.time.size

    def signal(self, name: str) -> Signal:
        """Return the channel called `name`.

        Raises
        ------
        RecordError
            If there is none; the message lists those there are.
        """
        for s in (*self.inputs, *self.outputs):
            if s.name == name:
                return s
        known = ", ".join(s.name for s in (*self.inputs, *self.outputs))
        raise RecordError(f"there is no channel {name!r}; the record has {known}")


def uniform(record: Record) -> Aligned:
    """Bring all channels of a record on the uniform clock of its first output.

    A record that is uniform already comes back with its own arrays, bit for bit; stamps that
    are merely rounded when printed are uniform. What else is done:

    * Gaps: the clock runs on through them. Samples beside a gap stay as they are; inside it
      values are filled in and marked in `Signal.valid`.
    * Jitter: values are interpolated from their own stamps with a cubic spline (not-a-knot).
      With stamps strewn by ±30 % of the interval it errs by 5e-4 of the amplitude (r.m.s.) at
      a tenth of the rate. A gap ends one spline and begins the next. An input stated as 'zoh'
      keeps its last value instead, and one stated as 'foh' is joined linearly.
    * Channels with clocks of their own: interpolated likewise, over the span that all share.

    Inside a gap the filling is a cubic (Hermite) between the two edges, with slopes limited so
    that it never leaves the range between them.

    Parameters
    ----------
    record : Record
        Channels on one clock or on several.

    Returns
    -------
    Aligned

    Raises
    ------
    RecordError
        If the channels share less than two samples of time.

    Examples
    --------
    >>> import numpy as np
    >>> record = Record.from_arrays(
    ...     {"u": [0, 1, 2, 5, 6]}, {"y": [0, 2, 4, 10, 12]}, time=[0, 0.1, 0.2, 0.5, 0.6]
    ... )
    >>> aligned = uniform(record)
    >>> aligned.outputs[0].valid.tolist()
    [True, True, True, False, False, True, True]
    >>> aligned.inputs[0].values.round(9).tolist()
    [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    """
    channels = (*record.outputs, *record.inputs)
    clocks = _clocks(channels, record.fs)
    first = channels[0]
    clock = clocks[id(first.time)]
    findings = [*record.findings, *clock_findings(clock, first.time, stated=record.fs)]
    shared = all(clocks[id(c.time)] is clock for c in channels)
    if shared and clock.uniform:
        everywhere = _frozen(np.ones(first.time.size, dtype=np.bool_))
        return Aligned(
            time=first.time,
            fs=clock.fs,
            inputs=tuple(_unchanged(c, everywhere) for c in record.inputs),
            outputs=tuple(_unchanged(c, everywhere) for c in record.outputs),
            findings=tuple(findings),
        )
    if shared:
        grid = clock.start + np.arange(clock.length) / clock.fs
    else:
        grid = _common_grid(channels, clocks, clock)
        findings.extend(_clock_differences(channels, clocks, clock))

    def on_grid(channel: Channel, intersample: Intersample | None) -> Signal:
        return _on_grid(channel, clocks[id(channel.time)], grid, 1 / clock.fs, intersample)

    return Aligned(
        time=_frozen(grid),
        fs=clock.fs,
        inputs=tuple(on_grid(c, record.intersample) for c in record.inputs),
        outputs=tuple(on_grid(c, None) for c in record.outputs),
        findings=tuple(findings),
    )


def _frozen(array: NDArray[_T]) -> NDArray[_T]:
    array.setflags(write=False)
    return array


def _unchanged(channel: Channel, valid: NDArray[np.bool_]) -> Signal:
    return Signal(name=channel.name, values=channel.values, valid=valid, unit=channel.unit)


def _clocks(channels: tuple[Channel, ...], fs: float) -> dict[int, Clock]:
    """Clock of each time array, by its identity; equal arrays share one clock."""
    made: list[tuple[NDArray[np.float64], Clock]] = []
    by_id: dict[int, Clock] = {}
    for c in channels:
        if id(c.time) in by_id:
            continue
        found = next((k for t, k in made if np.array_equal(t, c.time)), None)
        if found is None:
            found = fit_clock(c.time, nominal=fs)
            made.append((c.time, found))
        by_id[id(c.time)] = found
    return by_id


def _common_grid(
    channels: tuple[Channel, ...], clocks: dict[int, Clock], clock: Clock
) -> NDArray[np.float64]:
    """Those instants of the first output's clock at which every channel is known."""
    start = max(float(c.time[0]) for c in channels)
    stop = min(float(c.time[-1]) for c in channels)
    # A stamp that is rounded, or that strays, by less than the clocks can tell still counts.
    slack = max(max(k.rounding, float(np.abs(k.deviation).max())) for k in clocks.values())
    k0 = max(0, int(np.ceil((start - clock.start - slack) * clock.fs)))
    k1 = min(clock.length - 1, int(np.floor((stop - clock.start + slack) * clock.fs)))
    if k1 - k0 < 1:
        raise RecordError(
            f"the channels share no span of time: the latest starts at {start:.6g} s and the "
            f"earliest ends at {stop:.6g} s; put all of them on one origin of time"
        )
    return np.asarray(clock.start + np.arange(k0, k1 + 1) / clock.fs)


def _clock_differences(
    channels: tuple[Channel, ...], clocks: dict[int, Clock], clock: Clock
) -> list[Finding]:
    findings: list[Finding] = []
    reported = {id(clock)}
    for c in channels:
        own = clocks[id(c.time)]
        if id(own) in reported:
            continue
        reported.add(id(own))
        findings.extend(clock_findings(own, c.time, name=c.name))
        offset = (own.start - clock.start) * clock.fs
        findings.append(
            Finding(
                code="resampled",
                message=(
                    f"{c.name!r} has a clock of its own ({own.fs:.6g} Hz, "
                    f"{offset - np.floor(offset):.2g} of an interval beside that of "
                    f"{channels[0].name!r} at {clock.fs:.6g} Hz) and was interpolated; "
                    "what it holds above half the lower rate is lost or folded"
                ),
                severity="info",
                parameters=(),
            )
        )
    return findings


def _on_grid(
    channel: Channel,
    clock: Clock,
    grid: NDArray[np.float64],
    step: float,
    intersample: Intersample | None,
) -> Signal:
    """Values of one channel at the instants of `grid`."""
    place = (grid - clock.start) * clock.fs
    nearest = np.rint(place).astype(np.int64)
    on_clock = not clock.jittered and bool(
        np.all(np.abs(place - nearest) <= clock.rounding * clock.fs)
    )
    if on_clock:
        # Every instant is one of this channel's own: take its samples as they are.
        position = np.minimum(np.searchsorted(clock.index, nearest), clock.index.size - 1)
        valid = clock.index[position] == nearest
        values = channel.values[position]
    else:
        valid = ~_inside_gaps(channel.time, clock, grid)
        values = np.empty(grid.size)
        values[valid] = _interpolated(channel, clock, grid[valid], intersample)
    if not valid.all():
        own = channel.time if not on_clock else clock.start + clock.index / clock.fs
        values[~valid] = _filled(own, channel.values, clock, grid[~valid], intersample)
    return Signal(
        name=channel.name, values=_frozen(values), valid=_frozen(valid), unit=channel.unit
    )


def _inside_gaps(
    time: NDArray[np.float64], clock: Clock, grid: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Instants more than half an interval from both edges of a gap, inside it."""
    long = np.zeros(time.size + 1, dtype=np.bool_)
    long[clock.gaps + 1] = True  # the interval that ends at each stamp; open at both ends
    after = np.searchsorted(time, grid)
    left = time[np.maximum(after - 1, 0)]
    right = time[np.minimum(after, time.size - 1)]
    half = 0.5 / clock.fs
    return np.asarray(long[after] & (grid > left + half) & (grid < right - half))


def _interpolated(
    channel: Channel, clock: Clock, at: NDArray[np.float64], intersample: Intersample | None
) -> NDArray[np.float64]:
    time, values = channel.time, channel.values
    if intersample == "zoh":
        # Half a rounding step of grace, or a stamp printed low would give the value before.
        before = np.searchsorted(time, at + clock.rounding, side="right") - 1
        return np.asarray(values[np.clip(before, 0, time.size - 1)])
    if intersample == "foh":
        return np.interp(at, time, values)
    out = np.empty(at.size)
    edges = np.concatenate(([0], clock.gaps + 1, [time.size]))
    # A segment answers for its own span and half a gap beyond, where instants lie within half
    # an interval of its end; the spline is carried on that far.
    middles = 0.5 * (time[edges[1:-1] - 1] + time[edges[1:-1]])
    bounds = np.concatenate(([0], np.searchsorted(at, middles), [at.size]))
    for k in np.flatnonzero(np.diff(bounds)):
        part, mine = slice(edges[k], edges[k + 1]), slice(bounds[k], bounds[k + 1])
        if edges[k + 1] - edges[k] == 1:
            out[mine] = values[part]
        else:
            out[mine] = CubicSpline(time[part], values[part])(at[mine])
    return out


def _filled(
    time: NDArray[np.float64],
    values: NDArray[np.float64],
    clock: Clock,
    at: NDArray[np.float64],
    intersample: Intersample | None,
) -> NDArray[np.float64]:
    """Values inside gaps: held, or a monotone cubic Hermite between the two edges."""
    after = np.clip(np.searchsorted(time, at), 1, time.size - 1)
    before = after - 1
    t0, t1, v0, v1 = time[before], time[after], values[before], values[after]
    if intersample == "zoh":
        return np.asarray(v0)
    chord = (v1 - v0) / (t1 - t0)
    slope = np.diff(values) / np.diff(time)
    # The slope at an edge is that of the interval outside the gap, if that is a sample long.
    outside0 = np.where(before > 0, slope[np.maximum(before - 1, 0)], chord)
    outside1 = np.where(after < time.size - 1, slope[np.minimum(after, slope.size - 1)], chord)
    if intersample == "foh":
        outside0 = outside1 = chord

    def limited(s: NDArray[np.float64]) -> NDArray[np.float64]:
        # Fritsch and Carlson (1980): same sign as the chord, at most three times as steep.
        return np.where(s * chord > 0, np.sign(chord) * np.minimum(np.abs(s), 3 * np.abs(chord)), 0)

    h = t1 - t0
    x = (at - t0) / h
    d0, d1 = limited(outside0) * h, limited(outside1) * h
    cubic = v0 + x * (d0 + x * (3 * (v1 - v0) - 2 * d0 - d1 + x * (d0 + d1 - 2 * (v1 - v0))))
    return np.asarray(cubic)
