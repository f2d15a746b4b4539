"""The circle: what was identified is exported, becomes the truth, and is identified again.

Each exported model runs in its own tool, driven by our sweep. Noise of the identified level is
added outside, and the record identified: the 95 % intervals must hold the exported figures as
often as they say. Run with HMPIM_CIRCLE=FILE to have the counts written as a table.
"""

import ctypes
import os
import runpy
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import hmpim
from hmpim.formats.models import fmu
from tests_support import c_compiler, fewest, run_octave

FIGURES = ("delay", "natural_frequency", "damping_ratio", "scale_factor", "bias")
TIMES = 100
"""Noise drawn so often in the study; chance leaves 88 to 100 inside."""

FINE = 4
"""Samples of the sweep for each of the record's, where a tool interpolates its input."""


@pytest.fixture(scope="module")
def stimulus():
    limits = hmpim.Limits(position=3, velocity=1000, acceleration=40000, unit="deg")
    return hmpim.design(band=(0.1, 20), duration=10, fs=200, limits=limits)


@pytest.fixture(scope="module")
def result(stimulus):
    sensor = hmpim.Sensor(
        delay=0.15, natural_frequency=10, damping_ratio=0.4, bias=0.6, noise_std=0.1
    )
    return hmpim.identify(hmpim.run(sensor, stimulus, rng=5))


def sweep(stimulus, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """The motion at a rate, and its times."""
    t = np.arange(round(stimulus.samples * rate / stimulus.fs)) / rate
    return np.asarray(stimulus.motion(t).position), t


def by_c(result, stimulus, folder: Path) -> np.ndarray:
    compiler = c_compiler()
    hmpim.export(result, to="c", path=folder / "axis")
    library = folder / "axis.so"
    subprocess.run(
        [compiler, "-std=c99", "-Wall", "-Wextra", "-Werror", "-O2", "-shared", "-fPIC", "-o",
         library, folder / "axis" / "axis.c", "-lm"],
        check=True,
    )  # fmt: skip
    loaded = ctypes.CDLL(str(library))
    loaded.axis_step.restype = ctypes.c_double
    loaded.axis_step.argtypes = [ctypes.c_void_p, ctypes.c_double]
    loaded.axis_init.argtypes = [ctypes.c_void_p, ctypes.c_double]
    memory = ctypes.create_string_buffer(1 << 16)
    u = stimulus.position
    loaded.axis_init(memory, float(u[0]))
    return np.array([loaded.axis_step(memory, float(x)) for x in u])


def by_python(result, stimulus, folder: Path) -> np.ndarray:
    (file,) = hmpim.export(result, to="python", path=folder / "axis.py")
    return np.array(runpy.run_path(str(file))["simulate"](stimulus.position))


def by_fmu(result, stimulus, folder: Path) -> np.ndarray:
    fmpy = pytest.importorskip("fmpy")
    pytest.importorskip("ziglang")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fmu, "PLATFORMS", fmu.PLATFORMS[:1])
        (file,) = hmpim.export(result, to="fmu", path=folder / "axis.fmu")
    u, t = stimulus.position, stimulus.time - stimulus.time[0]
    signal = np.array(list(zip(t, u, strict=True)), dtype=[("time", float), ("u", float)])
    step = 1.0 / stimulus.fs
    found = fmpy.simulate_fmu(
        str(file), stop_time=t[-1], input=signal, output=["y"], output_interval=step
    )
    return np.asarray(found["y"])


def by_control(result, stimulus, folder: Path) -> np.ndarray:
    pytest.importorskip("control")
    (file,) = hmpim.export(result, to="control", path=folder / "axis.py")
    u, t = sweep(stimulus, FINE * stimulus.fs)
    return np.asarray(runpy.run_path(str(file))["simulate"](u, t)[::FINE])


def by_mujoco(result, stimulus, folder: Path) -> np.ndarray:
    mujoco = pytest.importorskip("mujoco")
    often = 20
    step = 1.0 / (often * stimulus.fs)
    (file,) = hmpim.export(result, to="mujoco", path=folder / "axis.xml", timestep=step)
    world = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(world)
    u, _ = sweep(stimulus, often * stimulus.fs)
    y = np.empty(u.size)
    for k, x in enumerate(u.tolist()):
        data.ctrl[0] = x
        mujoco.mj_step(world, data)
        y[k] = data.sensordata[0]
    return y[::often]


