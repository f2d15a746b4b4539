"""Records refuse what cannot be used, and keep what they are given."""

import numpy as np
import pytest

from hmpim.errors import ArgumentError, RecordError, UnitError
from hmpim.record import Channel, Record


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ([1.0, np.nan, 2.0], r"'u' holds nan at sample 1 \(1 such in all\)"),
        ([1.0, 2.0, -np.inf], "'u' holds -inf at sample 2"),
        ([[1.0, 2.0, 3.0]], r"'u' has shape \(1, 3\); give one dimension"),
        (["a", "b", "c"], "'u' is not numeric"),
        ([1 + 2j, 0, 0], "'u' is not numeric"),
        ([1.0, 2.0], r"unequal lengths \(u: 2, y: 3\)"),
    ],
)
def test_values_that_cannot_be_used(values, words):
    with pytest.raises(RecordError, match=words):
        Record.from_arrays({"u": values}, {"y": [0.0, 1.0, 2.0]}, fs=1.0)


@pytest.mark.parametrize(
    ("time", "words"),
    [
        ([0.0, 2.0, 1.0], "does not increase at sample 2: 2 s is followed by 1 s"),
        ([0.0, 1.0, 1.0], "does not increase at sample 2"),
        ([0.0, np.nan, 1.0], r"'u \(time\)' holds nan at sample 1"),
        ([0.0, 1.0], r"has 3 samples and 2 time stamps"),
    ],
)
def test_time_that_cannot_be_used(time, words):
    with pytest.raises(RecordError, match=words):
        Channel(name="u", time=time, values=[0.0, 1.0, 2.0])


def test_one_sample_is_no_signal():
    with pytest.raises(RecordError, match="1 samples; at least 2"):
        Channel(name="u", time=[0.0], values=[0.0])


def test_an_unknown_unit_is_quoted():
    with pytest.raises(UnitError, match="'furlongz' is not known"):
        Record.from_arrays({"u": [0, 1]}, {"y": [0, 1]}, fs=1.0, units={"u": "furlongz"})


@pytest.mark.parametrize("fs", [0.0, -1.0, np.nan, np.inf])
def test_a_rate_that_is_none(fs):
    with pytest.raises(ArgumentError, match="is not a sampling rate"):
        Record.from_arrays({"u": [0, 1]}, {"y": [0, 1]}, fs=fs)


def test_neither_rate_nor_time():
    with pytest.raises(ArgumentError, match="neither fs nor time"):
        Record.from_arrays({"u": [0, 1]}, {"y": [0, 1]})


def test_channels_missing_doubled_or_unknown():
    with pytest.raises(RecordError, match="at least one input and one output"):
        Record.from_arrays({"u": [0, 1]}, {}, fs=1.0)
    u = Channel(name="u", time=[0, 1], values=[0, 1])
    with pytest.raises(RecordError, match="'u' is used twice"):
        Record(inputs=(u,), outputs=(u,), fs=1.0)
    record = Record.from_arrays({"u": [0, 1]}, {"y": [0, 1]}, fs=1.0)
    with pytest.raises(RecordError, match="no channel 'z'; the record has u, y"):
        record.channel("z")
    with pytest.raises(RecordError, match="'z', which is not a channel"):
        Record.from_arrays({"u": [0, 1]}, {"y": [0, 1]}, fs=1.0, units={"z": "deg"})


def test_gaps_do_not_lower_the_rate():
    time = np.delete(np.arange(1000) / 100, np.s_[200:400])
    record = Record.from_arrays({"u": time}, {"y": time}, time=time)
    assert record.fs == pytest.approx(100.0, rel=1e-12)


def test_a_record_is_a_copy_that_cannot_be_written():
    u = np.arange(4.0)
    record = Record.from_arrays({"u": u}, {"y": u}, fs=2.0)
    u[0] = 99.0
    assert record.inputs[0].values[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        record.inputs[0].values[0] = 1.0


def test_digest_tells_apart_what_differs_and_nothing_else():
    def digest(**changes):
        given = {"inputs": {"u": [0, 1]}, "outputs": {"y": [0, 1]}, "fs": 1.0} | changes
        return Record.from_arrays(**given).sha256

    assert digest() == digest(band=(1.0, 2.0))
    others = [
        digest(inputs={"v": [0, 1]}),
        digest(inputs={"u": [0, 2]}),
        digest(fs=2.0),
        digest(units={"u": "deg"}),
        digest(inputs={"u": [0, 1], "w": [0, 1]}),
    ]
    assert len({digest(), *others}) == 6


def test_a_part_keeps_its_time_and_its_end_is_open():
    record = Record.from_arrays({"u": range(10)}, {"y": range(10)}, fs=10.0)
    part = record.between(0.2, 0.5)
    assert part.outputs[0].time.tolist() == pytest.approx([0.2, 0.3, 0.4])
    assert part.inputs[0].values.tolist() == [2, 3, 4]
    with pytest.raises(RecordError, match="fewer than 2 samples between 5 s and 6 s"):
        record.between(5, 6)
