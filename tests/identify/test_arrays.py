"""The median of a few numbers is that of NumPy, to the last digit."""

import numpy as np

from hmpim.identify.arrays import median


def test_the_median_is_numpys():
    rng = np.random.default_rng(0)
    for size in range(1, 40):
        values = rng.standard_normal(size)
        assert median(values) == np.median(values)
        assert np.isnan(median(np.append(values, np.nan)))
