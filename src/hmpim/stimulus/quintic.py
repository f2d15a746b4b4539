"""A polynomial of fifth degree from one state of motion to another."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hmpim.stimulus.motion import FloatArray, Motion, Peaks

__all__ = ["Quintic", "between", "coefficients_between", "evaluated"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Quintic:
    """Polynomial of fifth degree in (t - start)/duration, between two states of motion.

    Parameters
    ----------
    start, duration : float
        Seconds.
    coefficients : tuple of float, 6 of them
        Position at share s of the duration is sum of coefficients[k] s^k.
    """

    start: float
    duration: float
    coefficients: tuple[float, ...]

    @property
    def end(self) -> float:
        """Time in seconds at which it ends."""
        return self.start + self.duration

    def scaled(self, factor: float) -> "Quintic":
        """Return the same curve, `factor` times as large."""
        return replace(self, coefficients=tuple(factor * c for c in self.coefficients))

    def motion(self, time: FloatArray) -> Motion:
        """Position, velocity, acceleration, jerk at `time` (s, shape (n,)), the formula only.

        Examples
        --------
        >>> import numpy as np
        >>> q = between(np.zeros(3), np.array([1.0, 0.0, 0.0]), start=0.0, duration=2.0)
        >>> q.motion(np.array([0.0, 1.0, 2.0])).position.tolist()
        [0.0, 0.5, 1.0]
        """
        s = (time - self.start) / self.duration
        return evaluated(self.coefficients, s, time=time, duration=self.duration)

    @property
    def peaks(self) -> Peaks:
        """True peaks, from the roots of the derivatives."""
        c = np.array(self.coefficients)
        largest = []
        for order in range(4):
            p = np.polynomial.polynomial.polyder(c, order) if order else c
            slope = np.trim_zeros(np.polynomial.polynomial.polyder(p), "b")
            roots = np.polynomial.polynomial.polyroots(slope) if slope.size > 1 else np.empty(0)
            # a double root may come out as a pair just off the axis: its real part will do
            at = np.concatenate(([0.0, 1.0], np.clip(roots.real, 0.0, 1.0)))
            size = np.abs(np.polynomial.polynomial.polyval(at, p)).max()
            largest.append(float(size) / self.duration**order)
        x, v, a, j = largest
        return Peaks(position=x, velocity=v, acceleration=a, jerk=j)


def between(first: FloatArray, last: FloatArray, *, start: float, duration: float) -> Quintic:
    """Quintic from state `first` to state `last` (position, velocity, acceleration).

    Parameters
    ----------
    first, last : ndarray, shape (3,)
        States at the two ends.
    start, duration : float
        Seconds.

    Examples
    --------
    >>> import numpy as np
    >>> q = between(np.zeros(3), np.array([1.0, 0.0, 0.0]), start=0.0, duration=1.0)
    >>> [round(c) for c in q.coefficients]
    [0, 0, 0, 10, -15, 6]
    """
    c = coefficients_between(first, last, duration=duration)
    return Quintic(start=start, duration=duration, coefficients=tuple(float(v) for v in c))


def coefficients_between(
    first: FloatArray, last: FloatArray, *, duration: float
) -> tuple[FloatArray, ...]:
    """Coefficients of the quintic from state to state, or of many at once.

    Parameters
    ----------
    first, last : ndarray, shape (3, ...)
        Position, velocity, acceleration at the two ends.
    duration : float
        Seconds.

    Returns
    -------
    tuple of ndarray, 6 of them, each shape (...)
        As `Quintic.coefficients`.

    Examples
    --------
    >>> first, last = np.zeros((3, 2)), np.array([[1.0, 2.0], [0.0, 0.0], [0.0, 0.0]])
    >>> coefficients_between(first, last, duration=1.0)[5].tolist()
    [6.0, 12.0]
    """
    x0, v0, a0 = first
    x1, v1, a1 = last
    T = duration
    c0, c1, c2 = x0, v0 * T, 0.5 * a0 * T * T
    d = x1 - c0 - c1 - c2
    e = v1 * T - c1 - 2 * c2
    f = a1 * T * T - 2 * c2
    rest = (10 * d - 4 * e + 0.5 * f, -15 * d + 7 * e - f, 6 * d - 3 * e + 0.5 * f)
    return (c0, c1, c2, *rest)


def evaluated(
    coefficients: Sequence[float] | Sequence[FloatArray],
    share: FloatArray,
    *,
    time: FloatArray,
    duration: float,
) -> Motion:
    """Motion along quintics at a share of their duration.

    Parameters
    ----------
    coefficients : sequence, 6 of them
        Of one quintic, or of one for each time.
    share : ndarray, shape (n,)
        Of the duration.
    time : ndarray, shape (n,)
        What `Motion.time` shall say, s.
    duration : float
        Seconds.

    Examples
    --------
    >>> half = np.array([0.5])
    >>> evaluated((0, 0, 0, 10, -15, 6), half, time=half, duration=1.0).velocity.tolist()
    [1.875]
    """
    s = share
    c0, c1, c2, c3, c4, c5 = coefficients
    position = c0 + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * c5))))
    velocity = c1 + s * (2 * c2 + s * (3 * c3 + s * (4 * c4 + s * 5 * c5)))
    acceleration = 2 * c2 + s * (6 * c3 + s * (12 * c4 + s * 20 * c5))
    return Motion(
        time=time,
        position=position,
        velocity=velocity / duration,
        acceleration=acceleration / duration**2,
        jerk=(6 * c3 + s * (24 * c4 + s * 60 * c5)) / duration**3,
    )
