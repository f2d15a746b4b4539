"""A base motion under a stimulus: the sum keeps the limits, and between turns never turns back."""

import math

import numpy as np
import pytest

from hmpim.errors import ArgumentError, LimitsError
from hmpim.formats.stimulus_spec import stimuli_from_toml, stimulus_to_toml
from hmpim.stimulus import Limits, Shuttle, check_inside, design, left_early, true_peaks

LIMITS = Limits(position=45, velocity=200, acceleration=700, jerk=5e5, unit="deg")
WISH = {"band": (0.5, 40.0), "duration": 10.0, "fs": 500.0, "limits": LIMITS, "base": "auto"}


@pytest.fixture(scope="module")
def stimulus():
    return design(**WISH)


def test_each_derivative_is_that_of_the_one_before():
    base, h = Shuttle(speed=30.0, duration=9.0, turns=5, turning=0.6), 1e-5
    t = np.linspace(0.001, 8.999, 3001)
    t = t[np.abs(t[:, None] - np.array(base.breaks)).min(axis=1) > 3 * h]
    before, at, after = (base.motion(t + d) for d in (-h, 0.0, h))
    for name, by in (
        ("position", "velocity"),
        ("velocity", "acceleration"),
        ("acceleration", "jerk"),
    ):
        slope = (getattr(after, name) - getattr(before, name)) / (2 * h)
        assert np.abs(slope - getattr(at, by)).max() < 1e-5 * np.abs(slope).max(), by


def test_a_turn_takes_what_the_formulas_say():
    base = Shuttle(speed=30.0, duration=9.0, turns=5, turning=0.6)
    peaks = true_peaks(base)
    assert peaks.velocity == pytest.approx(30.0, rel=1e-9)
    assert peaks.acceleration == pytest.approx(15 / 4 * 30.0 / 0.6, rel=1e-6)
    assert peaks.jerk == pytest.approx(20 / math.sqrt(3) * 30.0 / 0.6**2, rel=1e-6)
    assert peaks.position < 30.0 * base.between / 2
    ends = base.motion(np.array([0.0, 9.0, 20.0]))
    assert not ends.position.any()
    assert not ends.velocity.any()


def test_the_sum_keeps_the_limits_and_the_sign_of_its_velocity_between_turns(stimulus):
    assert LIMITS.use(stimulus.peaks) <= 1.0
    check_inside(stimulus, LIMITS, whose="it")
    assert stimulus.position[-1] == stimulus.velocity[-1] == stimulus.acceleration[-1] == 0.0
    base = stimulus.waveform.base
    speed = base.motion(stimulus.time).velocity
    full = np.abs(speed) > (1 - 1e-9) * base.speed
    assert full.mean() > 0.3
    assert np.all(np.sign(stimulus.velocity[full]) == np.sign(speed[full]))
    without = design(**{**WISH, "base": None, "limits": Limits(position=2, acceleration=700)})
    turns = [
        np.count_nonzero(np.diff(np.sign(v[v != 0]))) for v in (stimulus.velocity, without.velocity)
    ]
    assert turns[0] < 0.25 * turns[1]


def test_what_excites_is_still_the_sweep(stimulus):
    assert stimulus.band == (0.5, 40.0)
    assert stimulus.extinction == 2.0
    assert stimulus.gain is not None
    assert 0.0 < stimulus.sweep_start < stimulus.duration


def test_it_is_saved_and_read_back_and_can_be_left_early(stimulus):
    [again] = stimuli_from_toml(stimulus_to_toml(stimulus), name="s")
    assert again == stimulus
    short = left_early(stimulus, after=2000)
    assert short.samples < stimulus.samples
    check_inside(short, LIMITS, whose="it")


@pytest.mark.parametrize(
    ("changed", "error", "words"),
    [
        ({"limits": Limits(position=45)}, LimitsError, "needs a finite travel and acceleration"),
        ({"lead": 0}, ArgumentError, "a base starts at rest"),
        ({"base": "slow"}, ArgumentError, "base = 'slow'"),
    ],
)
def test_what_leaves_no_base_is_refused(changed, error, words):
    with pytest.raises(error, match=words):
        design(**{**WISH, **changed})


def test_turns_that_do_not_fit_are_refused():
    with pytest.raises(ArgumentError, match="turns = 2 must be odd"):
        Shuttle(speed=1.0, duration=4.0, turns=2, turning=0.5)
    with pytest.raises(ArgumentError, match="turning = 2 s is more than"):
        Shuttle(speed=1.0, duration=4.0, turns=3, turning=2.0)
