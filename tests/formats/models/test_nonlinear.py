"""The nonlinear part in exports: each, run in its own tool, against the model's own simulation."""

import json
import re
import runpy
from dataclasses import replace

import numpy as np
import pytest

import hmpim
from hmpim.errors import ArgumentError
from hmpim.formats.models import TARGETS, LinearPartOnly, export
from hmpim.model import Model, NonlinearPart
from hmpim.record import Finding
from tests_support import few_of, run_octave

from .conftest import FS, compiled_c, result_of

T = np.arange(800) / FS
OMEGA, ZETA = 2 * np.pi * 8.0, 0.4
UNIT = Model(
    delay=0.0317,
    scale_factor=1.5,
    denominator=(OMEGA**-2, 2 * ZETA / OMEGA, 1.0),
    bias=0.2,
    noise_std=0.01,
    band=15.0,
    saturation_high=1.9,
)


LAG = 0.003
"""Between the command and the force of a third-order unit, s."""

THIRD = {
    "friction_loop": (LAG * OMEGA**-2, *UNIT.denominator),  # the lag is within the loop
    "friction_command": tuple(np.polymul(UNIT.denominator, (LAG, 1.0))),  # it is in front
}


def part(kind: str, at: str, size: float, reach: float = 2.0, lag: float = 0.0) -> NonlinearPart:
    return NonlinearPart(kind=kind, at=at, size=size, std=0.01 * abs(size), reach=reach, lag=lag)


PARTS = {
    "backlash": part("backlash", "output", 0.06),
    "dead_zone": part("dead_zone", "command", 0.08, 1.0),
    "rate_limit": part("rate_limit", "command", 50.0, 94.0),
    "friction": part("friction", "force", 0.05),
    "friction_loop": part("friction", "force", 0.05, lag=LAG),
    "friction_command": part("friction", "force", 0.3, lag=LAG),
    "hardening": part("hardening", "force", 0.1),
    "softening": part("softening", "force", 0.08),
    "asymmetry": part("asymmetry", "force", -0.05),
    "bent": part("asymmetry", "output", 0.05),
    "curvature": part("curvature", "output", -0.06),
}


def wave(t: np.ndarray = T) -> np.ndarray:
    """A sweep that begins off zero, to 14 Hz."""
    return 0.3 + np.sin(2 * np.pi * (0.1 * t + 7.2 / t[-1] * t**2))


def model_with(name: str, **changes: object) -> Model:
    unit = replace(UNIT, denominator=THIRD.get(name, UNIT.denominator))
    return replace(unit, nonlinear=PARTS[name], **changes)


def in_turn(names, others, both=()):
    """Each name with one of the others, in turn, and some with all; all in `make studies`."""
    names, others = sorted(names), sorted(others)
    pairs = [(name, others[k % len(others)]) for k, name in enumerate(names)]
    pairs += [(name, other) for name in both for other in others if (name, other) not in pairs]
    return few_of(pairs, names, others)


@pytest.mark.usefixtures("needs_cc")
@pytest.mark.parametrize(
    ("name", "intersample"), in_turn(PARTS, ["bandlimited", "zoh"], ["backlash", "friction_loop"])
)
def test_programs_step_what_the_model_steps(name, intersample, tmp_path, monkeypatch):
    # What a file says of its error is looked at below, and takes longer than the steps.
    monkeypatch.setattr("hmpim.formats.models.nonlinear._stepped_error", lambda source: 0.01)
    model, u = model_with(name, intersample=intersample), wave()
    truth = model.simulate(u, T)
    export(result_of(model), to="c", path=tmp_path / "unit")
    assert compiled_c(tmp_path / "unit")(u) == pytest.approx(truth, abs=1e-9)
    (file,) = export(result_of(model), to="python", path=tmp_path / "unit.py")
    assert runpy.run_path(str(file))["simulate"](u) == pytest.approx(truth, abs=1e-9)


def difference(found: np.ndarray, model: Model, u: np.ndarray) -> float:
    """R.m.s. error of an export's output, over the effect of the nonlinear part."""
    truth, linear = (
        one.within(hmpim.simulate(one, u, fs=FS, intersample=one.intersample))
        for one in (model, replace(model, nonlinear=None))
    )
    return float(np.std(found - truth) / np.std(truth - linear))


