"""MuJoCo, Modelica and Isaac Lab: within what is stated, where they can be run."""

import ast
import re
from dataclasses import replace
from math import ceil

import numpy as np
import pytest

from hmpim.errors import ArgumentError
from hmpim.formats.models import export, source_of
from hmpim.formats.models.mujoco import _error, _stepped, stepped_response
from hmpim.model import Model, frequency_response

from .conftest import result_of

SO = (2.5330295910584444e-4, 0.012732395447351628, 1.0)
PLAIN = Model(delay=0.0123, scale_factor=2.0, bias=0.3, noise_std=0.1, output_unit="deg", band=20.0)
MODELS = {
    "static": PLAIN,
    "first order": replace(PLAIN, denominator=(0.03, 1.0)),
    "second order": replace(PLAIN, denominator=SO),
    "overdamped": replace(PLAIN, denominator=(0.0002, 0.03, 1.0)),
    "third order": replace(PLAIN, denominator=tuple(np.polymul(SO, (0.02, 1.0)))),
    "integrator": replace(PLAIN, denominator=(1.0, 0.0)),
    "integrator behind a lag": replace(PLAIN, denominator=(0.03, 1.0, 0.0)),
    "integrator behind a mode": replace(PLAIN, denominator=(*SO, 0.0)),
    "no delay": replace(PLAIN, denominator=SO, delay=0.0),
    "a part of a step late": replace(PLAIN, denominator=(0.03, 1.0), delay=0.0007),
}


@pytest.mark.parametrize("step", [0.001, 0.004])
@pytest.mark.parametrize("name", sorted(MODELS))
def test_mujoco_responds_as_computed_and_within_what_is_stated(name, step, tmp_path):
    mujoco = pytest.importorskip("mujoco")
    model = MODELS[name]
    (file,) = export(result_of(model), to="mujoco", path=tmp_path / "axis.xml", timestep=step)
    world = mujoco.MjModel.from_xml_path(str(file))
    stepped = _stepped(source_of(result_of(model), name="axis"), step)
    stated, band = _error(source_of(result_of(model), name="axis"), stepped)
    assert f"Response within {stated:.1e} of the model" in file.read_text(encoding="utf-8")
    assert band == 20.0
    if stepped.delay:
        assert world.actuator_history[0].tolist() == [ceil(stepped.delay / step - 1e-9), 1]
    for frequency in (3.0, 17.0):
        data = mujoco.MjData(world)
        n, w = 1600, 2 * np.pi * frequency
        y = np.empty(n)
        for k in range(n):
            data.ctrl[0] = np.sin(w * k * step)
            mujoco.mj_step(world, data)
            y[k] = data.sensordata[0]
        t = np.arange(n) * step
        rows = np.stack([np.sin(w * t), np.cos(w * t), np.ones(n), t], axis=1)[800:]
        fitted = np.linalg.lstsq(rows, y[800:], rcond=None)[0]
        found, at = fitted[0] + 1j * fitted[1], np.array([frequency])
        assert found == pytest.approx(stepped_response(stepped, at)[0], rel=1e-6)
        truth = frequency_response(model, at)[0]
        assert abs(found / truth - 1) < stated + 1e-6
        if model.denominator[-1]:
            assert fitted[2] == pytest.approx(0.3, abs=1e-6)


def test_mujoco_is_near_enough_at_a_millisecond(tmp_path):
    for name in set(MODELS) - {"a part of a step late"}:
        source = source_of(result_of(MODELS[name]), name="x")
        assert _error(source, _stepped(source, 0.001))[0] < 3e-3


