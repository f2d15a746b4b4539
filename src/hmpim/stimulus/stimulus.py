"""A stimulus: a waveform sampled for a rig, inside its limits, and how one is designed."""

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from hmpim.errors import ArgumentError, LimitsError
from hmpim.stimulus.lead import RestToRest, rest_to_rest
from hmpim.stimulus.limits import Limits, three_digits
from hmpim.stimulus.motion import FloatArray, Motion, Peaks, Waveform
from hmpim.stimulus.peaks import true_peaks
from hmpim.stimulus.solve import largest_gain, smallest_extinction, sweep_peaks
from hmpim.stimulus.sweep import Sweep, check_band, check_positive
from hmpim.units import check_unit, rate_unit

__all__ = ["Stimulus", "design"]

_SETTLING = 0.5  # seconds at rest that a led stimulus appends, so that a late response is caught


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stimulus:
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

    Attributes
    ----------
    time, position, velocity, acceleration : ndarray, shape (n,)
        Samples at k/fs, read only.
    peaks : Peaks
        True peaks, between the samples too. Where the printed sweep is singular
        (0 < n < 1, no lead) the span between sample 0 and sample 1 is left out.

    Raises
    ------
    LimitsError
        If the waveform goes beyond the limits.
    ArgumentError
        If `fs` or `tail` is out of range.

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
    time: FloatArray = field(init=False, repr=False)
    position: FloatArray = field(init=False, repr=False)
    velocity: FloatArray = field(init=False, repr=False)
    acceleration: FloatArray = field(init=False, repr=False)
    peaks: Peaks = field(init=False)

    def __post_init__(self) -> None:
        fs = check_positive("fs", self.fs, "Hz")
        check_unit(self.unit)
        if not (math.isfinite(self.tail) and self.tail >= 0.0):
            raise ArgumentError(f"tail = {self.tail!r} s must be 0 or a positive, finite time")
        count = math.ceil(self.duration * fs - 1e-6)
        motion = self.waveform.motion(np.arange(count) / fs)
        for name in ("time", "position", "velocity", "acceleration"):
            samples: FloatArray = getattr(motion, name)
            samples.setflags(write=False)
            object.__setattr__(self, name, samples)
        if isinstance(self.waveform, Sweep):
            peaks = sweep_peaks(self.waveform, start=1.0 / fs)
        else:
            peaks = true_peaks(self.waveform)
        object.__setattr__(self, "peaks", peaks)
        if self.limits is not None:
            limits = self.limits.to(self.unit)
            object.__setattr__(self, "limits", limits)
            _keep(peaks, limits)

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
        return self.waveform.core if isinstance(self.waveform, RestToRest) else self.waveform

    @property
    def sweep_start(self) -> float:
        """Where time 0 of the waveform without its leads lies, in seconds."""
        return self.waveform.sweep_start if isinstance(self.waveform, RestToRest) else 0.0

    @property
    def sweep_duration(self) -> float:
        """Length of the waveform without its leads, in seconds."""
        return self.core.duration

    @property
    def gain(self) -> float | None:
        """G of the sweep inside, None where there is none."""
        return self.core.gain if isinstance(self.core, Sweep) else None

    @property
    def extinction(self) -> float | None:
        """Extinction factor n of the sweep inside, None where there is none."""
        return self.core.extinction if isinstance(self.core, Sweep) else None

    def motion(self, time: FloatArray) -> Motion:
        """Position, velocity and acceleration at any times (s, shape (n,)).

        Examples
        --------
        >>> import numpy as np
        >>> stimulus = Stimulus(waveform=Sweep(band=(0.1, 10.0), duration=5.0), fs=100.0)
        >>> bool(stimulus.motion(np.array([1.0])).position[0] == stimulus.position[100])
        True
        """
        return self.waveform.motion(time)


def _keep(peaks: Peaks, limits: Limits) -> None:
    for order, name in enumerate(("position", "velocity", "acceleration")):
        peak, limit = getattr(peaks, name), getattr(limits, name)
        if peak > limit * (1.0 + 1e-9):
            unit = rate_unit(limits.unit, order)
            bound = f"{limit:g} {unit}".rstrip()
            raise LimitsError(
                f"peak {name} {peak:.6g} is beyond the limit {bound}; "
                f"scale the waveform by {limit / peak:.4g} or raise the limit"
            )


