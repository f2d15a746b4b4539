"""Values that look wrong are said, and those that do not are not."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmpim.record import Channel, Record, inspect_record, inspect_values
from tests_support import examples

T = np.arange(2000) / 200
U = np.sin(2 * np.pi * 0.7 * T) + 0.3 * np.sin(2 * np.pi * 3.1 * T)


def codes(y, u=U):
    return [f.code for f in inspect_values(Record.from_arrays({"u": u}, {"y": y}, fs=200.0))]


def test_a_clean_record_is_let_pass():
    assert codes(np.roll(U, 7)) == []


@pytest.mark.parametrize("level", [0.0, 3.7, 3.7 * (1 + 1e-16 * np.sign(U))])
def test_a_constant_channel_is_dead(level):
    assert codes(level + 0 * U) == ["dead_channel"]


def test_a_dead_input_is_named():
    (finding,) = inspect_values(Record.from_arrays({"u": 0 * U + 2}, {"y": U}, fs=200.0))
    assert "channel 'u' is 2 from beginning to end" in finding.message


def test_an_output_that_dies_midway_is_stuck():
    y = U.copy()
    y[1520:] = y[1520]
    record = Record.from_arrays({"u": U}, {"y": y}, fs=200.0)
    (finding,) = inspect_values(record)
    assert finding.code == "stuck"
    assert "from 7.6 s to 9.995 s (480 samples) while 'u' moves" in finding.message


def test_standing_still_with_the_input_is_not_stuck():
    u = np.where((T > 4) & (T < 6), U[800], U)
    assert codes(2 * u, u) == []


def test_standing_still_at_the_end_of_the_range_is_left_to_saturation():
    assert codes(np.clip(U, -0.5, 0.5)) == []


def test_a_slow_update_shows_as_repeated_samples():
    (finding,) = inspect_values(Record.from_arrays({"u": U}, {"y": np.repeat(U[::4], 4)}, fs=200.0))
    assert finding.code == "repeated_samples"
    assert "75 % of the samples of 'y'" in finding.message
    assert "about every 4 samples" in finding.message


@examples(20)
@given(scale=st.floats(1e-6, 1e6), offset=st.floats(-10, 10), stuck=st.booleans())
def test_scale_and_offset_of_the_output_change_no_finding(scale, offset, stuck):
    y = U.copy()
    if stuck:
        y[700:900] = 0.25
    assert codes(scale * (y + offset)) == (["stuck"] if stuck else [])


def test_each_clock_is_looked_at_once_and_named_if_it_is_another():
    late = np.delete(T, [50, 51])
    record = Record(
        inputs=(Channel(name="u", time=late, values=np.delete(U, [50, 51])),),
        outputs=(
            Channel(name="y", time=T, values=U),
            Channel(name="z", time=T.copy(), values=U**2),
        ),
        fs=200.0,
    )
    (finding,) = inspect_record(record)
    assert finding.code == "gaps"
    assert finding.message.startswith("2 of 2000 samples of 'u' are missing, in 1 gap")
