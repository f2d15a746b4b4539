"""As large as the limits allow: one scale for position and all its derivatives."""

from typing import TypeVar

import numpy as np

from hmpim.errors import ArgumentError, LimitsError
from hmpim.stimulus.limits import QUANTITIES, Limits
from hmpim.stimulus.motion import FloatArray, Scalable, Waveform
from hmpim.stimulus.peaks import true_peaks

__all__ = ["KEEP", "check_limits_given", "largest_sine", "scale_to_limits"]

KEEP = 1.0 - 1e-9  # rounding must not carry a sample over a limit

W = TypeVar("W", bound=Waveform)


def check_limits_given(limits: Limits) -> None:
    """Refuse anything but `Limits` with at least one finite limit.

    Raises
    ------
    ArgumentError
        If it is not a `Limits`.
    LimitsError
        If no limit is finite.

    Examples
    --------
    >>> check_limits_given(Limits(velocity=3.0))
    """
    if not isinstance(limits, Limits):
        raise ArgumentError(f"limits = {limits!r} is not a Limits; write Limits(position=10, ...)")
    if not any(np.isfinite(getattr(limits, name)) for name in QUANTITIES):
        raise LimitsError(
            "no limit is finite, so nothing says how large the motion may be; give one"
        )


def scale_to_limits(waveform: W, limits: Limits) -> W:
    """Return the same waveform as large as all limits together allow.

    Position and its derivatives grow together, so the scale is the reciprocal of the largest
    share of a limit; peaks between samples count.

    Parameters
    ----------
    waveform : Waveform
        Of any size.
    limits : Limits
        In the waveform's unit; at least one of them finite.

    Returns
    -------
    Waveform
        Of the same type, the limit that binds being reached.

    Raises
    ------
    LimitsError
        If no limit is finite, or the waveform jumps where a limit forbids it.
    ArgumentError
        If the waveform has no scale to change, or does not move.

    Examples
    --------
    >>> from hmpim.stimulus.classical import Sine
    >>> sine = scale_to_limits(Sine(frequency=1.0, duration=3.0), Limits(position=2, velocity=50))
    >>> round(sine.amplitude, 6)
    2.0
    """
    check_limits_given(limits)
    if not isinstance(waveform, Scalable):
        raise ArgumentError(f"a {type(waveform).__name__} has no scale to change")
    use = limits.use(true_peaks(waveform, jerk=bool(np.isfinite(limits.jerk))))
    if np.isinf(use):
        raise LimitsError(
            f"a {type(waveform).__name__} jumps, so that no scale of it keeps these limits; "
            "take one with smooth transitions, such as Steps or Prbs"
        )
    if use == 0.0:
        raise ArgumentError(f"a {type(waveform).__name__} that does not move cannot be scaled")
    scaled: W = waveform.scaled(KEEP / use)
    return scaled


def largest_sine(frequency: FloatArray, limits: Limits) -> FloatArray:
    """Amplitude of the largest single sine inside the limits, at each frequency.

    Parameters
    ----------
    frequency : ndarray, shape (n,)
        Hz, positive.
    limits : Limits
        At least one of them finite.

    Examples
    --------
    >>> largest_sine(np.array([0.1, 1.0]), Limits(position=1.0, velocity=3.0)).round(3).tolist()
    [1.0, 0.477]
    """
    omega = 2.0 * np.pi * np.asarray(frequency, dtype=np.float64)
    bounds = [getattr(limits, name) / omega**order for order, name in enumerate(QUANTITIES)]
    smallest: FloatArray = np.min(bounds, axis=0)
    return smallest
