"""Bandwidths and peaks against closed forms."""

import numpy as np
import pytest
import scipy.optimize
from hypothesis import given
from hypothesis import strategies as st

from hmpim.errors import ArgumentError
from hmpim.model import (
    Model,
    RationalDelay,
    bandwidth_3db,
    bandwidth_phase,
    dominant_time_constant,
    frequency_response,
    peak_gain,
    phase,
    response,
    second_order_coefficients,
    simulate,
)


def second_order(natural_frequency: float, damping_ratio: float, delay: float = 0.0, gain=1.0):
    return RationalDelay(
        delay=delay,
        numerator=np.array([gain]),
        denominator=np.concatenate(
            [[1.0], second_order_coefficients(natural_frequency, damping_ratio)]
        ),
    )


def test_the_stated_system_of_fig_17_lags_by_90_degrees_at_1_534_hz():
    system = second_order(10.0, 0.4, delay=0.15)
    assert bandwidth_phase(system, highest=20.0) == pytest.approx(1.534, abs=5e-4)
    assert bandwidth_phase(system, highest=20.0, delay=False) == pytest.approx(10.0)


def test_a_pure_delay_lags_by_90_degrees_at_a_quarter_of_its_inverse():
    system = RationalDelay(delay=0.15, numerator=np.ones(1), denominator=np.ones(1))
    assert bandwidth_phase(system, highest=20.0) == pytest.approx(1 / 0.6)


@given(zeta=st.floats(0.05, 2.0), gain=st.floats(-3, 3).filter(lambda g: abs(g) > 0.01))
def test_second_order_figures(zeta, gain):
    system = second_order(10.0, zeta, gain=gain)
    w2 = 1 - 2 * zeta**2 + np.sqrt((1 - 2 * zeta**2) ** 2 + 1)
    assert bandwidth_3db(system, highest=100.0) == pytest.approx(10 * np.sqrt(w2), rel=1e-9)
    hump = -20 * np.log10(2 * zeta * np.sqrt(1 - zeta**2)) if zeta < np.sqrt(0.5) else 0.0
    peak = peak_gain(system, highest=100.0)
    assert peak.gain_db == pytest.approx(hump, abs=1e-4)
    there = 10 * np.sqrt(max(1 - 2 * zeta**2, 0.0))
    assert peak.frequency == pytest.approx(there, abs=0.02)


def test_phase_is_continuous_through_many_turns():
    system = second_order(10.0, 0.3, delay=0.5)
    f = np.linspace(0, 50, 4001)
    unwrapped = np.unwrap(np.angle(response(system, f)))
    np.testing.assert_allclose(phase(system, f), unwrapped, atol=1e-9)


def test_no_bandwidth_beyond_what_was_looked_at():
    assert bandwidth_3db(second_order(10.0, 0.4), highest=5.0) is None
    assert bandwidth_phase(second_order(10.0, 0.4), highest=5.0) is None


def test_dominant_time_constant_of_two_real_poles():
    system = RationalDelay(
        delay=0.0, numerator=np.ones(1), denominator=np.convolve([1.0, 0.3], [1.0, 0.02])
    )
    assert dominant_time_constant(system) == pytest.approx(0.3)
    assert dominant_time_constant(second_order(1.0, 0.3)) is None


def test_simulation_of_a_sine_meets_the_frequency_response():
    model = Model(
        delay=0.0123,
        scale_factor=-2.0,
        numerator=(0.01, 1.0),
        denominator=(1e-4, 5e-3, 1.0),
        bias=0.3,
    )
    t = np.arange(3000) / 1000
    u = np.minimum(t, 1.0) ** 3 * np.sin(2 * np.pi * 12 * t)
    y = simulate(model, u, fs=1000.0, intersample="bandlimited")
    gain = frequency_response(model, np.array([12.0]))[0]
    expected = 0.3 + np.imag(gain * np.exp(2j * np.pi * 12 * t))
    np.testing.assert_allclose(y[1500:2900], expected[1500:2900], atol=1e-4)


