"""Design a stimulus of any kind inside limits, rest to rest."""

import copy
import math
from typing import Literal, get_args

import numpy as np

from hmpim.arguments import check_size, checked, generator, size_of
from hmpim.errors import ArgumentError, LimitsError
from hmpim.stimulus.base import Superposed, room_beside_base, shuttle_for
from hmpim.stimulus.command import leave_room
from hmpim.stimulus.exponential import ExponentialSweep
from hmpim.stimulus.lead import rest_to_rest, starts_and_ends_at_rest
from hmpim.stimulus.limits import Limits, three_digits
from hmpim.stimulus.motion import Scalable, Waveform
from hmpim.stimulus.multisine import random_phase_multisine, schroeder_multisine
from hmpim.stimulus.profile import smooth_prbs, smooth_steps
from hmpim.stimulus.repeated import repeated_sweeps
from hmpim.stimulus.reverse import Reversed
from hmpim.stimulus.scale import check_limits_given
from hmpim.stimulus.solve import first_instant, largest_gain, smallest_extinction, sweep_peaks
from hmpim.stimulus.spectrum import OverFrequency, Redesign, check_spectrum
from hmpim.stimulus.stimulus import Stimulus
from hmpim.stimulus.sweep import Sweep, check_band, check_positive

__all__ = ["KINDS", "Kind", "design"]

Kind = Literal[
    "hmpim", "exponential", "reversed", "repeated", "schroeder", "random_phase", "prbs", "steps"
]
KINDS: tuple[Kind, ...] = get_args(Kind)
_SWEEPS = ("hmpim", "exponential", "reversed")
_CYCLES = 6.0  # of each repeated sweep: 0.6 s from 0.1 to 20 Hz, the study in docs/live.md
_SETTLING = 0.5  # seconds at rest that a led stimulus appends, so that a late response is caught
_EXTINCTIONS = (0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0)  # tried of a sweep on a base
_SMALLER = (0.98, 0.95, 0.9, 0.8, 0.7, 0.6, 0.5)  # scales that leave room for a lead


