"""What is really sent: commands rounded to the rig's resolution, at its rate."""

import math
from dataclasses import dataclass, replace

import numpy as np

from hmpim.arguments import check_size
from hmpim.errors import ArgumentError, LimitsError
from hmpim.stimulus.limits import QUANTITIES, Limits, three_digits
from hmpim.stimulus.motion import FloatArray, Peaks
from hmpim.units import rate_label

__all__ = ["Command", "check_resolution", "difference_peaks", "leave_room", "rounded"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Command:
    """Position commands as a rig receives them.

    Parameters
    ----------
    fs : float
        Command rate, Hz.
    resolution : float
        Step that positions are rounded to, in the unit; 0 for none.
    time, position : ndarray, shape (n,)
        At k/fs; positions are multiples of the resolution.
    peaks : Peaks
        Largest position, and first, second and third differences over the sampling interval.
    """

    fs: float
    resolution: float
    time: FloatArray
    position: FloatArray
    peaks: Peaks


def check_resolution(resolution: float) -> float:
    """Return `resolution` as a float if it is 0 or positive and finite.

    Raises
    ------
    ArgumentError
        If not.

    Examples
    --------
    >>> check_resolution(0.003)
    0.003
    """
    try:
        number = float(resolution)
    except (TypeError, ValueError):
        number = math.nan
    if isinstance(resolution, (str, bool)) or not (math.isfinite(number) and number >= 0.0):
        raise ArgumentError(
            f"resolution = {resolution!r} must be 0 (none) or a positive, finite step"
        )
    check_size("resolution", number)
    return number


def rounded(position: FloatArray, resolution: float) -> FloatArray:
    """Round positions to whole multiples of the resolution; 0 leaves them as they are.

    Examples
    --------
    >>> rounded(np.array([0.12, 0.13, -0.2]), 0.25).tolist()
    [0.0, 0.25, -0.25]
    """
    if resolution == 0.0:
        return position
    return np.round(position / resolution) * resolution + 0.0  # and no negative zero


def difference_peaks(position: FloatArray, fs: float, *, first: int = 0) -> Peaks:
    """Largest position and differences of samples, as a rig that differentiates them sees.

    Parameters
    ----------
    position : ndarray, shape (n,)
        At k/fs.
    fs : float
        Hz.
    first : int
        Sample from which on second and third differences count; 1 for the printed waveform,
        which starts with a velocity step.

    Examples
    --------
    >>> round(difference_peaks(np.array([0.0, 1.0, 3.0]), 10.0).acceleration, 9)
    100.0
    """
    top = float(np.abs(position).max())
    found = [top]
    noise = 4.0 * float(np.spacing(top))  # of a difference of rounded numbers
    for order in range(1, 4):
        samples = position if order == 1 else position[first:]
        steps = np.abs(np.diff(samples, order))
        largest = float(steps.max()) if steps.size else 0.0
        found.append(max(largest - noise * 2.0 ** (order - 1), 0.0) * fs**order)
    x, v, a, j = found
    return Peaks(position=x, velocity=v, acceleration=a, jerk=j)


def _with(value: float | str, unit: str) -> str:
    shown = value if isinstance(value, str) else f"{value:.4g}"
    return f"{shown} {unit}".rstrip()


def leave_room(limits: Limits, *, resolution: float, fs: float) -> Limits:
    """Limits inside which a motion keeps `limits` after its commands have been rounded.

    A command is at most half a step off, so positions are off by r/2, and differences over
    one, two and three intervals by r fs, 2r fs² and 4r fs³.

    Parameters
    ----------
    limits : Limits
        What the commands must keep.
    resolution : float
        r, in the limits' unit.
    fs : float
        Command rate, Hz.

    Raises
    ------
    LimitsError
        If rounding alone reaches a limit; the message says which resolution is enough.

    Examples
    --------
    >>> leave_room(Limits(velocity=10.0), resolution=0.001, fs=1000.0).velocity
    9.0
    """
    r = check_resolution(resolution)
    if r == 0.0:
        return limits
    left = limits
    for order, name in enumerate(QUANTITIES):
        limit = getattr(limits, name)
        error = r * (0.5, 1.0, 2.0, 4.0)[order] * fs**order
        if error >= limit:
            unit = rate_label(limits.unit, order)
            enough = three_digits(0.1 * r * limit / error, up=False)
            raise LimitsError(
                f"rounding to {_with(r, limits.unit)} at {fs:g} Hz alone can command "
                f"{_with(error, unit)} of {name}, and the limit is {_with(limit, unit)}; a "
                f"resolution of {_with(enough, limits.unit)} takes a tenth of the limit"
            )
        left = replace(left, **{name: limit - error})
    return left
