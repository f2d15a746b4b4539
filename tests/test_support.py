"""The bounds that studies are held against: seldom broken by chance, and not vacuous."""

import numpy as np
import pytest

from tests_support import (
    FALSE_ALARM,
    assert_share,
    excluded,
    fewest,
    independent,
    most,
    rms_between,
    room,
)


@pytest.mark.parametrize("trials", [5, 40, 100, 1000])
@pytest.mark.parametrize("chance", [0.01, 0.05, 0.5, 0.92, 0.95])
def test_counts_beyond_the_bounds_have_the_stated_chance(trials, chance):
    from scipy.stats import binom

    low, high = fewest(trials, chance), most(trials, chance)
    assert binom.cdf(low - 1, trials, chance) <= FALSE_ALARM < binom.cdf(low, trials, chance)
    assert binom.sf(high, trials, chance) <= FALSE_ALARM
    assert high == 0 or binom.sf(high - 1, trials, chance) > FALSE_ALARM


def test_no_event_excludes_what_would_have_shown_in_nineteen_of_twenty():
    assert excluded(5) == pytest.approx(0.45, abs=0.005)
    assert (1 - excluded(300)) ** 300 == pytest.approx(0.05)


def test_a_share_is_held_to_what_the_count_can_tell():
    rng = np.random.default_rng(0)
    assert_share(rng.random((100, 5)) < 0.95, at_least=0.92, at_most=0.98)
    with pytest.raises(AssertionError, match=r"where 0\.92 to 0\.98 is promised"):
        assert_share(rng.random((100, 5)) < 0.85, at_least=0.92, at_most=0.98)
    with pytest.raises(AssertionError, match="is promised"):
        assert_share(np.ones((100, 5), dtype=bool), at_least=0.92, at_most=0.98)
    with pytest.raises(AssertionError, match="nothing was counted"):
        assert_share([])


def test_figures_that_go_together_count_less():
    rng = np.random.default_rng(1)
    apart = rng.random((400, 5)) < 0.8
    assert independent(apart) == pytest.approx(2000, rel=0.15)
    assert independent(np.repeat(apart[:, :1], 5, axis=1)) == 400


def test_means_and_mean_squares_stay_within_their_room():
    values = np.random.default_rng(2).standard_normal((20_000, 25))
    low, high = rms_between(25)
    rms = np.sqrt(np.mean(values**2, axis=1))
    beyond = np.count_nonzero((rms < low) | (rms > high))
    off = np.count_nonzero(np.abs(values.mean(axis=1)) > room(25))
    for count in (beyond, off):
        assert count <= most(20_000, FALSE_ALARM)
    assert np.count_nonzero(np.abs(values.mean(axis=1)) > 0.5 * room(25)) > 100
