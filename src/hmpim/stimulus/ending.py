"""A motion that is left before its end: on to rest from any instant, inside the limits."""

import math

import numpy as np

from hmpim.errors import LimitsError
from hmpim.stimulus.inside import check_inside
from hmpim.stimulus.lead import RestToRest, gentlest_between
from hmpim.stimulus.limits import QUANTITIES, Limits
from hmpim.stimulus.motion import FloatArray, Waveform
from hmpim.stimulus.quintic import Quintic, between
from hmpim.stimulus.stimulus import Stimulus

__all__ = ["left_early", "passes_band_at"]

_LATER = 0.5  # s within which an instant is sought from which the limits leave a way to rest
_LONGEST = 5.0  # s that the way to rest may take
_STEPS = 32  # instants tried
_EVER = 1e12  # limit that bounds nothing


def passes_band_at(stimulus: Stimulus) -> float:
    """Time in s at which a stimulus has been at every frequency of its band once.

    That is the end of its first sweep where sweeps are repeated, and of its waveform otherwise.

    Examples
    --------
    >>> from hmpim.stimulus.kinds import design
    >>> wish = {"band": (0.1, 20), "duration": 6, "fs": 200, "limits": Limits(position=1)}
    >>> round(passes_band_at(design(**wish, kind="repeated", sweep=0.6)), 2)
    0.68
    """
    first: float = getattr(stimulus.core, "sweep", stimulus.sweep_duration)
    return stimulus.sweep_start + first


def left_early(
    stimulus: Stimulus, *, after: int, limits: Limits | None = None, whose: str = "the axis"
) -> Stimulus:
    """Return the stimulus left for rest after some of its samples.

    Up to there it is the same. Then the gentlest polynomial of fifth degree inside the limits
    brings the axis to rest at position 0; the tail at rest follows. If no such path exists, the
    stimulus is left a little later.

    Parameters
    ----------
    stimulus : Stimulus
        Played so far.
    after : int
        Samples that are the stimulus's own, at least.
    limits : Limits or None
        What must be kept; the stimulus's own if None.
    whose : str
        Whose limits they are, for messages.

    Returns
    -------
    Stimulus
        Shorter, or the same if it ends sooner by itself.

    Raises
    ------
    LimitsError
        If the limits leave no way to rest within half a second.

    Examples
    --------
    >>> from hmpim.stimulus.kinds import design
    >>> sweep = design(band=(0.1, 20), duration=6, fs=200, limits=Limits(position=1))
    >>> short = left_early(sweep, after=400)
    >>> bool((short.position[:400] == sweep.position[:400]).all()), short.position[-1]
    (True, np.float64(0.0))
    """
    bounds = limits or stimulus.limits or Limits(position=_EVER)
    bounds = bounds.to(stimulus.unit)
    fs = stimulus.fs
    step = max(1, round(_LATER * fs / _STEPS))
    for leave in range(after, after + _STEPS * step, step):
        at = leave / fs
        if at >= _rests_at(stimulus.waveform):
            return stimulus
        way = _way(stimulus, at, bounds)
        if way is None:
            continue
        end = way.end
        if end >= stimulus.waveform.duration:
            return stimulus
        short = Stimulus(
            waveform=_left(stimulus.waveform, at, way, fs),
            fs=fs,
            unit=stimulus.unit,
            axis=stimulus.axis,
            tail=stimulus.tail,
            resolution=stimulus.resolution,
        )
        try:
            check_inside(short, bounds, whose=whose)
        except LimitsError:
            continue
        return short
    raise LimitsError(
        f"from {after / fs:.3g} s on the limits of {whose} leave no smooth way to rest within "
        f"{_LATER:g} s; the stimulus is played to its end"
    )


def _rests_at(waveform: Waveform) -> float:
    """When the way back to rest begins by itself, s."""
    return waveform.joints[2] if isinstance(waveform, RestToRest) else waveform.duration


def _way(stimulus: Stimulus, at: float, limits: Limits) -> Quintic | None:
    """The gentlest way to rest from where the stimulus is at a time."""
    motion = stimulus.motion(np.array([at]))
    state = np.array([motion.position[0], motion.velocity[0], motion.acceleration[0]])
    peaks = stimulus.peaks
    finite = [getattr(peaks, name) for name in QUANTITIES[:3]]
    if not all(math.isfinite(peak) and peak > 0.0 for peak in finite):
        return None
    rest: FloatArray = np.zeros(3)
    found = gentlest_between(state, rest, peaks, limits, _LONGEST)
    return None if found is None else between(state, rest, start=at, duration=found.duration)


def _left(waveform: Waveform, at: float, way: Quintic, fs: float) -> RestToRest:
    """The waveform, left at a time; a lead that is there already stays."""
    duration = (math.ceil(way.end * fs - 1e-9) + 1) / fs
    if isinstance(waveform, RestToRest) and waveform.joints[1] <= at:
        return RestToRest(
            core=waveform.core,
            sweep_start=waveform.sweep_start,
            join=waveform.join,
            leave=at - waveform.sweep_start,
            lead_in=waveform.lead_in,
            lead_out=way,
            duration=duration,
        )
    return RestToRest(
        core=waveform,
        sweep_start=0.0,
        join=0.0,
        leave=at,
        lead_in=Quintic(start=0.0, duration=0.0, coefficients=(0.0,) * 6),
        lead_out=way,
        duration=duration,
    )
