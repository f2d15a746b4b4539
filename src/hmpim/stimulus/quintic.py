"""A polynomial of fifth degree from one state of motion to another."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hmpim.stimulus.motion import FloatArray, Motion, Peaks

__all__ = ["Quintic", "between", "coefficients_between", "evaluated", "largest"]

_NO_LEAD = 1e-14  # share of the largest coefficient below which the leading one is rounding


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
        found = largest(np.array([self.coefficients]), np.array([self.duration]))
        x, v, a, j = (float(peak) for peak in found[:, 0])
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
    first: FloatArray, last: FloatArray, *, duration: float | FloatArray
) -> tuple[FloatArray, ...]:
    """Coefficients of the quintic from state to state, or of many at once.

    Parameters
    ----------
    first, last : ndarray, shape (3, ...)
        Position, velocity, acceleration at the two ends.
    duration : float, or ndarray of shape (...)
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


def largest(coefficients: FloatArray, durations: FloatArray) -> FloatArray:
    """Largest |position|, |velocity|, |acceleration| and |jerk| of many quintics at once.

    Parameters
    ----------
    coefficients : ndarray, shape (k, 6)
        As `Quintic` has them.
    durations : ndarray, shape (k,)
        Seconds.

    Returns
    -------
    ndarray, shape (4, k)

    Notes
    -----
    A derivative is largest at an end or at a root of the next; beyond the second degree the roots
    are the eigenvalues of the companion matrices (L. N. Trefethen and D. Bau, Numerical Linear
    Algebra, 1997, lecture 25), all in one call.

    Examples
    --------
    >>> largest(np.array([[0.0, 1.0, -1.0, 0.0, 0.0, 0.0]]), np.array([2.0])).ravel().tolist()
    [0.25, 0.5, 0.5, 0.0]
    """
    p, found = coefficients, []
    for order in range(4):
        slope = p[:, 1:] * np.arange(1.0, p.shape[1])
        # a double root may come out as a pair just off the axis: its real part will do
        at = np.zeros((len(p), slope.shape[1] + 1))
        at[:, 1] = 1.0
        at[:, 2:] = np.clip(_real_roots(slope), 0.0, 1.0)
        value = np.zeros(at.shape)
        for column in p.T[::-1]:
            value = value * at + column[:, None]
        found.append(np.abs(value).max(axis=1) / durations**order)
        p = slope
    return np.stack(found)


def _real_roots(polynomials: FloatArray) -> FloatArray:
    """Real parts of the roots of polynomials with rising powers, shape (k, m + 1) to (k, m)."""
    degree = polynomials.shape[1] - 1
    lead = polynomials[:, -1]
    # of a lower degree than its row is long: the roots that it lacks are sent far away
    least = _NO_LEAD * np.abs(polynomials).max(axis=1)
    lead = np.where(np.abs(lead) > least, lead, np.where(least > 0.0, least, 1.0))
    rest = polynomials[:, :-1] / lead[:, None]
    if degree == 1:
        return np.asarray(-rest)
    if degree == 2:
        return _of_squares(rest)
    companion = np.zeros((len(polynomials), degree, degree))
    companion[:, np.arange(1, degree), np.arange(degree - 1)] = 1.0
    companion[:, :, -1] = -rest
    return np.asarray(np.linalg.eigvals(companion[:, ::-1, ::-1]).real)


def _of_squares(rest: FloatArray) -> FloatArray:
    """Real parts of the roots of s² + b s + c, shape (k, 2) of (c, b); nothing cancels."""
    middle = -0.5 * rest[:, 1]
    inside = middle**2 - rest[:, 0]
    far = middle + np.copysign(np.sqrt(np.maximum(inside, 0.0)), middle)
    near = np.where(far == 0.0, 0.0, rest[:, 0] / np.where(far == 0.0, 1.0, far))
    return np.stack((far, np.where(inside < 0.0, far, near)), axis=1)
