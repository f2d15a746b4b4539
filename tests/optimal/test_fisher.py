"""Predicted errors: analytic derivatives against numerical ones, route against route."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmpim.errors import ArgumentError
from hmpim.experiment import run
from hmpim.optimal import RoughModel, fisher_information, predict_errors, sensitivities
from hmpim.optimal.fisher import responses, standard_deviations
from hmpim.rigs import Sensor
from hmpim.stimulus import Limits, Stimulus, SumOfSines, design
from tests_support import examples

FS = 200.0
FIG_17 = RoughModel(delay=0.15, natural_frequency=10.0, damping_ratio=0.4)
NAMES = ("delay", "natural_frequency", "damping_ratio", "scale_factor")
roughs = st.builds(
    RoughModel,
    delay=st.floats(0.0, 0.3),
    natural_frequency=st.floats(2.0, 25.0),
    damping_ratio=st.floats(0.1, 1.5),
    scale_factor=st.floats(0.3, 3.0) | st.floats(-3.0, -0.3),
)


def changed(model, name, value):
    values = {k: getattr(model, k) for k in NAMES}
    return RoughModel(**{**values, name: value})


@pytest.fixture(scope="module")
def led():
    limits = Limits(position=10, unit="deg")
    return design(band=(0.5, 20), duration=4, fs=FS, limits=limits, extinction=1.0)


@given(model=roughs)
def test_derivatives_of_the_response_against_differences(model):
    s = 2j * np.pi * np.linspace(0.0, 60.0, 40)

    def response(m):
        omega = 2 * np.pi * m.natural_frequency
        low = omega**2 / (s**2 + 2 * m.damping_ratio * omega * s + omega**2)
        return m.scale_factor * low * np.exp(-s * m.delay)

    for name, row in zip(NAMES, responses(model, s), strict=True):
        step = 1e-5 * max(abs(getattr(model, name)), 0.01)
        at = getattr(model, name) + (step if name == "delay" else 0.0)  # a delay is not negative
        up, down = changed(model, name, at + step), changed(model, name, at - step)
        here = responses(changed(model, name, at), s)[NAMES.index(name)]
        numerical = (response(up) - response(down)) / (2 * step)
        assert np.abs(here - numerical).max() <= 1e-6 * np.abs(row).max()


@examples(8)
@given(model=roughs)
def test_the_two_routes_agree(led, model):
    by_fourier = sensitivities(led.position, model=model, fs=FS)
    by_filters = sensitivities(led.position, model=model, fs=FS, route="time")
    scale = np.abs(by_fourier).max(axis=1, keepdims=True)
    assert np.abs(by_fourier - by_filters).max(axis=1) == pytest.approx(0.0, abs=3e-4 * scale.max())
    one = standard_deviations(fisher_information(led.position, model=model, noise_std=0.1, fs=FS))
    other = standard_deviations(
        fisher_information(led.position, model=model, noise_std=0.1, fs=FS, route="time")
    )
    np.testing.assert_allclose(one, other, rtol=2e-3)


@pytest.mark.parametrize("name", NAMES)
def test_derivatives_against_the_stepped_sensor(led, name):
    """The sensor integrates its physics in time and knows no transfer function."""

    def read(model):
        sensor = Sensor(**{k: getattr(model, k) for k in NAMES})
        return run(sensor, led).outputs[0].values

    value = getattr(FIG_17, name)
    step = 1e-4 * value
    up, down = changed(FIG_17, name, value + step), changed(FIG_17, name, value - step)
    numerical = (read(up) - read(down)) / (2 * step)
    analytic = sensitivities(led.position, model=FIG_17, fs=FS)[NAMES.index(name)]
    assert np.abs(analytic - numerical).max() <= 1e-3 * np.abs(numerical).max()


def test_a_sine_tells_its_gain_as_the_textbook_says():
    """Of amplitude A over n samples: variance of the gain 2σ²/(nA²), if nothing else is unknown."""
    stiff = RoughModel(natural_frequency=60.0, damping_ratio=1.0)
    sine = Stimulus(waveform=SumOfSines(amplitudes=(3.0,), frequencies=(0.5,), duration=20), fs=FS)
    information = fisher_information(sine.position, model=stiff, noise_std=0.2, fs=FS)
    gain_alone = 1.0 / np.sqrt(information[3, 3])
    assert gain_alone == pytest.approx(np.sqrt(2 / sine.samples) * 0.2 / 3.0, rel=2e-3)
    assert information[4, 4] == pytest.approx(sine.samples / 0.2**2)


def test_errors_are_inverse_to_the_size_and_to_the_root_of_repeats(led):
    once = predict_errors(led, model=FIG_17, noise_std=0.1)
    larger = predict_errors(4.0 * led.position, fs=FS, model=FIG_17, noise_std=0.1)
    twice = predict_errors(np.tile(led.position, 2), fs=FS, model=FIG_17, noise_std=0.1)
    for name in NAMES:
        assert getattr(larger, name) == pytest.approx(getattr(once, name) / 4.0, rel=1e-9)
        assert getattr(twice, name) == pytest.approx(getattr(once, name) / np.sqrt(2), rel=1e-3)
    assert larger.bias == pytest.approx(once.bias, rel=1e-9)


def test_the_figure_of_the_paper_as_printed():
    """The bound for Fig. 17: 0.095 ms, 0.030 Hz, 0.0016, scale 0.0011, bias 0.0022."""
    limits = Limits(position=10, unit="deg")
    printed = design(band=(0.1, 20), duration=10, fs=FS, limits=limits, extinction=1.0, lead=0)
    errors = predict_errors(printed, model=FIG_17, noise_std=0.1)
    assert errors.delay == pytest.approx(0.0955e-3, rel=0.01)
    assert errors.natural_frequency == pytest.approx(0.0298, rel=0.01)
    assert errors.damping_ratio == pytest.approx(0.00165, rel=0.01)
    assert errors.scale_factor == pytest.approx(0.00106, rel=0.01)
    assert errors.bias == pytest.approx(0.00226, rel=0.01)
    assert errors.ci95("delay") == pytest.approx(1.96 * errors.delay, rel=1e-4)


def test_what_the_stimulus_does_not_tell_is_infinite():
    still = predict_errors(np.zeros(100), fs=FS, model=FIG_17, noise_std=0.1)
    assert np.isinf(still.delay)
    single = np.sin(2 * np.pi * 2.0 * np.arange(20000) / FS)  # one frequency, two equations
    assert predict_errors(single, fs=FS, model=FIG_17, noise_std=0.1).natural_frequency > 0.05


def test_an_array_needs_its_rate():
    with pytest.raises(ArgumentError, match="fs is not given"):
        predict_errors(np.zeros(100), model=FIG_17, noise_std=0.1)
