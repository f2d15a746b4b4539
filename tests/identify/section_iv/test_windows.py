from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmpim.errors import ArgumentError
from hmpim.identify.section_iv.windows import WindowName, window_samples


@given(st.integers(1, 300), st.floats(0.1, 5.0))
def test_equations_15_and_16_as_printed(half: int, alpha: float) -> None:
    big_n = 2 * half  # -N/2 <= n <= N/2 holds N + 1 points
    n = np.arange(-half, half + 1)
    printed = np.exp(-0.5 * (alpha * n / (big_n / 2)) ** 2)
    np.testing.assert_allclose(
        window_samples("gaussian", big_n + 1, alpha=alpha), printed, rtol=1e-12
    )


def test_ends_stand_at_one_third_for_the_papers_alpha() -> None:
    window = window_samples("gaussian", 2000)
    assert window[0] == pytest.approx(np.exp(-1.125), rel=1e-12)
    assert window[-1] == window[0]


@pytest.mark.parametrize("name", get_args(WindowName))
@pytest.mark.parametrize("samples", [50, 51])
def test_every_window_is_symmetric(name: WindowName, samples: int) -> None:
    window = window_samples(name, samples)
    np.testing.assert_allclose(window, window[::-1], atol=1e-14)


@pytest.mark.parametrize("name", get_args(WindowName))
def test_every_window_leaves_the_middle_of_the_record_as_it_is(name: WindowName) -> None:
    # flattop's published coefficients add up to 1.000000003
    window = window_samples(name, 51)
    assert window[25] == pytest.approx(1, abs=1e-8)
    assert window.argmax() == 25 or name in ("rectangular", "tukey")


def test_alpha_reaches_the_gaussian_window_only() -> None:
    assert window_samples("gaussian", 9, alpha=3.0)[0] == pytest.approx(np.exp(-4.5))
    np.testing.assert_array_equal(
        window_samples("hann", 9, alpha=3.0), window_samples("hann", 9, alpha=1.0)
    )


def test_rectangular_changes_nothing() -> None:
    np.testing.assert_array_equal(window_samples("rectangular", 7), np.ones(7))


def test_unknown_name_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ArgumentError, match=r"window is 'hanning'; give one of gaussian, "):
        window_samples("hanning", 10)  # type: ignore[arg-type]


@pytest.mark.parametrize("alpha", [0.0, -1.5, float("nan"), float("inf")])
def test_alpha_must_be_positive(alpha: float) -> None:
    with pytest.raises(ArgumentError, match="alpha is"):
        window_samples("gaussian", 10, alpha=alpha)


def test_one_sample_is_no_window() -> None:
    with pytest.raises(ArgumentError, match="samples is 1"):
        window_samples("hann", 1)
