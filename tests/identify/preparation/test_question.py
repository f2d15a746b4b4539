"""What is known of an input where rows are missing."""

import numpy as np

import hmpim
from hmpim.identify.preparation.question import Question
from hmpim.record import uniform

SAMPLES = 1200
KEPT = np.random.default_rng(3).uniform(size=SAMPLES) > 0.05
KEPT[[0, -1]] = True


def measured(u):
    time = np.arange(SAMPLES) / 100.0
    y = np.random.default_rng(4).standard_normal(SAMPLES)
    record = hmpim.Record(
        inputs=(hmpim.Channel(name="u", time=time[KEPT], values=u[KEPT]),),
        outputs=(hmpim.Channel(name="y", time=time[KEPT], values=y[KEPT]),),
        fs=100.0,
    )
    aligned = uniform(record)
    question = Question(
        record=record,
        aligned=aligned,
        output=aligned.outputs[0],
        intersample=None,
        structures=("first_order",),
        inputs=None,
        instrument=None,
    )
    return question.measured


def test_an_input_that_moves_is_not_known_between_rows():
    found = measured(np.sin(2 * np.pi * 0.003 * np.arange(SAMPLES)))
    np.testing.assert_array_equal(found, KEPT)


def test_a_sequence_that_is_slower_than_the_rows_is_known_all_along():
    bits = np.repeat(np.random.default_rng(5).choice([-1.0, 1.0], SAMPLES // 4), 4)
    assert measured(bits) is None


def test_a_sequence_that_may_change_at_every_row_is_not_known_between_them():
    bits = np.random.default_rng(6).choice([-1.0, 1.0], SAMPLES)
    np.testing.assert_array_equal(measured(bits), KEPT)


def stays(levels, shortest):
    """Levels, each for at least so many rows, on no clock."""
    return np.repeat(levels, np.random.default_rng(5).integers(shortest, 7, levels.size))[:SAMPLES]


def alone_where_it_stands(u):
    """Lost rows, one at a time, with the same value on either side."""
    lost = np.flatnonzero(~KEPT)
    alone = lost[KEPT[lost - 1] & KEPT[lost + 1]]
    return alone[u[alone - 1] == u[alone + 1]]


def test_what_stands_before_and_after_a_gap_stood_in_it_where_no_stay_is_as_short():
    u = stays(np.tile([-1.0, 0.0, 1.0, 0.0], SAMPLES // 4), 2)
    stands = alone_where_it_stands(u)
    assert stands.size > 10
    assert np.all(measured(u)[stands])


def test_of_levels_that_do_not_recur_equal_neighbours_tell_what_was_between():
    u = stays(np.random.default_rng(7).standard_normal(SAMPLES), 1)
    stands = alone_where_it_stands(u)
    assert stands.size > 10
    assert np.all(measured(u)[stands])


def test_levels_that_recur_after_one_row_may_hide_in_a_gap():
    u = stays(np.tile([-1.0, 0.0, 1.0, 0.0], SAMPLES // 4), 1)
    assert not np.any(measured(u)[alone_where_it_stands(u)])
