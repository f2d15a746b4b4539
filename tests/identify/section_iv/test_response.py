import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmpim.identify.section_iv.response import (
    damping_from_hump,
    delay_phase,
    falling_crossing,
    peak_gain,
    phase,
)

F = np.arange(0.05, 20.0, 0.05)


def second_order(f: np.ndarray, fn: float, zeta: float, delay: float = 0.0) -> np.ndarray:
    s = 2j * np.pi * f
    w = 2 * np.pi * fn
    return w**2 / (s**2 + 2 * zeta * w * s + w**2) * np.exp(-s * delay)


@given(st.floats(-100, 100), st.floats(-100, 100))
def test_equations_19_to_24(real: float, imag: float) -> None:
    g = complex(real, imag)
    if abs(g) > 1e-6:  # the angle of what is nearly nothing is not tested
        angle = np.radians(phase([g])[0])
        # tan φ = I/R, in the quadrant that G = |G| e^{jφ} asks for
        assert abs(g) * np.exp(1j * angle) == pytest.approx(g, abs=1e-9)


@given(st.floats(0.0, 0.3), st.floats(1.0, 18.0), st.floats(0.1, 2.0))
def test_phase_is_followed_through_many_turns(delay: float, fn: float, zeta: float) -> None:
    w = F / fn
    true = -np.degrees(np.arctan2(2 * zeta * w, 1 - w**2)) - 360 * F * delay
    np.testing.assert_allclose(phase(second_order(F, fn, zeta, delay)), true, atol=1e-6)


def test_phase_of_a_device_that_turns_the_sign() -> None:
    g = second_order(F, 10.0, 0.4, 0.02)
    np.testing.assert_allclose(phase(-g, inverted=True), phase(g), atol=1e-9)


def test_a_wild_first_bin_does_not_turn_the_rest() -> None:
    g = second_order(F, 10.0, 0.4, 0.01)
    wild = g.copy()
    wild[0] *= np.exp(2.5j)
    np.testing.assert_allclose(phase(wild)[1:], phase(g)[1:], atol=1e-9)


def test_phase_of_nothing_is_nothing() -> None:
    assert phase(np.zeros(0, dtype=complex)).size == 0


@given(st.floats(0.0, 1.0), st.floats(0.0, 100.0))
def test_equation_25(delay: float, f: float) -> None:
    omega = 2 * np.pi * f
    assert np.radians(delay_phase([f], delay)[0]) == pytest.approx(-omega * delay, abs=1e-9)


@given(st.floats(0.0, 0.2))
def test_what_remains_without_the_delay_is_the_dynamics(delay: float) -> None:
    total = phase(second_order(F, 10.0, 0.4, delay))
    remaining = total - delay_phase(F, delay)
    np.testing.assert_allclose(remaining, phase(second_order(F, 10.0, 0.4)), atol=1e-6)


def test_bandwidth_of_the_system_of_figure_17() -> None:
    # Analytic: 2 π f 0.15 + atan2(0.8 f/10, 1 - (f/10)²) = π/2 at f = 1.534 Hz.
    fine = np.arange(0.1, 20.0, 0.025)
    found = falling_crossing(fine, phase(second_order(fine, 10.0, 0.4, 0.15)), -90.0)
    assert found == pytest.approx(1.534, abs=0.001)


@given(st.floats(2.0, 18.0), st.floats(0.1, 1.5))
def test_natural_frequency_is_where_the_remaining_phase_is_minus_90(fn: float, zeta: float) -> None:
    remaining = phase(second_order(F, fn, zeta))
    assert falling_crossing(F, remaining, -90.0) == pytest.approx(fn, abs=0.01)


@given(st.floats(1.0, 10.0), st.floats(0.1, 1.0))
def test_3_db_bandwidth_of_a_second_order_lag(fn: float, zeta: float) -> None:
    z2 = zeta**2
    closed = fn * np.sqrt(1 - 2 * z2 + np.sqrt(1 + (1 - 2 * z2) ** 2))
    found = falling_crossing(F, np.abs(second_order(F, fn, zeta)), np.sqrt(0.5))
    assert found == pytest.approx(closed, abs=0.005)


@given(st.floats(0.02, 0.7))
def test_damping_is_read_back_from_the_hump_of_figure_16(zeta: float) -> None:
    assert damping_from_hump(1 / (2 * zeta * np.sqrt(1 - zeta**2))) == pytest.approx(zeta, rel=1e-6)


def test_the_hump_of_figure_17_is_about_3_db() -> None:
    hump = peak_gain(np.abs(second_order(F, 10.0, 0.4)))
    assert hump is not None
    assert 20 * np.log10(hump) == pytest.approx(2.7, abs=0.05)
    assert damping_from_hump(hump) == pytest.approx(0.4, abs=0.002)


def test_no_hump_no_damping() -> None:
    assert peak_gain(np.abs(second_order(F, 10.0, 0.8))) is None
    assert peak_gain(np.arange(1.0, 50.0)) is None  # still rising at the end of the band
    assert peak_gain([1.0, 2.0]) is None
    assert damping_from_hump(1.0) is None
    assert damping_from_hump(float("nan")) is None


@pytest.mark.parametrize(
    "curve",
    [
        [-95.0, -100.0, -120.0],  # below from the start
        [0.0, -40.0, -89.9],  # not yet at the end of the band
        [0.0],
    ],
)
def test_no_crossing_inside_the_band_is_none(curve: list[float]) -> None:
    assert falling_crossing(np.arange(1.0, 1 + len(curve)), curve, -90.0) is None


@given(st.floats(-170.0, -10.0))
def test_a_crossing_is_interpolated_between_bins(level: float) -> None:
    coarse = np.array([0.0, 5.0, 20.0])
    assert falling_crossing(coarse, -9 * coarse, level) == pytest.approx(-level / 9)


def test_the_first_of_several_crossings_counts() -> None:
    assert falling_crossing([0, 1, 2, 3], [1.0, -1.0, 1.0, -1.0], 0.0) == 0.5