def test_a_buffer_that_is_too_short_would_not_have_been_right(tmp_path):
    mujoco = pytest.importorskip("mujoco")
    (file,) = export(
        result_of(replace(PLAIN, delay=0.01)), to="mujoco", path=tmp_path / "a.xml", timestep=0.001
    )
    text = file.read_text(encoding="utf-8")
    assert 'delay="0.01" nsample="10" interp="linear"' in text

    def shown(xml: str) -> float:
        world = mujoco.MjModel.from_xml_string(xml)
        data = mujoco.MjData(world)
        for k in range(40):
            data.ctrl[0] = k
            mujoco.mj_step(world, data)
        return 39 - (data.sensordata[0] - 0.3) / 2.0

    assert shown(text) == pytest.approx(10.0)
    assert shown(text.replace('nsample="10"', 'nsample="5"')) == pytest.approx(5.0)


def test_mujoco_carries_ranges_and_origin(tmp_path):
    mujoco = pytest.importorskip("mujoco")
    model = MODELS["second order"]
    (file,) = export(result_of(model), to="mujoco", path=tmp_path / "axis.xml", timestep=0.002)
    world = mujoco.MjModel.from_xml_path(str(file))
    ranges = {world.numeric(i).name: world.numeric(i).data.tolist() for i in range(world.nnumeric)}
    assert ranges["range.delay"] == pytest.approx([0.0123 * 0.99804, 0.0123 * 1.00196])
    assert ranges["range.natural_frequency"] == pytest.approx([9.9804, 10.0196])
    text = file.read_text(encoding="utf-8")
    assert "0123abcd" * 8 in text
    assert "delay: 0.0123 +- 1.2e-05" in text
    assert 'delay="0.0123" nsample="7" interp="linear" noise="0.1"' in text  # a sensor's


def test_mujoco_refuses_what_it_cannot_hold(tmp_path):
    result = result_of(PLAIN)
    with pytest.raises(ArgumentError, match="time step of the simulation is not known"):
        export(result, to="mujoco", path=tmp_path / "x.xml")
    with pytest.raises(ArgumentError, match="timestep = -1"):
        export(result, to="mujoco", path=tmp_path / "x.xml", timestep=-1.0)
    with pytest.raises(ArgumentError, match="is for mujoco, isaac alone"):
        export(result, to="c", path=tmp_path / "x", timestep=0.001)
    lead = replace(PLAIN, denominator=SO, numerator=(0.02, 1.0))
    with pytest.raises(ArgumentError, match="zeros or more than three poles"):
        export(result_of(lead), to="mujoco", path=tmp_path / "x.xml", timestep=0.001)


def test_isaac_names_the_fields_of_the_class_and_the_ranges(tmp_path):
    model = MODELS["second order"]
    (file,) = export(result_of(model), to="isaac", path=tmp_path / "axis.py", timestep=0.005)
    text = file.read_text(encoding="utf-8")
    assert "NOT RUN" in text
    tree = ast.parse(text)
    calls = {
        node.func.id: {k.arg for k in node.keywords}
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
    }
    # Fields of isaaclab.actuators.DelayedPDActuatorCfg and its bases, as published.
    assert calls["DelayedPDActuatorCfg"] == {
        "joint_names_expr",
        "effort_limit",
        "stiffness",
        "damping",
        "min_delay",
        "max_delay",
    }
    assert calls["EventTermCfg"] == {"func", "mode", "params"}
    assert "DELAY_STEPS = (2, 3)" in text
    stiffness = float(re.search(r"stiffness=([\d.e+-]+) \* inertia", text)[1])
    damping = float(re.search(r"damping=([\d.e+-]+) \* inertia", text)[1])
    assert stiffness == pytest.approx((2 * np.pi * 10) ** 2)
    assert damping == pytest.approx(2 * 0.4 * 2 * np.pi * 10)
    ends = re.search(r'"stiffness_distribution_params": \(([\d.]+), ([\d.]+)\)', text)
    # The coefficient of s^2 is known to a thousandth, and so is the stiffness.
    assert [float(e) for e in ends.groups()] == pytest.approx([0.99804, 1.00196], abs=2e-4)


