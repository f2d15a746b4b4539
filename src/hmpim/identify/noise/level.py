"""The level of noise along a record."""

import numpy as np

from hmpim.identify.arrays import Real, summed
from hmpim.identify.noise.whiteness import is_steady, squares_of
from hmpim.identify.worth import PART

__all__ = ["level_of", "steadiness"]

_KURTOSIS = 3.0
"""Kurtosis of normal noise."""

_PARTS = 20
"""Parts of the record over each of which a level is estimated."""

_FEWEST = 50
"""Samples that determine a level to a tenth."""

_WINDOWS = 4
"""Least length of a record, in such parts, to show that the level changes."""


def level_of(innovations: Real) -> Real | None:
    """Local r.m.s. of white noise at each sample, over its geometric mean.

    Samples divided by it have a constant level, and their sum of squares is that of the likelihood
    (R. J. Carroll, Annals of Statistics 10, 1982). No level is less than a fifth of the overall
    r.m.s. Samples of 0 do not count. None if the level does not change, or there are too few
    samples.
    """
    window = max(innovations.size // _PARTS, _FEWEST)
    if innovations.size < _WINDOWS * window or is_steady(innovations):
        return None
    counted = innovations != 0.0
    about = summed(counted.astype(np.float64), window // 2)
    power = summed(squares_of(innovations), window // 2) / np.maximum(about, 1.0)
    power = np.where(about > 0.0, power, 1.0)
    level = np.sqrt(np.maximum(power, PART**2))
    return np.asarray(level / np.exp(np.mean(np.log(level[counted]))))


def steadiness(residual: Real) -> float:
    """Samples of steady normal noise that determine a level as well as one sample of a residual.

    3 over the kurtosis of the residual; 1 if it `is_steady`.
    """
    if is_steady(residual):
        return 1.0
    counted = residual[residual != 0.0]
    return min(_KURTOSIS / float(np.mean(squares_of(counted) ** 2)), 1.0)
