"""The period of an input that repeats."""

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.noise.whiteness import autocovariance
from hmpim.identify.worth import MATERIAL, PART

__all__ = ["find_period"]


def find_period(u: Real) -> int | None:
    """Samples after which an input, (n,), repeats exactly; None without two periods."""
    x = u - u.mean()
    n = x.size
    power = np.concatenate([[0.0], np.cumsum(x**2)])
    if power[-1] == 0:
        return None
    product = n * autocovariance(x, n // 2)
    lag = np.arange(n // 2 + 1)
    both = power[n - lag] + (power[n] - power[lag])
    different = (both - 2 * product) / np.maximum(both, np.finfo(float).tiny)
    moved = np.flatnonzero(different > PART)
    good = np.flatnonzero(different < MATERIAL**2)
    good = good[good > moved[0]] if moved.size else moved
    if good.size == 0:
        return None
    run = good[: 1 + int(np.argmax(np.append(np.diff(good), 2) > 1))]
    return int(run[np.argmin(different[run])])
