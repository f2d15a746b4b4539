"""A held command whose velocity and acceleration are held too."""

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

import hmpim
from hmpim.errors import ArgumentError
from hmpim.model import RationalDelay
from hmpim.model.discrete import discretise, fed_forward_response
from hmpim.model.poles import rational_response
from hmpim.model.sampled import MARGIN, prepare_input

FS, SAMPLES = 500.0, 3000
TIME = np.arange(SAMPLES) / FS
ABOVE, BELOW = np.array([1.0, 0.006, 4e-5]), np.array([1.0, 0.01, 6e-5, 1.5e-7])


def sweep(order=0):
    """A sweep from 1 to 40 Hz that fades in and out, or a derivative of it (per second)."""
    fade = np.sin(np.pi * TIME / TIME[-1]) ** 4
    wave = fade * np.exp(2j * np.pi * (TIME + 39.0 / 12.0 * TIME**2))
    for _ in range(order):  # by a Fourier transform: the ends are at rest
        wave = np.fft.ifft(np.fft.fft(wave) * 2j * np.pi * np.fft.fftfreq(SAMPLES, 1.0 / FS))
    return wave.real


def held(values):
    """Response of 1/A to a held input, by a matrix exponential."""
    above, below, _ = cont2discrete((np.ones(1), BELOW[::-1]), 1.0 / FS, "zoh")
    return lfilter(above.ravel(), below, values)


def stepped():
    """The output of a servo that receives position, velocity and acceleration, without a delay."""
    return sum(b * held(sweep(order)) for order, b in enumerate(ABOVE))


@pytest.mark.parametrize("order", [1, 2])
def test_velocity_and_acceleration_are_those_of_the_smooth_command(order):
    source = prepare_input(sweep(), "feedforward")
    found = source.derivatives[order - 1, MARGIN:-MARGIN] * FS**order
    expected = sweep(order)
    assert np.max(np.abs(found - expected)) < 1e-4 * np.max(np.abs(expected))


def test_a_model_answers_each_held_command():
    source = prepare_input(sweep(), "feedforward")
    steps = FS ** np.arange(4)
    found = rational_response(
        source, delay=0.0, numerator=ABOVE * steps[:3], denominator=BELOW * steps
    )
    expected = stepped()
    assert np.max(np.abs(found - expected)) < 1e-4 * np.max(np.abs(expected))
    alone = rational_response(
        prepare_input(sweep(), "zoh"),
        delay=0.0,
        numerator=ABOVE * steps[:3],
        denominator=BELOW * steps,
    )
    assert np.max(np.abs(alone - expected)) > 1e-3 * np.max(np.abs(expected))


def test_a_numerator_without_derivatives_is_that_of_a_held_command():
    held_alone, fed = (prepare_input(sweep(), mode) for mode in ("zoh", "feedforward"))
    same = {"delay": 1.3, "numerator": np.ones(1), "denominator": np.array([1.0, 4.0])}
    assert np.array_equal(rational_response(held_alone, **same), rational_response(fed, **same))


def test_a_command_has_two_derivatives():
    source = prepare_input(sweep(), "feedforward")
    with pytest.raises(ArgumentError, match="degree 3 is given; a command with feedforward"):
        rational_response(
            source, delay=0.0, numerator=np.ones(4), denominator=np.array([1.0, 3.0, 3.0, 1.0])
        )


def test_the_response_from_samples_to_samples_is_that_of_the_spectra():
    system = RationalDelay(delay=0.0, numerator=ABOVE, denominator=BELOW)
    u, y = np.fft.rfft(sweep()), np.fft.rfft(stepped())
    f = np.fft.rfftfreq(SAMPLES, 1.0 / FS)
    clear = (f > 2.0) & (f < 36.0)
    expected = fed_forward_response(system, f[clear], fs=FS)
    assert np.max(np.abs(y[clear] / u[clear] / expected - 1.0)) < 1e-3


@pytest.mark.parametrize("delay", [0.0, 0.0033, -0.0005])
def test_a_step_has_the_response_of_all_held_commands(delay):
    system = RationalDelay(delay=delay, numerator=ABOVE, denominator=BELOW)
    step = discretise(system, fs=FS, intersample="feedforward", band=40.0)
    f = np.linspace(0.2, 40.0, 300)
    missed = np.max(np.abs(step.response(f) / fed_forward_response(system, f, fs=FS) - 1.0))
    assert missed < 2.0 * step.error < 2e-3
    plain = RationalDelay(delay=delay, numerator=np.ones(1), denominator=BELOW)
    assert discretise(plain, fs=FS, intersample="feedforward").error == 0.0


def test_simulation_and_the_stepped_model_agree_within_that_error():
    model = hmpim.Model(
        delay=0.002,
        scale_factor=1.0,
        numerator=tuple(ABOVE[::-1]),
        denominator=tuple(BELOW[::-1]),
        intersample="feedforward",
        band=40.0,
    )
    u = sweep()
    whole = hmpim.simulate(model, u, fs=FS, intersample="feedforward")
    causal = model.simulate(u, TIME)
    error = np.std(whole - causal) / np.std(whole)
    assert 0.0 < error < model.at_rate(FS).error
