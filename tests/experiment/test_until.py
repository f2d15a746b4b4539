"""A run ends as soon as enough is known, never before, smoothly, and its intervals hold."""

import math
import threading
from functools import lru_cache

import numpy as np
import pytest
from scipy.signal import lfilter
from stopping import LAYOUT, TRUTH, blocks, errors, sensor

import hmpim
from hmpim import Until
from hmpim.errors import ArgumentError
from hmpim.experiment import ManualClock, RunOptions, until_of
from hmpim.experiment.sure import Sure
from hmpim.identify import Estimate
from hmpim.identify.result import Parameters
from hmpim.record import Stopping
from hmpim.rigs import Samples
from hmpim.rigs.fake import FakeRig
from hmpim.stimulus import Limits, Stimulus, check_inside, design, left_early, passes_band_at
from tests_support import assert_share

LIMITS = Limits(position=1.0, velocity=130.0, acceleration=17000.0, unit="deg")
RULE = Until(delay=4e-4, natural_frequency=0.1)


@lru_cache
def sweeps(duration=6.0):
    return design(
        band=(0.1, 20), duration=duration, fs=200, limits=LIMITS, kind="repeated", sweep=0.6
    )


class Following:
    """Answers each block by a delay and a discrete mode, as a unit that really follows."""

    def __init__(self, seed=0):
        self.rng = np.random.default_rng(seed)
        self.seen = []

    def __call__(self, block):
        for _ in block.due():
            pass
        self.seen += block.position[:, 0].tolist()
        w, z = 2 * math.pi * 10.0 / 200.0, 0.4
        pole = math.exp(-z * w)
        a = [1.0, -2 * pole * math.cos(w * math.sqrt(1 - z * z)), pole * pole]
        y = lfilter([sum(a)], a, np.concatenate((np.zeros(30), self.seen)))[: len(self.seen)]
        y = y[-len(block) :] + 0.6 + 0.1 * self.rng.standard_normal(len(block))
        columns = {"u": block.position[:, 0], "y": y}
        return {name: Samples(time=block.time, values=v) for name, v in columns.items()}


def followed(*, until=RULE, seed=0, clock=True):
    unit = Following(seed)
    rig = FakeRig(answer=unit, moves=True, limits=LIMITS)
    options = RunOptions(clock=ManualClock() if clock else None, realtime=False)
    return hmpim.run(rig, sweeps(), until=until, options=options), unit, rig


# When it ends.


def test_a_run_ends_when_it_is_sure_and_says_so():
    record = hmpim.run(sensor(), sweeps(), rng=1, until=RULE)
    stopping = record.stopping
    assert stopping.rule == "delay=0.0004s,natural_frequency=0.1Hz"
    assert record.duration == pytest.approx(stopping.time)
    assert stopping.saved == pytest.approx(sweeps().samples / 200 - stopping.time)
    assert stopping.time > passes_band_at(sweeps()) + 0.15
    assert stopping.looks >= RULE.looks
    whole = hmpim.run(sensor(), sweeps(), rng=1)
    assert whole.stopping is None
    n = record.samples
    assert np.array_equal(record.outputs[0].values, whole.outputs[0].values[:n])
    pair = hmpim.identify(record)["y", "u"]
    assert pair.delay.std <= 1.1 * RULE.delay
    assert pair.natural_frequency.std <= 1.1 * RULE.natural_frequency
    assert pair.stopping == stopping
    assert pair.to_dict()["stopping"] == stopping.to_dict()


@pytest.mark.parametrize("suffix", [".h5", ".csv"])
def test_that_it_was_sure_is_kept_with_the_record(tmp_path, suffix):
    path = tmp_path / f"r{suffix}"
    record = hmpim.run(sensor(), sweeps(), rng=1, until=RULE, path=path)
    assert hmpim.load(path) == record
    assert hmpim.read(path).stopping == record.stopping
    assert isinstance(record.stopping, Stopping)


@pytest.mark.parametrize("seed", [3])
def test_a_mode_beyond_the_sweep_is_played_to_the_end(seed):
    rig = sensor(natural_frequency=35.0)
    record = hmpim.run(rig, sweeps(2.4), rng=seed, until=RULE)
    assert record.stopping is None
    assert record.samples == sweeps(2.4).samples