def test_isaac_refuses_what_a_pd_actuator_is_not(tmp_path, monkeypatch):
    monkeypatch.setattr("hmpim.formats.models.isaac._DRAWS", 20)
    with pytest.raises(ArgumentError, match="physics step is not known"):
        export(result_of(MODELS["second order"]), to="isaac", path=tmp_path / "x.py")
    with pytest.raises(ArgumentError, match="neither a first-order lag nor of second order"):
        export(result_of(MODELS["third order"]), to="isaac", path=tmp_path / "x.py", timestep=0.005)
    (file,) = export(
        result_of(MODELS["first order"]), to="isaac", path=tmp_path / "x.py", timestep=0.005
    )
    assert "velocity target" in file.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["first order", "second order", "third order", "no delay"])
def test_modelica_compiles_and_responds_in_rumoca(name, tmp_path):
    rumoca = pytest.importorskip("rumoca")
    model = replace(MODELS[name], numerator=(0.001, 1.0) if name == "third order" else (1.0,))
    (file,) = export(result_of(model), to="modelica", path=tmp_path / "axis.mo")
    text = file.read_text(encoding="utf-8")
    assert "0123abcd" * 8 in text
    bench = (
        "model Bench\n  axis a;\nequation\n  a.u = sin(18.849555921538759 * time);\nend Bench;\n"
    )
    fine = rumoca.SimConfig(rtol=1e-7, atol=1e-8)
    compiled = rumoca.Session().loads(text + bench, model="Bench")
    ran = compiled.simulate(t=(0.0, 1.5), dt=0.001, config=fine)
    t, y = np.array(ran.time), np.array(ran["a.y"])
    truth = frequency_response(model, np.array([3.0]))[0]
    wave = 0.3 + np.imag(truth * np.exp(6j * np.pi * t))
    # Without a delay the solver's own tolerance; with one, how rumoca keeps the past.
    limit = 1e-3 if model.delay else 1e-5
    assert np.abs(y - wave)[t > 1.0].max() < limit * abs(truth)


@pytest.mark.parametrize(
    ("numerator", "denominator"),
    [((-0.004, 1.0), SO), ((0.02, 1.0), (0.03, 1.0))],
    ids=["non-minimum phase", "fed through"],
)
def test_modelica_takes_weights_below_zero_and_what_is_fed_through(
    numerator, denominator, tmp_path
):
    rumoca = pytest.importorskip("rumoca")
    model = replace(PLAIN, numerator=numerator, denominator=denominator, delay=0.0, bias=-0.3)
    (file,) = export(result_of(model), to="modelica", path=tmp_path / "axis.mo")
    bench = (
        "model Bench\n  axis a;\nequation\n  a.u = sin(18.849555921538759 * time);\nend Bench;\n"
    )
    compiled = rumoca.Session().loads(file.read_text(encoding="utf-8") + bench, model="Bench")
    fine = rumoca.SimConfig(rtol=1e-7, atol=1e-8)
    ran = compiled.simulate(t=(0.0, 1.5), dt=0.001, config=fine)
    t, y = np.array(ran.time), np.array(ran["a.y"])
    truth = frequency_response(model, np.array([3.0]))[0]
    wave = -0.3 + np.imag(truth * np.exp(6j * np.pi * t))
    assert np.abs(y - wave)[t > 1.0].max() < 1e-5 * abs(truth)


def test_modelica_clips_holds_and_rounds(tmp_path):
    rumoca = pytest.importorskip("rumoca")
    model = replace(
        MODELS["first order"], saturation_low=-0.5, saturation_high=1.0, quantization_step=0.25
    )
    (file,) = export(result_of(model), to="modelica", path=tmp_path / "axis.mo")
    bench = "model Bench\n  axis a;\nequation\n  a.u = sin(6 * time);\nend Bench;\n"
    text = file.read_text(encoding="utf-8")
    ran = rumoca.Session().loads(text + bench, model="Bench").simulate(t=(0.0, 1.5), dt=0.01)
    y = np.array(ran["a.y"])
    assert (y.min(), y.max()) == (-0.5, 1.0)
    assert np.all(np.abs(y / 0.25 - np.rint(y / 0.25)) < 1e-9)