def by_octave(result, stimulus, folder: Path) -> np.ndarray:
    hmpim.export(result, to="matlab", path=folder / "unit.m")
    u, t = sweep(stimulus, FINE * stimulus.fs)
    np.savetxt(folder / "u.txt", np.stack([t, u], axis=1), fmt="%.17g")
    (folder / "run.m").write_text(
        "d = load('u.txt'); m = unit(); y = m.simulate(d(:,2), d(:,1));\n"
        f"y = y(1:{FINE}:end); save('-ascii', '-double', 'y.txt', 'y');\n"
    )
    run_octave(folder)
    return np.loadtxt(folder / "y.txt")


TOOLS: dict[str, tuple[Callable, float]] = {
    "C": (by_c, 1e-6),
    "Python": (by_python, 1e-6),
    "FMU in FMPy": (by_fmu, 1e-6),
    "python-control": (by_control, 1e-4),
    "MuJoCo": (by_mujoco, 1e-4),
    "GNU Octave": (by_octave, 1e-4),
}
"""How each tool is run, and how far it may be off, as a share of the output's amplitude."""


def identified(y: np.ndarray, stimulus, noise: float, seed: int) -> hmpim.Identification:
    noisy = y + noise * np.random.default_rng(seed).standard_normal(y.size)
    record = hmpim.Record.from_arrays(
        {"u": stimulus.position},
        {"y": noisy},
        fs=stimulus.fs,
        units={"u": "deg", "y": "deg"},
        band=stimulus.band,
        intersample="bandlimited",
    )
    return hmpim.identify(record)


def truth_of(result) -> dict[str, float]:
    pair = result["y", "u"]
    return {name: getattr(pair.parameters, name).value for name in FIGURES}


@pytest.mark.parametrize("tool", TOOLS)
def test_an_exported_model_is_identified_as_what_it_is(tool, result, stimulus, tmp_path):
    run, share = TOOLS[tool]
    y = run(result, stimulus, tmp_path)
    model = hmpim.to_model(result["y", "u"])
    # Tools that see the motion between the samples are held against the model at their rate.
    often = 1 if share < 1e-5 else FINE
    expected = model.simulate(*sweep(stimulus, often * stimulus.fs))[::often]
    assert np.abs(y - expected).max() < share * np.ptp(expected) / 2
    found = identified(y, stimulus, model.noise_std, seed=1)["y", "u"]
    for name, truth in truth_of(result).items():
        estimate = getattr(found.parameters, name)
        assert abs(estimate.value - truth) < 4.5 * estimate.std, name


@pytest.mark.study
@pytest.mark.parametrize("tool", TOOLS)
def test_the_circle_closes(tool, result, stimulus, tmp_path):
    y = TOOLS[tool][0](result, stimulus, tmp_path)
    noise = hmpim.to_model(result["y", "u"]).noise_std
    truth = truth_of(result)
    inside = dict.fromkeys(FIGURES, 0)
    away: dict[str, list[float]] = {name: [] for name in FIGURES}
    first = 1000 * (1 + list(TOOLS).index(tool))  # noise of its own for each tool
    for seed in range(first, first + TIMES):
        parameters = identified(y, stimulus, noise, seed=seed)["y", "u"].parameters
        for name, value in truth.items():
            estimate = getattr(parameters, name)
            low, high = estimate.ci95
            inside[name] += low <= value <= high
            away[name].append((estimate.value - value) / estimate.std)
    if "HMPIM_CIRCLE" in os.environ:
        means = " | ".join(f"{inside[n]} ({np.mean(away[n]):+.2f})" for n in FIGURES)
        with Path(os.environ["HMPIM_CIRCLE"]).open("a", encoding="utf-8") as table:
            table.write(f"| {tool} | {means} |\n")
    low = 88 if TIMES == 100 else fewest(TIMES, 0.95)
    assert {name: count for name, count in inside.items() if count < low} == {}
    for name in FIGURES:  # and no shift that the intervals would hide
        assert abs(np.mean(away[name])) < 4.5 / np.sqrt(TIMES), name
