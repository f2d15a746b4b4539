"""Pictures of stimuli: spectra, spectrogram, time near limits."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmpim.plots import Curve, Span
from hmpim.plots.stimulus import (
    share_beyond,
    stimulus_spectrogram,
    stimulus_spectrum,
    time_near_limits,
)
from hmpim.stimulus import KINDS, Limits, Sine, Step, Stimulus, design

LIMITS = Limits(position=2.0, velocity=40.0, acceleration=2000.0, jerk=1e5, unit="deg")


@given(x=st.lists(st.floats(-5, 5), min_size=1, max_size=50), level=st.floats(0, 5))
def test_share_beyond_counts(x, level):
    expected = sum(abs(v) >= level for v in x) / len(x)
    assert share_beyond(np.array(x), np.array([level]))[0] == pytest.approx(expected, abs=1e-12)


def test_time_of_a_sine_near_its_limit_is_the_arcsine_law():
    sine = Sine(amplitude=1.0, frequency=2.0, duration=3.0)
    stimulus = Stimulus(waveform=sine, fs=500.0, limits=Limits(position=1.25))
    (curve,) = time_near_limits(stimulus).panels[0].items
    share, beyond = curve.x, curve.y
    at = np.array([10.0, 40.0, 70.0])
    expected = 100 * (1 - 2 / math.pi * np.arcsin(at / 80.0))
    assert np.interp(at, share, beyond) == pytest.approx(expected, abs=0.3)
    assert share[-1] == pytest.approx(80.0, abs=0.2)


def test_ridge_of_a_sweeps_spectrogram_is_its_frequency():
    stimulus = design(band=(1.0, 20.0), duration=10, fs=100, limits=Limits(position=1.0))
    figure = stimulus_spectrogram(stimulus)
    (image,) = figure.panels[0].items
    level = image.values
    edges = np.linspace(*image.x, level.shape[1] + 1), np.linspace(*image.y, level.shape[0] + 1)
    times, frequency = (0.5 * (edge[1:] + edge[:-1]) for edge in edges)
    ridge = frequency[np.argmax(level, axis=0)]
    inside = (times > stimulus.sweep_start + 1.5) & (times < stimulus.sweep_start + 8.5)
    expected = 1.0 + 1.9 * (times[inside] - stimulus.sweep_start)
    assert inside.sum() > 100
    assert np.abs(ridge[inside] - expected).max() < 0.5


def test_spectrum_shows_both_and_the_band():
    stimulus = design(band=(0.5, 20.0), duration=10, fs=100, limits=LIMITS, axis="yaw")
    (panel,) = stimulus_spectrum(stimulus).panels
    assert "yaw" in panel.title
    plain, windowed = panel.of(Curve)
    assert plain.y.max() > windowed.y.max()
    (span,) = panel.of(Span)
    assert (span.low, span.high) == (0.5, 20.0)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_is_drawn_without_a_warning(kind, tmp_path):
    stimulus = design(band=(0.5, 20.0), duration=4, fs=100, limits=LIMITS, kind=kind, rng=1)
    for draw in (stimulus_spectrum, stimulus_spectrogram, time_near_limits):
        draw(stimulus).savefig(tmp_path / "p.svg")
    labels = [curve.label for curve in time_near_limits(stimulus).panels[0].items]
    assert labels == ["position", "velocity", "acceleration", "jerk"]


def test_without_band_or_limits(tmp_path):
    step = Stimulus(waveform=Step(duration=2.0, start=0.5), fs=50.0)
    for draw in (stimulus_spectrum, stimulus_spectrogram, time_near_limits):
        draw(step).savefig(tmp_path / "p.svg")
    assert not time_near_limits(step).panels[0].items
