"""Closed form of a seeker's response, frames and all, with which a record is compared."""

from typing import Literal

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from hmpim.errors import ArgumentError

__all__ = ["seeker_bandwidth", "seeker_response"]

ComplexArray = NDArray[np.complex128]

_ALIASES = 300  # of the platform; they fade with the third power


def seeker_response(
    frequency: ArrayLike,
    *,
    gain: float,
    lag: float,
    latency: float,
    frame_rate: float,
    hold: Literal["included", "removed"] = "included",
) -> ComplexArray:
    """Platform rate command over line-of-sight rate.

    The pointing error is seen once a frame, the command stands from `latency` after a frame to
    `latency` after the next, and the platform follows it with a lag. With the period T of the
    frames, H(s) = (1 - e^(-sT)) / (sT) for the hold, and P the platform as it is seen once a
    frame, the sum over all aliases of T H e^(-sτ) / (s (1 + s lag)) / T::

        G(s) = K H(s) e^(-sτ) / (s (1 + K P(e^(sT))))

    Parameters
    ----------
    frequency : array_like, shape (n,)
        Hz, above 0 and below half the frame rate.
    gain : float
        K, 1/s.
    lag, latency : float
        s.
    frame_rate : float
        Hz.
    hold : {'included', 'removed'}
        With the hold of the command, or the loop behind it: that is what a fit finds that knows
        the hold.

    Returns
    -------
    complex ndarray, shape (n,)

    Raises
    ------
    ArgumentError
        If a frequency is out of range.

    Examples
    --------
    >>> slow = seeker_response([1e-3], gain=5.0, lag=0.01, latency=0.03, frame_rate=60.0)
    >>> bool(abs(slow[0] - 1.0) < 2e-3)
    True
    """
    f = np.atleast_1d(np.asarray(frequency, dtype=np.float64))
    if not np.all((f > 0.0) & (f < 0.5 * frame_rate)):
        raise ArgumentError(
            f"frequency = {frequency!r} Hz must lie above 0 and below half the frame rate, "
            f"{0.5 * frame_rate:g} Hz"
        )
    alias = np.arange(-_ALIASES, _ALIASES + 1)
    each = 2j * np.pi * (f[:, None] + frame_rate * alias)
    held = (1.0 - np.exp(-each / frame_rate)) / (each / frame_rate) * np.exp(-each * latency)
    platform = np.sum(held / (each * (1.0 + each * lag)), axis=1)
    s = 2j * np.pi * f
    out = held[:, _ALIASES] if hold == "included" else np.exp(-s * latency)
    return np.asarray(gain * out / (s * (1.0 + gain * platform)))


def seeker_bandwidth(
    *,
    gain: float,
    lag: float,
    latency: float,
    frame_rate: float,
    hold: Literal["included", "removed"] = "included",
) -> float:
    """Frequency in Hz at which the command lags the line-of-sight rate by 90°.

    Parameters
    ----------
    gain, lag, latency, frame_rate, hold
        As for `seeker_response`.

    Raises
    ------
    ArgumentError
        If the phase does not fall so far below half the frame rate.

    Examples
    --------
    >>> round(seeker_bandwidth(gain=5.0, lag=0.01, latency=0.03, frame_rate=60.0), 2)
    1.83
    """
    grid = np.linspace(0.02, 0.49, 400) * frame_rate

    def response(f: ArrayLike) -> ComplexArray:
        return seeker_response(
            f, gain=gain, lag=lag, latency=latency, frame_rate=frame_rate, hold=hold
        )

    phase = np.unwrap(np.angle(response(grid)))
    past = np.flatnonzero(phase < -0.5 * np.pi)
    if not past.size:
        raise ArgumentError("the phase does not fall to -90° below half the frame rate")

    def behind(f: float) -> float:
        return float(response([f])[0].real)

    first = int(past[0])
    low = grid[first - 1] if first else 1e-3 * frame_rate
    return float(scipy.optimize.brentq(behind, low, grid[first], xtol=1e-9))
