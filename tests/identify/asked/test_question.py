"""What is known of an input where rows are missing."""

import numpy as np

import hmpim
from hmpim.identify.asked.question import Question
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


def test_what_stands_before_and_after_a_gap_stood_in_it():
    bits = np.random.default_rng(6).choice([-1.0, 1.0], SAMPLES)
    found = measured(bits)
    lost = np.flatnonzero(~KEPT)
    alone = lost[KEPT[lost - 1] & KEPT[lost + 1]]
    np.testing.assert_array_equal(found[alone], bits[alone - 1] == bits[alone + 1])
    assert np.all(found[KEPT])
