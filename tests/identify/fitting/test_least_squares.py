"""Least squares: rows added to a model, and the power that rows explain."""

import numpy as np
import pytest

from hmpim.identify.fitting.least_squares import added, explained, without


def test_rows_explain_the_power_of_their_projection():
    """Of many residuals at once; a row that repeats another adds no direction."""
    rng = np.random.default_rng(5)
    rows = rng.standard_normal((3, 4, 200)) * np.array([1.0, 1e3, 1e-3, 1.0])[:, None]
    rows[:, 3] = 2.0 * rows[:, 0]
    residual = rng.standard_normal((3, 200))
    gram = rows @ rows.swapaxes(-1, -2)
    power, determined = explained(gram, (rows @ residual[..., None])[..., 0], least=1e-9)
    for own, left, known in zip(rows, residual, power, strict=True):
        projection = own.T @ np.linalg.lstsq(own.T, left, rcond=None)[0]
        assert known == pytest.approx(float(projection @ projection), rel=1e-9)
    assert determined.tolist() == [3, 3, 3]


def test_added_rows_count_without_what_the_model_explains():
    rng = np.random.default_rng(6)
    model, more, residual = (rng.standard_normal((k, 200)) for k in (3, 2, 1))
    shift, own, along = added(
        model @ model.T, more @ model.T, more @ more.T, model @ residual[0], more @ residual[0]
    )
    rest = without(more, model)
    np.testing.assert_allclose(more + shift.T @ model, rest, atol=1e-12)
    np.testing.assert_allclose(own, rest @ rest.T, rtol=1e-10)
    np.testing.assert_allclose(along, rest @ residual[0], rtol=1e-9)


def test_a_row_that_rounding_left_less_than_no_power_explains_nothing():
    gram = np.array([[1.0, 1e3], [1e3, -1e-12]])
    power, determined = explained(gram, np.array([2.0, 1e10]), least=1e-9)
    assert float(power) == pytest.approx(4.0)
    assert int(determined) == 1
