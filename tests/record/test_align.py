"""All channels on one uniform clock: unchanged where they can be, honest where not."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmpim.errors import RecordError
from hmpim.record import Channel, Record, Series, uniform
from hmpim.record.mend import mend, restarts
from tests_support import examples


def sine(time, f=1.0):
    return np.sin(2 * np.pi * f * time)


def record_at(time, f=1.0, **options):
    return Record.from_arrays({"u": sine(time, f)}, {"y": 2 * sine(time, f)}, time=time, **options)


@examples(20)
@given(
    n=st.integers(2, 300),
    fs=st.floats(1e-2, 1e5),
    start=st.floats(-1e3, 1e3),
    seed=st.integers(0, 2**32 - 1),
)
def test_a_uniform_record_comes_back_as_it_is(n, fs, start, seed):
    rng = np.random.default_rng(seed)
    record = Record.from_arrays(
        {"u": rng.normal(size=n)}, {"y": rng.normal(size=n)}, time=start + np.arange(n) / fs
    )
    aligned = uniform(record)
    assert aligned.inputs[0].values is record.inputs[0].values
    assert aligned.outputs[0].values is record.outputs[0].values
    assert aligned.time is record.outputs[0].time
    assert aligned.outputs[0].valid.all()
    assert aligned.findings == ()


def test_rounded_stamps_change_no_value():
    time = np.round(0.0016384 * np.arange(4096), 6)
    record = record_at(time)
    aligned = uniform(record)
    assert aligned.outputs[0].values is record.outputs[0].values
    assert aligned.findings == ()
    assert aligned.fs == pytest.approx(610.3515625, rel=1e-8)


def test_the_stated_rate_is_kept_digit_for_digit():
    assert uniform(Record.from_arrays({"u": np.ones(7)}, {"y": np.ones(7)}, fs=610.35)).fs == 610.35


@examples(20)
@given(seed=st.integers(0, 2**32 - 1), lost=st.sets(st.integers(1, 198), min_size=1, max_size=40))
def test_gaps_are_masked_and_all_else_is_left_alone(seed, lost):
    rng = np.random.default_rng(seed)
    keep = np.setdiff1d(np.arange(200), list(lost))
    u, y = rng.normal(size=(2, keep.size))
    aligned = uniform(Record.from_arrays({"u": u}, {"y": y}, time=3 + keep / 50))
    assert np.flatnonzero(~aligned.outputs[0].valid).tolist() == sorted(lost)
    assert np.array_equal(aligned.inputs[0].values[keep], u)
    assert np.array_equal(aligned.outputs[0].values[keep], y)
    assert [f.code for f in aligned.findings] == ["gaps"]
    assert np.allclose(aligned.time, 3 + np.arange(200) / 50, rtol=0, atol=1e-9)


def test_the_filling_of_a_gap_follows_a_smooth_input_and_stays_between_its_edges():
    time = np.delete(np.arange(1000) / 100, np.s_[105:110])
    aligned = uniform(record_at(time, f=0.5))
    filled = aligned.inputs[0].values[105:110]
    # Five samples of a half-hertz sine at 100 Hz: a parabola with limited slopes misses little.
    assert filled == pytest.approx(sine(aligned.time[105:110], 0.5), abs=2e-3)
    edges = aligned.inputs[0].values[[104, 110]]
    assert edges.min() <= filled.min()
    assert filled.max() <= edges.max()


def test_a_held_input_is_held_through_a_gap():
    time = np.delete(np.arange(20) / 10, [7, 8])
    u = np.where(time < 0.65, 1.0, 5.0)
    record = Record.from_arrays({"u": u}, {"y": u}, time=time, intersample="zoh")
    assert uniform(record).inputs[0].values[6:10].tolist() == [1, 1, 1, 5]


@pytest.mark.parametrize(("f", "inside", "near_ends"), [(20.0, 6e-5, 5e-4), (40.0, 9e-4, 7e-3)])
def test_jitter_is_interpolated_to_the_stated_accuracy(f, inside, near_ends):
    rng = np.random.default_rng(0)
    time = (np.arange(4000) + 0.3 * rng.uniform(-1, 1, 4000)) / 200
    aligned = uniform(record_at(time, f=f))
    assert [f.code for f in aligned.findings] == ["jitter"]
    error = aligned.outputs[0].values / 2 - sine(aligned.time, f)
    # As the docstring says; the jitter is random.
    assert np.sqrt(np.mean(error[40:-40] ** 2)) < 1.2 * inside
    ends = np.append(error[2:40], error[-40:-2])
    assert np.sqrt(np.mean(ends**2)) < 1.5 * near_ends
    # Without interpolation the jitter alone would err a hundred times as much.
    assert np.std(sine(time, f) - sine(aligned.time, f)) > 5e-2


def test_the_noise_of_interpolated_samples_is_doubted_where_it_is_raised():
    """White noise at stamps that jitter: the text states by how much it grows."""
    rng = np.random.default_rng(5)
    for size, doubted in ((0.05, False), (0.3, True)):
        stamps = (np.arange(20_000) + size * rng.uniform(-1, 1, 20_000)) / 200
        noise = rng.standard_normal(stamps.size)
        signals = {"u": sine(stamps, 30.0)}, {"y": 1e3 * sine(stamps, 30.0) + noise}
        aligned = uniform(Record.from_arrays(*signals, time=stamps))
        (finding,) = aligned.findings
        assert finding.parameters == (("noise_std",) if doubted else ())
        left = aligned.outputs[0].values - 1e3 * sine(aligned.time, 30.0)
        raised = float(np.std(left[50:-50])) - 1.0
        said = 4.0 * size**2 / 3
        assert raised == pytest.approx(said, abs=0.02)
        assert (f"by about {100 * said:.0f} %" in finding.message) == doubted


@examples(20)
@given(
    seed=st.integers(0, 2**32 - 1),
    offset=st.floats(-50, 50),
    jitter=st.floats(0.05, 0.35),
    lost=st.sets(st.integers(10, 90), max_size=3),
)
def test_an_offset_of_time_commutes_with_alignment(seed, offset, jitter, lost):
    rng = np.random.default_rng(seed)
    keep = np.setdiff1d(np.arange(100), list(lost))
    time = (keep + jitter * rng.uniform(-1, 1, keep.size)) / 20
    u, y = rng.normal(size=(2, keep.size))
    here = uniform(Record.from_arrays({"u": u}, {"y": y}, time=time))
    there = uniform(Record.from_arrays({"u": u}, {"y": y}, time=time + offset))
    assert np.allclose(there.time - offset, here.time, rtol=0, atol=1e-9)
    for a, b in zip((*here.inputs, *here.outputs), (*there.inputs, *there.outputs), strict=True):
        assert np.array_equal(a.valid, b.valid)
        # A gap's filling moves with the slopes at its edges, which rounding of time disturbs.
        assert np.allclose(a.values, b.values, rtol=0, atol=1e-6)


@examples(12)
@given(order=st.permutations(["a", "b", "c"]), seed=st.integers(0, 2**32 - 1))
def test_the_order_of_channels_does_not_matter(order, seed):
    rng = np.random.default_rng(seed)
    time = (np.arange(60) + 0.2 * rng.uniform(-1, 1, 60)) / 10
    values = {name: rng.normal(size=60) for name in "abc"}
    y = rng.normal(size=60)
    one = uniform(Record.from_arrays(values, {"y": y}, time=time))
    two = uniform(Record.from_arrays({k: values[k] for k in order}, {"y": y}, time=time))
    for name in "abcy":
        assert np.array_equal(one.signal(name).values, two.signal(name).values)


def two_clocks(t_u, t_y, f=1.0, **options):
    return Record(
        inputs=(Channel(name="u", time=t_u, values=sine(np.asarray(t_u), f)),),
        outputs=(Channel(name="y", time=t_y, values=sine(np.asarray(t_y), f)),),
        fs=100.0,
        **options,
    )


def test_other_clocks_are_brought_onto_that_of_the_output():
    aligned = uniform(two_clocks(np.arange(0, 8.99, 0.004) + 0.0013, np.arange(200, 1200) / 100))
    assert aligned.fs == 100.0
    assert aligned.inputs[0].values == pytest.approx(sine(aligned.time), abs=1e-7)
    assert np.array_equal(aligned.outputs[0].values, sine(np.arange(200, 1200) / 100)[:699])
    assert np.allclose(aligned.time, np.arange(200, 899) / 100, rtol=0, atol=1e-12)
    assert [f.code for f in aligned.findings] == ["resampled"]


def test_a_clock_that_ticks_at_the_same_instants_costs_no_interpolation():
    record = two_clocks(np.arange(0, 1200) / 100, np.arange(200, 1400) / 100)
    aligned = uniform(record)
    assert np.array_equal(aligned.inputs[0].values, record.inputs[0].values[200:])
    assert np.array_equal(aligned.outputs[0].values, record.outputs[0].values[:1000])


def test_a_gap_in_a_clock_of_its_own_is_masked_there_only():
    t_u = np.delete(np.arange(0, 5, 0.003), np.s_[300:340])  # 0.900 s to 1.017 s
    aligned = uniform(two_clocks(t_u, np.arange(500) / 100))
    inside = (aligned.time > 0.8985) & (aligned.time < 1.0185)
    assert np.array_equal(~aligned.inputs[0].valid, inside)
    assert aligned.outputs[0].valid.all()
    assert "of 'u' are missing" in aligned.findings[0].message


def held_at(t_u, t_y, intersample):
    """A sweep that is held or joined between its samples, and any output."""
    u = Channel(name="u", time=t_u, values=sine(np.asarray(t_u), 2.0))
    y = Channel(name="y", time=t_y, values=np.zeros(np.asarray(t_y).size))
    return Record(inputs=(u,), outputs=(y,), fs=100.0, intersample=intersample)


@pytest.mark.parametrize("intersample", ["zoh", "foh"])
@pytest.mark.parametrize("beside", [0.002, 0.0075])
def test_of_an_input_that_changes_beside_the_samples_comes_what_lies_below_half_the_rate(
    intersample, beside
):
    """A hold delays by half an interval and by its sinc lessens; joining lessens by its square."""
    aligned = uniform(held_at(np.arange(400) / 100 + beside, np.arange(400) / 100, intersample))
    lessened = np.sinc(0.02) ** (1 if intersample == "zoh" else 2)
    late = 0.005 if intersample == "zoh" else 0.0
    inner = slice(50, -50)
    expected = lessened * sine(aligned.time - late, 2.0)
    assert np.abs(aligned.inputs[0].values - expected)[inner].max() < 1e-3
    assert aligned.intersample == "bandlimited"
    (doubt,) = [f for f in aligned.findings if f.severity == "doubt"]
    assert (doubt.code, doubt.parameters[0]) == ("held_between", "delay")


def test_a_hold_whose_steps_are_samples_of_the_output_is_left_as_it_is():
    """At half the rate, from the same instant on: each value twice, and nothing is doubtful."""
    record = held_at(np.arange(200) / 50, np.arange(398) / 100, "zoh")
    aligned = uniform(record)
    twice = np.repeat(record.inputs[0].values, 2)[:398]
    assert aligned.inputs[0].values == pytest.approx(twice, abs=1e-9)
    assert aligned.intersample == "zoh"
    assert not [f for f in aligned.findings if f.severity == "doubt"]


def test_clocks_that_never_meet_are_refused():
    with pytest.raises(RecordError, match="share no span of time: the latest starts at 20 s"):
        uniform(two_clocks(np.arange(100) / 100, 20 + np.arange(100) / 100))


def test_an_unknown_signal_lists_those_there():
    aligned = uniform(record_at(np.arange(10.0)))
    with pytest.raises(RecordError, match="no channel 'z'; the record has u, y"):
        aligned.signal("z")


def test_a_stamp_far_from_all_others_is_left_out_and_said():
    """One damaged stamp is no second recording and no gap of a thousand years."""
    time = np.arange(400) / 100.0
    time[200] = 1e12
    mended = mend([Series(name="y", values=np.sin(np.arange(400.0)), time=time)])
    assert mended.channels[0].time.size == 399
    assert [f.code for f in mended.findings] == ["stray_stamps"]
    assert restarts(time).size == 0


def test_a_clock_that_was_set_is_refused_with_its_place():
    time = np.arange(400) / 100.0
    time[300:] += 1e9
    with pytest.raises(RecordError, match=r"time of 'y' jumps by 1e\+09 s after sample 299"):
        mend([Series(name="y", values=np.sin(np.arange(400.0)), time=time)])


def test_samples_caught_up_in_a_burst_bend_no_curve():
    """After a stall a machine reads several samples at nearly one instant, each with its noise."""
    rng = np.random.default_rng(0)
    time = np.arange(1000) / 200.0
    time[400:417] = time[417] + 1e-5 * np.arange(-17, 0)
    y = np.sin(2 * np.pi * time) + 0.01 * rng.standard_normal(time.size)
    record = Record.from_arrays({"u": np.sin(2 * np.pi * time)}, {"y": y}, time=time)
    aligned = uniform(record)
    (found,) = aligned.outputs
    error = (found.values - np.sin(2 * np.pi * aligned.time))[found.valid]
    assert np.max(np.abs(error)) < 0.06
