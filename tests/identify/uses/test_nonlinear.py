"""Predictions of units that are not linear, under another input than the identified one."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from nonlinear_predictions import (
    FS,
    NOISE,
    SAMPLES,
    SIZES,
    binary,
    chirp,
    driven_by,
    moved,
    recorded,
)

import hmpim
from hmpim.identify import Nonlinearity
from hmpim.model.nonlinear import nonlinear_effect
from hmpim.record import Finding


@cache
def found_of(kind: str) -> hmpim.Identification:
    """Which structure is chosen, other tests ask."""
    record = recorded(chirp(), moved(kind, chirp()), 1)
    return hmpim.identify(record, structures=["second_order"])


def identified(kind: str) -> hmpim.Identification:
    """As read back from its file."""
    return hmpim.Identification.from_dict(json.loads(json.dumps(found_of(kind).to_dict())))


@pytest.fixture(scope="module", params=sorted(SIZES))
def other(request):
    """A kind, its result as read back from its file, and another record of the unit."""
    drive = binary(7, 1.1 if request.param == "rate_limit" else 0.7)
    clean = moved(request.param, drive)
    return request.param, identified(request.param), recorded(drive, clean, 2), clean


def test_another_input_is_predicted_to_a_part_of_the_noise(other):
    kind, result, record, clean = other
    pair = result["y", "u"]
    part = pair.nonlinear_part
    assert part is not None
    assert part.kind == kind
    found = hmpim.predict(pair, record)
    linear = hmpim.predict(replace(pair, nonlinear_part=None), record)

    def error(prediction) -> float:
        return float(np.sqrt(np.mean((prediction.predicted - clean)[found.scored] ** 2)))

    assert error(found) < 0.15 * NOISE
    assert error(linear) > 10.0 * error(found)
    assert error(linear) > NOISE
    assert found.fit_percent > linear.fit_percent


def test_a_right_unit_is_valid_on_it_and_its_linear_part_is_not(other):
    _, result, record, _ = other
    validation = hmpim.validate(result, record)
    assert validation.passed, validation.to_dict()
    (pair,) = result.pairs
    linear = replace(result, pairs=(replace(pair, nonlinear_part=None),))
    assert not hmpim.validate(linear, record).passed


def test_what_is_found_is_the_same_on_its_own_record():
    """The prediction that the fit made, row by row, is what the equations give on their own."""
    for kind in ("backlash", "friction", "hardening", "rate_limit"):
        pair = found_of(kind)["y", "u"]
        found = hmpim.predict(pair, recorded(chirp(), moved(kind, chirp()), 1))
        difference = (found.predicted - pair.prediction)[found.scored]
        assert np.max(np.abs(difference)) < 0.02 * NOISE, kind


def test_an_input_beyond_the_identified_amplitude_is_said():
    result = identified("hardening")
    drive = chirp(1.3)
    (said,) = hmpim.predict(
        result["y", "u"], recorded(drive, moved("hardening", drive), 3)
    ).findings
    assert said.code == "beyond_reach"
    assert said.message.startswith("'u' moves the output by up to 2.4")
    assert "a hardening spring was identified from a record of up to 1.9" in said.message
    (output,) = hmpim.validate(result, recorded(drive, moved("hardening", drive), 3)).outputs
    assert output.findings == (said,)
    within = recorded(chirp(), moved("hardening", chirp()), 4)
    assert hmpim.predict(result["y", "u"], within).findings == ()


def test_a_spring_that_would_not_return_leaves_the_linear_part_and_says_so():
    result = identified("softening")
    drive = chirp(4.0)
    record = recorded(drive, moved("linear", drive), 3)
    found = hmpim.predict(result["y", "u"], record)
    (said,) = found.findings
    assert said.code == "linear_only"
    assert "is that of the linear part alone: a softening spring, known up to" in said.message
    linear = hmpim.predict(replace(result["y", "u"], nonlinear_part=None), record)
    assert found.predicted.tolist() == linear.predicted.tolist()


def test_a_nonlinearity_that_is_no_part_of_the_model_is_named():
    record = recorded(chirp(), moved("backlash", chirp()), 1)
    result = hmpim.identify(record, structures=["second_order"], nonlinear="reported")
    pair = result["y", "u"]
    assert pair.nonlinear_part is None
    (said,) = hmpim.predict(pair, recorded(binary(7), moved("backlash", binary(7)), 2)).findings
    assert said.code == "linear_only"
    assert "backlash" in said.message
    assert said.message.endswith("was found, but is not part of the model.")
    unknown = replace(
        pair,
        warnings=(Finding(code="nonlinear", message="…", severity="info", parameters=()),),
        nonlinearity=Nonlinearity(
            share=0.01, even=0.0, odd=0.0, noise=1.0, linear=0.0, nonlinear=0.0
        ),
    )
    (said,) = hmpim.predict(unknown, recorded(binary(7), moved("backlash", binary(7)), 2)).findings
    assert "a nonlinearity of no known kind was found" in said.message


def test_a_linear_unit_is_predicted_as_its_linear_model_simulates():
    drive = binary(7)
    result = identified("linear")
    pair = result["y", "u"]
    assert pair.nonlinear_part is None
    record = recorded(drive, moved("linear", drive), 2)
    found = hmpim.predict(pair, record)
    assert found.findings == ()
    model = hmpim.to_model(pair, fs=FS)
    plain = hmpim.simulate(model, drive.sampled(), fs=FS, intersample=pair.intersample)
    assert found.predicted.tolist() == plain.tolist()


def test_until_the_gap_is_crossed_the_prediction_is_not_scored():
    """Backlash may begin anywhere in its gap."""
    result = identified("backlash")

    def late(t):
        t = np.asarray(t)
        return 0.02 * np.sin(2 * np.pi * 2.0 * t) * (t < 4.0) + chirp().source(t - 4.0)

    drive = driven_by(late)
    y = moved("backlash", drive) + 0.05 * (np.arange(SAMPLES) < 4.0 * FS)
    found = hmpim.predict(result["y", "u"], recorded(drive, y, 3))
    first = int(np.argmax(found.scored))
    assert 4.0 < first / FS < 6.0
    assert hmpim.validate(result, recorded(drive, y, 3)).passed


@pytest.mark.parametrize("kind", ["hardening", "friction"])
def test_a_force_is_followed_once_for_a_prediction_and_once_for_a_validation(kind, monkeypatch):
    result, record = found_of(kind), recorded(chirp(0.9), moved(kind, chirp(0.9)), 2)
    model, (u,) = hmpim.to_model(result["y", "u"], fs=record.fs), record.inputs
    whole = hmpim.simulate(model, u.values, fs=record.fs, intersample=model.intersample)
    followed = []

    def counted(*arguments):
        followed.append(arguments)
        return nonlinear_effect(*arguments)

    monkeypatch.setattr("hmpim.model.model.nonlinear_effect", counted)
    monkeypatch.setattr("hmpim.model.nonlinear.nonlinear_effect", counted)
    predicted = hmpim.predict(result["y", "u"], record).predicted
    assert len(followed) == 1
    (output,) = hmpim.validate(result, record).outputs
    assert len(followed) == 2
    assert np.array_equal(predicted, whole)
    begins = int(np.argmax(output.scored))  # from there on with the free response of its state
    assert np.array_equal(output.predicted[:begins], ((whole - model.bias) + model.bias)[:begins])
    assert output.predicted == pytest.approx(whole, abs=0.02)
