"""The waveforms of Fig. 5 against their closed forms and spectra."""

import math

import numpy as np
import pytest

from hmpim.errors import ArgumentError
from hmpim.stimulus import Chirp, Ramp, Sine, Step, Stimulus, SumOfSines, true_peaks


def numerical_slope(function, t, h=1e-3):
    """Central differences at h and h/2, extrapolated: error of order h^4."""
    coarse = (function(t + h) - function(t - h)) / (2 * h)
    fine = (function(t + h / 2) - function(t - h / 2)) / h
    return (4 * fine - coarse) / 3


@pytest.mark.parametrize(
    "waveform",
    [
        Sine(amplitude=2.0, frequency=1.5, duration=4.0),
        SumOfSines(
            amplitudes=(1.0, -0.4), frequencies=(0.5, 3.0), phases=(0.3, -1.0), duration=4.0
        ),
        Chirp(amplitude=0.7, band=(0.1, 3.0), duration=4.0),
        Ramp(rate=-3.0, duration=4.0),
    ],
)
def test_each_is_the_derivative_of_the_one_before(waveform):
    t = np.linspace(0.1, 3.9, 57)
    at = waveform.motion(t)
    velocity = numerical_slope(lambda s: waveform.motion(s).position, t)
    acceleration = numerical_slope(lambda s: waveform.motion(s).velocity, t)
    assert at.velocity == pytest.approx(velocity, abs=2e-7)
    assert at.acceleration == pytest.approx(acceleration, abs=5e-6)


def test_sine_is_a_sine():
    sine = Sine(amplitude=-2.0, frequency=1.5, duration=4.0)
    t = np.linspace(0.0, 4.0, 33)
    assert sine.motion(t).position == pytest.approx(-2.0 * np.sin(3.0 * math.pi * t), abs=1e-12)
    assert sine.band == (1.5, 1.5)


def test_step_jumps_once():
    step = Step(amplitude=-2.0, duration=3.0, start=1.0)
    at = step.motion(np.array([-1.0, 0.999, 1.0, 5.0]))
    assert at.position.tolist() == [0.0, 0.0, -2.0, -2.0]
    assert not at.velocity.any()


def test_ramp_stops_at_its_end():
    at = Ramp(rate=2.0, duration=3.0, start=1.0).motion(np.array([-1.0, 0.5, 2.0, 3.5]))
    assert at.position.tolist() == [0.0, 0.0, 2.0, 4.0]
    assert at.velocity.tolist() == [0.0, 0.0, 2.0, 0.0]


def test_sine_peaks_fall_between_samples_and_are_found():
    stimulus = Stimulus(waveform=Sine(amplitude=2.0, frequency=3.0, duration=1.0), fs=7.0)
    omega = 6.0 * math.pi
    assert np.abs(stimulus.position).max() < 1.999
    assert stimulus.peaks.position == pytest.approx(2.0, rel=1e-9)
    assert stimulus.peaks.velocity == pytest.approx(2.0 * omega, rel=1e-9)
    assert stimulus.peaks.acceleration == pytest.approx(2.0 * omega**2, rel=1e-9)
    assert stimulus.gain is None
    assert stimulus.extinction is None


def test_peaks_of_a_part_only():
    ramp = Ramp(rate=2.0, duration=3.0)
    assert true_peaks(ramp, start=0.5, stop=1.0).position == pytest.approx(2.0, rel=1e-12)


def test_only_the_chirp_excites_the_whole_band():
    """Fig. 5: spectra at 500 Hz over 10 s, level at its lowest within 1 to 9 Hz."""
    duration, fs = 10.0, 500.0
    lowest = {}
    for waveform in (
        Step(duration=duration, start=1.0),
        Ramp(duration=duration, rate=0.1),
        Sine(frequency=2.0, duration=duration),
        SumOfSines(amplitudes=(1.0,) * 4, frequencies=(1.0, 3.0, 5.0, 8.0), duration=duration),
        Chirp(band=(0.1, 10.0), duration=duration),
    ):
        samples = Stimulus(waveform=waveform, fs=fs).position
        level = np.abs(np.fft.rfft(samples))
        frequency = np.fft.rfftfreq(samples.size, 1 / fs)
        inside = (frequency >= 1.0) & (frequency <= 9.0)
        lowest[type(waveform).__name__] = 20 * np.log10(level[inside].min() + 1e-12)
    # a chirp's level is flat: amplitude/2 sqrt(T/(f_f - f_i)) fs, with Fresnel ripple
    flat = 20 * np.log10(0.5 * math.sqrt(duration / 9.9) * fs)
    chirp = lowest.pop("Chirp")
    assert chirp == pytest.approx(flat, abs=2.0)
    assert max(lowest.values()) < chirp - 10.0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Step(amplitude=0.0, duration=1.0), "amplitude = 0.0 moves nothing"),
        (lambda: Step(duration=1.0, start=1.0), "start = 1.0 s must lie in"),
        (lambda: Step(duration=math.nan), "duration = nan s"),
        (lambda: Ramp(rate=math.nan, duration=1.0), "rate = nan moves nothing"),
        (lambda: Sine(frequency=-1.0, duration=1.0), "frequency = -1.0 Hz"),
        (lambda: Chirp(band=(3.0, 1.0), duration=1.0), "does not rise"),
        (
            lambda: SumOfSines(amplitudes=(1.0,), frequencies=(1.0, 2.0), duration=1.0),
            "1 amplitudes, 2 frequencies and 0 phases do not match",
        ),
        (
            lambda: SumOfSines(amplitudes=(1.0, 1.0), frequencies=(2.0, 1.0), duration=1.0),
            "do not rise",
        ),
    ],
)
def test_refusals(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()
