"""The estimate so far: right as soon as it claims anything, and doubtful where it cannot know."""

import pickle

import numpy as np
import pytest

import hmpim
from hmpim import HmpimError, LiveEstimator
from hmpim.errors import ArgumentError
from hmpim.identify.fitting.fit import fit_structure
from hmpim.identify.fitting.rows import Part
from hmpim.identify.statistics.fit import Compressed, pulse
from hmpim.identify.statistics.live import only_told
from hmpim.identify.statistics.products import Products
from hmpim.model.dynamics import STRUCTURES
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


def test_a_settled_look_is_the_whole_fit_of_what_was_read():
    u, y = answered(10.0, 2)
    live = LiveEstimator(STIMULUS)
    source = pulse(live.statistics.reach, "bandlimited")
    compared = 0
    for first in range(0, u.size, 10):
        look = live.update(u[first : first + 10], y[first : first + 10])
        if look is None or look.time < 1.0 or first % 20:
            continue
        structure = STRUCTURES["second_order"]
        problem = Compressed.of(Products(live.statistics, skipped=0), source)
        start = np.array([30.0, np.log(3.0), 1.5])
        whole = fit_structure(problem, structure, start, precision=1e-10)
        std = np.sqrt(np.diag(whole.covariance))
        zeta = 0.5 / np.sqrt(whole.theta[2])
        hertz = 2.0 * zeta * np.exp(-whole.theta[1]) * FS / (2.0 * np.pi)
        found = look.parameters
        for here, there in (
            (found.delay, whole.delay / FS),
            (found.natural_frequency, hertz),
            (found.damping_ratio, zeta),
            (found.scale_factor, whole.linear[0]),
            (found.bias, whole.linear[-1]),
        ):
            assert abs(here.value - there) < 0.05 * here.std
        assert found.delay.std == pytest.approx(std[0] / FS, rel=0.02)
        compared += 1
    assert compared == 15


def test_no_look_evaluates_the_model_more_than_a_few_times(monkeypatch):
    u, y = answered(10.0, 1)
    made = []
    inner = Part.__init__
    monkeypatch.setattr(
        Part, "__init__", lambda self, *given: (made.append(1), inner(self, *given))[1]
    )
    live, counts, sizes = LiveEstimator(STIMULUS), [], []
    for first in range(0, u.size, 10):
        made.clear()
        live.update(u[first : first + 10], y[first : first + 10])
        counts.append(len(made))
        sizes.append(live.statistics.nbytes)
    ordinary = [count for count in counts if count <= 4]
    begins = [count for count in counts if count > 4]
    assert 1 <= len(begins) <= 5  # new starts
    assert max(begins) < 70
    assert np.median(ordinary[-20:]) == 1
    assert len(set(sizes)) == 1


def test_lags_that_a_run_has_not_lasted_tell_nothing():
    u, y = answered(10.0, 3, seconds=0.6)
    live = LiveEstimator(STIMULUS)
    live.read(u, y)
    whole, structure = live.statistics, STRUCTURES["second_order"]
    short = only_told(whole)
    assert (short.lags, whole.lags) == (u.size, 200)
    costs = []
    for statistics in (whole, short):
        source = pulse(statistics.reach, "bandlimited")
        problem = Compressed.of(Products(statistics, skipped=0), source)
        fitted = fit_structure(problem, structure, np.array([28.0, 1.0, 2.0]))
        costs.append((fitted.objective, *fitted.theta, *np.diag(fitted.covariance)))
    assert costs[1] == pytest.approx(costs[0], rel=1e-5)


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


def test_an_estimate_so_far_goes_on_in_another_process():
    """The workbench looks in a process of its own, and takes the estimator back."""
    u, y = answered(10.0, 1)
    here, there = LiveEstimator(STIMULUS), LiveEstimator(STIMULUS)
    for first in range(0, u.size, 50):
        block = slice(first, first + 50)
        one, other = here.update(u[block], y[block]), there.update(u[block], y[block])
        there = pickle.loads(pickle.dumps(there))
    assert one.parameters.delay.value == pytest.approx(other.parameters.delay.value, abs=1e-9)


@pytest.mark.filterwarnings("error")
def test_samples_come_one_at_a_time_or_in_pairs_that_match():
    u, y = answered(10.0, 3)
    live = LiveEstimator(STIMULUS)
    with pytest.raises(ArgumentError, match="u has 0 samples and y 2"):
        live.update([], y[:2])
    assert live.update([], []) is None
    for one, other in zip(u[:200], y[:200], strict=True):
        live.update([one], [other])
    last = live.update(u[200:], y[200:])
    assert last.parameters.delay.value == pytest.approx(0.15, abs=4 * last.parameters.delay.std)
