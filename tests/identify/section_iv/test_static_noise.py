import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmpim.identify.section_iv.correlation import autocorrelation
from hmpim.identify.section_iv.static import noise_by_autocorrelation


@given(st.floats(-5, 5), st.floats(0.01, 2), st.integers(0, 2**32 - 1))
def test_equation_14_mean_square_less_square_of_the_mean(
    bias: float, sigma: float, seed: int
) -> None:
    error = bias + sigma * np.random.default_rng(seed).standard_normal(100)
    r = autocorrelation(error)
    printed = r.value[r.lag == 0].item() - error.mean() ** 2
    assert noise_by_autocorrelation(error) ** 2 == pytest.approx(printed, rel=1e-6, abs=1e-12)


def test_white_noise_on_a_bias_is_found() -> None:
    error = 0.6 + 0.1 * np.random.default_rng(5).standard_normal(20_000)
    # four standard deviations of the estimate, which is sigma / sqrt(2 n)
    found = noise_by_autocorrelation(error)
    assert found == pytest.approx(0.1, abs=4 * 0.1 / np.sqrt(40_000))


def test_a_bias_alone_has_no_noise() -> None:
    assert noise_by_autocorrelation(np.full(100, 0.5)) == 0.0


@given(st.floats(-10, 10), st.floats(0.1, 10))
def test_noise_ignores_bias_and_scales(bias: float, scale: float) -> None:
    error = np.random.default_rng(2).standard_normal(200)
    one = noise_by_autocorrelation(error)
    assert noise_by_autocorrelation(scale * error + bias) == pytest.approx(scale * one, rel=1e-9)
