"""Whether a stimulus keeps limits: what a rig looks at before anything moves."""

import math

import numpy as np

from hmpim.errors import LimitsError, UnitError
from hmpim.stimulus.limits import QUANTITIES, Limits
from hmpim.stimulus.stimulus import Stimulus
from hmpim.units import conversion_factor, rate_label

__all__ = ["check_inside"]

_ROUNDING = 1e-9  # a stimulus solved onto a limit may stand a rounding error beyond it


def check_inside(
    stimulus: Stimulus,
    limits: Limits,
    *,
    whose: str,
    samples: int | None = None,
    from_rest: bool = False,
) -> None:
    """Refuse a stimulus that goes beyond limits, converted to their unit.

    Parameters
    ----------
    stimulus : Stimulus
        Its true peaks are looked at, between the samples too, and the jumps that its samples
        command.
    limits : Limits
        What may be asked.
    whose : str
        Whose limits they are, for the message.
    samples : int or None
        How many commands are sent, where more follow at rest; None for the stimulus's.
    from_rest : bool
        Whether the velocity step with which a waveform without a lead starts counts, too.

    Raises
    ------
    LimitsError
        If a peak is beyond a limit.
    UnitError
        If one has a unit and the other has none, or the dimensions differ.

    Examples
    --------
    >>> from hmpim.stimulus import Ramp
    >>> ramp = Stimulus(waveform=Ramp(rate=2.0, duration=1.0), fs=10.0, unit="deg")
    >>> check_inside(ramp, Limits(velocity=1.0, unit="deg"), whose="yaw")
    Traceback (most recent call last):
    hmpim.errors.LimitsError: peak velocity 2 deg/s is beyond the limit 1 deg/s of yaw; ...
    """
    # Pint takes no unit for rad; here it means that nobody said.
    if (stimulus.unit == "") != (limits.unit == ""):
        has, wants = (f"{unit!r}" if unit else "no unit" for unit in (stimulus.unit, limits.unit))
        raise UnitError(
            f"the stimulus is in {has} and the limits of {whose} are in {wants}; "
            "state the unit of both"
        )
    factor = conversion_factor(stimulus.unit, to=limits.unit)
    sent = _peaks_sent(stimulus, stimulus.samples if samples is None else samples)
    shares = []
    for order, quantity in enumerate(QUANTITIES):
        limit: float = getattr(limits, quantity)
        if math.isinf(limit):
            continue
        peak = factor * max(getattr(stimulus.peaks, quantity), sent[order])
        shares.append((peak / limit, quantity, peak, limit, rate_label(limits.unit, order)))
    if from_rest:
        _check_start(stimulus, limits.acceleration / factor, whose=whose)
    share, quantity, peak, limit, unit = max(shares, default=(0.0, "", 0.0, 0.0, ""))
    if share > 1.0 + _ROUNDING:
        advice = (
            f"scale the stimulus by {_down(1 / share):.4g}, or design it within this limit"
            if math.isfinite(share)
            else "it jumps, so take one that starts and ends at rest, designed within this limit"
        )
        raise LimitsError(
            f"peak {quantity} {peak:.6g} {unit} is beyond the limit {limit:.6g} {unit} of "
            f"{whose}; {advice}"
        )


def _check_start(stimulus: Stimulus, limit: float, *, whose: str) -> None:
    """Refuse a start in motion that takes more than the acceleration limit, in its own unit."""
    fs = stimulus.fs
    x = stimulus.motion(np.arange(-1, 3) / fs).position
    bend = (float(np.abs(np.diff(x, 2)).max()) - 8.0 * float(np.spacing(np.abs(x).max()))) * fs**2
    if bend > limit * (1.0 + _ROUNDING):
        unit = rate_label(stimulus.unit, 2)
        raise LimitsError(
            f"the stimulus starts in motion: its first commands take {bend:.6g} {unit} from rest, "
            f"beyond the limit {limit:.6g} {unit} of {whose}; design it with lead='auto'"
        )


def _peaks_sent(stimulus: Stimulus, samples: int) -> tuple[float, float, float, float]:
    """Largest position, and first and second differences of the commands as they are sent.

    The mean velocity between samples is never above the true peak, unless the motion jumps,
    as a step does, whose derivative is 0 wherever it has one; and a sweep that stops short has
    none at its end. The first interval is left out of the second differences: the printed sweep
    (lead 0) starts there with a velocity step. Third differences would be all rounding: the jerk
    is that of the motion in closed form alone.
    """
    fs = stimulus.fs
    x = stimulus.motion(np.arange(-1, samples) / fs).position
    peak = stimulus.peaks.velocity
    late = peak * float(np.spacing(samples / fs)) if math.isfinite(peak) else 0.0
    rounding = 4.0 * float(np.spacing(np.abs(x).max())) + late  # of positions, and of their times
    rate = float(np.abs(np.diff(x)).max()) - rounding
    bend = float(np.abs(np.diff(x[2:], 2)).max()) - 2.0 * rounding if x.size > 4 else 0.0
    return float(np.abs(x).max()), rate * fs, bend * fs * fs, 0.0


def _down(value: float) -> float:
    """Four digits of `value`, cut and not rounded, so that the advice does."""
    place = 10.0 ** (3 - math.floor(math.log10(value)))
    return math.floor(value * place) / place
