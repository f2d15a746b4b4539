"""Six modes, identified and exported: every tool answers as the identification does."""

import csv
import io
import json
import re
import runpy

import numpy as np
import pytest
from rich.console import Console
from scipy.io import loadmat

import hmpim
from hmpim.errors import ArgumentError
from hmpim.formats.models import export, fmu
from hmpim.model import Model
from hmpim.report import print_result
from hmpim.report.modes import mode_rows
from tests_support import run_octave

from .conftest import compiled_c

FS = 200.0
MODES = (
    (1.0, 3.1, 0.03),
    (0.5, 5.2, 0.05),
    (-0.4, 8.6, 0.04),
    (0.6, 14.3, 0.03),
    (0.3, 23.7, 0.05),
    (0.5, 34.9, 0.04),
)
"""Gain, Hz and damping ratio of each."""


def unit() -> Model:
    top, below = np.zeros(1), np.ones(1)
    for gain, natural, damping in MODES:
        omega = 2 * np.pi * natural
        own = np.array([omega**-2, 2 * damping / omega, 1.0])
        top = np.polyadd(np.polymul(top, own), gain * below)
        below = np.polymul(below, own)
    gain = top[-1]
    return Model(
        delay=0.0317, scale_factor=gain, numerator=tuple(top / gain), denominator=tuple(below)
    )


@pytest.fixture(scope="module")
def result() -> hmpim.Identification:
    stimulus = hmpim.Stimulus(
        waveform=hmpim.Chirp(band=(0.5, 45.0), duration=20.0, amplitude=1.0), fs=FS
    )
    u = stimulus.position
    noise = 0.05 * np.random.default_rng(5).standard_normal(u.size)
    y = unit().simulate(u, np.arange(u.size) / FS) + noise
    found = hmpim.identify(hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=FS))
    assert found["y", "u"].structure == "six_modes"
    return found


T = np.arange(1600) / FS


@pytest.fixture(scope="module")
def u() -> np.ndarray:
    """From rest, up to 15 Hz: the splines of the scripts are right there to 1e-4."""
    rise = np.clip(T / 2.0, 0.0, 1.0)
    rise = rise**3 * (10 - 15 * rise + 6 * rise**2)
    return rise * sum(np.sin(2 * np.pi * f * T + f) for f in (3.0, 8.0, 15.0))


@pytest.fixture(scope="module")
def answer(result, u) -> np.ndarray:
    return hmpim.to_model(result["y", "u"]).simulate(u, T)


