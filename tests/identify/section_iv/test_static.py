import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmpim.identify.section_iv.correlation import autocorrelation
from hmpim.identify.section_iv.static import (
    bias_by_autocorrelation,
    initial_period,
    scale_factor_near_dc,
    time_corrected_error,
)

FS = 200.0
T = np.arange(2000) / FS
SWEEP = np.sin(2 * np.pi * (0.1 * T + 0.995 * T**2))


def late(x: np.ndarray, k: int) -> np.ndarray:
    return np.concatenate((np.zeros(k), x[: x.size - k]))


@given(st.integers(0, 500), st.floats(-3, 3))
def test_equation_9_is_truth_minus_measurement_once_the_delay_is_out(k: int, bias: float) -> None:
    error = time_corrected_error(SWEEP, late(SWEEP, k) + bias, k)
    assert error.size == SWEEP.size - k
    np.testing.assert_allclose(error, -bias, atol=1e-12)


@given(st.floats(-5, 5), st.floats(0.01, 2), st.integers(0, 2**32 - 1))
def test_equation_11_is_the_root_of_the_autocorrelation_at_zero(
    bias: float, sigma: float, seed: int
) -> None:
    error = -bias + sigma * np.random.default_rng(seed).standard_normal(50)
    r = autocorrelation(error)
    root = np.sqrt(r.value[r.lag == 0].item())
    assert abs(bias_by_autocorrelation(error)) == pytest.approx(root, rel=1e-9)


def test_equation_11_holds_noise_too() -> None:
    # bias 0.6, noise 0.8: the paper's bias is 1.0
    error = -0.6 + 0.8 * np.tile([1.0, -1.0], 50)
    assert bias_by_autocorrelation(error) == pytest.approx(1.0)


def test_the_sign_is_that_of_measurement_minus_truth() -> None:
    assert bias_by_autocorrelation(np.full(9, 0.6)) == pytest.approx(-0.6)
    assert bias_by_autocorrelation(np.full(9, -0.6)) == pytest.approx(0.6)


def test_initial_period_of_a_sweep_is_its_first_cycle() -> None:
    # 0.1 t + 0.995 t² = 1 at t = 0.9536 s
    assert initial_period(SWEEP) / FS == pytest.approx(0.9536, abs=1.5 / FS)


def test_initial_period_is_not_ended_by_noise_on_the_excitation() -> None:
    noisy = SWEEP + 0.01 * np.random.default_rng(1).standard_normal(SWEEP.size)
    assert initial_period(noisy) == pytest.approx(initial_period(SWEEP), abs=3)


def test_an_excitation_without_a_cycle_is_taken_whole() -> None:
    assert initial_period(np.r_[np.zeros(50), np.ones(150)]) == 200
    assert initial_period(np.zeros(40)) == 40


@given(st.floats(0.3, 3.0), st.sampled_from([-1, 1]), st.floats(-2, 2), st.integers(0, 100))
def test_equations_12_and_13_are_solved_exactly(
    scale: float, sign: int, bias: float, k: int
) -> None:
    y = late(SWEEP, k) * scale * sign + bias
    found = scale_factor_near_dc(SWEEP, y, k, bias)
    assert found == pytest.approx(sign * scale, rel=1e-9)


@given(st.floats(-1, 1))
def test_a_wrong_bias_cancels_between_the_half_cycles(wrong: float) -> None:
    t = np.arange(400) / 200
    u = np.sin(2 * np.pi * t)
    assert scale_factor_near_dc(u, 1.1 * u, 0, wrong) == pytest.approx(1.1, abs=1e-9)


def test_only_the_initial_period_counts() -> None:
    y = 2.0 * SWEEP
    y[400:] = 0.0
    assert scale_factor_near_dc(SWEEP, y, 0, 0.0) == pytest.approx(2.0)


def test_no_excitation_gives_no_scale_factor() -> None:
    assert scale_factor_near_dc(np.zeros(20), np.ones(20), 0, 1.0) is None


def test_an_excitation_on_one_side_only_is_enough() -> None:
    u = np.abs(np.sin(2 * np.pi * T[:400])) + 0.1
    assert scale_factor_near_dc(u, 3 * u + 1, 0, 1.0) == pytest.approx(3.0)
