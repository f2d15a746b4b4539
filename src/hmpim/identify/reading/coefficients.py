"""Coefficients of a system as in results: highest power first, with unit gain."""

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.model.filters import in_z
from hmpim.model.response import RationalDelay, by_falling_powers

__all__ = ["coefficients_of", "highest_first"]


def coefficients_of(system: RationalDelay) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Numerator and denominator of unit gain, highest power first: of s, or of z for software.

    The denominator has a coefficient of 1 at s⁰, or at the highest power of z.

    Examples
    --------
    >>> lag = RationalDelay(delay=0.1, numerator=2.0 * np.ones(1), denominator=np.array([1.0, 0.5]))
    >>> coefficients_of(lag)
    ((1.0,), (0.5, 1.0))
    """
    above, below = system.numerator, system.denominator
    if above.any():  # the first that is not 0 is the scale factor
        above = above / above[np.flatnonzero(above)[0]]
    if system.step is not None:
        length = max(above.size, below.size)
        above, below = (np.pad(in_z(c), (0, length - c.size))[::-1] for c in (above, below))
        above, below = above / below[-1], below / below[-1]
    return tuple(above[::-1].tolist()), tuple(below[::-1].tolist())


def highest_first(covariance: Real, system: RationalDelay) -> Real | None:
    """Covariance of delay, numerator and denominator, (q, q), by falling powers instead of rising.

    None where it is not finite, because the record does not determine every parameter.
    """
    finite = np.isfinite(covariance).all()
    return by_falling_powers(covariance, system.numerator.size) if finite else None