@pytest.mark.parametrize(
    ("name", "tool"), in_turn(PARTS, ["control", "scipy"], ["dead_zone", "friction_loop"])
)
def test_scripts_simulate_what_is_predicted(name, tool, tmp_path):
    if tool == "control":
        pytest.importorskip("control")
    model, u = model_with(name), wave()
    (file,) = export(result_of(model), to=tool, path=tmp_path / "unit.py")
    found = runpy.run_path(str(file))["simulate"](u, T)
    assert difference(found, model, u) < 0.02


def test_the_function_of_matlab_simulates_what_is_predicted(tmp_path):
    t = T[:300]  # Octave is slow in loops
    u = wave(t)
    np.savetxt(tmp_path / "u.txt", np.stack([t, u], axis=1), fmt="%.17g")
    lines = ["d = load('u.txt');"]
    for name in sorted(PARTS):
        export(result_of(model_with(name)), to="matlab", path=tmp_path / f"unit_{name}.m")
        lines += [
            f"m = unit_{name}(); y = m.simulate(d(:, 2), d(:, 1));",
            f"save('-ascii', '-double', '{name}.txt', 'y');",
        ]
    (tmp_path / "run.m").write_text("\n".join(lines) + "\n")
    run_octave(tmp_path)
    for name in sorted(PARTS):
        found = np.loadtxt(tmp_path / f"{name}.txt")
        assert difference(found, model_with(name), u) < 0.02, name


@pytest.mark.parametrize(("step", "within"), [(0.0005, 0.02), (0.001, 0.04)])
def test_mujoco_rubs_as_predicted(step, within, tmp_path):
    mujoco = pytest.importorskip("mujoco")
    model = model_with("friction", saturation_high=None)
    (file,) = export(result_of(model), to="mujoco", path=tmp_path / "a.xml", timestep=step)
    assert (
        "The file includes Coulomb friction (it equals the restoring force at" in file.read_text()
    )
    world = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(world)
    t = np.arange(0.0, 6.0, step)
    u = np.sin(2 * np.pi * (0.1 * t + 0.9 * t**2))
    y = np.empty(t.size)
    for k, command in enumerate(u):
        data.ctrl[0] = command
        mujoco.mj_step(world, data)
        y[k] = data.sensordata[0]
    truth, linear = (
        hmpim.simulate(one, u, fs=1.0 / step, intersample="foh")
        for one in (model, replace(model, nonlinear=None))
    )
    assert np.std(y - truth) < within * np.std(truth - linear)


@pytest.mark.parametrize("name", ["friction_loop", "friction_command"])
def test_mujoco_omits_friction_behind_a_lag_of_the_force(name, tmp_path):
    with pytest.warns(LinearPartOnly, match="it omits Coulomb friction"):
        (file,) = export(
            result_of(model_with(name)), to="mujoco", path=tmp_path / "a.xml", timestep=0.001
        )
    assert "frictionloss" not in file.read_text()


@pytest.mark.parametrize("name", ["dead_zone", "curvature", "bent"])
def test_modelica_follows_what_is_predicted(name, tmp_path):
    rumoca = pytest.importorskip("rumoca")
    model = model_with(name, saturation_high=None, delay=0.0)
    (file,) = export(result_of(model), to="modelica", path=tmp_path / "axis.mo")
    bench = "model Bench\n  axis a;\nequation\n  a.u = sin(20.0 * time);\nend Bench;\n"
    compiled = rumoca.Session().loads(file.read_text(encoding="utf-8") + bench, model="Bench")
    fine = rumoca.SimConfig(rtol=1e-7, atol=1e-8)
    ran = compiled.simulate(t=(0.0, 1.5), dt=0.001, config=fine)
    t, y = np.array(ran.time), np.array(ran["a.y"])
    u = np.sin(20.0 * t)
    truth, linear = (
        hmpim.simulate(one, u, fs=1000.0, intersample="foh")
        for one in (model, replace(model, nonlinear=None))
    )
    assert np.max(np.abs(y - truth)) < 0.005 * np.max(np.abs(truth - linear))


def heading(file) -> str:
    text = file.read_bytes()
    return " ".join(text.decode("utf-8", "replace").split())


CARRIED = {
    "c": set(PARTS),
    "python": set(PARTS),
    "fmu": set(PARTS),
    "control": set(PARTS),
    "scipy": set(PARTS),
    "matlab": set(PARTS),
    "json": set(PARTS),
    "mat": set(PARTS),
    "mujoco": {"friction"},
    "modelica": {"dead_zone", "curvature", "bent"},
    "isaac": set(),
    "csv": set(),
    "uff58": set(),
}


