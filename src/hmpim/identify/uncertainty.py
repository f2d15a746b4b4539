"""Error bars: how the covariance of a fit carries over to what is read off it.

What follows from the parameters gets its error by first-order propagation, implicit where it is
the root of an equation.
"""

from collections.abc import Callable

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.identify.result import Estimate
from hmpim.model import RationalDelay, response

__all__ = ["estimate", "gradient", "noise_estimate", "response_std"]


def gradient(
    function: Callable[[NDArray[np.float64]], float], at: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Derivative of a scalar function by central differences, shape (p,)."""
    out = np.empty(at.size)
    for i in range(at.size):
        step = 1e-6 * max(abs(at[i]), 1e-3)
        up, down = at.copy(), at.copy()
        up[i] += step
        down[i] -= step
        out[i] = (function(up) - function(down)) / (2 * step)
    return out


def estimate(value: float, variance: float, *, freedom: float, unit: str = "") -> Estimate:
    """Value with its standard deviation and 95 % interval (Student's t).

    Examples
    --------
    >>> estimate(1.0, 0.01, freedom=1e9).ci95[1].__round__(3)
    1.196
    """
    std = float(np.sqrt(max(variance, 0.0)))
    half = float(scipy.special.stdtrit(max(freedom, 1.0), 0.975)) * std
    return Estimate(
        value=float(value), std=std, ci95=(float(value - half), float(value + half)), unit=unit
    )


def noise_estimate(
    sum_of_squares: float, *, freedom: int, share: float, unit: str = ""
) -> Estimate:
    """Standard deviation of the noise, its own error, and its interval (chi-squared).

    Parameters
    ----------
    sum_of_squares : float
        Of the residual.
    freedom : int
        Samples that counted less parameters.
    share : float
        Independent samples per sample, 1 for white noise.
    unit : str
        Of the output.
    """
    sigma = float(np.sqrt(sum_of_squares / freedom))
    effective = max(freedom * share, 1.0)
    low, high = (
        float(scipy.special.chdtri(effective, 0.025)),
        float(scipy.special.chdtri(effective, 0.975)),
    )
    return Estimate(
        value=sigma,
        std=sigma / float(np.sqrt(2 * effective)),
        ci95=(sigma * (effective / low) ** 0.5, sigma * (effective / high) ** 0.5),
        unit=unit,
    )


def response_std(
    system: RationalDelay, covariance: NDArray[np.float64], frequency: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Standard deviation of a model's response, sqrt(E|error|²), to first order.

    Parameters
    ----------
    system : RationalDelay
        The model.
    covariance : ndarray, shape (q, q)
        Of its delay, its numerator, and its denominator behind the first coefficient that is not
        zero, by rising powers of s.
    frequency : ndarray, shape (m,)
        Hz, above 0.

    Returns
    -------
    ndarray, shape (m,)
        In the response's unit.

    Examples
    --------
    A delay that is known to 1 ms turns the response by 2π/1000 at 1 Hz:

    >>> late = RationalDelay(delay=0.1, numerator=np.ones(1), denominator=np.ones(1))
    >>> response_std(late, np.diag([1e-6, 0.0]), np.array([1.0])).round(6).tolist()
    [0.006283]
    """
    s = 2j * np.pi * frequency
    powers = (
        system.variable(frequency)[None, :]
        ** np.arange(max(system.numerator.size, system.denominator.size))[:, None]
    )
    above, below = system.numerator, system.denominator
    first = int(np.flatnonzero(below)[0]) + 1
    slopes = np.concatenate(
        [
            -s[None, :],
            powers[: above.size] / (above @ powers[: above.size]),
            -powers[first : below.size] / (below @ powers[: below.size]),
        ]
    )
    variance = np.sum(slopes.conj() * (covariance @ slopes), axis=0).real
    return np.asarray(np.abs(response(system, frequency)) * np.sqrt(np.maximum(variance, 0.0)))
