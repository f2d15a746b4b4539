"""Equality by value: equal fields, equal values; whatever is equal has one hash."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from hmpim.equality import ByValue


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Holder(ByValue):
    value: Any
    beside: Any = field(default=None, compare=False)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Other(ByValue):
    value: Any


ARRAYS = hnp.arrays(np.float64, hnp.array_shapes(max_side=4), elements=st.floats())


@given(ARRAYS)
def test_a_copy_is_equal_and_has_the_same_hash(array):
    one, other = Holder(value=array), Holder(value=array.copy(), beside=1)
    assert one == other
    assert hash(one) == hash(other)
    assert Holder(value=(array, {"a": array})) == Holder(value=(array.copy(), {"a": array.copy()}))


@given(ARRAYS, st.data())
def test_one_number_less_or_another_is_not_equal(array, data):
    place = data.draw(st.integers(0, array.size - 1))
    changed = array.copy().ravel()
    changed[place] = 1.0 if changed[place] != 1.0 else 2.0
    assert Holder(value=array) != Holder(value=changed.reshape(array.shape))
    assert Holder(value=array) != Holder(value=array[..., np.newaxis])


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (np.zeros(2), -np.zeros(2)),
        (np.zeros(2), np.zeros(2, dtype=int)),
        (1.0, 1),
        (float("nan"), float("nan")),
        ((float("nan"), "a"), (float("nan"), "a")),
    ],
)
def test_equal_though_written_otherwise(one, other):
    assert Holder(value=one) == Holder(value=other)
    assert hash(Holder(value=one)) == hash(Holder(value=other))


@pytest.mark.parametrize(
    ("one", "other"),
    [((1, 2), [1, 2]), (np.zeros(2), (0.0, 0.0)), ({"a": 1}, {"b": 1}), ((1,), (1, 2)), (1, None)],
)
def test_not_equal(one, other):
    assert Holder(value=one) != Holder(value=other)


def test_other_classes_are_not_equal():
    assert Holder(value=1) != Other(value=1)
    assert Holder(value=1) != 1