def design(
    *,
    band: tuple[float, float],
    duration: float,
    fs: float,
    limits: Limits,
    extinction: float | Literal["auto"] = "auto",
    lead: float | Literal["auto"] = "auto",
    tail: float | Literal["auto"] = "auto",
    axis: str = "",
) -> Stimulus:
    """Design an HMPIM sweep inside limits (section III).

    The amplitude is taken to the position limit first, then the extinction is raised
    until rate and acceleration fit: the smallest n, to 0.001, and the largest gain.

    Parameters
    ----------
    band : tuple of float
        First and last frequency of the sweep, Hz.
    duration : float
        Length T of the sweep, seconds; leads and tail come on top.
    fs : float
        Sampling rate, Hz; more than twice the last frequency.
    limits : Limits
        What the axis may do; its unit is the stimulus's.
    extinction : 'auto' or float
        n; a number is taken as given, and only the gain is solved.
    lead : 'auto' or float
        Time for coming from rest and going back to rest, in seconds on each side; 'auto'
        takes what is gentle; 0 is the waveform as printed, with its velocity step.
    tail : 'auto' or float
        Seconds at rest at the end; 'auto' is 0.5 s with a lead and 0 without.
    axis : str
        Name of the axis, where there are several.

    Returns
    -------
    Stimulus
        Never beyond the limits, between the samples too.

    Raises
    ------
    LimitsError
        If limits and band cannot both be met; the message says what would do.
    ArgumentError
        For anything else that is out of range.

    Examples
    --------
    >>> limits = Limits(position=10, velocity=1000, acceleration=40000, unit="deg")
    >>> stimulus = design(band=(0.1, 10), duration=10, fs=500, limits=limits)
    >>> stimulus.extinction, round(stimulus.peaks.velocity), stimulus.velocity[0]
    (0.0, 628, np.float64(0.0))
    """
    low, high = check_band(band)
    length = check_positive("duration", duration, "s")
    rate = check_positive("fs", fs, "Hz")
    if high >= 0.5 * rate:
        raise LimitsError(
            f"band = ({low:g}, {high:g}) Hz reaches the Nyquist frequency {0.5 * rate:g} Hz of "
            f"fs = {rate:g} Hz; sample faster than {2.0 * high:g} Hz, or end the band below "
            f"{0.5 * rate:g} Hz"
        )
    cycles = 0.5 * (low + high) * length
    if cycles < 1.0 - 1e-9:
        raise LimitsError(
            f"band = ({low:g}, {high:g}) Hz makes {cycles:.3g} cycles in {length:g} s, "
            f"and one is needed; a duration of {three_digits(length / cycles, up=True)} s would do"
        )
    if not isinstance(limits, Limits):
        raise ArgumentError(f"limits = {limits!r} is not a Limits; write Limits(position=10, ...)")
    if math.isinf(min(limits.position, limits.velocity, limits.acceleration)):
        raise LimitsError(
            "no limit is finite, so nothing says how large the motion may be; give one"
        )
    ahead = _seconds("lead", lead)
    start = 1.0 / rate if ahead == 0.0 else None
    if extinction == "auto":
        n = smallest_extinction((low, high), length, limits, start=start)
    elif isinstance(extinction, str):
        raise ArgumentError(f"extinction = {extinction!r} must be 'auto' or a number")
    else:
        n = extinction
    sweep = Sweep(band=(low, high), duration=length, gain=1.0, extinction=n)
    sweep = largest_gain(sweep, limits, start=start)
    waveform: Waveform = sweep
    if ahead != 0.0:
        longest = math.inf if ahead is None else ahead
        waveform = rest_to_rest(sweep, limits=limits, fs=rate, longest=longest)
    settling = _seconds("tail", tail)
    if settling is None:
        settling = 0.0 if ahead == 0.0 else _SETTLING
    return Stimulus(
        waveform=waveform, fs=rate, unit=limits.unit, limits=limits, axis=axis, tail=settling
    )


def _seconds(name: str, given: float | Literal["auto"]) -> float | None:
    """Seconds, or None for 'auto'."""
    if given == "auto":
        return None
    if isinstance(given, str) or not (math.isfinite(given) and given >= 0.0):
        raise ArgumentError(f"{name} = {given!r} must be 'auto', 0 or a positive time in seconds")
    return float(given)
