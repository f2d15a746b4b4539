"""Even samples whose stamps jitter: which of two clocks the samples were taken by."""

from dataclasses import replace

import numpy as np
import pytest

import hmpim
from hmpim.record import Record, Series, inspect_record, rate_of, uniform
from hmpim.record.mend import mend

FS, N = 200.0, 2000
TAKEN = np.arange(N) / FS


def motion(t, *, late=0.0):
    """A sweep from 0.2 Hz to 12 Hz, at any instants."""
    t = np.maximum(t - late, 0.0)
    return np.sin(2 * np.pi * (0.2 * t + 0.59 * t**2))


def record_at(taken, stamps, *, noise=0.01, seed=0, kept=slice(None)):
    """Taken at some instants and stamped at others."""
    y = motion(taken, late=0.05) + noise * np.random.default_rng(seed).standard_normal(taken.size)
    return Record.from_arrays({"u": motion(taken)[kept]}, {"y": y[kept]}, time=stamps[kept], fs=FS)


def strayed(size, seed=1):
    """Stamps that stray by so many intervals, in order."""
    return np.sort(TAKEN + size / FS * np.random.default_rng(seed).standard_normal(N))


def in_packets(size):
    """Stamps of a logger that reads a few samples at a time."""
    return np.ceil((np.arange(N) + 1) / size) * size / FS + 2e-5 * (np.arange(N) % size)


def stalled(seconds):
    """Stamps of a computer that stands still now and then, and catches up at once."""
    stamps = TAKEN.copy()
    for k in range(150, N, 200):
        behind = (stamps >= TAKEN[k]) & (stamps < TAKEN[k] + seconds)
        stamps[behind] = TAKEN[k] + seconds + 1e-5 * np.arange(np.count_nonzero(behind))
    return np.maximum.accumulate(stamps) + 1e-9 * np.arange(N)


@pytest.mark.parametrize(
    "stamps",
    [strayed(0.05), strayed(0.3), strayed(1.0), in_packets(10), stalled(0.2)],
    ids=["a little", "much", "out of order", "packets", "stalls"],
)
def test_even_samples_are_kept_as_they_are(stamps):
    record = record_at(TAKEN, stamps)
    aligned = uniform(record)
    assert [f.code for f in aligned.findings] == ["even_samples"]
    assert [f.code for f in inspect_record(record)] == ["even_samples"]
    assert aligned.fs == FS
    assert np.array_equal(aligned.outputs[0].values, record.outputs[0].values)
    assert aligned.outputs[0].valid.all()


@pytest.mark.parametrize("size", [0.05, 0.3])
def test_samples_that_were_taken_when_their_stamps_say_are_moved(size):
    stamps = strayed(size)
    aligned = uniform(record_at(stamps, stamps, noise=0.0))
    assert "jitter" in [f.code for f in aligned.findings]
    error = aligned.inputs[0].values - motion(aligned.time)
    assert np.std(error[5:-5]) < 0.1 * np.std(motion(stamps) - motion(TAKEN))


@pytest.mark.parametrize("stamps", [strayed(0.3), strayed(1.0), in_packets(10)])
def test_a_pause_is_counted_from_all_stamps_after_it(stamps):
    kept = np.ones(N, dtype=bool)
    kept[900:1000] = False
    aligned = uniform(record_at(TAKEN, stamps, kept=kept))
    assert aligned.samples == N
    assert np.flatnonzero(~aligned.outputs[0].valid).tolist() == list(range(900, 1000))


def test_signals_that_say_nothing_leave_the_stamps():
    """White noise is as smooth at one clock as at the other; a chance of 1 in 30 000 each."""
    for seed in range(60):
        rng = np.random.default_rng(seed)
        u, y = rng.standard_normal((2, 400))
        size = float(rng.choice([0.05, 0.3, 1.0]))
        stamps = np.sort(np.arange(400) + size * rng.standard_normal(400)) / FS
        record = Record.from_arrays({"u": u}, {"y": y}, time=stamps, fs=FS)
        assert "even_samples" not in [f.code for f in uniform(record).findings], seed


def test_channels_with_stamps_of_their_own_keep_them():
    """Their mean lateness may differ, and would be a delay that no interval allows for."""
    record = record_at(TAKEN, strayed(0.2))
    y = replace(record.outputs[0], time=strayed(0.2, seed=2))
    assert "even_samples" not in [f.code for f in uniform(replace(record, outputs=(y,))).findings]


def test_figures_are_those_of_even_stamps():
    stamped = hmpim.identify(record_at(TAKEN, strayed(0.3)))["y", "u"]
    even = hmpim.identify(record_at(TAKEN, TAKEN))["y", "u"]
    assert stamped.delay.verdict == even.delay.verdict == "ok"
    assert stamped.delay.value == pytest.approx(even.delay.value, rel=1e-6)
    assert stamped.noise_std.value == pytest.approx(even.noise_std.value, rel=1e-6)


def test_samples_that_share_the_stamp_of_their_packet_are_all_used():
    """A logger that reads ten lines at a time, now and then late, and prints milliseconds."""
    rng = np.random.default_rng(3)
    stamps = np.ceil((np.arange(N) + 1) / 10) * 10 / FS
    stamps = np.round(stamps + np.repeat(rng.exponential(0.004, N // 10), 10), 3)
    signals = {"u": motion(TAKEN), "y": motion(TAKEN, late=0.05)}
    mended = mend([Series(name=k, values=v, time=stamps) for k, v in signals.items()])
    assert "arrive in packets" in mended.findings[0].message
    u, y = mended.channels
    aligned = uniform(Record(inputs=(u,), outputs=(y,), fs=rate_of(u.time)))
    assert [f.code for f in aligned.findings] == ["even_samples"]
    assert aligned.samples == N
    assert aligned.fs == pytest.approx(FS, rel=1e-3)


def test_the_rate_of_packets_is_that_of_all_samples():
    assert rate_of(in_packets(10)) == pytest.approx(FS, rel=0.01)
    assert rate_of(TAKEN) == pytest.approx(FS, rel=1e-12)


def test_losses_that_cannot_be_counted_leave_the_stamps():
    """One sample in fifty is lost, and stamps jitter: no clock holds all, so no rate is claimed."""
    kept = np.random.default_rng(2).random(N) > 0.02
    aligned = uniform(record_at(TAKEN, strayed(1.0), kept=kept))
    assert "even_samples" not in [f.code for f in aligned.findings]


def test_losses_move_no_rate_that_is_read_off_stamps():
    kept = np.random.default_rng(2).random(N) > 0.05
    assert rate_of(strayed(0.05)[kept]) == pytest.approx(FS, rel=1e-4)


def test_a_long_pause_of_a_good_clock_is_none_of_jitter():
    stamps = np.append(TAKEN, TAKEN + 40.0) + 1e-6 * np.random.default_rng(1).random(2 * N)
    u = motion(np.append(TAKEN, TAKEN))
    aligned = uniform(Record.from_arrays({"u": u}, {"y": u}, time=stamps, fs=FS))
    assert [f.code for f in aligned.findings] == ["gaps"]
