"""A value with its error bar: Student's t for an estimate, chi-squared for a noise."""

import numpy as np
import scipy

from hmpim.identify.result.estimate import Estimate

__all__ = ["estimate", "noise_estimate"]


def estimate(value: float, variance: float, *, freedom: float = np.inf, unit: str = "") -> Estimate:
    """Value with its standard deviation and 95 % interval (Student's t).

    The default `freedom` is for a known variance: the interval is that of a normal error.

    Examples
    --------
    >>> estimate(1.0, 0.01).ci95[1].__round__(3)
    1.196
    """
    std = float(np.sqrt(max(variance, 0.0)))
    half = float(scipy.special.stdtrit(max(freedom, 1.0), 0.975)) * std
    ends = float(value - half), float(value + half)
    return Estimate(value=float(value), std=std, ci95=ends, unit=unit)


def noise_estimate(
    sum_of_squares: float, *, freedom: int, share: float, unit: str = ""
) -> Estimate:
    """Standard deviation of the noise, its own error, and its interval (chi-squared).

    The sum of squares is that of the residual, `freedom` the number of samples that count less that
    of the parameters, and `share` that of independent samples, 1 for white noise.
    """
    sigma = float(np.sqrt(sum_of_squares / freedom))
    effective = max(freedom * share, 1.0)
    low, high = (float(scipy.special.chdtri(effective, tail)) for tail in (0.025, 0.975))
    return Estimate(
        value=sigma,
        std=sigma / float(np.sqrt(2 * effective)),
        ci95=(sigma * (effective / low) ** 0.5, sigma * (effective / high) ** 0.5),
        unit=unit,
    )
