"""The covariance of a least-squares fit, where the record does not see a direction."""

import numpy as np
import pytest
import scipy

from hmpim.identify.noise.covariance import covariance, white_covariance

LEFT = np.random.default_rng(0).standard_normal(50)


@pytest.mark.parametrize("white", [True, False])
def test_a_parameter_that_moves_nothing_has_a_large_variance_and_no_error(white):
    (found,) = covariance(np.zeros((1, 50)), LEFT, freedom=49, white=white)
    assert 1e10 < found < np.inf


def test_one_of_two_that_moves_nothing_leaves_the_other_as_it_is():
    row = np.ones(50)
    alone = covariance(row[None], LEFT, freedom=49, white=True)[0, 0]
    both = covariance(np.stack([row, np.zeros(50)]), LEFT, freedom=49, white=True)
    assert both[0, 0] == pytest.approx(alone)
    assert both[1, 1] > 1e10


def loud(rng, n=2000):
    """Noise that is five times as loud where the second of two parameters is seen."""
    late = np.arange(n) < n // 4
    wave = np.sin(0.3 * np.arange(n))
    return np.stack([wave, wave * late]), np.where(late, 5.0, 1.0) * rng.standard_normal(n)


@pytest.mark.parametrize("pole", [0.0, 0.7])
def test_noise_counts_as_loud_as_it_is_where_a_parameter_is_seen(pole):
    """The stated deviations are those of 400 draws; taken as steady the noise gives others."""
    found, stated = [], []
    for seed in range(400):
        rows, noise = loud(np.random.default_rng(seed))
        if pole:
            noise = scipy.signal.lfilter([1.0], [1.0, -pole], noise)
        weights = np.linalg.solve(rows @ rows.T, rows @ noise)
        left = noise - weights @ rows
        found.append(weights)
        if seed < 40:
            cov = covariance(rows, left, freedom=1998, white=not pole)
            stated.append(np.diag(cov))
    scatter = np.var(found, axis=0)
    assert np.mean(stated, axis=0) == pytest.approx(scatter, rel=0.25)


def test_a_parameter_that_moves_nothing_has_no_error_beside_noise_that_changes():
    rows, noise = loud(np.random.default_rng(0))
    rows[1] = 0.0
    assert covariance(rows, noise, freedom=1998, white=True)[1, 1] > 1e10


def test_products_that_rounding_turned_negative_determine_no_covariance():
    gram = np.array([[1.0, 0.0], [0.0, -1e-17]])
    assert white_covariance(gram, 1.0, freedom=100) is None
