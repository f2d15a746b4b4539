"""Limits are law: what is refused before anything moves."""

import math

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import LimitsError, UnitError
from hmpim.rigs.table.axes import AXES, AxisSpec
from hmpim.stimulus import Limits, Stimulus
from hmpim.stimulus.limits import QUANTITIES
from hmpim.units import conversion_factor, rate_unit

__all__ = ["check_axis", "check_torques"]

FloatArray = NDArray[np.float64]

_ROUNDING = 1e-9  # a stimulus solved onto a limit may stand a rounding error beyond it


def check_axis(
    stimulus: Stimulus, limits: Limits, *, axis: str, samples: int | None = None
) -> None:
    """Refuse a stimulus that goes beyond an axis's position, rate, acceleration or jerk.

    Parameters
    ----------
    stimulus : Stimulus
        Its true peaks are looked at, between the samples too, and the jumps that its samples
        command.
    limits : Limits
        Of the axis, from where it stands.
    axis : str
        Its name, for the message.
    samples : int or None
        How many commands are sent, where the axis waits for others after its own; None for the
        stimulus's.

    Raises
    ------
    LimitsError
        If a peak is beyond a limit.
    UnitError
        If the stimulus is in no unit of angle.

    Examples
    --------
    >>> from hmpim.stimulus import Ramp
    >>> ramp = Stimulus(waveform=Ramp(rate=2.0, duration=1.0), fs=10.0, unit="deg")
    >>> check_axis(ramp, Limits(velocity=1.0, unit="deg"), axis="yaw")
    Traceback (most recent call last):
    hmpim.errors.LimitsError: peak velocity 2 deg/s is beyond the limit 1 deg/s of yaw; ...
    """
    if stimulus.unit == "":
        raise UnitError(f"the stimulus for {axis} has no unit; a table takes 'deg' or 'rad'")
    factor = conversion_factor(stimulus.unit, to=limits.unit)
    sent = _peaks_sent(stimulus, stimulus.samples if samples is None else samples)
    shares = []
    for order, quantity in enumerate(QUANTITIES):
        limit: float = getattr(limits, quantity)
        if math.isinf(limit):
            continue
        peak = factor * max(getattr(stimulus.peaks, quantity), sent[order])
        shares.append((peak / limit, quantity, peak, limit, rate_unit(limits.unit, order)))
    share, quantity, peak, limit, unit = max(shares, default=(0.0, "", 0.0, 0.0, ""))
    if share > 1.0 + _ROUNDING:
        advice = (
            f"scale the stimulus by {1.0 / share:.4g}, or design it within this limit"
            if np.isfinite(share)
            else "no axis can jump, so take another waveform, with design(...) for instance"
        )
        raise LimitsError(
            f"peak {quantity} {peak:.6g} {unit} is beyond the limit {limit:.6g} {unit} of "
            f"{axis}; {advice}"
        )


def _peaks_sent(stimulus: Stimulus, samples: int) -> tuple[float, float, float, float]:
    """Largest position, and first and second differences of the commands as they are sent.

    A jump has no derivative that would show it, and a sweep that stops short has none at its
    end. The first interval is left out of the second differences: the printed sweep (lead 0)
    starts there with a velocity step. Third differences would be all rounding: the jerk is that
    of the motion in closed form alone.
    """
    fs = stimulus.fs
    x = stimulus.motion(np.arange(-1, samples) / fs).position
    rounding = 4.0 * float(np.spacing(np.abs(x).max()))
    rate = float(np.abs(np.diff(x)).max()) - rounding
    bend = float(np.abs(np.diff(x[2:], 2)).max()) - 2.0 * rounding if x.size > 4 else 0.0
    return float(np.abs(x).max()), rate * fs, bend * fs * fs, 0.0


def check_torques(time: FloatArray, torque: FloatArray, axes: tuple[AxisSpec, ...]) -> None:
    """Refuse a motion of all axes together that takes more torque than an axis has.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds.
    torque : ndarray, shape (n, 5)
        What the motion takes, N·m, in the order of `AXES`.
    axes : tuple of AxisSpec
        With their torque limits.

    Raises
    ------
    LimitsError
        If the torque of an axis is beyond its limit; the message says when and by how much.

    Examples
    --------
    >>> from hmpim.rigs.table.axes import FIG_4
    >>> check_torques(np.zeros(1), np.full((1, 5), 400.0), FIG_4)
    Traceback (most recent call last):
    hmpim.errors.LimitsError: at 0.000 s the motion of all axes together takes 400 N·m of roll, ...
    """
    allowed = np.array([axis.torque_limit for axis in axes])
    share = np.abs(torque) / allowed
    k, i = np.unravel_index(int(np.argmax(share)), share.shape)
    if share[k, i] > 1.0 + _ROUNDING:
        raise LimitsError(
            f"at {time[k]:.3f} s the motion of all axes together takes {abs(torque[k, i]):.4g} N·m "
            f"of {AXES[i]}, beyond its limit {allowed[i]:g} N·m; scale the stimuli by "
            f"{1.0 / share[k, i]:.3g} or so, or run fewer axes at once"
        )
