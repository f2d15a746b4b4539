"""The estimate so far: right as soon as it claims anything, and doubtful where it cannot know."""

import numpy as np
import pytest

import hmpim
from hmpim import HmpimError, LiveEstimator
from hmpim.stimulus import Chirp, Stimulus

FS = 200.0
STIMULUS = Stimulus(waveform=Chirp(band=(0.1, 20.0), duration=3.0), fs=FS)


def up_and_down(seconds, sweep=0.6, low=0.1, high=20.0):
    """Short sweeps, one up and one down in turn, in one phase."""
    t = np.arange(round(seconds * FS)) / FS
    turn = np.floor(t / sweep)
    local, rate = t - turn * sweep, (high - low) / sweep
    up = low * local + rate / 2 * local**2
    down = high * local - rate / 2 * local**2
    phase = turn * (low + high) / 2 * sweep + np.where(turn % 2 == 0, up, down)
    return np.sin(2 * np.pi * phase)


def answered(natural_frequency, seed, seconds=2.5):
    u = up_and_down(seconds)
    omega = 2 * np.pi * natural_frequency
    model = hmpim.Model(
        delay=0.15,
        scale_factor=1.0,
        bias=0.6,
        noise_std=0.1,
        denominator=(1 / omega**2, 0.8 / omega, 1.0),
    )
    return u, np.asarray(hmpim.simulate(model, u, fs=FS, intersample="bandlimited", rng=seed))


def looks(u, y, size=25):
    live = LiveEstimator(STIMULUS)
    blocks = np.split(np.arange(u.size), range(size, u.size, size))
    return live, [live.update(u[block], y[block]) for block in blocks]


@pytest.mark.parametrize("seed", [1])
def test_the_estimate_closes_in_and_ends_as_the_whole_record_says(seed):
    u, y = answered(10.0, seed)
    _, seen = looks(u, y)
    assert seen[0] is None
    last = seen[-1]
    assert last.time == 2.5
    assert last.structure == "second_order"
    record = hmpim.Record.from_arrays(
        {"u": u}, {"y": y}, fs=FS, intersample="bandlimited", band=(0.1, 20)
    )
    pair = hmpim.identify(record, structures=["second_order"])["y", "u"]
    for name in ("delay", "natural_frequency", "damping_ratio", "scale_factor", "bias"):
        here, there = getattr(last.parameters, name), getattr(pair, name)
        assert here.verdict == "ok"
        assert abs(here.value - there.value) < 0.1 * there.std, name
        assert here.std == pytest.approx(there.std, rel=0.05), name
    half = seen[len(seen) // 2].parameters.delay
    assert last.parameters.delay.std < half.std


def test_a_mode_beyond_the_band_stays_doubtful():
    u, y = answered(35.0, 1)
    _, seen = looks(u, y)
    claimed = [
        look.parameters.natural_frequency
        for look in seen
        if look is not None and look.parameters.natural_frequency is not None
    ]
    assert all(e.verdict == "doubtful" or e.std > 0.5 for e in claimed)


def test_what_is_no_stimulus_or_no_window_is_refused():
    with pytest.raises(HmpimError, match="stimulus = 3"):
        LiveEstimator(3)
    with pytest.raises(HmpimError, match=r"window = 0\.01 s is 2 samples"):
        LiveEstimator(STIMULUS, window=0.01)
    with pytest.raises(HmpimError, match="u has 2 samples and y 1"):
        LiveEstimator(STIMULUS).update([0.0, 1.0], [0.0])