@pytest.mark.parametrize(
    ("target", "name"),
    in_turn(TARGETS, ["backlash", "friction", "hardening", "curvature"], ["modelica", "mujoco"]),
)
def test_what_a_target_lacks_it_says_in_the_file_and_as_a_warning(
    target, name, tmp_path, monkeypatch
):
    monkeypatch.setattr("hmpim.formats.models.fmu.can_compile", lambda: True)
    monkeypatch.setattr("hmpim.formats.models.fmu.PLATFORMS", ())
    monkeypatch.setattr("hmpim.formats.models.isaac._DRAWS", 20)
    if target == "uff58":
        pytest.importorskip("pyuff")
    step = {"timestep": 0.001} if target in ("mujoco", "isaac") else {}
    result, place = result_of(model_with(name)), tmp_path / f"unit{TARGETS[target].suffix}"
    words = PARTS[name].words
    if name in CARRIED[target]:
        files = export(result, to=target, path=place, **step)
        said = f"The file includes {words} ("
    else:
        with pytest.warns(LinearPartOnly, match=f"it omits {words}"):
            files = export(result, to=target, path=place, **step)
        said = f"it omits {words} ("
    if target not in ("json", "mat", "fmu"):
        assert all(said in heading(file) for file in files)


def test_every_target_is_listed():
    assert CARRIED.keys() == TARGETS.keys()


def test_values_hold_the_part(tmp_path):
    (file,) = export(result_of(model_with("backlash")), to="json", path=tmp_path / "m.json")
    found = json.loads(file.read_text())["nonlinear"]
    assert NonlinearPart.from_dict(found) == PARTS["backlash"]


@pytest.mark.parametrize("target", ["c", "json", "csv"])
def test_a_nonlinearity_that_was_found_and_is_no_part_of_the_model_is_said(target, tmp_path):
    result = result_of(replace(UNIT, nonlinear=None))
    (pair,) = result.pairs
    found = Finding(code="backlash", message="…", severity="info", parameters=())
    result = replace(result, pairs=(replace(pair, warnings=(found,)),))
    with pytest.warns(LinearPartOnly, match="omits backlash, which was found but is not part of"):
        export(result, to=target, path=tmp_path / f"m{TARGETS[target].suffix}")


def test_programs_say_how_near_they_are(tmp_path):
    for name in ("dead_zone", "friction", "friction_loop", "hardening"):
        (file,) = export(result_of(model_with(name)), to="python", path=tmp_path / "m.py")
        said = re.search(r"within (\S+) of its effect \(r\.m\.s\.\)", heading(file))
        assert said is not None
        assert float(said[1]) < 0.05, name


@pytest.mark.parametrize(
    ("denominator", "name"),
    [
        ((0.02, 1.0), "friction"),
        (THIRD["friction_loop"], "friction"),
        (UNIT.denominator, "friction_loop"),
    ],
)
def test_friction_that_cannot_act_in_the_dynamics_is_left_out(denominator, name, tmp_path):
    model = replace(UNIT, denominator=denominator, nonlinear=PARTS[name])
    with pytest.warns(LinearPartOnly, match="omits Coulomb friction"):
        (file,) = export(result_of(model), to="python", path=tmp_path / "m.py")
    linear = replace(model, nonlinear=None)
    truth = linear.simulate(wave(), T)
    assert runpy.run_path(str(file))["simulate"](wave()) == pytest.approx(truth, abs=1e-9)


@pytest.mark.usefixtures("needs_cc")
def test_a_spring_that_would_not_return_is_not_stepped_further(tmp_path):
    model, u = model_with("softening", saturation_high=None), 8.0 * wave()
    export(result_of(model), to="c", path=tmp_path / "unit")
    assert np.isnan(compiled_c(tmp_path / "unit")(u)[-1])
    for tool in ("python", "scipy"):
        (file,) = export(result_of(model), to=tool, path=tmp_path / f"{tool}.py")
        given = (u,) if tool == "python" else (u, T)
        with np.errstate(all="ignore"), pytest.raises(ValueError, match="keep the input smaller"):
            runpy.run_path(str(file))["simulate"](*given)
    with pytest.raises(ArgumentError, match=r"a softening spring, known up to .* keep the input"):
        model.simulate(u, T)
