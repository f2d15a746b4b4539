"""Responses between the samples, against closed forms and against time-stepped physics."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmpim.model import delayed_response, prepare_input, second_order_coefficients
from hmpim.model.sampled import interpolation_error
from tests_support import examples


def lag(time_constant: float) -> np.ndarray:
    return np.array([1.0, time_constant])


@given(
    delay=st.floats(0.0, 7.0),
    time_constant=st.floats(0.3, 50.0),
    levels=st.lists(st.floats(-2, 2), min_size=12, max_size=12),
)
@examples(20)
def test_held_input_through_a_lag_is_a_sum_of_exponentials(delay, time_constant, levels):
    u = np.array([0.0, *levels])
    y = delayed_response(prepare_input(u, "zoh"), delay=delay, denominator=lag(time_constant))[0]
    k = np.arange(u.size)
    expected = np.zeros(u.size)
    for i, jump in enumerate(np.diff(u), start=1):
        since = k - delay - i
        expected += np.where(
            since > 0, jump * (1 - np.exp(-np.maximum(since, 0) / time_constant)), 0
        )
    np.testing.assert_allclose(y, expected, atol=1e-10)


@given(delay=st.floats(0.0, 5.0), time_constant=st.floats(0.3, 30.0))
@examples(12)
def test_a_ramp_through_a_lag_trails_by_its_time_constant(delay, time_constant):
    u = np.arange(20.0)
    y = delayed_response(prepare_input(u, "foh"), delay=delay, denominator=lag(time_constant))[0]
    since = np.maximum(np.arange(20.0) - delay, 0)
    expected = since - time_constant * (1 - np.exp(-since / time_constant))
    np.testing.assert_allclose(y, expected, atol=1e-9)


@pytest.mark.parametrize("damping_ratio", [0.2, 0.7, 1.0, 1.6])
def test_held_step_through_a_second_order_lag(damping_ratio):
    natural = 0.02  # cycles per sample
    u = np.concatenate([[0.0], np.ones(200)])
    y = delayed_response(
        prepare_input(u, "zoh"),
        delay=0.0,
        denominator=np.concatenate([[1.0], second_order_coefficients(natural, damping_ratio)]),
    )[0]
    omega, zeta = 2 * np.pi * natural, damping_ratio
    t = np.maximum(np.arange(201.0) - 1, 0)
    if zeta == 1.0:
        expected = 1 - np.exp(-omega * t) * (1 + omega * t)
    else:
        root = np.sqrt(complex(zeta * zeta - 1))
        decay = np.exp(-zeta * omega * t)
        expected = 1 - decay * (np.cosh(omega * root * t) + zeta / root * np.sinh(omega * root * t))
    np.testing.assert_allclose(y, np.real(expected), atol=1e-10)


@pytest.mark.parametrize(("frequency", "tolerance"), [(0.05, 1e-7), (0.15, 1e-4), (0.4, 2e-3)])
def test_band_limited_sine_meets_the_frequency_response(frequency, tolerance):
    """Steady state of a sine: gain and phase of 1/A(jω) e^(-jωτ), up to 80 % of Nyquist."""
    k = np.arange(4000)
    ramp = np.minimum(k / 1000, 1.0)
    ramp = ramp**3 * (10 - 15 * ramp + 6 * ramp**2)
    u = ramp * np.sin(2 * np.pi * frequency * k)
    denominator = np.concatenate([[1.0], second_order_coefficients(0.08, 0.5)])
    y = delayed_response(prepare_input(u, "bandlimited"), delay=3.37, denominator=denominator)[0]
    s = 2j * np.pi * frequency
    gain = np.exp(-3.37 * s) / np.polynomial.polynomial.polyval(s, denominator)
    expected = np.imag(gain * np.exp(s * k))
    np.testing.assert_allclose(y[1500:3900], expected[1500:3900], atol=tolerance * abs(gain))


def test_band_limited_sweep_agrees_with_time_stepped_physics(field_record):
    _, u, stepped = field_record
    y = delayed_response(
        prepare_input(u, "bandlimited"),
        delay=0.15 * 200,
        denominator=np.concatenate(
            [[1.0], second_order_coefficients(10.0, 0.4) * np.array([200.0, 200.0**2])]
        ),
    )[0]
    np.testing.assert_allclose(
        y + 0.6, stepped, atol=1e-4
    )  # the sweep's kink at t = 0 is not band-limited


def test_powers_are_derivatives():
    rng = np.random.default_rng(5)
    u = np.cumsum(rng.standard_normal(400))
    denominator = np.array([1.0, 6.0, 30.0])
    held = prepare_input(u, "zoh")
    _, rate = delayed_response(held, delay=2.3, denominator=denominator, powers=2)
    step = 1e-5
    ahead = delayed_response(held, delay=2.3 - step, denominator=denominator)[0]
    behind = delayed_response(held, delay=2.3 + step, denominator=denominator)[0]
    np.testing.assert_allclose(rate[5:], (ahead - behind)[5:] / (2 * step), atol=1e-7)


@given(shift=st.integers(0, 10), delay=st.floats(0, 5))
@examples(10)
def test_a_whole_sample_of_delay_is_a_shift(shift, delay):
    rng = np.random.default_rng(shift)
    u = np.concatenate([np.zeros(30), rng.standard_normal(100)])
    for mode in ("zoh", "foh", "bandlimited"):
        source = prepare_input(u, mode)
        early = delayed_response(source, delay=delay, denominator=lag(4.0))[0]
        late = delayed_response(source, delay=delay + shift, denominator=lag(4.0))[0]
        np.testing.assert_allclose(late[shift:], early[: early.size - shift], atol=1e-9)


def test_without_dynamics_a_fraction_of_a_sample_is_exact():
    k = np.arange(600.0)
    bump = np.exp(-(((k - 300) / 40) ** 2)) * np.sin(0.5 * k)
    y = delayed_response(prepare_input(bump, "bandlimited"), delay=0.42, denominator=np.ones(1))[0]
    moved = np.exp(-(((k - 0.42 - 300) / 40) ** 2)) * np.sin(0.5 * (k - 0.42))
    np.testing.assert_allclose(y, moved, atol=2e-5)


def test_an_input_in_motion_is_continued_without_a_corner():
    n, frequency = 400, 0.05
    u = np.cos(2 * np.pi * frequency * np.arange(n) + 0.6)
    exact = np.cos(2 * np.pi * frequency * (np.arange(n) - 0.4) + 0.6) - u[0]

    def missed(*, rest: bool) -> float:
        shifted = delayed_response(
            prepare_input(u, "bandlimited", rest=rest), delay=0.4, denominator=np.ones(1)
        )
        return float(np.abs(shifted[0] - exact)[1:12].max())

    assert missed(rest=False) < 0.3 * missed(rest=True)


@pytest.mark.parametrize("precision", [1e-3, 1e-5, 1e-6, 1e-8])
def test_a_sweep_is_interpolated_as_closely_as_asked(precision):
    index = np.arange(2000)
    u = np.sin(np.pi * 0.2 / index.size * index**2) * np.hanning(index.size)
    late = index - 0.5
    exact = np.sin(np.pi * 0.2 / index.size * late**2) * (
        0.5 - 0.5 * np.cos(2 * np.pi * late / (index.size - 1))
    )
    source = prepare_input(u, "bandlimited", precision=precision)
    missed = (delayed_response(source, delay=0.5, denominator=np.ones(1))[0] - exact)[100:-100]
    assert np.sqrt(np.mean(missed**2)) < precision * u.std()
    assert interpolation_error(u, source.oversampling) < precision