def test_unstable_or_improper_models_are_refused():
    with pytest.raises(ArgumentError, match="has a pole at 1"):
        Model(delay=0.0, scale_factor=1.0, denominator=(1.0, -1.0))
    with pytest.raises(ArgumentError, match="is not proper"):
        Model(delay=0.0, scale_factor=1.0, numerator=(1.0, 1.0, 1.0), denominator=(1.0, 1.0))
    with pytest.raises(ArgumentError, match="integrates more than once"):
        Model(delay=0.0, scale_factor=1.0, denominator=(1.0, 0.0, 0.0))


def test_poles_lost_to_rounding_have_no_time_constant():
    lost = RationalDelay(
        delay=0.005,
        numerator=np.array([1.0, 1.2, -0.98, 0.25]),
        denominator=np.array([1.0, 2.15238724, 0.917807189, 1.11872473e-99]),
        step=0.005,
    )
    assert dominant_time_constant(lost) is None


def section(frequency, damping):
    return np.concatenate([[1.0], second_order_coefficients(frequency, damping)])


@pytest.mark.parametrize("place", [26.6, 27.3, 41.0, 88.8])
def test_a_mode_narrower_than_the_grid_is_the_peak_all_the_same(place):
    below = np.convolve(section(place, 0.002), section(120.0, 0.5))
    system = RationalDelay(delay=0.0, numerator=np.ones(1), denominator=below)
    found = peak_gain(system, highest=200.0)
    gain = np.abs(response(system, np.linspace(place * 0.99, place * 1.01, 20_001)))
    assert found.gain_db == pytest.approx(20 * np.log10(gain.max()), abs=0.01)
    assert found.frequency == pytest.approx(place, rel=1e-3)


def test_a_narrow_notch_is_seen_by_the_bandwidth():
    top, below = section(33.0, 1e-4), section(33.0, 0.01)
    system = RationalDelay(delay=0.0, numerator=top, denominator=below)
    assert bandwidth_3db(system, highest=200.0) == pytest.approx(33.0, rel=0.02)


def test_a_dip_that_no_grid_shows_is_a_bandwidth():
    """Five modes in parallel; between those at 36 and 47.5 Hz the gain falls by a little over 3 dB.

    Where it is least is scaled to a thousandth, or a twentieth of a thousandth, below the level.
    """
    gains = (-0.93117, -0.74381, -0.21323, -0.86773, 0.40425)
    places, damping = (
        (35.958, 47.507, 70.488, 104.129, 171.575),
        (0.0286, 0.0546, 0.045, 0.031, 0.0553),
    )
    polynomial = np.polynomial.polynomial
    poles = [second_order(f, z).denominator for f, z in zip(places, damping, strict=True)]
    below, above = np.ones(1), np.zeros(1)
    for gain, pole in zip(gains, poles, strict=True):
        above = polynomial.polyadd(polynomial.polymul(above, pole), gain * below)
        below = polynomial.polymul(below, pole)
    fine = np.linspace(36.0, 47.5, 20_001)

    def scaled(at_dc):
        """The same modes, and a constant that sets the gain at DC."""
        return RationalDelay(
            delay=0.0, numerator=polynomial.polyadd(above, at_dc * below), denominator=below
        )

    def depth(at_dc):
        seen = np.abs(response(scaled(at_dc), fine)) / abs(above[0] + at_dc)
        return float(seen.min() * np.sqrt(2.0)), float(fine[np.argmin(seen)])

    for wanted in (1.0 - 1e-3, 1.0 - 5e-5):
        at_dc = scipy.optimize.brentq(lambda x, w=wanted: depth(x)[0] - w, -0.05, 0.05)
        place = depth(at_dc)[1]
        found = bandwidth_3db(scaled(at_dc), highest=268.0)
        assert 0.98 * place < found < place


def test_the_phase_of_an_undamped_mode_turns_by_half_a_turn_without_overflow():
    mode = RationalDelay(delay=0.0, numerator=np.ones(1), denominator=np.array([1.0, 0.0, 1e-10]))
    at = np.array([0.0, 0.9e5, 1.1e5]) / (2 * np.pi)
    assert phase(mode, at) == pytest.approx([0.0, 0.0, -np.pi])
