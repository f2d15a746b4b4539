"""python-control, scipy.signal and MATLAB's function, run in their own tools."""

import runpy
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from hmpim.errors import ArgumentError
from hmpim.formats.models import export
from hmpim.formats.models.refined import pade_error
from hmpim.model import Model, frequency_response
from tests_support import few_of, run_octave

from .conftest import FS, result_of

T = np.arange(600) / FS
SECOND = Model(
    delay=0.1537,
    scale_factor=2.0,
    denominator=(2.5330295910584444e-4, 0.012732395447351628, 1.0),
    bias=0.6,
    noise_std=0.1,
    output_unit="deg",
    band=15.0,
)
MODELS = {
    "static": Model(delay=0.0123, scale_factor=-1.5, bias=0.3, noise_std=0.1, band=15.0),
    "second": SECOND,
    "zero": replace(SECOND, numerator=(0.02, 1.0), delay=0.0),
    "integrator": Model(
        delay=0.007, scale_factor=3.0, denominator=(0.03, 1.0, 0.0), noise_std=0.1, band=15.0
    ),
    "clipped": replace(SECOND, saturation_low=-1.0, quantization_step=0.05),
}


def waves(level: float = 0.0) -> np.ndarray:
    """From rest to rest in every derivative that counts, up to 12 Hz."""
    rise = np.clip(T / 0.8, 0, 1)
    rise = rise**3 * (10 - 15 * rise + 6 * rise**2)
    return level + rise * (np.sin(2 * np.pi * 3 * T) + 0.5 * np.sin(2 * np.pi * 12 * T + 1))


def tolerance(model: Model) -> float:
    return 0.03 if model.quantization_step else 3e-4 * abs(model.scale_factor) * 1.5


TOOLS, BETWEEN = ("control", "scipy"), ("bandlimited", "foh", "zoh")
SCRIPTS = [
    (tool, name, BETWEEN[(i + k) % 3])
    for i, tool in enumerate(TOOLS)
    for k, name in enumerate(sorted(MODELS))
]
SCRIPTS += [one for one in product(TOOLS, ["second"], BETWEEN) if one not in SCRIPTS]
"""Each tool with each model, and one model however the input moves between its samples."""


@pytest.mark.parametrize(
    ("tool", "name", "intersample"), few_of(SCRIPTS, TOOLS, sorted(MODELS), BETWEEN)
)
def test_scripts_simulate_what_the_model_says(tool, name, intersample, tmp_path):
    if tool == "control":
        pytest.importorskip("control")
    model = replace(MODELS[name], intersample=intersample)
    (file,) = export(result_of(model), to=tool, path=tmp_path / "m.py")
    script = runpy.run_path(str(file))
    truth = model.simulate(waves(), T)
    found = script["simulate"](waves(), T)
    if intersample == "zoh":  # the delay is right to a fortieth of a sample, so steps come late
        assert np.mean(np.abs(found - truth)) < 0.01 * np.ptp(truth)
    else:
        assert np.mean(np.abs(found - truth) < tolerance(model)) > 0.995
    f = np.linspace(0.3, 14, 50)
    assert script["response"](f) == pytest.approx(frequency_response(model, f), rel=1e-12)
    assert script["PARAMETERS"]["delay"]["unit"] == "s"
    assert script["DELAY"] == model.delay
    assert "sha256 0123abcd" in script["__doc__"]


def test_a_held_sensor_is_read_by_its_own_clock(tmp_path):
    model = replace(SECOND, hold_period=0.0317)
    (file,) = export(result_of(model), to="scipy", path=tmp_path / "m.py")
    found = runpy.run_path(str(file))["simulate"](waves(), T)
    assert found == pytest.approx(model.simulate(waves(), T), abs=2e-3)


def test_control_has_the_exact_delay_as_data_and_pade_within_what_it_says(tmp_path):
    control = pytest.importorskip("control")
    model = replace(SECOND, delay=0.02)
    (file,) = export(result_of(model), to="control", path=tmp_path / "m.py")
    script = runpy.run_path(str(file))
    f = np.linspace(0.1, 15.0, 200)
    truth = frequency_response(model, f)
    omega = 2 * np.pi * f
    assert script["frd"](f)(1j * omega) == pytest.approx(truth, rel=1e-9)
    assert np.allclose(script["measured"].complex, script["MEASURED"])
    order = script["PADE_ORDER"]
    stated = pade_error(order, 2 * np.pi * 15 * 0.02)
    assert stated < 0.01 < pade_error(order - 1, 2 * np.pi * 15 * 0.02)
    for wanted in (order, 1, 6):
        (file,) = export(result_of(model), to="control", path=tmp_path / "m.py", pade=wanted)
        system = runpy.run_path(str(file))["delayed"]()
        error = np.max(np.abs(system(1j * omega) / truth - 1))
        limit = pade_error(wanted, 2 * np.pi * 15 * 0.02)
        assert 0.9 * limit - 1e-9 < error < limit + 1e-6
        assert f"Pade of order {wanted}" in file.read_text(encoding="utf-8")
    assert control.poles(script["system"]).size == 2
    with pytest.raises(ArgumentError, match="pade = 40"):
        export(result_of(model), to="control", path=tmp_path / "m.py", pade=40)
    with pytest.raises(ArgumentError, match="for control alone"):
        export(result_of(model), to="json", path=tmp_path / "m.json", pade=3)


def test_octave_simulates_what_the_model_says(tmp_path):
    np.savetxt(tmp_path / "u.txt", np.stack([T, waves()], axis=1), fmt="%.17g")
    lines = ["data = load('u.txt');"]
    cases = {}
    for number, model in enumerate(MODELS.values()):
        for intersample in ("bandlimited", "foh"):
            case = f"m{number}_{intersample}"
            cases[case] = replace(model, intersample=intersample)
            export(result_of(cases[case]), to="matlab", path=tmp_path / f"{case}.m")
            lines += [
                f"m = {case}(); y = m.simulate(data(:,2), data(:,1)); r = m.response([1 9]);",
                f"save('-ascii', '-double', '{case}.txt', 'y');",
                f"printf('{case} %.15g %.15g %.15g %s\\n', real(r(2)), imag(r(2)), "
                "m.parameters.delay.std, m.sha256);",
            ]
    (tmp_path / "run.m").write_text("\n".join(lines) + "\n")
    said = {line.split()[0]: line.split()[1:] for line in run_octave(tmp_path).splitlines()}
    for case, model in cases.items():
        found = np.loadtxt(tmp_path / f"{case}.txt")
        truth = model.simulate(waves(), T)
        assert np.mean(np.abs(found - truth) < tolerance(model)) > 0.995, case
        response = complex(float(said[case][0]), float(said[case][1]))
        assert response == pytest.approx(frequency_response(model, np.array([9.0]))[0], rel=1e-9)
        assert float(said[case][2]) == pytest.approx(max(1e-3 * model.delay, 1e-6) if model.delay
                                                     else 1e-6)  # fmt: skip
        assert said[case][3] == "0123abcd" * 8


def test_matlab_gets_input_delay_and_octave_does_not(tmp_path):
    (file,) = export(result_of(SECOND), to="matlab", path=tmp_path / "axis.m")
    text = file.read_text(encoding="utf-8")
    assert text.startswith("function m = axis()\n")
    assert "'InputDelay', m.delay" in text
    assert "delay: 0.1537 +- 0.00015 [0.153398748, 0.154001252] s" in text
