import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from hmpim.plots.envelope import envelope

values = st.floats(-1e6, 1e6)
curves = arrays(np.float64, st.integers(1, 400), elements=values)


@given(y=curves, most=st.integers(4, 60), spacing=st.sampled_from(["linear", "log"]))
def test_it_shows_real_points_few_enough_and_both_extremes(y, most, spacing):
    x = np.arange(1.0, y.size + 1)
    shown_x, shown_y = envelope(x, y, most_points=most, spacing=spacing)
    assert shown_x.size <= max(most, 4)
    assert np.all(np.diff(shown_x) > 0)
    np.testing.assert_array_equal(shown_y, y[shown_x.astype(int) - 1])
    assert shown_y.max() == y.max()
    assert shown_y.min() == y.min()


@given(y=arrays(np.float64, 1000, elements=values))
def test_each_slice_keeps_its_own_extremes(y):
    x = np.arange(1000.0)
    shown_x, _ = envelope(x, y, most_points=100)
    kept = set(shown_x.astype(int))
    for start in range(0, 1000, 20):
        part = y[start : start + 20]
        in_slice = [k for k in kept if start <= k < start + 20]
        assert max(y[in_slice]) == part.max()
        assert min(y[in_slice]) == part.min()


def test_a_short_curve_is_left_alone():
    x, y = np.arange(10.0), np.arange(10.0) ** 2
    shown_x, shown_y = envelope(x, y, most_points=10)
    assert shown_x is x
    assert shown_y is y


def test_on_a_logarithmic_axis_slow_frequencies_keep_their_points():
    x = np.arange(1.0, 1_000_001.0)
    shown_x, _ = envelope(x, np.sin(x), most_points=2000, spacing="log")
    per_decade = [np.count_nonzero((shown_x >= 10**k) & (shown_x < 10 ** (k + 1))) for k in (3, 5)]
    assert per_decade[0] > 250
    assert per_decade[1] > 250
