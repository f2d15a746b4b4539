"""What is left over at the lines of an input, and how often noise alone looks like it."""

import numpy as np
import pytest
import scipy
from scipy.signal import lfilter

from hmpim.identify.noise.misfit import misfit

N = 2000
T = np.arange(N)
COLOURS = {"white": [1.0], "a walk, nearly": [1.0, -0.99], "a resonance": [1.0, -1.8, 0.9]}


def lines(rng: np.random.Generator, at: list[float]) -> np.ndarray:
    return sum(np.cos(2 * np.pi * f * T + rng.uniform(0, 6.28)) for f in at)


@pytest.mark.few(150)
@pytest.mark.parametrize("colour", COLOURS)
def test_noise_alone_rarely_seems_to_follow_lines(colour, seeds):
    rng, found = np.random.default_rng(0), []
    for _ in range(2 * seeds):
        at = np.sort(rng.uniform(0.01, 0.2, 4))
        noise = lfilter([1.0], COLOURS[colour], rng.standard_normal(N))
        found.append(misfit(lines(rng, at), noise, delay=0.0, band=(at[0], at[-1])).probability)
    assert np.mean(np.array(found) < 0.01) <= 0.02
    assert min(found) > 1e-6


def test_two_lines_side_by_side_that_are_left_with_opposite_signs_are_no_noise():
    """One gain of both explains nothing of them."""
    rng = np.random.default_rng(1)
    at = [0.0149, 0.0487, 0.0652, 0.0666]
    u = lines(rng, at)
    left = 0.1 * (lines(np.random.default_rng(1), [at[2]]) - np.cos(2 * np.pi * at[3] * T + 1.0))
    found = misfit(u, left + 0.01 * rng.standard_normal(N), delay=0.0, band=(at[0], at[-1]))
    assert found.probability < 1e-6
    assert found.share > 0.9


def test_a_sweep_has_no_lines():
    u = np.sin(2 * np.pi * (0.001 * T + 5e-5 * T**2))
    hum = np.cos(2 * np.pi * 0.05 * T)
    noise = np.random.default_rng(2).standard_normal(N)
    assert misfit(u, hum + noise, delay=0.0, band=(0.001, 0.2)).share < 0.05


def test_the_share_is_of_the_whole_power_and_within_of_that_in_the_band():
    """A response to a slow input, in noise up to half the rate: noise above the band counts too."""
    rng = np.random.default_rng(3)
    n = 8000
    u = scipy.signal.lfilter(*scipy.signal.butter(4, 0.1, fs=1.0), rng.standard_normal(n))
    u /= u.std()
    noise = rng.standard_normal(n)
    residual = 0.5 * u + noise
    found = misfit(u, residual, delay=0.0, band=(0.001, 0.1))
    assert found.probability < 1e-9
    assert found.share == pytest.approx(0.25 / 1.25, abs=0.03)
    assert 2.0 * found.share < found.within < 1.0


def two_inputs(rng, other):
    """Two sweeps, and an output that follows the first late and, by `other`, the second."""
    u = np.sin(2 * np.pi * (0.001 * T + 5e-5 * T**2))
    v = np.sin(2 * np.pi * (0.2 * T - 4.9e-5 * T**2 + 0.1))
    missed = lfilter([0.5], [1.0, -0.5], np.concatenate([np.zeros(40), u])[:N])
    return u, v, missed + other * v + 0.01 * rng.standard_normal(N)


def test_what_another_input_left_is_no_noise_if_that_input_is_known():
    u, v, y = two_inputs(np.random.default_rng(4), 0.03)
    hidden = misfit(v, y, delay=0.0, band=(0.001, 0.2))
    found = misfit(v, y, delay=0.0, band=(0.001, 0.2), others=[(u, 40.0)])
    assert found.probability < 1e-12 < 1e-6 < hidden.probability


@pytest.mark.few(150)
def test_another_input_does_not_make_noise_significant(seeds):
    found = []
    for seed in range(2 * seeds):
        u, v, y = two_inputs(np.random.default_rng(seed), 0.0)
        y = y + np.random.default_rng(seed + 1).standard_normal(N)
        found.append(misfit(v, y, delay=0.0, band=(0.001, 0.2), others=[(u, 40.0)]).probability)
    assert np.mean(np.array(found) < 0.01) <= 0.02
    assert np.mean(found) == pytest.approx(0.5, abs=0.1)
