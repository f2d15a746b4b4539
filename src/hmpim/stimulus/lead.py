"""From rest into a waveform and back to rest, never beyond the limits.

The printed sweep starts with a velocity step and ends wherever it happens to be. Here a
polynomial of fifth degree carries the axis from rest at 0 to the waveform's own position,
velocity and acceleration, and another carries it back to rest at 0, so that all three are
continuous and each is the derivative of the one before. The waveform keeps its gain,
extinction and phase.

Where to join: with extinction the jerk, and for 0 < n < 1 the acceleration (7) too, is
unbounded as t → 0. Such a sweep is joined a hundredth of a cycle after its start, or at the
later instant from which its acceleration stays within that of its first full cycle.
Without extinction it is joined at its start. Where the jerk is limited it, too, must stay
within that of the first full cycle. How long: of all durations the one with the
least sum of squares of peak position, velocity and acceleration, each relative to the cycle
the lead adjoins, so a lead is as gentle as its neighbour and excites nothing above the
band. Should that not fit the limits, the sweep is joined later (up to its first turning
point) or left earlier (back to its last one), where it stands still for an instant.
A reversed waveform is led as its original is, mirrored. One that is at rest at 0 at both
ends, as a binary sequence, needs no lead; time at rest is put around it.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import ArgumentError, LimitsError
from hmpim.stimulus.limits import QUANTITIES, Limits, three_digits
from hmpim.stimulus.motion import FloatArray, Motion, Peaks, Piecewise, Scalable, Waveform
from hmpim.stimulus.peaks import true_peaks
from hmpim.stimulus.quintic import Quintic, between, coefficients_between, largest
from hmpim.stimulus.repeated import Repeated
from hmpim.stimulus.reverse import Reversed
from hmpim.stimulus.sweep import Sweep

__all__ = ["RestToRest", "join_time", "rest_to_rest", "starts_and_ends_at_rest"]

_CHOICES = 64  # durations tried for one lead at first
_FINER = 33  # and in each round about the best: odd, so that the best is among them
_CLOSE = 1e-9  # of itself: a duration is known well enough
_ALIKE = 1e-12  # of itself: two are equally harsh but for rounding
_STEPS = 16  # instants tried for joining or leaving
_BEYOND = 1e12  # harsher than any lead inside the limits


@dataclass(frozen=True, slots=True, kw_only=True)
class RestToRest:
    """A waveform with a lead-in from rest and a lead-out to rest, both at position 0.

    Parameters
    ----------
    core : Waveform
        The waveform inside; its time 0 is at `sweep_start`.
    sweep_start : float
        Seconds from the start of the record.
    join, leave : float
        Where the core takes over and is left, in seconds of the core's own time.
    lead_in, lead_out : Quintic
        In the record's time.
    duration : float
        Whole length in seconds; at rest from the end of `lead_out`.

    Examples
    --------
    >>> import numpy as np
    >>> sweep = Sweep(band=(0.1, 10.0), duration=10.0, gain=37.3, extinction=0.0)
    >>> led = rest_to_rest(sweep, limits=Limits(position=10, velocity=1000), fs=500.0)
    >>> ends = led.motion(np.array([0.0, led.duration]))
    >>> ends.position.tolist(), ends.velocity.tolist(), ends.acceleration.tolist()
    ([0.0, 0.0], [0.0, 0.0], [0.0, 0.0])
    """

    core: Waveform
    sweep_start: float
    join: float
    leave: float
    lead_in: Quintic
    lead_out: Quintic
    duration: float

    @property
    def band(self) -> tuple[float, float] | None:
        """Band of the core, in Hz."""
        return self.core.band

    @property
    def breaks(self) -> tuple[float, ...]:
        """Times in seconds at which one piece hands over to the next."""
        within = self.core.breaks if isinstance(self.core, Piecewise) else ()
        begin, joined, left, end = self.joints
        inner = (self.sweep_start + t for t in within if self.join < t < self.leave)
        return (begin, joined, *inner, left, end)

    @property
    def joints(self) -> tuple[float, float, float, float]:
        """Times in seconds at which the lead-in begins and joins, the core is left, rest begins."""
        return (
            self.lead_in.start,
            self.sweep_start + self.join,
            self.sweep_start + self.leave,
            self.lead_out.end,
        )

    def scaled(self, factor: float) -> "RestToRest":
        """Return the same motion, leads included, `factor` times as large."""
        if not isinstance(self.core, Scalable):
            raise ArgumentError(f"a {type(self.core).__name__} has no scale to change")
        return replace(
            self,
            core=self.core.scaled(factor),
            lead_in=self.lead_in.scaled(factor),
            lead_out=self.lead_out.scaled(factor),
        )

    def motion(self, time: FloatArray) -> Motion:
        """Position, velocity, acceleration and jerk at `time`.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Seconds from the start of the record; at rest outside.

        Examples
        --------
        >>> import numpy as np
        >>> sweep = Sweep(band=(0.1, 10.0), duration=10.0, gain=37.3, extinction=0.0)
        >>> led = rest_to_rest(sweep, limits=Limits(position=10), fs=500.0)
        >>> bool(led.motion(np.array([led.sweep_start + 3.0])).position[0]
        ...      == sweep.motion(np.array([3.0])).position[0])
        True
        """
        t = np.asarray(time, dtype=np.float64)
        motion = np.zeros((4, *t.shape))
        known = True
        begin, joined, left, end = self.joints
        for piece, offset, inside in (
            (self.lead_in, 0.0, (t >= begin) & (t < joined)),
            (self.core, self.sweep_start, (t >= joined) & (t <= left)),
            (self.lead_out, 0.0, (t > left) & (t < end)),
        ):
            part = piece.motion(t[inside] - offset)
            motion[0, inside] = part.position
            motion[1, inside] = part.velocity
            motion[2, inside] = part.acceleration
            if part.jerk is None:
                known = False
            else:
                motion[3, inside] = part.jerk
        return Motion(
            time=t,
            position=motion[0],
            velocity=motion[1],
            acceleration=motion[2],
            jerk=motion[3] if known else None,
        )


def join_time(sweep: Sweep, *, jerk: bool = False) -> float:
    """Where a lead may hand over to the sweep: past its singular start.

    The first instant from which the acceleration stays within that of the first full
    cycle, with extinction a hundredth of a cycle after the start at the earliest.

    Parameters
    ----------
    sweep : Sweep
        Of at least one cycle.
    jerk : bool
        Whether the jerk must stay within that of the first full cycle, too.

    Returns
    -------
    float
        Seconds; 0 where the sweep starts gently, as with n = 0.

    Examples
    --------
    >>> join_time(Sweep(band=(0.1, 10.0), duration=10.0, extinction=0.0))
    0.0
    >>> 0.0 < join_time(Sweep(band=(0.1, 40.0), duration=10.0, extinction=0.8)) < 0.1
    True
    """
    total = 2.0 * math.pi * sweep.cycles
    quarter = sweep.time_of_phase(0.5 * math.pi)
    around = np.linspace(quarter, sweep.time_of_phase(min(2.5 * math.pi, total)), 512)
    names = ("acceleration", "jerk") if jerk else ("acceleration",)
    moved = sweep.motion if jerk else sweep.without_jerk
    most = moved(around)
    levels = {name: float(np.abs(getattr(most, name)).max()) for name in names}

    def too_much(time: FloatArray) -> NDArray[np.bool_]:
        at = moved(time)
        over: NDArray[np.bool_] = np.zeros(time.shape, dtype=np.bool_)
        for name, level in levels.items():
            over |= np.abs(getattr(at, name)) > level
        return over

    early = quarter * np.concatenate((np.geomspace(1e-12, 1.0, 512), np.linspace(0.01, 1.0, 100)))
    early = np.unique(np.concatenate(([0.0], early)))
    beyond = too_much(early)
    earliest = 0.0 if sweep.extinction == 0.0 else sweep.time_of_phase(0.02 * math.pi)
    if not beyond.any():
        return earliest
    last = int(np.flatnonzero(beyond)[-1])
    low, high = float(early[last]), float(early[min(last + 1, early.size - 1)])
    near = 1e-9 * quarter
    while high - low > near:  # halvings, four at a time: the instants that they may ask at once
        at = [low, high]
        for _ in range(4):
            at = [*(t for a, b in pairwise(at) for t in (a, 0.5 * (a + b))), high]
        over = too_much(np.array(at))
        first, last = 0, len(at) - 1
        while last - first > 1 and at[last] - at[first] > near:
            middle = (first + last) // 2
            first, last = (middle, last) if over[middle] else (first, middle)
        low, high = at[first], at[last]
    return max(high, earliest)


def rest_to_rest(
    core: Waveform, *, limits: Limits, fs: float, longest: float = math.inf
) -> RestToRest:
    """Put a lead-in and a lead-out around `core`, inside `limits`.

    Parameters
    ----------
    core : Waveform
        The motion in the middle, itself inside the limits.
    limits : Limits
        In the core's unit.
    fs : float
        Sampling rate in Hz; the core starts on a sample, and the last sample is at rest.
    longest : float
        Time allowed for each lead, in seconds outside the core.

    Returns
    -------
    RestToRest
        Starting and ending at rest at position 0.

    Raises
    ------
    LimitsError
        If no lead of that length fits; the message says what is enough.
    ArgumentError
        If the core has no band, as a step.

    Examples
    --------
    >>> sweep = Sweep(band=(0.1, 10.0), duration=10.0, gain=37.3, extinction=0.0)
    >>> led = rest_to_rest(sweep, limits=Limits(position=10, acceleration=40000), fs=500.0)
    >>> led.join, led.leave
    (0.0, 10.0)
    """
    if starts_and_ends_at_rest(core):
        return _waiting(core, 0.0 if math.isinf(longest) else longest, fs)
    if isinstance(core, Reversed):
        forward = rest_to_rest(core.waveform, limits=limits, fs=fs, longest=longest)
        return _mirrored(forward, fs)
    earliest, first, last = _spans(core, jerk=math.isfinite(limits.jerk))
    start_peaks = true_peaks(core, start=earliest, stop=first, jerk=False)
    end_peaks = true_peaks(core, start=last, stop=core.duration, jerk=False)
    rest = np.zeros(3)
    entry = exit_ = None
    for join in _handovers(core, earliest, first, 0):
        state = _state(core, join)
        entry = gentlest_between(rest, state, start_peaks, limits, longest + join)
        if entry is not None:
            break
    for leave in _handovers(core, core.duration, last, -1):
        state = _state(core, leave)
        exit_ = gentlest_between(state, rest, end_peaks, limits, longest + core.duration - leave)
        if exit_ is not None:
            break
    if entry is None or exit_ is None:
        which = "in" if entry is None else "out"
        raise LimitsError(_no_lead(core, which, limits, longest, fs))
    outside = max(entry.duration - join, 0.0) if math.isinf(longest) else longest
    sweep_start = math.ceil(outside * fs - 1e-9) / fs
    lead_in = between(
        rest,
        _state(core, join),
        start=sweep_start + join - entry.duration,
        duration=entry.duration,
    )
    lead_out = between(
        _state(core, leave), rest, start=sweep_start + leave, duration=exit_.duration
    )
    after = lead_out.end if math.isinf(longest) else sweep_start + core.duration + longest
    return RestToRest(
        core=core,
        sweep_start=sweep_start,
        join=join,
        leave=leave,
        lead_in=lead_in,
        lead_out=lead_out,
        duration=(math.ceil(after * fs - 1e-9) + 1) / fs,
    )


def starts_and_ends_at_rest(core: Waveform) -> bool:
    """Whether a waveform needs no lead: at rest at position 0 at both ends.

    Examples
    --------
    >>> from hmpim.stimulus.profile import Steps
    >>> starts_and_ends_at_rest(Steps(levels=(1.0, 0.0), hold=1.0, rise=0.5))
    True
    """
    return not any(_state(core, end).any() for end in (0.0, core.duration))


def _waiting(core: Waveform, wait: float, fs: float) -> RestToRest:
    """Time at rest around what starts and ends at rest."""
    begin = math.ceil(wait * fs - 1e-9) / fs
    rest = (0.0,) * 6
    return RestToRest(
        core=core,
        sweep_start=begin,
        join=0.0,
        leave=core.duration,
        lead_in=Quintic(start=0.0, duration=begin, coefficients=rest),
        lead_out=Quintic(start=begin + core.duration, duration=wait, coefficients=rest),
        duration=(math.ceil((begin + core.duration + wait) * fs - 1e-9) + 1) / fs,
    )


def _mirrored(forward: RestToRest, fs: float) -> RestToRest:
    """The same leads around the reversed core, last first."""
    core = Reversed(waveform=forward.core)
    length = core.duration
    after = forward.duration - 1.0 / fs - forward.sweep_start - length
    begin = math.ceil(after * fs - 1e-9) / fs
    join, leave = length - forward.leave, length - forward.join
    rest = np.zeros(3)
    into, out = forward.lead_out.duration, forward.lead_in.duration
    end = begin + length + forward.sweep_start
    return RestToRest(
        core=core,
        sweep_start=begin,
        join=join,
        leave=leave,
        lead_in=between(rest, _state(core, join), start=begin + join - into, duration=into),
        lead_out=between(_state(core, leave), rest, start=begin + leave, duration=out),
        duration=(math.ceil(end * fs - 1e-9) + 1) / fs,
    )


def _no_lead(core: Waveform, which: str, limits: Limits, longest: float, fs: float) -> str:
    if math.isinf(longest):
        return (
            f"no lead-{which} of any length keeps the limits around a waveform of "
            f"{core.duration:g} s; let it make more cycles, or take lead=0 for the printed one"
        )
    try:
        fits = rest_to_rest(core, limits=limits, fs=fs)
    except LimitsError as error:
        return str(error)
    needed = max(
        fits.lead_in.duration - fits.join, fits.lead_out.end - fits.sweep_start - core.duration
    )
    return (
        f"lead = {longest:g} s is too short to keep the limits; "
        f"lead = {three_digits(needed, up=True)} s is enough, or lead='auto'"
    )


def _state(waveform: Waveform, time: float) -> FloatArray:
    at = waveform.motion(np.array([time]))
    return np.array([at.position[0], at.velocity[0], at.acceleration[0]])


def _spans(core: Waveform, *, jerk: bool) -> tuple[float, float, float]:
    """Earliest instant to join, and the ends of the two spans that a lead is compared with."""
    T = core.duration
    if isinstance(core, Sweep):
        total = 2.0 * math.pi * core.cycles
        earliest = join_time(core, jerk=jerk)
        first = core.time_of_phase(min(2.5 * math.pi, total))
        return earliest, first, core.time_of_phase(max(total - 2.0 * math.pi, 0.0))
    if isinstance(core, Repeated):
        first = core.time_of_phase(min(2.5 * math.pi, core.end_phase))
        return 0.0, first, core.time_of_phase(max(core.end_phase - 2.0 * math.pi, 0.0))
    if core.band is None:
        raise ArgumentError(
            f"a {type(core).__name__} jumps within itself, which no lead can smooth; "
            "take a waveform that has a band"
        )
    low, high = core.band
    return 0.0, min(1.0 / low, T), max(T - 1.0 / high, 0.0)


def _handovers(core: Waveform, best: float, far: float, which: int) -> Iterator[float]:
    """Instants to join (`which` 0) or to leave (-1), best first, towards where the core turns."""
    yield best
    times = np.linspace(best, max(far, best), 1024) if which == 0 else np.linspace(far, best, 1024)
    turn = _turning(core, times, which)
    for share in np.linspace(0.0, 1.0, _STEPS + 1)[1:].tolist():
        yield best + (turn - best) * share


def _turning(core: Waveform, times: FloatArray, which: int) -> float:
    velocity = core.motion(times).velocity
    sign = np.sign(velocity)  # their product neither overflows nor underflows
    flips = np.flatnonzero(sign[:-1] * sign[1:] <= 0.0)
    if flips.size == 0:
        return float(times[-1 if which == 0 else 0])
    low, high = float(times[flips[which]]), float(times[flips[which] + 1])
    before = float(sign[flips[which]])
    for _ in range(50):
        middle = 0.5 * (low + high)
        same = float(core.motion(np.array([middle])).velocity[0]) * before > 0.0
        low, high = (middle, high) if same else (low, middle)
    return 0.5 * (low + high)


def gentlest_between(
    first: FloatArray, last: FloatArray, beside: Peaks, limits: Limits, longest: float
) -> Quintic | None:
    """The gentlest quintic beside its neighbour's peaks, of those that keep the limits."""
    if not longest > 0.0:
        return None
    scales = (beside.position / beside.velocity, beside.velocity / beside.acceleration)
    neighbour = np.array([beside.position, beside.velocity, beside.acceleration])
    bounds = np.array([getattr(limits, name) for name in QUANTITIES])

    def harshness(log_durations: FloatArray) -> FloatArray:
        durations = np.exp(log_durations)
        found = coefficients_between(first, last, duration=durations)
        peaks = largest(np.stack(np.broadcast_arrays(*found), axis=1), durations)
        use = (peaks / bounds[:, None]).max(axis=0)
        shares = peaks[:3] / neighbour[:, None]
        return np.asarray(np.where(use > 1.0, _BEYOND * use, (shares**2).sum(axis=0)))

    low = math.log(0.3 * min(scales))
    high = min(math.log(20.0 * max(scales)), math.log(longest))
    grid = np.linspace(min(low, high - 1e-3), high, _CHOICES)
    best, least = _shortest(harshness(grid))
    if least >= _BEYOND:
        return None
    log_duration = float(grid[best])
    # many at once: a call for one takes nearly as long as a call for all
    while grid[-1] - grid[0] > _CLOSE:
        grid = np.linspace(grid[max(best - 1, 0)], grid[min(best + 1, grid.size - 1)], _FINER)
        best, found = _shortest(harshness(grid))
        if found <= least * (1.0 + _ALIKE):
            least, log_duration = min(found, least), float(grid[best])
    return between(first, last, start=0.0, duration=math.exp(log_duration))


def _shortest(harshness: FloatArray) -> tuple[int, float]:
    """Where the first of those stands that are as small as the smallest, and how small that is."""
    least = float(harshness.min())
    return int(np.argmax(harshness <= least * (1.0 + _ALIKE))), least
