"""From an identification to a model of the whole chain."""

from dataclasses import replace

import numpy as np
import pytest

import hmpim
from hmpim.model import draw_models, frequency_response, response_error


@pytest.fixture(scope="module")
def found() -> hmpim.Identification:
    sensor = hmpim.Sensor(
        delay=0.15,
        natural_frequency=10,
        damping_ratio=0.4,
        bias=0.6,
        noise_std=0.1,
        saturation_high=8.0,
        quantization_step=0.05,
        hold_period=0.0125,
    )
    limits = hmpim.Limits(position=10, velocity=1000, acceleration=40000, unit="deg")
    stimulus = hmpim.design(band=(0.1, 20), duration=10, fs=200, limits=limits)
    return hmpim.identify(hmpim.run(sensor, stimulus, rng=1), structures=["second_order"])


def test_a_model_has_the_whole_chain_and_its_errors(found):
    pair = found["y", "u"]
    model = hmpim.to_model(pair, fs=found.record.fs)
    assert model.hold_period == pytest.approx(0.0125, rel=1e-3)
    assert model.quantization_step == pytest.approx(0.05)
    assert model.saturation_high == pytest.approx(8.0)
    assert model.saturation_low is None
    assert model.fs == 200.0
    assert model.intersample == pair.intersample
    assert model.spread.covariance[0][0] == pytest.approx(pair.delay.std**2, rel=1e-3)
    assert model.spread.bias == pair.bias.std
    output = model.simulate(np.full(400, 20.0), np.arange(400) / 200.0, rng=0)
    assert output.max() == pytest.approx(8.0)
    assert np.all(np.abs(output / 0.05 - np.rint(output / 0.05)) < 1e-6)


def test_draws_scatter_as_the_response_is_uncertain(found):
    model = hmpim.to_model(found["y", "u"])
    f = np.array([0.5, 5.0, 12.0])
    drawn = np.array([frequency_response(m, f) for m in draw_models(model, 500, rng=3)])
    scatter = np.sqrt(np.mean(np.abs(drawn - frequency_response(model, f)) ** 2, axis=0))
    stated = response_error(model, f)
    assert scatter == pytest.approx(stated, rel=0.1)


def test_predictions_keep_within_the_range_of_the_output(found):
    prediction = hmpim.predict(found["y", "u"], found.data)
    high = found["y", "u"].saturation_high.value
    assert prediction.predicted.max() == high
    open_ = hmpim.to_model(found["y", "u"], fs=200.0)
    u = found.data.inputs[0].values
    free = hmpim.simulate(open_, u, fs=200.0, intersample=open_.intersample)
    assert free.max() > 8.5
    assert prediction.predicted.tolist() == np.minimum(free, high).tolist()
    assert prediction.findings == ()


def test_a_result_without_a_covariance_has_no_spread(found):
    pair = replace(found["y", "u"], covariance=None)
    assert hmpim.to_model(pair).spread is None