def test_a_single_slow_sweep_is_never_left_before_its_band_is_passed():
    slow = design(band=(0.1, 20), duration=2.0, fs=200, limits=LIMITS)
    record = hmpim.run(sensor(), slow, rng=1, until=Until(delay=0.1))
    assert record.stopping is None or record.stopping.time >= passes_band_at(slow) + 0.15


def _lost(time, values):
    return time, np.where(np.abs(time - 1.0) < 1e-9, np.nan, values)


def _doubled(time, values):
    return np.repeat(time, 2), np.repeat(values, 2)


def _swapped(time, values):
    return time[::-1], values[::-1]


@pytest.mark.parametrize("spoilt", [_lost, _doubled, _swapped])
def test_samples_that_a_record_mends_do_not_end_a_run_that_is_looked_at(spoilt):
    class Spoilt:
        name, axes, limits, moves = "spoilt", (), None, False

        def __init__(self):
            self.unit = sensor()

        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

        def seed(self, rng):
            self.unit.seed(rng)

        def prepare(self, stimulus):
            return self.unit.prepare(stimulus)

        def play(self, block):
            reply = self.unit.play(block)
            time, values = spoilt(block.time, np.asarray(reply["y"]))
            return {"u": reply["u"], "y": Samples(time=time, values=values)}

        def stop(self):
            self.unit.stop()

    record = hmpim.run(Spoilt(), sweeps(), rng=1, until=RULE)
    assert record.stopping is not None
    assert len(record.findings) == 1


def test_what_is_doubtful_or_not_there_is_never_enough():
    def known(**given):
        return Estimate(**{"value": 10.0, "std": 0.05, "ci95": None, "unit": "Hz", **given})

    rule = Until(natural_frequency=0.1)
    assert rule.is_met(Parameters(natural_frequency=known()))
    for worse in ({"verdict": "doubtful"}, {"std": 0.11}, {"std": None}, {"std": 0.0}):
        assert not rule.is_met(Parameters(natural_frequency=known(**worse)))
    assert not rule.is_met(Parameters(delay=known()))
    share = Until(natural_frequency=0.01, relative=("natural_frequency",))
    assert share.is_met(Parameters(natural_frequency=known(std=0.099)))
    assert not share.is_met(Parameters(natural_frequency=known(std=0.101)))


# How it ends.


def ends_at_rest_inside(unit, stopping):
    """The commands are the stimulus's own, then lead smoothly to rest inside the limits."""
    sent = np.array(unit.seen)
    after = round(stopping.time * 200)
    assert np.array_equal(sent[:after], sweeps().position[:after])
    assert sent.size < sweeps().samples
    assert np.all(sent[-50:] == 0.0)
    assert np.abs(sent).max() <= 1.0
    assert np.abs(np.diff(sent)).max() * 200 <= LIMITS.velocity
    bends = np.diff(sent, 2) * 200**2
    assert np.abs(bends).max() <= LIMITS.acceleration
    # No jump of the velocity where it is left: the bend there is no larger than in the sweep.
    assert np.abs(bends[after - 3 : after + 2]).max() <= np.abs(bends[: after - 3]).max()


def test_what_moves_is_led_to_rest_inside_its_limits():
    record, unit, rig = followed()
    ends_at_rest_inside(unit, record.stopping)
    assert rig.told[-2:] == ["stop", "exit"]
    assert record.samples == len(unit.seen)


def test_beside_a_run_in_real_time_nobody_waits_for_a_look():
    rule = Until(delay=2e-3, looks=1)  # soon met: a busy machine takes its time for a look
    record, unit, _ = followed(until=rule, clock=False)
    assert record.stopping is not None
    ends_at_rest_inside(unit, record.stopping)


def test_a_look_that_is_still_going_on_is_waited_for_at_the_end_of_the_process():
    """A daemon thread that is broken off within compiled code aborts the process."""
    go_on, threads = threading.Event(), []

    class Slow(Sure):
        def _looked(self, waiting):
            threads.append(threading.current_thread())
            go_on.wait(10.0)

    looking = Slow(RULE, {"": sweeps()}, {"": LIMITS}, LAYOUT, ahead=0.2)
    looking(next(blocks(sweeps(), sensor(), 0)))
    go_on.set()
    looking._busy.join()
    assert [thread.daemon for thread in threads] == [False]