@checked
def design(
    *,
    band: tuple[float, float],
    duration: float,
    fs: float,
    limits: Limits,
    kind: Kind = "hmpim",
    sweep: float | None = None,
    extinction: float | Literal["auto"] = "auto",
    lead: float | Literal["auto"] = "auto",
    tail: float | Literal["auto"] = "auto",
    base: Literal["auto"] | None = None,
    axis: str = "",
    resolution: float = 0.0,
    rng: np.random.Generator | int | None = None,
    wanted_snr: float | OverFrequency | None = None,
    noise: float | OverFrequency | None = None,
) -> Stimulus:
    """Design a stimulus inside limits, from rest to rest (section III).

    Of sweeps, the amplitude is taken to the position limit first, then the extinction is
    raised until the derivatives fit: the smallest n, to 0.001, and the largest gain. Binary
    sequences and steps take the amplitude to the limit, then the shortest transition;
    multisines are shaped as the limits are and scaled to them.

    Parameters
    ----------
    band : tuple of float
        First and last frequency, Hz.
    duration : float
        Length T of the waveform, seconds; leads and tail come on top.
    fs : float
        Sampling rate, Hz; more than twice the last frequency.
    limits : Limits
        What the axis may do; its unit is the stimulus's.
    kind : str
        'hmpim', the linear sweep of the paper; 'exponential' sweep; 'reversed', the paper's
        from high to low; 'repeated', short sweeps up and down in turn; 'schroeder' and
        'random_phase' multisines; 'prbs', a binary sequence, and 'steps', both through smooth
        transitions.
    sweep : float, optional
        Length of each sweep of kind 'repeated', in seconds; that of six cycles by default.
    extinction : 'auto' or float
        n of a sweep; a number is taken as given, and only the gain is solved.
    lead : 'auto' or float
        Time for coming from rest and going back to rest, in seconds on each side; 'auto'
        takes what is gentle; 0 is the waveform as printed, with its velocity step.
    tail : 'auto' or float
        Seconds at rest at the end; 'auto' is 0.5 s with a lead and 0 without.
    base : 'auto' or None
        'auto' puts a slow motion to and fro under the waveform, which keeps an axis with dry
        friction out of stiction; the limits are kept by the sum (`hmpim.stimulus.base`).
    axis : str
        Name of the axis, where there are several.
    resolution : float
        Step that the rig rounds its position commands to; the limits then hold for the
        rounded commands at `fs`, too.
    rng : numpy.random.Generator, int or None
        Source of random phases, or its seed; needed for 'random_phase' only.
    wanted_snr : float or OverFrequency, optional
        Signal-to-noise ratio in dB wanted at each frequency of the band, in each line of the
        waveform's DFT (`check_spectrum`); less is refused.
    noise : float or OverFrequency, optional
        Standard deviation of white noise, in the unit, or one-sided density of a measured
        one, in unit²/Hz; needed with `wanted_snr`.

    Returns
    -------
    Stimulus
        Never beyond the limits, between the samples too.

    Raises
    ------
    LimitsError
        If limits, band and ratio cannot all be met; the message says what is enough.
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
    _check_frequencies(low, high, length, rate)
    size_of(length, rate)
    check_size("duration", length, "s")
    check_size("fs", rate, "Hz")
    if rng is not None:
        generator(rng)
    check_limits_given(limits)
    ahead = _seconds("lead", lead)
    if (wanted_snr is None) != (noise is None):
        raise ArgumentError(
            f"wanted_snr = {wanted_snr!r} and noise = {noise!r} belong together; give both"
        )
    again = copy.deepcopy(rng)  # a second design must draw the same phases
    if kind not in KINDS:
        raise ArgumentError(f"kind = {kind!r} must be one of {', '.join(map(repr, KINDS))}")
    if sweep is not None and kind != "repeated":
        raise ArgumentError(f"sweep = {sweep!r} s is for kind = 'repeated', and kind = {kind!r}")
    room = leave_room(limits, resolution=resolution, fs=rate)
    under = room_beside_base(room) if base == "auto" else None
    if under is not None:
        if ahead == 0.0:
            raise ArgumentError("lead = 0 starts in motion, and a base starts at rest; lead='auto'")
        room = under.upper
    core: Waveform
    if kind in _SWEEPS:
        first = first_instant(length, rate, backwards=kind == "reversed")
        start = first if ahead == 0.0 else None
        if under is not None and extinction == "auto":
            extinction = _largest_extinction(kind, (low, high), length, room)
        core = _sweep(kind, (low, high), length, room, extinction, start)
    elif extinction != "auto":
        raise ArgumentError(
            f"extinction = {extinction!r} is for sweeps; the limits shape kind = {kind!r}"
        )
    elif kind == "repeated":
        each = min(2.0 * _CYCLES / (low + high), length) if sweep is None else sweep
        core = repeated_sweeps(band=(low, high), duration=length, sweep=each, limits=room)
    elif kind == "schroeder":
        core = schroeder_multisine(band=(low, high), duration=length, limits=room)
    elif kind == "random_phase":
        if rng is None:
            raise ArgumentError("kind = 'random_phase' needs rng, a seed for instance")
        core = random_phase_multisine(band=(low, high), duration=length, limits=room, rng=rng)
    elif kind == "prbs":
        core = smooth_prbs(band=(low, high), duration=length, fs=rate, limits=room)
    else:
        core = smooth_steps(band=(low, high), duration=length, fs=rate, limits=room)
    waveform = _led(core, room, rate, ahead)
    if under is not None:
        waveform = Superposed(upper=waveform, base=shuttle_for(under, waveform.duration))
    settling = _seconds("tail", tail)
    if settling is None:
        settling = 0.0 if ahead == 0.0 else max(_SETTLING, 2.0 / rate)  # a sample at rest at least
    stimulus = Stimulus(
        waveform=waveform,
        fs=rate,
        unit=limits.unit,
        limits=limits,
        axis=axis,
        tail=settling,
        resolution=resolution,
    )
    if wanted_snr is not None and noise is not None:

        def make(others: Limits, seconds: float) -> Stimulus:
            return design(
                band=band,
                duration=seconds,
                fs=fs,
                limits=others,
                kind=kind,
                sweep=sweep,
                extinction=extinction,
                lead=lead,
                tail=tail,
                base=base,
                resolution=resolution,
                rng=copy.deepcopy(again),
            )

        check_spectrum(
            stimulus,
            noise=noise,
            snr_db=wanted_snr,
            band=(low, high),
            resolution=1.0 / length,
            redesign=Redesign(duration=length, make=make),
        )
    return stimulus


def _largest_extinction(
    kind: Kind, band: tuple[float, float], duration: float, room: Limits
) -> float:
    """The n with which a sweep on a base is largest: its velocity, not its travel, is scarce."""
    found = []
    for n in _EXTINCTIONS:
        one: Sweep | ExponentialSweep = (
            ExponentialSweep(band=band, duration=duration, extinction=n)
            if kind == "exponential"
            else Sweep(band=band, duration=duration, extinction=n)
        )
        peaks = sweep_peaks(one, start=None, jerk=math.isfinite(room.jerk))
        found.append((peaks.position / room.use(peaks), -n))
    return -max(found)[1]


def _sweep(
    kind: Kind,
    band: tuple[float, float],
    duration: float,
    limits: Limits,
    extinction: float | Literal["auto"],
    start: float | None,
) -> Waveform:
    """The sweep of a kind with its n and gain solved."""
    if start is not None and math.isfinite(limits.jerk):
        raise LimitsError(
            "lead = 0 is a waveform that starts with a velocity step, whose jerk is unbounded; "
            "take lead='auto', or leave out the jerk limit"
        )
    kept: float

    def linear(n: float) -> Sweep:
        return Sweep(band=band, duration=duration, extinction=n)

    def exponential(n: float) -> ExponentialSweep:
        return ExponentialSweep(band=band, duration=duration, extinction=n)

    if extinction == "auto":
        make = exponential if kind == "exponential" else linear
        kept = smallest_extinction(make, limits, start=start)
    elif isinstance(extinction, str):
        raise ArgumentError(f"extinction = {extinction!r} must be 'auto' or a number")
    else:
        kept = extinction
    if kind == "exponential":
        return largest_gain(exponential(kept), limits, start=start)
    sweep = largest_gain(linear(kept), limits, start=start)
    return Reversed(waveform=sweep) if kind == "reversed" else sweep


def _led(core: Waveform, limits: Limits, fs: float, lead: float | None) -> Waveform:
    """The core with its leads; a little smaller where no lead of any length fits at full size."""
    if lead == 0.0 or (lead is None and starts_and_ends_at_rest(core)):
        return core
    try:
        return rest_to_rest(core, limits=limits, fs=fs, longest=math.inf if lead is None else lead)
    except LimitsError:
        if lead is not None or not isinstance(core, Scalable):
            raise
        for factor in _SMALLER:
            try:
                return rest_to_rest(core.scaled(factor), limits=limits, fs=fs)
            except LimitsError:
                continue
        raise


def _check_frequencies(low: float, high: float, length: float, rate: float) -> None:
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
            f"and one is needed; a duration of {three_digits(length / cycles, up=True)} s is enough"
        )


def _seconds(name: str, given: float | Literal["auto"]) -> float | None:
    """Seconds, or None for 'auto'."""
    if given == "auto":
        return None
    if isinstance(given, str) or not (math.isfinite(given) and given >= 0.0):
        raise ArgumentError(f"{name} = {given!r} must be 'auto', 0 or a positive time in seconds")
    check_size(name, given, "s")
    return float(given)
