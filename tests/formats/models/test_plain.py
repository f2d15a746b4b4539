"""JSON, MAT, CSV and UFF58, read back by their own readers."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.io import loadmat

from hmpim.formats.models import export
from hmpim.model import (
    Model,
    Spread,
    coefficient_vector,
    frequency_response,
    response_error,
)

from .conftest import result_of

MODEL = Model(
    delay=0.15,
    scale_factor=2.0,
    numerator=(0.01, 1.0),
    denominator=(2.5330295910584444e-4, 0.012732395447351628, 1.0),
    bias=0.6,
    noise_std=0.1,
    saturation_high=7.0,
    hold_period=0.02,
    output_unit="deg",
    band=20.0,
)


def test_json_holds_all_that_is_known(tmp_path):
    (file,) = export(result_of(MODEL), to="json", path=tmp_path / "m.json")
    found = json.loads(file.read_text(encoding="utf-8"))
    assert found["schema"] == "hmpim/model/1"
    assert found["denominator"] == list(MODEL.denominator)
    assert found["saturation"] == [None, 7.0]
    assert found["hold_period"] == 0.02
    assert found["parameters"]["delay"]["ci95"] == pytest.approx([0.149706, 0.150294])
    assert found["covariance"]["of"] == [
        "delay",
        "scale_factor * numerator s^1",
        "scale_factor * numerator s^0",
        "denominator s^2",
        "denominator s^1",
    ]
    values = np.array(found["covariance"]["values"])
    assert np.sqrt(np.diag(values)) == pytest.approx(1e-3 * coefficient_vector(MODEL))
    assert found["record"]["sha256"] == "0123abcd" * 8
    assert found["warnings"][0]["code"] == "odd"


def test_json_names_the_coefficients_of_an_integrator(tmp_path):
    model = Model(delay=0.1, scale_factor=3.0, denominator=(0.03, 1.0, 0.0), noise_std=0.1)
    (file,) = export(result_of(model), to="json", path=tmp_path / "m.json")
    names = json.loads(file.read_text(encoding="utf-8"))["covariance"]["of"]
    assert names == ["delay", "scale_factor * numerator s^0", "denominator s^2"]


def test_mat_opens_as_a_struct(tmp_path):
    (file,) = export(result_of(MODEL), to="mat", path=tmp_path / "axis.mat")
    found = loadmat(file, squeeze_me=True, struct_as_record=False)["axis"]
    assert found.denominator == pytest.approx(MODEL.denominator)
    assert found.parameters.natural_frequency.std == pytest.approx(0.01)
    assert found.covariance.values.shape == (5, 5)
    assert found.quantization_step.size == 0
    f = found.response.frequency
    assert found.response.model == pytest.approx(frequency_response(MODEL, f))
    assert found.record.sha256 == "0123abcd" * 8
    assert any("sha256" in line for line in found.about)


def test_csv_has_measurement_and_model_with_their_errors(tmp_path):
    (file,) = export(result_of(MODEL), to="csv", path=tmp_path / "r.csv")
    lines = file.read_text(encoding="utf-8").splitlines()
    assert any("verdict ok" in line for line in lines if line.startswith("#"))
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    f = np.array([float(r["frequency_hz"]) for r in rows])
    response = np.array([complex(float(r["model_real"]), float(r["model_imag"])) for r in rows])
    assert response == pytest.approx(frequency_response(MODEL, f), rel=1e-12)
    assert [float(r["measured_std"]) for r in rows] == pytest.approx(0.01 * np.abs(response))
    spread = Spread(covariance=tuple(map(tuple, np.diag((1e-3 * coefficient_vector(MODEL)) ** 2))))
    stated = response_error(replace(MODEL, spread=spread), f)
    assert [float(r["model_std"]) for r in rows] == pytest.approx(stated)
    phase = [float(r["model_phase_deg"]) for r in rows]
    assert phase == pytest.approx(np.degrees(np.angle(response)))


def test_csv_leaves_out_an_error_that_is_not_known(tmp_path):
    result = result_of(MODEL)
    (pair,) = result.pairs
    unknown = replace(result, pairs=(replace(pair, covariance=None),))
    (file,) = export(unknown, to="csv", path=tmp_path / "r.csv")
    table = [x for x in file.read_text(encoding="utf-8").splitlines() if not x.startswith("#")]
    assert {row["model_std"] for row in csv.DictReader(table)} == {""}


def test_uff58_is_read_back_by_pyuff(tmp_path):
    pyuff = pytest.importorskip("pyuff")
    (file,) = export(result_of(MODEL), to="uff58", path=tmp_path / "r.uff")
    export(result_of(MODEL), to="uff58", path=file)  # written anew, not appended to
    measured, std, model = pyuff.UFF(str(file)).read_sets()
    f = measured["x"]
    truth = frequency_response(MODEL, f)
    assert (measured["func_type"], std["func_type"], model["func_type"]) == (4, 0, 4)
    assert model["data"] == pytest.approx(truth, rel=1e-4)
    assert std["data"] == pytest.approx(0.01 * np.abs(truth), rel=1e-4)
    assert measured["id5"].strip() == "sha256 " + "0123abcd" * 8
    assert measured["abscissa_axis_units_lab"].strip() == "Hz"
