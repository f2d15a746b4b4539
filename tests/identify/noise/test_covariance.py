"""The covariance of a least-squares fit, where the record does not see a direction."""

import numpy as np
import pytest

from hmpim.identify.noise.covariance import covariance

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
