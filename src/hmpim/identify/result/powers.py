"""The order of coefficients for people and files: highest power first."""

import numpy as np

from hmpim.identify.arrays import Real

__all__ = ["by_falling_powers"]


def by_falling_powers(covariance: Real, numerator: int) -> Real:
    """Covariance of delay, numerator and denominator, (q, q), by falling powers for rising ones.

    Parameters
    ----------
    covariance : ndarray, shape (q, q)
        Of the delay, then of the numerator's coefficients, then of the denominator's.
    numerator : int
        Coefficients of the numerator.

    Examples
    --------
    >>> by_falling_powers(np.diag([0.0, 1.0, 2.0, 3.0, 4.0]), 2).diagonal().tolist()
    [0.0, 2.0, 1.0, 4.0, 3.0]
    """
    above = 1 + numerator
    order = [0, *range(1, above)[::-1], *range(above, covariance.shape[0])[::-1]]
    return covariance[np.ix_(order, order)]
