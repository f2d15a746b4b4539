"""Bandwidths off the response: right under noise that fools the first crossing."""

import numpy as np
import pytest

import hmpim
from hmpim.identify.reading.bandwidth import response_bandwidths
from hmpim.identify.result import Estimate, FrequencyResponse, Parameters
from hmpim.model import RationalDelay, bandwidth_phase, phase, response, second_order_coefficients

ROLL = RationalDelay(
    delay=0.002,
    numerator=np.array([1.0]),
    denominator=np.concatenate([[1.0], second_order_coefficients(43.0, 0.6)]),
)


def near(value: float) -> Estimate:
    return Estimate(value=value, std=0.1, ci95=(value - 0.2, value + 0.2), unit="Hz")


MODELLED = Parameters(
    bandwidth_phase90=near(bandwidth_phase(ROLL, highest=100.0)),
    bandwidth_phase90_without_delay=near(43.0),
)
SAMPLED = {"fs": 1e5, "intersample": "bandlimited"}
FREQUENCY = np.arange(0.5, 60.0, 0.1)


def noisy(seed: int, level: float) -> FrequencyResponse:
    rng = np.random.default_rng(seed)
    truth = response(ROLL, FREQUENCY)
    error = rng.standard_normal((2, FREQUENCY.size)) @ np.eye(FREQUENCY.size) * level / np.sqrt(2)
    return FrequencyResponse(
        frequency=FREQUENCY,
        response=truth + error[0] + 1j * error[1],
        std=np.full(FREQUENCY.size, level),
    )


def first_crossing(measured: FrequencyResponse) -> float:
    turned = np.unwrap(np.angle(measured.response))
    return float(FREQUENCY[np.argmax(turned < -np.pi / 2)])


def test_without_noise_it_is_the_models():
    found = response_bandwidths(noisy(0, 1e-9), ROLL, MODELLED, **SAMPLED)
    there = found.bandwidth_phase90.value
    assert phase(ROLL, np.array([there]))[0] == pytest.approx(-np.pi / 2, abs=1e-6)
    assert found.bandwidth_phase90_without_delay.value == pytest.approx(43.0, abs=1e-4)


def test_a_noisy_phase_does_not_pull_it_down():
    """The first crossing of the raw phase comes far too low; this reading stays put."""
    truth = response_bandwidths(noisy(0, 1e-9), ROLL, MODELLED, **SAMPLED).bandwidth_phase90.value
    found = [
        response_bandwidths(noisy(seed, 0.4), ROLL, MODELLED, **SAMPLED).bandwidth_phase90
        for seed in range(60)
    ]
    raw = [first_crossing(noisy(seed, 0.4)) for seed in range(60)]
    values = np.array([e.value for e in found])
    assert np.mean(raw) < 0.9 * truth
    assert np.mean(values) == pytest.approx(truth, rel=0.03)
    assert np.std(values) < np.mean([e.std for e in found])


def test_a_response_that_differs_from_the_model_is_read_as_it_is():
    other = RationalDelay(
        delay=0.0025,
        numerator=np.array([1.0]),
        denominator=np.concatenate([[1.0], second_order_coefficients(41.0, 0.6)]),
    )
    measured = FrequencyResponse(
        frequency=FREQUENCY,
        response=response(other, FREQUENCY),
        std=np.full(FREQUENCY.size, 1e-3),
    )
    there = response_bandwidths(measured, ROLL, MODELLED, **SAMPLED).bandwidth_phase90.value
    assert phase(other, np.array([there]))[0] == pytest.approx(-np.pi / 2, abs=0.02)


def test_response_and_model_agree_on_a_record(field_record):
    _, u, y = field_record
    noisy_y = y + 0.1 * np.random.default_rng(0).standard_normal(y.size)
    record = hmpim.Record.from_arrays({"u": u}, {"y": noisy_y}, fs=200.0, intersample="bandlimited")
    pair = hmpim.identify(record)["y", "u"]
    for name in ("bandwidth_phase90", "bandwidth_phase90_without_delay", "bandwidth_3db"):
        model, measured = getattr(pair, name), getattr(pair.from_response, name)
        assert abs(model.value - measured.value) < 3 * np.hypot(model.std, measured.std), name


def test_a_held_input_is_taken_out():
    """Samples over samples of a held input lag by half a sample more; the system does not."""
    held = sum(  # its aliases too
        response(ROLL, f) * np.sinc(f / 500) * np.exp(-1j * np.pi * f / 500)
        for f in (FREQUENCY + 500.0 * k for k in range(-50, 51))
    )
    measured = FrequencyResponse(
        frequency=FREQUENCY, response=held, std=np.full(FREQUENCY.size, 1e-3)
    )
    found = response_bandwidths(measured, ROLL, MODELLED, fs=500.0, intersample="zoh")
    assert found.bandwidth_phase90.value == pytest.approx(MODELLED.bandwidth_phase90.value)
