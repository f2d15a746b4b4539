"""Filters in z under the same names as systems in s."""

import numpy as np
import pytest
from scipy import signal

import hmpim
from hmpim.errors import ArgumentError
from hmpim.model.dynamics import FILTERS, coefficients_of
from hmpim.model.filters import in_delta, in_z, poles_in_z, section_parameters
from hmpim.model.response import RationalDelay, bandwidth_3db, phase, response

FREQUENCY = np.linspace(0.5, 99.5, 60)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_a_butterworth_filter_is_a_bilinear_structure(order):
    top, below = signal.butter(order, 0.2)
    structure = FILTERS[f"bilinear_{order}"]
    theta = section_parameters(structure, np.roots(below).astype(complex))
    coefficients = coefficients_of(structure, theta)
    assert np.sort_complex(poles_in_z(structure, coefficients)) == pytest.approx(
        np.sort_complex(np.roots(below).astype(complex)), abs=1e-9
    )
    numerator, denominator = in_delta(structure, coefficients, np.ones(1))
    system = RationalDelay(delay=0.02, numerator=numerator, denominator=denominator, step=1 / 200)
    _, truth = signal.freqz(top, below, worN=FREQUENCY, fs=200.0)
    truth = truth * np.exp(-2j * np.pi * FREQUENCY * 0.02)
    assert np.abs(response(system, FREQUENCY) - truth).max() < 1e-9
    assert bandwidth_3db(system, highest=100.0) == pytest.approx(20.0)
    turned = phase(system, np.arange(0.0, 99.0, 0.1))
    assert np.abs(np.diff(turned)).max() < 0.1  # continuous
    wrapped = np.angle(response(system, np.arange(0.0, 99.0, 0.1)))
    assert np.abs(np.exp(1j * turned) - np.exp(1j * wrapped)).max() < 1e-7


def test_powers_of_z_and_of_differences_turn_into_each_other():
    coefficients = np.array([0.3, -1.2, 0.5, 2.0])
    assert in_z(in_z(coefficients)) == pytest.approx(coefficients)


@pytest.mark.parametrize(
    ("top", "below"),
    [
        ([1.0], [1.0]),
        ([0.2, 0.3, 0.5], [1.0]),
        ([0.2], [1.0, -0.8]),
        ([0.3, -0.2], [1.0, -1.6, 0.7]),
    ],
)
def test_a_model_of_software_runs_as_the_software_does(top, below):
    top, below = np.array(top), np.array(below)
    length = max(top.size, below.size)
    gain = top.sum() / below.sum()
    model = hmpim.Model(
        delay=0.015,
        scale_factor=gain,
        numerator=tuple(np.pad(top / gain, (0, length - top.size))),
        denominator=tuple(np.pad(below, (0, length - below.size))),
        bias=0.5,
        intersample="sampled",
        fs=200.0,
    )
    u = np.random.default_rng(0).standard_normal(300)
    late = np.concatenate([np.full(3, u[0]), u[:-3]])
    truth = signal.lfilter(top, below, late - u[0]) + gain * u[0] + 0.5
    assert model.simulate(u, np.arange(300) / 200) == pytest.approx(truth, abs=1e-12)
    assert hmpim.simulate(model, u, fs=200.0, intersample="sampled") == pytest.approx(
        truth, abs=1e-12
    )
    _, seen = signal.freqz(top, below, worN=FREQUENCY, fs=200.0)
    seen = seen * np.exp(-2j * np.pi * FREQUENCY * 0.015)
    assert hmpim.frequency_response(model, FREQUENCY) == pytest.approx(seen, abs=1e-12)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"fs": None}, "is not the rate of software"),
        ({"delay": 0.0123}, "is 2.46 samples; software is late by a whole number"),
        ({"numerator": (1.0, 0.0, 0.0)}, "needs input from after its output"),
        ({"denominator": (1.0, -1.1)}, "has a pole at z = 1.1"),
    ],
)
def test_what_no_software_does_is_refused(changed, words):
    given = {"delay": 0.01, "scale_factor": 1.0, "intersample": "sampled", "fs": 200.0}
    given |= {"numerator": (0.2, 0.0), "denominator": (1.0, -0.8)} | changed
    with pytest.raises(ArgumentError, match=words):
        hmpim.Model(**given)


def test_software_runs_at_its_own_rate_alone():
    model = hmpim.Model(delay=0.01, scale_factor=1.0, intersample="sampled", fs=200.0)
    with pytest.raises(ArgumentError, match="100 Hz is not the rate of this software, 200 Hz"):
        model.at_rate(100.0)


def test_a_filter_with_more_taps_than_poles_off_zero_is_run_as_it_is():
    """A pole at z = 0 to within rounding is cut off, and with it the state that held a tap."""
    above, below = np.array([0.2, 0.3, -0.1, 0.05]), np.array([1.0, -1.5, 0.6, -1e-22])
    model = hmpim.Model(
        delay=0.0,
        scale_factor=above.sum() / below.sum(),
        numerator=tuple(above * below.sum() / above.sum()),
        denominator=tuple(below),
        intersample="sampled",
        fs=200.0,
    )
    u = np.concatenate([np.zeros(5), np.random.default_rng(0).standard_normal(200)])
    found = hmpim.simulate(model, u, fs=200.0, intersample="sampled")
    np.testing.assert_allclose(found, signal.lfilter(above, below, u), atol=1e-9)