@pytest.fixture(scope="module")
def truth(result) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies in Hz, and the response of what was identified."""
    f = np.linspace(0.5, 40.0, 200)
    return f, hmpim.frequency_response(hmpim.to_model(result["y", "u"]), f)


@pytest.mark.parametrize("tool", ["control", "scipy"])
def test_scripts_answer_as_the_identification_does(tool, result, u, answer, truth, tmp_path):
    pytest.importorskip(tool)
    (file,) = export(result, to=tool, path=tmp_path / "six.py")
    script = runpy.run_path(str(file))
    assert script["simulate"](u, T) == pytest.approx(answer, abs=2e-3 * np.ptp(answer))
    f, response = truth
    assert script["response"](f) == pytest.approx(response, rel=1e-9)
    assert script["system"].A.shape == (12, 12)
    if tool == "control":
        late = script["system"](2j * np.pi * f) * np.exp(-2j * np.pi * f * script["DELAY"])
        assert late == pytest.approx(response, rel=1e-9)
        assert script["delayed"](14)(2j * np.pi * f) == pytest.approx(response, rel=1e-4)


def test_python_gives_the_same_numbers(result, u, answer, tmp_path):
    (file,) = export(result, to="python", path=tmp_path / "six.py")
    script = runpy.run_path(str(file))
    (model,) = [v for v in script.values() if isinstance(v, type) and v.__module__ == "<run_path>"]
    stepped = model()
    assert [stepped.step(x) for x in u] == pytest.approx(answer, abs=1e-9)


def test_c_gives_the_same_numbers(needs_cc, result, u, answer, tmp_path):
    export(result, to="c", path=tmp_path / "six")
    assert compiled_c(tmp_path / "six")(u) == pytest.approx(answer, abs=1e-9)


@pytest.mark.parametrize("version", [2, 3])
def test_an_fmu_gives_the_same_numbers(version, result, u, answer, tmp_path, monkeypatch):
    fmpy = pytest.importorskip("fmpy")
    pytest.importorskip("ziglang")
    monkeypatch.setattr(fmu, "PLATFORMS", fmu.PLATFORMS[:1])
    path = tmp_path / "six.fmu"
    export(result, to="fmu", path=path, fmi=version)
    signal = np.array(list(zip(T, u, strict=True)), dtype=[("time", float), ("u", float)])
    found = fmpy.simulate_fmu(
        str(path), stop_time=T[-1], input=signal, output=["y"], output_interval=1 / FS
    )
    assert found["y"] == pytest.approx(answer, abs=1e-5)


def test_mat_holds_the_response(result, truth, tmp_path):
    (file,) = export(result, to="mat", path=tmp_path / "six.mat")
    found = loadmat(file, squeeze_me=True, struct_as_record=False)["six"]
    f, response = truth
    s = 2j * np.pi * f
    top, below = np.polyval(found.numerator, s), np.polyval(found.denominator, s)
    assert found.scale_factor * top / below * np.exp(-s * found.delay) == pytest.approx(
        response, rel=1e-9
    )
    assert found.covariance.values.shape == (24, 24)


def test_octave_answers_as_the_identification_does(result, u, answer, tmp_path):
    export(result, to="matlab", path=tmp_path / "six.m")
    np.savetxt(tmp_path / "u.txt", np.stack([T, u], axis=1), fmt="%.17g")
    (tmp_path / "run.m").write_text(
        "data = load('u.txt'); m = six(); y = m.simulate(data(:,2), data(:,1));\n"
        "save('-ascii', '-double', 'y.txt', 'y');\n"
    )
    run_octave(tmp_path)
    found = np.loadtxt(tmp_path / "y.txt")
    assert found == pytest.approx(answer, abs=2e-3 * np.ptp(answer))


def test_modelica_answers_as_the_identification_does(result, tmp_path):
    rumoca = pytest.importorskip("rumoca")
    (file,) = export(result, to="modelica", path=tmp_path / "six.mo")
    model = hmpim.to_model(result["y", "u"])
    omega = 2 * np.pi * 8.6
    bench = f"model Bench\n  six a;\nequation\n  a.u = sin({omega!r} * time);\nend Bench;\n"
    text = file.read_text(encoding="utf-8")
    fine = rumoca.SimConfig(rtol=1e-7, atol=1e-8)
    ran = (
        rumoca.Session()
        .loads(text + bench, model="Bench")
        .simulate(t=(0.0, 14.0), dt=0.002, config=fine)
    )
    t, y = np.array(ran.time), np.array(ran["a.y"])
    response = hmpim.frequency_response(model, np.array([8.6]))[0]
    wave = model.bias + np.imag(response * np.exp(1j * omega * t))
    assert np.abs(y - wave)[t > 12.0].max() < 5e-3 * abs(response)


@pytest.mark.parametrize("tool", ["mujoco", "isaac"])
def test_what_cannot_hold_modes_says_so(tool, result, tmp_path):
    with pytest.raises(ArgumentError, match="six_modes"):
        export(result, to=tool, path=tmp_path / "six", timestep=0.001)


def test_files_that_are_read_hold_the_response(result, tmp_path):
    pyuff = pytest.importorskip("pyuff")
    pair = result["y", "u"]
    response = hmpim.frequency_response(hmpim.to_model(pair), pair.frequency_response.frequency)
    (file,) = export(result, to="csv", path=tmp_path / "six.csv")
    lines = file.read_text(encoding="utf-8").splitlines()
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    found = [complex(float(row["model_real"]), float(row["model_imag"])) for row in rows]
    assert found == pytest.approx(response, rel=1e-9)
    (file,) = export(result, to="uff58", path=tmp_path / "six.uff")
    assert pyuff.UFF(str(file)).read_sets()[2]["data"] == pytest.approx(response, rel=1e-4)
    (file,) = export(result, to="json", path=tmp_path / "six.json")
    document = json.loads(file.read_text(encoding="utf-8"))
    assert document["denominator"] == list(pair.denominator)
    assert document["covariance"]["of"][-1] == "denominator s^1"


def test_every_mode_is_stated_with_an_error_that_holds(result, tmp_path):
    modes = hmpim.to_model(result["y", "u"]).modes
    assert len(modes) == len(MODES)
    for mode, (_, natural, damping) in zip(modes, MODES, strict=True):
        assert abs(mode.natural_frequency - natural) < 4 * mode.natural_frequency_std
        assert abs(mode.damping_ratio - damping) < 4 * mode.damping_ratio_std
        assert mode.natural_frequency_std < 1e-2 * natural
        assert mode.damping_ratio_std < 0.1 * damping
    lowest = result["y", "u"].natural_frequency
    assert modes[0].natural_frequency == pytest.approx(lowest.value, rel=1e-9)
    hmpim.report(result, tmp_path / "six.html")
    page = re.sub(r"</?span[^>]*>|<wbr>", "", (tmp_path / "six.html").read_text(encoding="utf-8"))
    stream = io.StringIO()
    print_result(result, Console(file=stream, width=120))
    rows = mode_rows(result["y", "u"])
    assert len(rows) == len(MODES)
    for natural, damping in rows:
        assert f"{natural}</td>" in page
        assert f"{damping}</td>" in page
        assert any(natural in line and damping in line for line in stream.getvalue().splitlines())
    (file,) = export(result, to="json", path=tmp_path / "six.json")
    stated = json.loads(file.read_text(encoding="utf-8"))["modes"]
    assert [one["natural_frequency"] for one in stated] == [m.natural_frequency for m in modes]
