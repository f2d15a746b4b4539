"""Colour of the noise, and noise on the input: right and rightly uncertain."""

import numpy as np
import pytest
from scipy.signal import lfilter

from hmpim.identify.noise.colour import noise_colour
from hmpim.identify.noise.input_noise import input_noise

FS = 200.0
T = np.arange(2000) / FS
CHIRP = np.sin(2 * np.pi * (0.1 * T + 19.9 / 20 * T * T))


def autoregressive(coefficient: float, seed: int, n: int = 2000) -> np.ndarray:
    white = np.random.default_rng(seed).standard_normal(n + 500)
    return lfilter([np.sqrt(1 - coefficient**2)], [1.0, -coefficient], white)[500:]


def flicker(seed: int, n: int = 2000) -> np.ndarray:
    frequency = np.fft.rfftfreq(n)
    frequency[0] = 1.0
    white = np.fft.rfft(np.random.default_rng(seed).standard_normal(n))
    return np.fft.irfft(white / np.sqrt(frequency))


@pytest.mark.parametrize("coefficient", [-0.5, 0.6, 0.9, 0.97])
def test_the_coefficient_scatters_no_more_than_it_must(coefficient):
    found = [noise_colour(autoregressive(coefficient, s), FS) for s in range(60)]
    std = np.sqrt((1 - coefficient**2) / T.size)
    errors = [(f.coefficient - coefficient) / std for f in found]
    assert abs(np.mean(errors)) < 0.5
    assert 0.75 < np.std(errors) < 1.3
    assert all(f.kind == "autoregressive" for f in found)


def test_kinds_are_told_apart():
    kinds = [
        noise_colour(np.random.default_rng(s).standard_normal(2000), FS).kind for s in range(50)
    ]
    assert kinds.count("white") >= 49
    for seed in range(20):
        found = noise_colour(flicker(seed), FS)
        assert found.kind == "power_law"
        assert found.exponent == pytest.approx(1.0, abs=0.15)
        assert "1/f" in found.description


def test_a_line_is_found_and_taken_out_of_the_colour():
    for seed in range(20):
        noise = np.random.default_rng(seed).standard_normal(2000)
        found = noise_colour(noise + 0.5 * np.sin(2 * np.pi * 60.03 * T + 1), FS)
        assert found.line_frequency == pytest.approx(60.03, abs=0.03)
        assert found.kind == "white"
        assert "60" in found.description
        assert noise_colour(noise, FS).line_frequency is None


def test_the_noise_of_the_input_and_what_it_costs():
    found = [
        input_noise(
            CHIRP + 0.02 * np.random.default_rng(s).standard_normal(2000), FS, band=(0.1, 20)
        )
        for s in range(60)
    ]
    # The floor is seen in the bins from 24 to 100 Hz.
    errors = [(f.std - 0.02) / (0.02 / np.sqrt(760)) for f in found]
    assert abs(np.mean(errors)) < 0.4
    assert 0.75 < np.std(errors) < 1.3
    # Power in the band: the sweep's 1/2 spread over a fifth of the bins, and the noise.
    expected = 0.02**2 / (0.5 / 0.199 + 0.02**2)
    assert np.mean([f.attenuation for f in found]) == pytest.approx(expected, rel=0.15)


@pytest.mark.parametrize("u", [CHIRP, np.sign(CHIRP), CHIRP / (1 + T), np.zeros(2000)])
def test_a_clean_input_has_no_noise(u):
    assert input_noise(u, FS, band=(0.1, 20.0)) is None


def test_an_input_that_excites_everything_cannot_tell():
    binary = np.random.default_rng(0).choice([-1.0, 1.0], 2000)
    assert input_noise(binary, FS, band=(0.1, 100.0)) is None
