"""One autoregression for every colour: of samples with gaps, and of the autocovariance."""

import numpy as np
import pytest
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

from hmpim.identify.noise.autoregression import (
    autoregression,
    deviation_of_mean,
    spectrum_of_filter,
    yule_walker,
)
from hmpim.identify.noise.whiteness import autocovariance

NOISE = lfilter([1.0], [1.0, -0.9], np.random.default_rng(0).standard_normal(20_000))


def test_the_colour_between_gaps() -> None:
    known = np.arange(NOISE.size) % 30 > 8
    omega = np.array([0.01, 0.1, 0.5, 2.0])
    found = spectrum_of_filter(autoregression(np.where(known, NOISE, 7.0), known), omega)
    np.testing.assert_allclose(found, np.abs(1 - 0.9 * np.exp(-1j * omega)) ** -2, rtol=0.2)


def test_products_from_the_autocovariance_solve_the_equations_of_yule_and_walker() -> None:
    noise, left = yule_walker(NOISE, 8)
    order = noise.size - 1
    r = autocovariance(NOISE, order)
    expected = solve_toeplitz(r[:order], r[1:])
    np.testing.assert_allclose(noise, [1.0, *-expected], atol=1e-9)
    assert left == pytest.approx(r[0] - expected @ r[1:], rel=1e-9)
    assert np.abs(np.roots(noise)).max() < 1.0


def test_silence_has_no_colour() -> None:
    noise, left = yule_walker(np.zeros(100))
    assert (noise.tolist(), left) == ([1.0], 0.0)


def rising(slope: float, seed: int, n: int = 2000) -> np.ndarray:
    """Noise with power as f^-slope down to a quarter of its lowest bin."""
    shape = np.maximum(np.arange(2 * n + 1), 1.0) ** (-slope / 2)
    white = np.fft.rfft(np.random.default_rng(seed).standard_normal(4 * n))
    return np.fft.irfft(shape * white)[:n]


@pytest.mark.parametrize(
    ("made", "widest"),
    [
        (lambda seed: rising(0.5, seed), 1.6),
        (lambda seed: rising(1.0, seed), 1.6),
        (lambda seed: lfilter([1.0], [1.0, -0.9], rising(0.0, seed, 2500))[500:], 1.6),
    ],
    ids=["slope 0.5", "1/f", "AR(0.9)"],
)
def test_the_mean_of_a_noise_scatters_as_stated(made, widest) -> None:
    noises = [made(seed) for seed in range(200)]
    means = np.array([noise.mean() for noise in noises])
    stated = np.array([deviation_of_mean(noise - noise.mean(), noise.size) for noise in noises])
    pulls = np.abs(means / stated)
    assert np.mean(pulls < 1.96) > 0.85  # an autoregression alone: 0.4 under 1/f noise
    assert np.mean(pulls > 4.0) < 0.02
    assert np.median(stated) < widest * means.std()
