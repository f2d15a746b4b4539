"""One uniform clock for all channels of a record, which is what identification needs."""

from dataclasses import dataclass, replace
from itertools import zip_longest
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import RecordError
from hmpim.record.channel import Channel, Intersample
from hmpim.record.clock import Clock, fit_clock
from hmpim.record.even import evenly_sampled
from hmpim.record.finding import Finding
from hmpim.record.held import Waveform, switches_beside, waveform_of
from hmpim.record.onto import FASTER, is_reduced, on_grid
from hmpim.record.quality import clock_findings
from hmpim.record.record import Record
from hmpim.record.resample import share_above
from hmpim.record.turns import continue_turns

__all__ = ["Aligned", "Signal", "uniform"]

_T = TypeVar("_T", bound=np.generic)

_FOLDED = 0.001
"""Share of an input's power above half the output's rate that is said: 3 % of its amplitude."""


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
        What was found when the record was read, then what had to be repaired here: 'wrapped',
        'gaps', 'jitter', 'even_samples', 'rate', 'resampled'. Empty if nothing.
    intersample : {'zoh', 'foh', 'bandlimited', 'feedforward', 'sampled'} or None
        What the inputs do between the samples here: as the record states, but 'bandlimited'
        where a held or linear one has its corners by a clock of its own, and 'zoh' for
        'feedforward' on a clock of its own.
    waveforms : tuple of Waveform
        What the inputs truly were, where that is so; empty else.
    """

    time: NDArray[np.float64]
    fs: float
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    findings: tuple[Finding, ...]
    intersample: Intersample | None = None
    waveforms: tuple[Waveform, ...] = ()

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

    * Angles and counters that start again after a whole turn: whole turns are added to remove
      the jumps (see `hmpim.record.turns`).
    * Gaps: the clock runs on through them. Samples beside a gap stay as they are; inside it
      values are filled in and marked in `Signal.valid`.
    * Jitter of stamps whose samples were taken evenly: the samples are kept as they are
      (`hmpim.record.even`). Jitter of the samples themselves: values are interpolated from their
      own stamps with a cubic spline (not-a-knot), corrected once by the interpolated residual of
      the band-limited result at the samples. With stamps strewn by ±30 % of the interval it errs
      by 6e-5 of the amplitude (r.m.s.) at a tenth of the rate and by 9e-4 at a fifth; within 32
      samples of the ends, by 5e-4 and 7e-3. A gap ends one spline and begins the next.
    * Channels with clocks of their own: interpolated likewise, over the span that all share. One
      that is sampled faster loses what lies above half the lower rate first, by a symmetric
      filter: no path moves the delay (see `hmpim.record.resample`).
    * Inputs stated as 'zoh' or 'foh' whose corners lie beside the instants of the output's clock:
      what of them lies below half the output's rate, by the same filter, for a band-limited input
      (see `hmpim.record.held`). The rest folds in the output, which `identify` puts right.

    Inside a gap the filling is a cubic (Hermite) between the two edges, with slopes limited so
    that it never leaves the range between them; a short gap is bridged by an autoregression of the
    channel where that foretells samples that are known better (see `hmpim.record.bridge`).

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
    continued = continue_turns(record)
    record = continued.record
    channels = (*record.outputs, *record.inputs)
    clocks = _clocks(channels, record.fs)
    first = channels[0]
    clock = clocks[id(first.time)]
    shared = all(clocks[id(c.time)] is clock for c in channels)
    even = evenly_sampled(channels, clock, nominal=record.fs) if shared else None
    timing = clock_findings(clock, first.time, stated=record.fs, even=even)
    findings = [*record.findings, *continued.findings, *timing]
    if even is not None:
        clock, record = even, _stamped_evenly(record, even)
        channels = (*record.outputs, *record.inputs)
        first, clocks = channels[0], {id(c.time): clock for c in channels}
    if shared and clock.uniform:
        everywhere = _frozen(np.ones(first.time.size, dtype=np.bool_))
        return Aligned(
            time=first.time,
            fs=clock.fs,
            inputs=tuple(_unchanged(c, everywhere) for c in record.inputs),
            outputs=tuple(_unchanged(c, everywhere) for c in record.outputs),
            findings=tuple(findings),
            intersample=record.intersample,
        )
    if shared:
        grid = clock.start + np.arange(clock.length) / clock.fs
    else:
        grid = _common_grid(channels, clocks, clock)
        findings.extend(_clock_differences(record, clocks, clock))
    # The output's clock does not keep a command's own samples, so its derivatives are unknown.
    unknown = record.intersample == "feedforward" and not shared
    between = "zoh" if unknown else record.intersample
    waveforms: tuple[Waveform, ...] = ()
    if (between == "zoh" or between == "foh") and switches_beside(
        record.inputs, clocks, clock, between
    ):
        waveforms = tuple(waveform_of(c, clocks[id(c.time)], between) for c in record.inputs)
        findings.append(_held_between(record, clock, between))
        between = "bandlimited"

    def signal(channel: Channel, intersample: Intersample | None, true: Waveform | None) -> Signal:
        own = clocks[id(channel.time)]
        values, valid = on_grid(channel, own, grid, fs=clock.fs, intersample=intersample)
        if true is not None:
            values = true.below_half(grid, fs=clock.fs)
        return Signal(
            name=channel.name, values=_frozen(values), valid=_frozen(valid), unit=channel.unit
        )

    return Aligned(
        time=_frozen(grid),
        fs=clock.fs,
        inputs=tuple(signal(c, between, true) for c, true in zip_longest(record.inputs, waveforms)),
        outputs=tuple(signal(c, None, None) for c in record.outputs),
        findings=tuple(findings),
        intersample=between,
        waveforms=waveforms,
    )


def _stamped_evenly(record: Record, clock: Clock) -> Record:
    """The same samples at the instants of an even clock, which all channels share."""
    time = _frozen(clock.start + clock.index / clock.fs)

    def moved(channels: tuple[Channel, ...]) -> tuple[Channel, ...]:
        return tuple(replace(c, time=time) for c in channels)

    return replace(record, inputs=moved(record.inputs), outputs=moved(record.outputs))


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


def _clock_differences(record: Record, clocks: dict[int, Clock], clock: Clock) -> list[Finding]:
    """What is to be said of the channels that have a clock of their own."""
    channels = (*record.outputs, *record.inputs)
    findings: list[Finding] = []
    reported = {id(clock)}
    for c in channels:
        own = clocks[id(c.time)]
        if id(own) in reported:
            continue
        reported.add(id(own))
        findings.extend(clock_findings(own, c.time, name=c.name))
        place = (own.start - clock.start) * clock.fs
        beside = abs(place - np.rint(place))
        same = abs(own.fs / clock.fs - 1.0) * own.length < 0.01
        if same and beside <= (own.rounding + clock.rounding) * clock.fs and not own.jittered:
            continue  # one clock, of which this channel misses some samples
        between = record.intersample if c in record.inputs else None
        findings.append(_resampled(c, own, channels[0], clock, between))
        if c in record.inputs:
            findings.extend(_folded(c, own, channels[0], clock))
    return findings


def _held_between(record: Record, clock: Clock, intersample: Intersample) -> Finding:
    """An input that is held, or linear, by another clock: its corners lie where none is sampled."""
    how = "are held" if intersample == "zoh" else "turn"
    names = ", ".join(repr(c.name) for c in record.inputs)
    return Finding(
        code="held_between",
        message=(
            f"Values of {names} {how} between the samples of {record.outputs[0].name!r} at "
            f"{clock.fs:.6g} Hz; the response between samples is aliased in these, which only "
            "identification of the original record corrects"
        ),
        severity="doubt",
        parameters=("delay", "delay_correlation", "delay_low_frequency"),
    )


def _resampled(
    channel: Channel, own: Clock, first: Channel, clock: Clock, intersample: Intersample | None
) -> Finding:
    place = (own.start - clock.start) * clock.fs
    held = intersample in ("zoh", "foh")
    how = "was interpolated"
    if held:
        how = f"was brought onto it as it is {'held' if intersample == 'zoh' else 'joined'}"
    if not held and is_reduced(channel, own, clock.fs):
        how = f"was reduced to it, with what it holds above {clock.fs / 2:.6g} Hz taken out"
    return Finding(
        code="resampled",
        message=(
            f"{channel.name!r} has a clock of its own ({own.fs:.6g} Hz, "
            f"{place - np.floor(place):.2g} of an interval after that of {first.name!r} at "
            f"{clock.fs:.6g} Hz) and {how}{'' if held else '; neither moves its delay'}"
        ),
        severity="info",
        parameters=(),
    )


def _folded(channel: Channel, own: Clock, first: Channel, clock: Clock) -> list[Finding]:
    """An input that moves faster than the output is sampled comes back folded in the output."""
    if own.fs < FASTER * clock.fs:
        return []
    share = share_above(channel.values, fs=own.fs, limit=0.5 * clock.fs)
    if share < _FOLDED:
        return []
    return [
        Finding(
            code="folded",
            message=(
                f"{100 * share:.2g} % of the power of {channel.name!r} lies above "
                f"{clock.fs / 2:.6g} Hz, half the rate of {first.name!r}: the response to it is "
                "aliased to lower frequencies there, as noise; record the output faster, or "
                "sweep lower"
            ),
            severity="info",
            parameters=(),
        )
    ]
