"""Regularity of a run: measured exactly, told always, doubted where it does harm."""

import numpy as np
import pytest

from hmpim.experiment import ManualClock, RunLog, RunOptions, measure_timing, run
from hmpim.experiment.timing import TOO_IRREGULAR, judge_timing
from hmpim.identify import identify
from hmpim.stimulus import Limits, design

FS = 500.0
LIMITS = Limits(position=5, velocity=300, acceleration=9000, unit="deg")
SWEEP = design(band=(0.2, 20), duration=6, fs=FS, limits=LIMITS)


class Follower:
    """A rig with a lag of 20 ms that takes a command when it comes; its sensor has some noise."""

    name, axes, limits, moves, watchdog = "follower", (), LIMITS, True, 0.1

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def prepare(self, stimulus):
        self.angle, self.held, self.since = 0.0, 0.0, 0.0
        self.noise = np.random.default_rng(3)

    def play(self, block):
        read = []
        for k in block.due():
            now = block.pace.now()
            self.angle += (1 - np.exp((self.since - now) / 0.02)) * (self.held - self.angle)
            self.held, self.since = block.position[k, 0], now
            read.append(self.angle)
        return np.array(read) + self.noise.normal(scale=0.05, size=len(read))

    def stop(self):
        pass


def played(late, log=None):
    return run(Follower(), SWEEP, log=log, options=RunOptions(clock=ManualClock(late=late)))


def test_jitter_and_missed_periods_are_measured():
    rng = np.random.default_rng(0)
    due = np.arange(10_000) / 1000
    late = rng.uniform(0, 2e-4, due.size)
    late[4000:4003] = 2.5e-3
    timing = measure_timing(due + late, fs=1000.0)
    assert timing.missed == 3
    assert timing.worst == pytest.approx(2.4e-3, rel=0.01)
    assert timing.median == pytest.approx(5e-5, rel=0.05)
    assert timing.most == pytest.approx(1e-4, rel=0.05)
    assert timing.within_half == pytest.approx(1 - 2 / 9999)
    assert timing.std == pytest.approx(np.std(late))


def test_a_regular_run_says_so_without_a_doubt():
    record = played(np.zeros(1))
    (timing,) = [f for f in record.findings if f.code == "timing"]
    assert timing.severity == "info"
    assert f"0 of {SWEEP.samples} commands were a period or more late" in timing.message


@pytest.mark.parametrize("times", [0.7, 1.5])
def test_irregular_sending_is_doubted_from_the_stated_share_on(times):
    rng = np.random.default_rng(1)
    std = times * TOO_IRREGULAR / (2 * np.pi * 20)
    late = np.abs(rng.normal(size=SWEEP.samples))
    record = played(late * std / np.std(late))
    (timing,) = [f for f in record.findings if f.code == "timing"]
    assert timing.severity == ("doubt" if times > 1 else "info")
    pair = identify(record)["y", "u"]
    assert (pair.verdict == "doubtful") == (times > 1)


def test_commands_and_samples_are_stamped_when_they_went():
    """So that what is found hardly suffers, even though the verdict doubts it."""
    late = np.abs(np.random.default_rng(2).normal(scale=5e-4, size=SWEEP.samples))
    record = played(late)
    command = record.inputs[0]
    assert np.allclose(
        command.time - SWEEP.time, np.maximum.accumulate(SWEEP.time + late) - SWEEP.time, atol=2e-3
    )
    assert np.std(command.time - SWEEP.time) > 2e-4
    found = identify(record)["y", "u"].parameters.time_constant
    assert found.value == pytest.approx(0.02, rel=0.01)


def test_a_run_that_is_far_too_late_is_said_in_figures_that_can_be_read():
    timing = measure_timing(np.arange(1000) / FS + np.linspace(0.0, 4.0, 1000), fs=FS)
    (finding,) = judge_timing(timing, band=(0.2, 60.0), stamped=False)
    assert "cause an error of 100 % and more there" in finding.message
    assert "worst: 2 s" in finding.message
    assert "e+" not in finding.message


def test_the_log_says_how_the_run_was_scheduled_and_timed():
    log = RunLog()
    played(np.zeros(1), log=log)
    notes = [event.message for event in log.events if event.kind == "note"]
    assert "scheduling" in notes[0]
    assert notes[1].startswith("Commands were sent within 0 ms of their due time")
