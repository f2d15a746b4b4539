"""The input's lags are multiplied from one to the next, whatever samples are left out."""

import numpy as np
import pytest
import scipy

import hmpim
from hmpim.identify.judgement.feedback import chances_without_feedback
from tests_support import answer_of


def by_regression(u, left, counts, ahead=12):
    """The score test of the input's future beside its past, lag by lag."""
    places = np.arange(ahead, u.size - ahead)
    places = places[counts[places]]
    lags = (u - u.mean())[places + np.arange(-ahead, ahead + 1)[:, None]]
    past = np.vstack([np.ones(places.size), lags[: ahead + 1]])
    e, future = left[places], lags[ahead + 1 :]
    own = future - np.linalg.lstsq(past.T, future.T, rcond=None)[0].T @ past
    rest = e - np.linalg.lstsq(past.T, e, rcond=None)[0] @ past
    told = np.linalg.lstsq(own.T, rest, rcond=None)[0] @ own
    return scipy.special.chdtrc(ahead, float(told @ told) / e.var())


@pytest.mark.parametrize("share", [0.0, 0.1])
def test_the_chance_is_that_of_a_regression(share):
    rng = np.random.default_rng(4)
    u = 3.0 + np.convolve(rng.standard_normal(804), [1.0, 0.8, 0.3, 0.1, 0.05], "valid")
    counts = rng.random(u.size) >= share
    left = rng.standard_normal((2, u.size))
    left[1, :-6] += 0.2 * u[6:]
    found = chances_without_feedback(u, left, counts if share else None)
    wanted = [by_regression(u, one, counts) for one in left]
    assert found[0] == pytest.approx(wanted[0], rel=1e-6)
    assert found[0] > 1e-3
    assert max(found[1], wanted[1]) < 1e-6  # of a loop, for a residual of any colour


def test_of_no_records_there_are_no_chances():
    u = np.random.default_rng(4).standard_normal(800)
    assert chances_without_feedback(u, np.empty((0, u.size))).shape == (0,)


@pytest.mark.parametrize("top", [10.0, 60.0])
@pytest.mark.parametrize("length", [10, 100])
def test_slow_noise_does_not_move_a_smooth_input(top, length):
    """The past of the slower one determines its future, to all the digits that products keep."""
    t = np.arange(4000) / 1000.0
    u = 5.0 * np.sin(2 * np.pi * (0.1 * t + top / 8.0 * t**2))
    slow = np.array(
        [
            np.convolve(
                np.random.default_rng(k).standard_normal(t.size + length - 1),
                np.ones(length),
                "valid",
            )
            for k in range(40)
        ]
    )
    assert chances_without_feedback(u, slow).min() > 1e-4


def test_even_samples_whose_stamps_jitter_are_no_loop():
    """Moved to their stamps, both channels would err alike, and what is left follows the input."""
    rng, fs = np.random.default_rng(1), 200.0
    time = np.arange(2000) / fs
    u = np.sin(2 * np.pi * (0.1 * time + time**2))
    y = answer_of([1.0], [2.5e-4, 1.3e-2, 1.0], u, time) + 0.01 * rng.standard_normal(time.size)
    stamps = time + 3e-4 * rng.standard_normal(time.size)
    (pair,) = hmpim.identify(hmpim.Record.from_arrays({"u": u}, {"y": y}, time=stamps))
    codes = [w.code for w in pair.warnings]
    assert "even_samples" in codes
    assert "feedback" not in codes


def test_nothing_left_is_no_sign_of_a_loop():
    u = np.random.default_rng(4).standard_normal(800)
    assert chances_without_feedback(u, np.zeros((1, u.size))).tolist() == [1.0]
