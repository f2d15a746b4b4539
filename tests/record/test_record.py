"""Records refuse what cannot be used, and keep what they are given."""

from dataclasses import replace

import numpy as np
import pytest

from hmpim.errors import ArgumentError, RecordError, UnitError
from hmpim.identify import identify
from hmpim.record import Channel, Record


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ([1.0, np.nan, 2.0], r"'u' holds nan at sample 1 \(1 in all\)"),
        ([1.0, 2.0, -np.inf], "'u' holds -inf at sample 2"),
        ([[1.0, 2.0, 3.0]], r"'u' has shape \(1, 3\); give one dimension"),
        (["a", "b", "c"], "'u' is not numeric"),
        ([1 + 2j, 0, 0], "'u' is complex; give real numbers"),
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
        # Seen in a damaged file: so far from the first stamp that the others are one.
        ([-1.78e259, 1.0, 2.0], "does not increase at sample 2: 1 s is followed by 2 s"),
        ([-1.7e308, 1.0, 1.7e308], "does not increase"),
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


def four_roles(**changes):
    given = {
        "inputs": {"u": [0, 1, 0, 1]},
        "outputs": {"y": [0, 1, 2, 3]},
        "references": {"r": [1, 1, 1, 1]},
        "auxiliary": {"rate": [5, 6, 7, 8], "heat": [20, 21, 22, 23]},
        "fs": 10.0,
        "units": {"r": "deg", "heat": "degC"},
    } | changes
    return Record.from_arrays(**given)


def test_references_and_auxiliary_channels_are_kept_with_the_rest():
    record = four_roles()
    assert [c.name for c in record.channels] == ["u", "y", "r", "rate", "heat"]
    assert record.channel("heat").unit == "degC"
    assert [c.name for c in record.of("reference")] == ["r"]
    part = record.between(0.1, 0.3)
    assert part.channel("r").values.size == part.channel("rate").values.size == 2
    # The digest covers what a channel holds and what it is in the test.
    others = [
        four_roles(references={"r": [1, 1, 1, 2]}),
        four_roles(references={}, auxiliary={"r": [1] * 4, "rate": [5, 6, 7, 8]}, units={}),
        four_roles(auxiliary={}, units={}),
    ]
    assert len({record.sha256, *(other.sha256 for other in others)}) == 4


@pytest.mark.parametrize("role", ["outputs", "references", "auxiliary"])
def test_a_name_is_used_once_whatever_the_role(role):
    with pytest.raises(RecordError, match="'u' is used twice"):
        four_roles(**{role: {"u": [0, 1, 2, 3]}}, units={})


def test_a_slow_auxiliary_channel_does_not_hinder_cutting():
    heat = Channel(name="heat", time=[0.0, 0.9], values=[20.0, 21.0])
    record = replace(four_roles(), auxiliary=(heat,))
    assert record.between(0.0, 0.3).auxiliary == ()
    assert record.between(0.0, 1.0).auxiliary == (heat,)
    slow = replace(four_roles(), references=(heat,), auxiliary=())
    with pytest.raises(RecordError, match="'heat' has fewer than 2 samples"):
        slow.between(0.0, 0.3)


def test_a_masked_sample_is_a_gap_of_its_channel_alone():
    y = np.ma.MaskedArray([0.0, 1e9, 2.0, np.nan], mask=[False, True, False, True])
    record = four_roles(outputs={"y": y})
    assert record.outputs[0].values.tolist() == [0.0, 2.0]
    assert record.outputs[0].time.tolist() == [0.0, 0.2]
    assert record.inputs[0].values.size == 4
    # Nothing hidden: the same record as without a mask.
    assert four_roles(outputs={"y": np.ma.MaskedArray([0, 1, 2, 3])}) == four_roles()
    stamps = np.ma.MaskedArray([0.0, 0.1, 0.2, 0.3], mask=[False, True, False, False])
    late = four_roles(time=stamps, outputs={"y": y})
    assert late.outputs[0].time.tolist() == [0.0, 0.2]
    assert late.inputs[0].time.tolist() == [0.0, 0.2, 0.3]


def test_what_is_masked_does_not_change_what_is_identified():
    """The hidden values are absurd; the delay is found as if they had never been recorded."""
    rng = np.random.default_rng(4)
    u = np.cumsum(rng.standard_normal(600)) / 5
    y = np.concatenate((np.zeros(3), 2.0 * u[:-3])) + 0.01 * rng.standard_normal(600)
    mask = np.zeros(600, dtype=bool)
    mask[200:215] = True
    spoilt = np.where(mask, 1e6, y)
    hidden = Record.from_arrays(
        {"u": u}, {"y": np.ma.MaskedArray(spoilt, mask=mask)}, fs=100.0, intersample="zoh"
    )
    pair = identify(hidden)["y", "u"]
    assert abs(pair.parameters.delay.value - 0.03) < 4 * pair.parameters.delay.std
    assert abs(pair.parameters.scale_factor.value - 2.0) < 4 * pair.parameters.scale_factor.std


def test_masked_to_less_than_two_samples_is_refused():
    y = np.ma.MaskedArray([0.0, 1.0, 2.0, 3.0], mask=[False, True, True, True])
    with pytest.raises(RecordError, match="'y' has 1 samples; at least 2"):
        four_roles(outputs={"y": y})


@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
def test_dates_are_taken_in_seconds_since_the_first(unit):
    """As pandas has them: nanoseconds had been taken for seconds, and all was ok."""
    since = np.arange(3) * np.timedelta64(5, "ms")
    dates = np.datetime64("2026-03-01T23:59:59.995", unit) + since
    for time in (dates, since):
        record = Record.from_arrays({"u": [0, 1, 0]}, {"y": [0, 0, 1]}, time=time)
        assert record.inputs[0].time.tolist() == [0.0, 0.005, 0.01]
        assert record.fs == pytest.approx(200.0)
    with pytest.raises(RecordError, match=r"'u \(time\)' holds dates or durations; give numbers"):
        Channel(name="u", time=dates, values=np.zeros(3))
    with pytest.raises(RecordError, match="'u' holds dates or durations"):
        Record.from_arrays({"u": dates}, {"y": [0, 0, 1]}, fs=10.0)


def test_complex_time_is_refused():
    with pytest.raises(RecordError, match=r"'u \(time\)' is complex"):
        Channel(name="u", time=np.array([0, 1j]), values=[0.0, 1.0])


def test_other_roles_for_the_same_channels():
    again = four_roles().with_roles(inputs=["rate", "r"], outputs=["y"])
    assert [c.name for c in again.inputs] == ["rate", "r"]
    assert [c.name for c in again.auxiliary] == ["u", "heat"]
    assert again.references == ()
    with pytest.raises(RecordError, match="no channel 'rpm'"):
        four_roles().with_roles(inputs=["rpm"], outputs=["y"])
    with pytest.raises(RecordError, match="'y' is used twice"):
        four_roles().with_roles(inputs=["y"], outputs=["y"])


def test_records_are_equal_by_value():
    assert four_roles() == four_roles()
    assert hash(four_roles()) == hash(four_roles())
    others = [
        four_roles(fs=20.0),
        four_roles(band=(1.0, 2.0)),
        four_roles(inputs={"u": [0, 1, 0, 2]}),
        four_roles(units={}),
        replace(four_roles(), source="bench 2"),
    ]
    assert four_roles() not in others
    assert len({four_roles(), *others}) == 6
    assert four_roles() != "a record"
