"""A stimulus: a waveform sampled for a rig, inside its limits."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from hmpim.arguments import checked, size_of
from hmpim.equality import ByValue
from hmpim.errors import ArgumentError, LimitsError
from hmpim.stimulus.base import Superposed
from hmpim.stimulus.command import Command, check_resolution, difference_peaks, rounded
from hmpim.stimulus.exponential import ExponentialSweep
from hmpim.stimulus.lead import RestToRest
from hmpim.stimulus.limits import QUANTITIES, Limits
from hmpim.stimulus.motion import FloatArray, Motion, Peaks, Waveform
from hmpim.stimulus.peaks import true_peaks
from hmpim.stimulus.reverse import Reversed
from hmpim.stimulus.sampled import SampledMotion
from hmpim.stimulus.solve import first_instant, sweep_peaks
from hmpim.stimulus.sweep import Sweep, check_positive
from hmpim.tables import html_table, shortened
from hmpim.units import check_unit, rate_label

__all__ = ["Stimulus", "blocks"]


@checked
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stimulus(ByValue):
    """A waveform, sampled, checked against its limits when made.

    Parameters
    ----------
    waveform : Waveform
        The motion in closed form.
    fs : float
        Sampling rate in Hz.
    unit : str
        Unit of the position.
    limits : Limits or None
        What it must keep; converted to `unit`.
    axis : str
        Which axis it is for, where there are several.
    tail : float
        Seconds at rest appended after the waveform.
    resolution : float
        Step that the rig rounds its position commands to; 0 for none. The limits must then
        hold for the rounded commands, too.

    Attributes
    ----------
    time, position, velocity, acceleration : ndarray, shape (n,)
        Samples at k/fs, read only.
    peaks : Peaks
        True peaks, between the samples too. Where the printed sweep is singular
        (0 < n < 1, no lead) the span between sample 0 and sample 1 is left out. Of a
        jump it is the difference over one sampling interval, as commanded; any limit on a
        derivative of what jumps refuses it. A waveform without leads begins and ends with a
        velocity step: its jerk is infinite.

    Raises
    ------
    LimitsError
        If the waveform, or what is commanded of it, goes beyond the limits.
    ArgumentError
        If `fs`, `tail` or `resolution` is out of range.

    Examples
    --------
    >>> sweep = Sweep(band=(0.1, 10.0), duration=5.0, gain=10.0, extinction=0.0)
    >>> stimulus = Stimulus(waveform=sweep, fs=100.0, unit="deg")
    >>> stimulus.samples, stimulus.band, stimulus.gain
    (500, (0.1, 10.0), 10.0)
    """

    waveform: Waveform
    fs: float
    unit: str = ""
    limits: Limits | None = None
    axis: str = ""
    tail: float = 0.0
    resolution: float = 0.0
    # These follow from the fields above, and do not count where stimuli are compared.
    time: FloatArray = field(init=False, repr=False, compare=False)
    position: FloatArray = field(init=False, repr=False, compare=False)
    velocity: FloatArray = field(init=False, repr=False, compare=False)
    acceleration: FloatArray = field(init=False, repr=False, compare=False)
    peaks: Peaks = field(init=False, compare=False)

    def __post_init__(self) -> None:
        fs = check_positive("fs", self.fs, "Hz")
        check_unit(self.unit)
        if not (math.isfinite(self.tail) and self.tail >= 0.0):
            raise ArgumentError(f"tail = {self.tail!r} s must be 0 or a positive, finite time")
        object.__setattr__(self, "resolution", check_resolution(self.resolution))
        count = size_of(self.duration, fs)
        motion = self.waveform.motion(np.arange(count) / fs)
        for name in ("time", "position", "velocity", "acceleration"):
            samples: FloatArray = getattr(motion, name)
            samples.setflags(write=False)
            object.__setattr__(self, name, samples)
        peaks = _peaks(self.waveform, fs)
        object.__setattr__(self, "peaks", _as_commanded(peaks, self.waveform, self.position, fs))
        if self.limits is not None:
            limits = self.limits.to(self.unit)
            object.__setattr__(self, "limits", limits)
            _keep(peaks, limits)
            if self.resolution > 0.0:
                self.commanded()

    def __repr__(self) -> str:
        axis = f"{shortened([self.axis])}: " if self.axis else ""
        band = f" {self.band[0]:.6g} to {self.band[1]:.6g} Hz" if self.band else ""
        return (
            f"Stimulus({axis}{type(self.core).__name__}{band}, {self.duration:.6g} s at "
            f"{self.fs:.6g} Hz, {self.peaks.position:.6g} {self.unit}".rstrip()
            + ")"
        )

    def _repr_html_(self) -> str:
        """Return a table of peaks and limits, as a notebook shows it."""
        rows = []
        for order, name in enumerate(QUANTITIES):
            limit = math.inf if self.limits is None else getattr(self.limits, name)
            peak = getattr(self.peaks, name)
            cells = [f"{each:.6g}" if math.isfinite(each) else "–" for each in (peak, limit)]
            rows.append([name, *cells, rate_label(self.unit, order)])
        return html_table(repr(self), ["quantity", "peak", "limit", "unit"], rows)

    @property
    def duration(self) -> float:
        """Whole length in seconds: leads, waveform and tail."""
        return self.waveform.duration + self.tail

    @property
    def samples(self) -> int:
        """Number of samples."""
        return self.time.size

    @property
    def band(self) -> tuple[float, float] | None:
        """Excited band in Hz, None where the waveform has none."""
        return self.waveform.band

    @property
    def core(self) -> Waveform:
        """The waveform without its leads."""
        led = _without_base(self.waveform)
        return led.core if isinstance(led, RestToRest) else led

    @property
    def sweep_start(self) -> float:
        """Where time 0 of the waveform without its leads lies, in seconds."""
        led = _without_base(self.waveform)
        return led.sweep_start if isinstance(led, RestToRest) else 0.0

    @property
    def sweep_duration(self) -> float:
        """Length of the waveform without its leads, in seconds."""
        return self.core.duration

    @property
    def gain(self) -> float | None:
        """G of the sweep inside, None where there is none."""
        sweep = _unreversed(self.core)
        return sweep.gain if isinstance(sweep, Sweep | ExponentialSweep) else None

    @property
    def extinction(self) -> float | None:
        """Extinction factor n of the sweep inside, None where there is none."""
        sweep = _unreversed(self.core)
        return sweep.extinction if isinstance(sweep, Sweep | ExponentialSweep) else None

    def motion(self, time: FloatArray) -> Motion:
        """Position and its derivatives at any times (s, shape (n,)).

        Examples
        --------
        >>> import numpy as np
        >>> stimulus = Stimulus(waveform=Sweep(band=(0.1, 10.0), duration=5.0), fs=100.0)
        >>> bool(stimulus.motion(np.array([1.0])).position[0] == stimulus.position[100])
        True
        """
        return self.waveform.motion(time)

    def commanded(self, *, resolution: float | None = None, fs: float | None = None) -> Command:
        """Position commands as they are really sent, checked against the limits once more.

        Parameters
        ----------
        resolution : float, optional
            Step that positions are rounded to; the stimulus's own by default.
        fs : float, optional
            Command rate in Hz; the stimulus's own by default.

        Raises
        ------
        LimitsError
            If the rounded commands, or their differences over the sampling interval, go beyond
            a limit; the message says what is enough.

        Examples
        --------
        >>> from hmpim.stimulus.profile import Steps
        >>> steps = Steps(levels=(1.0, 0.0), hold=1.0, rise=0.5)
        >>> sent = Stimulus(waveform=steps, fs=8.0).commanded(resolution=0.25)
        >>> sent.position[:5].tolist()
        [0.0, 0.0, 0.5, 1.0, 1.0]
        """
        rate = self.fs if fs is None else check_positive("fs", fs, "Hz")
        step = self.resolution if resolution is None else check_resolution(resolution)
        time = np.arange(size_of(self.duration, rate)) / rate
        position = rounded(self.motion(time).position, step)
        at = self.motion(np.zeros(1))
        from_rest = at.velocity[0] == 0.0 and at.acceleration[0] == 0.0
        before = rounded(self.motion(np.array([-1.0 / rate])).position, step)
        sent = np.concatenate((before, position)) if from_rest else position
        peaks = difference_peaks(sent, rate, first=0 if from_rest else 1)
        if self.limits is not None:
            what = f"rounded to {step:g} and sent at {rate:g} Hz, the stimulus's " if step else ""
            _keep(peaks, self.limits, what=what)
        return Command(fs=rate, resolution=step, time=time, position=position, peaks=peaks)


def blocks(stimulus: Stimulus, size: int, *, fs: float | None = None) -> Iterator[Motion]:
    """Generate a stimulus block by block, as a real-time player wants it.

    Put together, the blocks are the whole, bit for bit.

    Parameters
    ----------
    stimulus : Stimulus
        Any.
    size : int
        Samples of each block; the last may be shorter.
    fs : float, optional
        Rate in Hz; the stimulus's own by default.

    Yields
    ------
    Motion
        Position (rounded to the stimulus's resolution) and its derivatives, times included.

    Raises
    ------
    ArgumentError
        If size or rate are out of range.

    Examples
    --------
    >>> stimulus = Stimulus(waveform=Sweep(band=(0.1, 10.0), duration=5.0), fs=100.0)
    >>> [block.time.size for block in blocks(stimulus, 200)]
    [200, 200, 100]
    """
    if isinstance(size, bool) or size != int(size) or size < 1:
        raise ArgumentError(f"size = {size!r} must be a whole number of samples from 1 on")
    rate = stimulus.fs if fs is None else check_positive("fs", fs, "Hz")
    return _blocks(stimulus, int(size), rate)


def _blocks(stimulus: Stimulus, size: int, rate: float) -> Iterator[Motion]:
    count = _count(stimulus.duration, rate)
    for first in range(0, count, size):
        at = stimulus.motion(np.arange(first, min(first + size, count)) / rate)
        yield replace(at, position=rounded(at.position, stimulus.resolution))


def _count(duration: float, fs: float) -> int:
    """Number of samples at k/fs in a duration."""
    return math.ceil(duration * fs - 1e-6)


def _without_base(waveform: Waveform) -> Waveform:
    return waveform.upper if isinstance(waveform, Superposed) else waveform


def _unreversed(waveform: Waveform) -> Waveform:
    return waveform.waveform if isinstance(waveform, Reversed) else waveform


def _peaks(waveform: Waveform, fs: float) -> Peaks:
    if isinstance(waveform, SampledMotion):
        return waveform.peaks
    printed = _unreversed(waveform)
    if isinstance(printed, Sweep):
        backwards = printed is not waveform
        return sweep_peaks(printed, start=first_instant(printed.duration, fs, backwards=backwards))
    peaks = true_peaks(waveform)
    ends = waveform.motion(np.array([0.0, waveform.duration]))
    if ends.velocity.any() or ends.acceleration.any():
        return replace(peaks, jerk=math.inf)
    return peaks


def _as_commanded(peaks: Peaks, waveform: Waveform, position: FloatArray, fs: float) -> Peaks:
    """Peaks with the differences that the samples command where a jump makes them infinite."""
    if math.isfinite(peaks.acceleration):
        return peaks
    before = waveform.motion(np.array([-1.0 / fs])).position
    sent = difference_peaks(np.concatenate((before, position)), fs)
    velocity = sent.velocity if math.isinf(peaks.velocity) else peaks.velocity
    return replace(peaks, velocity=velocity, acceleration=sent.acceleration)


def _keep(peaks: Peaks, limits: Limits, *, what: str = "") -> None:
    for order, name in enumerate(QUANTITIES):
        peak, limit = getattr(peaks, name), getattr(limits, name)
        if math.isfinite(limit) and peak > limit * (1.0 + 1e-9):
            bound = f"{limit:g} {rate_label(limits.unit, order)}".rstrip()
            if math.isinf(peak):
                raise LimitsError(
                    f"{what}peak {name} is infinite, for the waveform jumps, and the limit is "
                    f"{bound}; take one with smooth transitions, or leave this limit out"
                )
            raise LimitsError(
                f"{what}peak {name} {peak:.6g} is beyond the limit {bound}; "
                f"scale the waveform by {_rounded_down(limit / peak)} or raise the limit"
            )


def _rounded_down(value: float) -> str:
    """Four digits, cut and not rounded, so that the advice does."""
    place = 10.0 ** (3 - math.floor(math.log10(value)))
    return f"{math.floor(value * place) / place:.4g}"
