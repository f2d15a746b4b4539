"""Error bars: first-order propagation of the covariance of a fit to figures."""

from collections.abc import Callable

import numpy as np

from hmpim.identify.arrays import Complex, Real
from hmpim.model import RationalDelay, response

__all__ = ["gradient", "log_slopes", "response_std"]


def gradient(function: Callable[[Real], float] | Callable[[Real], Real], at: Real) -> Real:
    """Derivatives by central differences, shape (p,), or (p, q) of a function of q values."""
    out = []
    for i, step in enumerate(1e-6 * np.maximum(np.abs(at), 1e-3)):
        up, down = at.copy(), at.copy()
        up[i] += step
        down[i] -= step
        out.append((function(up) - function(down)) / (2 * step))
    return np.array(out)


def response_std(system: RationalDelay, covariance: Real, frequency: Real) -> Real:
    """Standard deviation of a model's response, sqrt(E|error|²), at each frequency in Hz, (m,).

    To first order, in the response's unit. The covariance, (q, q), is that of its delay, its
    numerator, and its denominator after the first coefficient that is not zero, by rising powers.

    Examples
    --------
    A delay that is known to 1 ms turns the response by 2π/1000 at 1 Hz:

    >>> late = RationalDelay(delay=0.1, numerator=np.ones(1), denominator=np.ones(1))
    >>> response_std(late, np.diag([1e-6, 0.0]), np.array([1.0])).round(6).tolist()
    [0.006283]
    """
    slopes = np.concatenate(log_slopes(system, frequency))
    variance = np.sum(slopes.conj() * (covariance @ slopes), axis=0).real
    return np.asarray(np.abs(response(system, frequency)) * np.sqrt(np.maximum(variance, 0.0)))


def log_slopes(system: RationalDelay, frequency: Real) -> tuple[Complex, Complex, Complex]:
    """Derivatives of the logarithm of a response, at each frequency in Hz, (m,).

    By the delay, (1, m); the numerator, (k, m); and the denominator after its first coefficient
    that is not zero, (l, m).
    """
    above, below = system.numerator, system.denominator
    powers = system.variable(frequency)[None, :] ** np.arange(max(above.size, below.size))[:, None]
    first = int(np.flatnonzero(below)[0]) + 1
    return (
        np.asarray(-2j * np.pi * frequency[None, :], dtype=np.complex128),
        powers[: above.size] / (above @ powers[: above.size]),
        -powers[first : below.size] / (below @ powers[: below.size]),
    )
