"""The period of an input that repeats."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hmpim.identify.nonlinear.period import find_period
from tests_support import examples


@examples(12)
@given(period=st.integers(20, 400), times=st.floats(2.1, 6.0), seed=st.integers(0, 50))
def test_the_period_of_whatever_repeats(period, times, seed):
    one = np.random.default_rng(seed).standard_normal(period)
    u = np.resize(one, int(period * times))
    assert find_period(u) == period
    assert find_period(u + 1e-3 * np.random.default_rng(1).standard_normal(u.size)) == period


def test_no_period_where_there_is_none():
    t = np.arange(2000) / 200
    assert find_period(np.sin(2 * np.pi * (0.1 * t + t**2))) is None
    assert find_period(np.random.default_rng(0).standard_normal(500)) is None
    assert find_period(np.ones(500)) is None