@pytest.mark.parametrize("after", [3, 60, 137, 300, 555])
def test_any_instant_has_a_way_to_rest(after):
    whole = sweeps()
    short = left_early(whole, after=after)
    assert short.samples < whole.samples
    assert np.array_equal(short.position[:after], whole.position[:after])
    assert short.position[-1] == short.velocity[-1] == short.acceleration[-1] == 0.0
    check_inside(short, LIMITS, whose="it")
    assert math.isfinite(short.peaks.jerk)


def test_near_its_end_a_stimulus_is_played_as_it_is():
    whole = sweeps()
    assert left_early(whole, after=whole.samples - 60) is whole


# What is asked.


def test_a_rule_reads_back_as_it_is_printed():
    rule = until_of("delay=0.4ms, natural_frequency=1%,damping_ratio=0.02,bias=0.1")
    assert rule.targets == pytest.approx(
        {"delay": 4e-4, "natural_frequency": 0.01, "damping_ratio": 0.02, "bias": 0.1}
    )
    assert rule.relative == ("natural_frequency",)
    assert until_of(str(rule)) == rule


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "'' is not a target; write one as delay=0.4ms"),
        ("delay", "'delay' is not a target"),
        ("delay=0.4", "delay needs a unit, s for instance"),
        ("delay=0.4Hz", "--until delay: unit 'Hz' cannot be turned into 's'"),
        ("delay=0.4ms,delay=1%", "'delay' is given twice"),
        ("lag=3ms", "'lag' is not known; use one of delay,"),
        ("bias=3deg", "bias is in the channel's own unit: leave 'deg' out"),
        ("damping_ratio=3Hz", "damping_ratio has no unit"),
        ("delay=0ms", "delay = 0.0 must be a positive"),
        ("delay=1.2.3ms", "is not a number"),
    ],
)
def test_what_is_no_rule_is_refused(text, words):
    with pytest.raises(ArgumentError, match=words):
        until_of(text)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, "no target is given"),
        ({"delay": 1e-3, "looks": 0}, "looks = 0 must be 1 or more"),
        ({"delay": 1e-3, "relative": ("bias",)}, "relative = 'bias' is not a target"),
        ({"delay": "1 ms"}, "delay = '1 ms' is not"),
    ],
)
def test_a_rule_of_nothing_is_refused(given, words):
    with pytest.raises(ArgumentError, match=words):
        Until(**given)


def test_a_pair_that_is_not_there_is_refused_before_anything_moves():
    unit = Following()
    rig = FakeRig(answer=unit, moves=True, limits=LIMITS)
    options = RunOptions(clock=ManualClock(), realtime=False)
    with pytest.raises(ArgumentError, match="refers to 'z', but the channels are 'u', 'y'"):
        hmpim.run(rig, sweeps(), until=Until(delay=1e-3, pair=("z", "u")), options=options)
    step = Stimulus(waveform=hmpim.Ramp(duration=1.0, rate=0.1), fs=200.0, unit="deg")
    with pytest.raises(ArgumentError, match="the stimulus has no band"):
        hmpim.run(rig, step, until=RULE, options=options)
    assert unit.seen == []


# Whether it may be believed: the long form is in docs/live.md.


@pytest.mark.few(5)
def test_intervals_hold_where_a_run_was_ended(seeds):
    errors, times = [], []
    for seed in range(seeds):
        record = hmpim.run(sensor(), sweeps(), rng=seed, until=RULE)
        times.append(record.stopping.time)
        errors.append(errors_of(record))
    assert np.median(times) <= 1.6
    assert np.abs(errors).max() < 5.0
    assert_share(np.abs(errors) < 1.96, at_least=0.93)


def errors_of(record):
    """Errors of the live estimate at the stop, in its own standard deviations."""
    live = hmpim.LiveEstimator(sweeps())
    live.read(record.inputs[0].values, record.outputs[0].values)
    found = errors(live.look().parameters)
    assert found.keys() == TRUTH.keys()
    return list(found.values())
