"""Which inputs one record tells apart, which not, and that they are named."""

import numpy as np
import pytest
from scipy import signal

from hmpim.identify.coupling.inputs import input_set, own_band
from hmpim.identify.result import InputSet, OutputCoherence

FS, N = 200.0, 2000
T = np.arange(N) / FS


def sweep(first, last):
    return np.sin(2 * np.pi * (first * T + (last - first) / 20 * T**2))


UP, DOWN = sweep(0.1, 20.0), sweep(0.1, 20.0)[::-1].copy()
NOISE = np.random.default_rng(0).standard_normal((3, N))
SLOW = signal.butter(2, 8.0, fs=FS, output="sos")
LATE = signal.sosfilt(signal.butter(6, (11, 19), "bandpass", fs=FS, output="sos"), NOISE[0])


@pytest.mark.parametrize(
    ("inputs", "named"),
    [
        ([UP, DOWN, UP], ("a", "c")),
        ([UP, DOWN, -3 * UP], ("a", "c")),
        ([UP, 2 * UP + 0.01 * NOISE[0]], ("a", "b")),
        ([UP, DOWN, signal.sosfilt(SLOW, UP)], ("a", "c")),
        ([UP, DOWN, np.concatenate((np.zeros(20), UP[:-20]))], ("a", "c")),
        ([UP, DOWN, UP + DOWN], ("a", "b", "c")),
        ([UP, DOWN, UP - 2 * DOWN + 0.01 * NOISE[0]], ("a", "b", "c")),
    ],
    ids=["same", "scaled", "noisy", "filtered", "delayed", "sum", "noisy sum"],
)
def test_copies_are_named(inputs, named):
    found = input_set(inputs, "abc"[: len(inputs)], FS)
    assert found.alike[0].names == named
    assert found.alike[0].share > 0.9


def test_sweeps_that_are_nearly_the_same_are_not_told_apart_where_they_start():
    near = input_set([UP, sweep(0.1, 22.0)], "ab", FS)
    (alike, *_) = near.alike
    assert alike.names == ("a", "b")
    assert alike.bands[0][0] == pytest.approx(0.1)
    assert 2.0 < alike.bands[0][1] < 10.0
    assert near.usable[near.frequency > 10.0].all()
    assert input_set([UP, sweep(0.1, 40.0)], "ab", FS).alike == ()


def test_a_part_of_the_band_is_stated():
    # Both sweep alike until 5 s, at 10 Hz; then one goes on and the other is noise above 11 Hz.
    found = input_set([UP, np.where(T < 5, UP, 0.0) + np.where(T >= 5, LATE, 0.0)], "ab", FS)
    (alike, *_) = found.alike
    assert alike.bands[0][0] < 0.2
    assert 6.0 < alike.bands[0][1] < 11.0
    assert alike.where.endswith(" Hz")
    assert not found.usable[found.frequency < 6].any()
    assert found.usable[found.frequency > 12].mean() > 0.9


def test_what_has_nothing_in_common_has_a_condition_near_one():
    found = input_set(list(NOISE), "abc", FS)
    assert found.condition.max() < 1.5
    assert found.alike == ()


def test_units_and_order_do_not_matter():
    inputs = [UP, DOWN, sweep(14.0, 0.2)]
    one = input_set(inputs, "abc", FS)
    other = input_set([1e3 * inputs[2], 1e-3 * inputs[0], -inputs[1]], "cab", FS)
    np.testing.assert_allclose(other.condition, one.condition, rtol=1e-5)
    assert {frozenset(a.names) for a in other.alike} == {frozenset(a.names) for a in one.alike}


def test_each_input_has_its_own_band_within_the_stated_one():
    slow = np.sin(2 * np.pi * (0.5 * T + 0.25 * T**2)) * np.hanning(N)  # to 5.5 Hz
    low, high = own_band(slow, FS, (0.1, 80.0))
    assert 0.1 <= low < 2.0
    assert 5.0 < high < 7.0
    found = input_set([slow, UP], "ab", FS, stated=(0.1, 15.0))
    assert found.bands[1][1] == 15.0
    assert np.all(found.condition[found.frequency > 7.5] == 1.0)


def test_it_is_read_back_as_written():
    found = input_set([UP, DOWN, UP], "abc", FS)
    coherence = OutputCoherence(output="y", frequency=np.array([1.0]), multiple=np.array([0.5]))
    written = InputSet(
        names=found.names,
        bands=found.bands,
        frequency=found.frequency,
        condition=found.condition,
        alike=found.alike,
        coherence=(coherence,),
    ).to_dict()
    assert None in written["condition"]  # infinite
    assert InputSet.from_dict(written).to_dict() == written
