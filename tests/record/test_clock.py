"""The uniform clock behind time stamps: rate, jitter, gaps, rounding."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmpim.record import fit_clock, inspect_timing
from tests_support import examples

DATA = Path(__file__).resolve().parents[2].parent / "shared" / "data"


def test_rate_of_printed_stamps_is_not_spoilt_by_their_rounding():
    # 0.0016384 s is the interval of the silverbox records; six digits cut it.
    time = np.round(0.0016384 * np.arange(8192), 6)
    clock = fit_clock(time)
    assert clock.uniform
    assert clock.fs == pytest.approx(610.3515625, rel=1e-7)
    assert inspect_timing(time, 610.3515625) == ()


def test_whole_milliseconds_at_400_hz_are_a_uniform_clock():
    time = np.round(np.arange(4000) / 400, 3)
    clock = fit_clock(time)
    assert clock.uniform
    assert clock.fs == pytest.approx(400, rel=1e-4)
    assert clock.resolution == 1e-3


def test_whole_milliseconds_at_800_hz_are_rounding_not_a_thousand_gaps():
    time = np.round(np.arange(4000) / 800, 3)
    assert fit_clock(time).uniform


def test_one_dropped_sample_in_whole_milliseconds_is_a_gap_not_another_rate():
    time = np.delete(np.arange(1000) / 1000, 500)
    clock = fit_clock(time)
    assert clock.gaps.tolist() == [499]
    assert clock.fs == pytest.approx(1000, rel=1e-12)


def test_stated_rate_is_kept_digit_for_digit_where_the_stamps_agree():
    assert fit_clock(np.arange(2000) / 200, nominal=200.0).fs == 200.0


def test_an_interval_long_by_jitter_is_no_gap():
    time = np.arange(50) * 0.01
    time[20] += 0.006  # 1.6 intervals, then 0.4
    clock = fit_clock(time)
    assert clock.gaps.size == 0
    assert clock.jittered
    assert int(np.argmax(np.abs(clock.deviation))) == 20


def test_gap_says_how_many_where_and_how_long():
    time = np.delete(np.arange(1000) / 200, np.s_[300:340])
    (finding,) = inspect_timing(time, 200.0)
    assert finding.code == "gaps"
    assert "40 of 1000 samples" in finding.message
    assert "0.205 s from 1.495 s" in finding.message


def test_jitter_is_told_relative_to_the_interval():
    rng = np.random.default_rng(1)
    time = np.arange(20000) / 200 + rng.normal(0, 0.05 / 200, 20000)
    (finding,) = inspect_timing(time, 200.0)
    assert finding.code == "jitter"
    assert "by 5 % of the interval (r.m.s.)" in finding.message


@pytest.mark.parametrize(("share", "found"), [(0.009, []), (0.011, ["jitter"])])
def test_threshold_of_jitter_is_one_percent_of_the_interval(share, found):
    time = np.pi + np.arange(1001) / 200
    time[500] += share / 200
    assert [f.code for f in inspect_timing(time, 200.0)] == found


def test_stamps_that_run_at_another_rate_than_stated_are_told():
    (finding,) = inspect_timing(np.arange(1000) / 100, 200.0)
    assert finding.code == "rate"
    assert "100 Hz where 200 Hz" in finding.message


@examples(20)
@given(
    fs=st.floats(1, 5000),
    start=st.floats(-1e4, 1e4),
    n=st.integers(20, 400),
    dropped=st.sets(st.integers(2, 17), max_size=3),
)
def test_places_are_found_through_gaps_from_any_start(fs, start, n, dropped):
    keep = np.setdiff1d(np.arange(n), list(dropped))
    time = start + keep / fs
    clock = fit_clock(time)
    assert clock.index.tolist() == keep.tolist()
    assert not clock.jittered
    # Stamps of 1e4 s carry 2e-12 s of rounding; over 20 samples at 5 kHz that is 1e-9.
    assert clock.fs == pytest.approx(fs, rel=1e-8)


@examples(20)
@given(
    seed=st.integers(0, 2**32 - 1),
    amount=st.floats(0.05, 0.35),
    offset=st.floats(-100, 100),
    scale=st.sampled_from([1e-3, 1.0, 60.0]),
)
def test_an_offset_or_another_unit_of_time_changes_nothing_else(seed, amount, offset, scale):
    rng = np.random.default_rng(seed)
    time = (np.arange(200) + amount * rng.uniform(-1, 1, 200)) / 100
    a, b = fit_clock(time), fit_clock(scale * (time + offset))
    assert a.index.tolist() == b.index.tolist()
    assert (a.jittered, a.uniform) == (b.jittered, b.uniform)
    assert b.fs * scale == pytest.approx(a.fs, rel=1e-9)
    assert b.start == pytest.approx(scale * (a.start + offset), abs=1e-9 * scale)


@examples(20)
@given(
    seed=st.integers(0, 2**32 - 1),
    dropped=st.sets(st.integers(1, 38).map(lambda k: 5 * k), max_size=4),
)
def test_dropped_samples_are_told_from_late_ones_under_strong_jitter(seed, dropped):
    rng = np.random.default_rng(seed)
    keep = np.setdiff1d(np.arange(200), list(dropped))
    time = (keep + 0.1 * rng.uniform(-1, 1, keep.size)) / 100
    clock = fit_clock(time)
    assert clock.index.tolist() == keep.tolist()
    assert clock.jittered


def test_thirty_percent_of_jitter_makes_no_gap():
    rng = np.random.default_rng(0)
    for _ in range(20):
        time = (np.arange(4000) + 0.3 * rng.uniform(-1, 1, 4000)) / 200
        assert fit_clock(time).gaps.size == 0


@pytest.mark.real_data
def test_measured_stamps_are_uniform_as_they_are_and_as_printed():
    path = DATA / "silverbox" / "snls80mv.npz"
    if not path.exists():
        pytest.skip(f"no measured record at {path}")
    with np.load(path) as stored:
        time = stored["time"]
    for stamps in (time, np.round(time, 6)):
        clock = fit_clock(stamps)
        assert clock.uniform
        assert clock.fs == pytest.approx(610.3515625, rel=1e-8)
        assert inspect_timing(stamps, 610.3515625) == ()
