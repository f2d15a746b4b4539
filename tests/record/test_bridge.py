"""Samples lost here and there are found from those around them, where that is the better guess."""

import numpy as np

from hmpim.record.bridge import SHORT, bridged

SIZE = 2000
TIME = np.arange(SIZE)


def _by_lines(x):
    return lambda known: np.interp(TIME, TIME[known], x[known])


def _lost(seed=0, share=0.05):
    known = np.random.default_rng(seed).uniform(size=SIZE) > share
    known[[0, -1]] = True
    return known


def test_a_sweep_that_lost_one_sample_in_twenty_is_found_to_a_thousandth():
    x = np.sin(np.pi * 0.3 * TIME**2 / SIZE)  # up to 0.3 of the rate
    known = _lost()
    error = bridged(x, known, _by_lines(x)) - x
    np.testing.assert_array_equal(error[known], 0.0)
    assert np.sqrt(np.mean(error[~known] ** 2)) < 1e-3
    assert np.sqrt(np.mean((_by_lines(x)(known) - x)[~known] ** 2)) > 0.3


def test_the_error_is_about_the_noise_of_what_is_measured():
    x = np.sin(np.pi * 0.2 * TIME**2 / SIZE) + 0.001 * np.random.default_rng(1).normal(size=SIZE)
    known = _lost()
    error = (bridged(x, known, _by_lines(x)) - x)[~known]
    assert np.sqrt(np.mean(error**2)) < 5e-3


def test_steps_stay_as_the_rule_has_them():
    x = np.where(np.random.default_rng(2).uniform(size=SIZE // 40) > 0.5, 1.0, -1.0).repeat(40)
    known = _lost()

    def held(seen):
        return x[np.maximum.accumulate(np.where(seen, TIME, 0))]

    np.testing.assert_array_equal(bridged(x, known, held), held(known))


def test_a_long_gap_is_left_to_the_rule():
    x = np.sin(TIME / 9)
    known = _lost()
    known[700 : 700 + SHORT + 5] = False
    found = bridged(x, known, _by_lines(x))
    there = slice(700, 700 + SHORT + 5)
    np.testing.assert_array_equal(found[there], _by_lines(x)(known)[there])
    assert np.abs(found - x)[~known & ((TIME < 650) | (TIME > 750))].max() < 1e-6


def test_gaps_in_every_stretch_are_bridged_in_rounds():
    x = np.sin(TIME**2 / 5000)
    known = TIME % 23 > 0
    known[0] = True
    assert np.abs(bridged(x, known, _by_lines(x)) - x).max() < 1e-5
