"""A motion known by its samples: exact there, smooth between, and played as it was designed."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmpim.errors import ArgumentError, LimitsError
from hmpim.stimulus import Limits, SampledMotion, Stimulus, check_inside, design
from tests_support import examples

LIMITS = Limits(position=10, velocity=300, acceleration=5000, unit="deg")
SWEEP = design(band=(0.1, 20), duration=4, fs=200, limits=LIMITS)


def sampled(stimulus):
    return SampledMotion(
        fs=stimulus.fs,
        position=stimulus.position,
        velocity=stimulus.velocity,
        acceleration=stimulus.acceleration,
        band=stimulus.band,
    )


def test_samples_come_back_bit_for_bit_and_the_limits_it_was_designed_onto_are_kept():
    again = Stimulus(waveform=sampled(SWEEP), fs=SWEEP.fs, unit="deg")
    assert again.samples == SWEEP.samples
    for name in ("position", "velocity", "acceleration"):
        assert getattr(again, name).tobytes() == getattr(SWEEP, name).tobytes()
    check_inside(again, LIMITS, whose="it", samples=again.samples + 100)
    with pytest.raises(LimitsError, match="peak position"):
        check_inside(again, Limits(position=9.9, unit="deg"), whose="it")


@examples(10)
@given(seed=st.integers(0, 10_000), fs=st.floats(0.1, 1e4))
def test_a_polynomial_of_fifth_degree_is_met_everywhere(seed, fs):
    rng = np.random.default_rng(seed)
    p = np.polynomial.Polynomial(rng.standard_normal(6), domain=[0, 20 / fs])
    t = np.arange(21) / fs
    motion = SampledMotion(fs=fs, position=p(t), velocity=p.deriv()(t), acceleration=p.deriv(2)(t))
    at = rng.uniform(0, 20 / fs, 50)
    moved = motion.motion(at)
    for order, name in enumerate(("position", "velocity", "acceleration")):
        truth = p.deriv(order)(at) if order else p(at)
        scale = np.abs(p.deriv(order)(t) if order else p(t)).max()
        assert np.abs(getattr(moved, name) - truth).max() < 1e-6 * scale


def test_between_the_samples_it_follows_the_sweep_and_outside_it_stands():
    motion = sampled(SWEEP)
    fine = np.arange(0, SWEEP.duration - 2 / SWEEP.fs, 1 / 7919)
    gap = motion.motion(fine).position - SWEEP.motion(fine).position
    assert np.abs(gap).max() < 2e-4 * SWEEP.peaks.position  # at ten samples a cycle
    outside = motion.motion(np.array([-3.0, -1e-9, SWEEP.duration, 1e6]))
    assert outside.velocity.tolist() == outside.acceleration.tolist() == [0.0] * 4
    assert outside.position[0] == SWEEP.position[0]
    assert outside.position[-1] == SWEEP.position[-1]


def test_what_is_no_motion_is_refused():
    good = np.zeros(3)
    for wrong, words in (
        ({"velocity": np.zeros(2)}, "have shapes"),
        ({"position": np.array([0.0, np.nan, 0.0])}, "position holds nan at sample 1"),
        ({"fs": 0.0}, "fs = 0"),
    ):
        given = {"fs": 1.0, "position": good, "velocity": good, "acceleration": good, **wrong}
        with pytest.raises(ArgumentError, match=words):
            SampledMotion(**given)
