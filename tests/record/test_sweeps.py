"""Sweeps in a log: found where they are, cut so that nothing is lost and repeats lie alike."""

from itertools import pairwise

import numpy as np
import pytest

from hmpim.errors import RecordError
from hmpim.record import Channel, find_motions
from hmpim.record.sweeps import cut_alike

FS = 200.0


def rising(duration=10.0, low=0.2, high=20.0):
    t = np.arange(round(duration * FS)) / FS
    edge = np.clip(np.minimum(t, duration - t) * 4, 0, 1)
    return edge * np.sin(2 * np.pi * (low * t + (high - low) / (2 * duration) * t**2))


def rest(duration):
    return np.zeros(round(duration * FS))


def log(*parts, noise=0.0, bias=0.0, seed=0):
    values = np.concatenate(parts) + bias
    values = values + noise * np.random.default_rng(seed).standard_normal(values.size)
    return Channel(name="u", time=np.arange(values.size) / FS, values=values)


# Two sweeps, a step between them, and a long wait: where each begins and ends.
PARTS = (rest(3.5), rising(), rest(3), rising()[::-1], rest(2), np.ones(400), rest(40))
BEGIN = (3.5, 16.5, 28.5)
END = (13.5, 26.5, 30.5)


@pytest.mark.parametrize("bias", [0.0, -7.0])
@pytest.mark.parametrize("noise", [0.0, 0.003, 0.03])
def test_motions_are_found_between_rests(noise, bias):
    found = find_motions(log(*PARTS, noise=noise, bias=bias))
    assert [m.kind for m in found] == ["sweep", "sweep", "other"]
    assert [m.rising for m in found] == [True, False, None]
    for motion, begin, end in zip(found, BEGIN, END, strict=True):
        # Softly started and ended sweeps hide in the noise for a while.
        assert begin - 0.1 < motion.begin < begin + 0.5
        assert end - 0.5 < motion.end < end + 0.1
        assert motion.start < begin - 0.4
        assert motion.stop > end + 0.4
    for one, next_one in pairwise(found):
        assert one.stop <= next_one.start + 1 / FS
    for motion in found[:2]:
        assert motion.low == pytest.approx(0.2, abs=0.1)  # told before its first period is over
        assert motion.high == pytest.approx(20.0, rel=0.1)


def test_a_wait_of_an_hour_is_left_out():
    motions = find_motions(log(rest(60), rising(), rest(600)))
    (sweep,) = motions
    assert sweep.start > 50
    assert sweep.stop < 80


@pytest.mark.parametrize("seed", range(20))
def test_noise_and_constants_hold_no_sweep(seed):
    noise = np.random.default_rng(seed).standard_normal(4000)
    assert [m.kind for m in find_motions(log(noise))] == ["other"]
    assert find_motions(log(np.full(500, 3.0))) == ()
    # Several tones, and a sine of one frequency, are no sweep either.
    t = np.arange(4000) / FS
    assert [m.kind for m in find_motions(log(np.sin(2 * np.pi * 3 * t + seed)))] == ["other"]


def test_a_sweep_without_any_rest_is_one():
    t = np.arange(2400) / FS
    (motion,) = find_motions(log(3.0 + np.sin(2 * np.pi * (0.2 * t + 0.5 * t**2))))
    assert (motion.kind, motion.rising) == ("sweep", True)
    assert (motion.begin, motion.end) == (0.0, 2399 / FS)


def test_a_slow_turning_point_is_no_rest():
    (motion,) = find_motions(log(rest(2), rising(duration=60, low=0.05, high=5), rest(2)))
    assert motion.begin == pytest.approx(2.0, abs=0.5)
    assert motion.end == pytest.approx(62.0, abs=0.5)


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_repeats_are_cut_to_lie_over_each_other(noise):
    one = rising()
    u = log(rest(2.005), one, rest(3.37), 0.5 * one, rest(1.115), one, rest(2), noise=noise)
    spans = cut_alike(u, find_motions(u))
    cuts = [u.values[(u.time >= a) & (u.time < b)] for a, b in spans]
    assert len({c.size for c in cuts}) == 1
    assert np.abs(cuts[0] - cuts[2]).max() < 8 * noise + 1e-12
    assert np.abs(cuts[0] - 2 * cuts[1]).max() < 16 * noise + 1e-12
    assert cuts[0].size > one.size + 0.5 * 1.1 * FS  # with half of the shortest rest


def test_another_sweep_keeps_its_own_span():
    u = log(rest(2), rising(), rest(3), rising(high=8.0), rest(2))
    motions = find_motions(u)
    spans = cut_alike(u, motions)
    assert spans[1] == (motions[1].start, motions[1].stop)


def test_a_first_stamp_that_is_damaged_is_no_clock():
    """Seen in a damaged log of three samples: half of both intervals is the jump itself."""
    channel = Channel(name="u", time=[-8.2e12, 0.0, 0.005], values=[0.0, 0.5, 0.4])
    with pytest.raises(RecordError, match=r"jumps by 8.2e\+12 s after sample 0.*0.005 s apart"):
        find_motions(channel)
