"""Section V's stimuli for five axes: Fig. 4's limits, Fig. 18's levels, 6 dB between rates."""

import math

import numpy as np
import pytest

from hmpim.stimulus import FIG_4, section_v


@pytest.fixture(scope="module")
def both():
    return {fs: section_v(fs=fs) for fs in (500.0, 1000.0)}


def levels(stimulus, frequencies):
    """20 log10 |DFT| with the Gaussian window (15), α = 1.5, written out."""
    N = stimulus.samples
    window = np.exp(-0.5 * (1.5 * (np.arange(N) - (N - 1) / 2) / (N / 2)) ** 2)
    kernel = np.exp(-2j * math.pi * np.outer(frequencies, stimulus.time))
    return 20 * np.log10(np.abs(kernel @ (window * stimulus.position)))


@pytest.mark.parametrize("axis", FIG_4)
@pytest.mark.parametrize("fs", [500.0, 1000.0])
def test_inside_fig_4_and_at_rest_at_both_ends(both, axis, fs):
    stimulus = both[fs][axis]
    assert stimulus.axis == axis
    assert FIG_4[axis].use(stimulus.peaks) <= 1.0
    fine = stimulus.motion(np.arange(16 * stimulus.samples) / (16 * fs))
    for name in ("position", "velocity", "acceleration"):
        assert np.abs(getattr(fine, name)).max() <= getattr(FIG_4[axis], name)
        assert getattr(stimulus, name)[0] == getattr(stimulus, name)[-1] == 0.0


def test_outer_axes_are_gentler_and_severely_extinguished(both):
    for axis in ("azimuth", "elevation"):
        stimulus = both[500.0][axis]
        assert stimulus.band == (0.1, 20.0)
        assert stimulus.limits.velocity < FIG_4[axis].velocity
        assert stimulus.peaks.acceleration < 0.96 * FIG_4[axis].acceleration
        assert stimulus.extinction > 1.5 > both[500.0]["roll"].extinction


@pytest.mark.parametrize("axis", FIG_4)
def test_levels_up_to_10_hz_and_6_db_between_the_rates(both, axis):
    frequencies = np.arange(0.1, 10.001, 0.1)
    slow, fast = (levels(both[fs][axis], frequencies) for fs in (500.0, 1000.0))
    assert slow.min() > 30.0
    assert fast - slow == pytest.approx(np.full(slow.size, 20 * math.log10(2)), abs=0.05)
