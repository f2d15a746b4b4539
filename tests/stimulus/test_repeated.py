"""Repeated sweeps: every sweep passes the whole band, up and down in one phase, smoothly."""

import math

import numpy as np
import pytest

from hmpim.errors import ArgumentError
from hmpim.formats.stimulus_spec import stimuli_from_toml, stimulus_to_toml
from hmpim.stimulus import Limits, Repeated, design, true_peaks

LIMITS = Limits(position=10, velocity=100, acceleration=4000, jerk=4e5, unit="deg")
WISH = {"band": (0.1, 20.0), "duration": 3.0, "fs": 200.0, "kind": "repeated", "sweep": 0.6}


@pytest.fixture(scope="module")
def stimulus():
    return design(**WISH, limits=LIMITS)


def away_from(breaks, t, h):
    return t[np.abs(t[:, None] - np.array(breaks)).min(axis=1) > 3 * h]


def test_the_frequency_is_the_phase_s_rate_and_turns_at_the_band_s_ends():
    sweeps = Repeated(band=(0.1, 20.0), duration=3.0, sweep=0.6)
    ends = sweeps.frequency(0.6 * np.arange(6))
    assert ends == pytest.approx([0.1, 20.0] * 3, rel=1e-12)
    t = np.linspace(0.0, 3.0, 3001)
    assert sweeps.frequency(t).min() >= 0.1 - 1e-12
    assert sweeps.frequency(t).max() <= 20.0 + 1e-12
    # A sweep makes as many cycles as a linear one: the mean frequency times its length.
    for whole in range(1, 6):
        cycles = whole * 0.6 * 20.1 / 2
        assert sweeps.time_of_phase(2 * math.pi * cycles) == pytest.approx(0.6 * whole, abs=1e-12)


def test_each_derivative_is_that_of_the_one_before(stimulus):
    core, h = stimulus.core, 1e-5
    t = away_from(core.breaks, np.linspace(0.01, 2.99, 4001), h)
    before, at, after = (core.motion(t + d) for d in (-h, 0.0, h))
    for name, by in (
        ("position", "velocity"),
        ("velocity", "acceleration"),
        ("acceleration", "jerk"),
    ):
        slope = (getattr(after, name) - getattr(before, name)) / (2 * h)
        most = np.abs(slope).max()
        assert np.abs(slope - getattr(at, by)).max() < 1e-5 * most, by


def test_up_to_the_acceleration_it_is_continuous_and_inside_its_limits(stimulus):
    assert math.isfinite(true_peaks(stimulus.core).jerk)
    assert LIMITS.use(stimulus.peaks) == pytest.approx(1.0, abs=1e-6)
    assert max(LIMITS.velocity, stimulus.peaks.velocity) == LIMITS.velocity


def test_without_limits_on_its_rates_the_amplitude_is_constant():
    flat = design(**WISH, limits=Limits(position=2.0)).core
    t = np.linspace(0.0, 3.0, 1001)
    assert flat.motion(t).position == pytest.approx(2.0 * np.sin(phase_of(flat, t)), abs=1e-8)


def phase_of(sweeps, t):
    """Integral of the frequency, by Simpson's rule between the samples."""
    fine = np.linspace(0.0, t[-1], 20 * (t.size - 1) + 1)
    f = sweeps.frequency(fine)
    step = fine[1] - fine[0]
    pieces = (f[:-2:2] + 4 * f[1:-1:2] + f[2::2]) * step / 3
    return 2 * math.pi * np.concatenate(([0.0], np.cumsum(pieces)))[::10]


def test_the_lead_is_short_beside_a_sweep(stimulus):
    assert 0.0 < stimulus.sweep_start < 0.2


def test_it_is_saved_and_read_back(stimulus):
    [again] = stimuli_from_toml(stimulus_to_toml(stimulus), name="s")
    assert again == stimulus
    assert again.position.tobytes() == stimulus.position.tobytes()


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"sweep": 4.0}, "sweep = 4 s is longer than the duration of 3 s"),
        ({"sweep": 0.05}, "less than one cycle; 0.0996 s is enough"),
        ({"sweep": -1.0}, "sweep = -1.0 s must be a positive"),
        ({"kind": "hmpim"}, "sweep = 0.6 s is for kind = 'repeated'"),
        ({"extinction": 1.0}, "extinction = 1.0 is for sweeps"),
    ],
)
def test_what_is_no_repeated_sweep_is_refused(changed, words):
    with pytest.raises(ArgumentError, match=words):
        design(**{**WISH, "limits": LIMITS, **changed})
