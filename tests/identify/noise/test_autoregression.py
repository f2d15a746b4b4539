"""One autoregression for every colour: of samples with gaps, and of the autocovariance."""

import numpy as np
import pytest
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

from hmpim.identify.noise.autoregression import autoregression, spectrum_behind, yule_walker
from hmpim.identify.noise.whiteness import autocovariance

NOISE = lfilter([1.0], [1.0, -0.9], np.random.default_rng(0).standard_normal(20_000))


def test_the_colour_between_gaps() -> None:
    known = np.arange(NOISE.size) % 30 > 8
    omega = np.array([0.01, 0.1, 0.5, 2.0])
    found = spectrum_behind(autoregression(np.where(known, NOISE, 7.0), known), omega)
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
