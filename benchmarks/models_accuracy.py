"""How right each export is, measured by running it: the table of docs/models.md.

    python benchmarks/models_accuracy.py

The model is the paper's: delay 150 ms, 10 Hz, damping ratio 0.4, at 200 Hz, excited to 20 Hz.
Programs get sines at seven frequencies up to 20 Hz, and their settled output is held against the
model's response; a step is held against the closed form.
"""

import ctypes
import runpy
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from hmpim.formats.models import export
from hmpim.formats.models.mujoco import _error, _stepped
from hmpim.formats.models.refined import pade_error
from hmpim.formats.models.source import source_of
from hmpim.identify import (
    Estimate,
    FrequencyResponse,
    Identification,
    PairIdentification,
    PaperEstimates,
    Parameters,
    RecordSummary,
)
from hmpim.model import Model, frequency_response

FS = 200.0
FREQUENCIES = np.array([0.5, 2.0, 5.0, 8.0, 10.0, 15.0, 20.0])
MODEL = Model(
    delay=0.15,
    scale_factor=1.0,
    denominator=(1 / (2 * np.pi * 10) ** 2, 0.8 / (2 * np.pi * 10), 1.0),
    noise_std=0.1,
    band=20.0,
)


def result_of(model: Model) -> Identification:
    """The result that says exactly this model."""
    names = ("delay", "scale_factor", "bias", "noise_std")
    known = {n: Estimate(value=getattr(model, n), std=1e-4, ci95=(0.0, 1.0)) for n in names}
    f = np.linspace(0.1, model.band or 20.0, 50)
    truth = frequency_response(model, f)
    pair = PairIdentification(
        input="u",
        output="y",
        structure="second_order",
        intersample=model.intersample,
        fit_percent=99.0,
        parameters=Parameters(**known),
        paper=PaperEstimates(),
        frequency_response=FrequencyResponse(frequency=f, response=truth, std=abs(truth)),
        numerator=model.numerator,
        denominator=model.denominator,
        candidates=(),
        warnings=(),
        verdict="ok",
    )
    return Identification(record=RecordSummary(fs=FS, samples=2000, sha256="0" * 64), pairs=(pair,))


def c_program(model: Model, folder: Path) -> Callable[[np.ndarray], np.ndarray]:
    export(result_of(model), to="c", path=folder / "axis")
    library = folder / "axis.so"
    command = ["cc", "-std=c99", "-O2", "-shared", "-fPIC", "-o", library]
    subprocess.run([*command, folder / "axis" / "axis.c", "-lm"], check=True)
    loaded = ctypes.CDLL(str(library))
    loaded.axis_step.restype = ctypes.c_double
    loaded.axis_step.argtypes = [ctypes.c_void_p, ctypes.c_double]
    loaded.axis_init.argtypes = [ctypes.c_void_p, ctypes.c_double]

    def run(u: np.ndarray) -> np.ndarray:
        memory = ctypes.create_string_buffer(1 << 16)
        loaded.axis_init(memory, float(u[0]))
        return np.array([loaded.axis_step(memory, float(x)) for x in u])

    return run


def python_program(model: Model, folder: Path) -> Callable[[np.ndarray], np.ndarray]:
    (file,) = export(result_of(model), to="python", path=folder / "axis.py")
    return runpy.run_path(str(file))["simulate"]


def script(model: Model, folder: Path, tool: str) -> Callable[[np.ndarray], np.ndarray]:
    (file,) = export(result_of(model), to=tool, path=folder / "axis.py")
    simulate = runpy.run_path(str(file))["simulate"]
    return lambda u: simulate(u, np.arange(u.size) / FS)


def octave(model: Model, folder: Path) -> Callable[[np.ndarray], np.ndarray]:
    export(result_of(model), to="matlab", path=folder / "unit.m")

    def run(u: np.ndarray) -> np.ndarray:
        np.savetxt(folder / "u.txt", u, fmt="%.17g")
        code = (
            f"u = load('u.txt'); m = unit(); y = m.simulate(u, (0:{u.size - 1})' / {FS});"
            "save('-ascii', '-double', 'y.txt', 'y');"
        )
        subprocess.run(["octave-cli", "--quiet", "--eval", code], cwd=folder, check=True)
        return np.loadtxt(folder / "y.txt")

    return run


def response_error(run: Callable[[np.ndarray], np.ndarray], model: Model) -> float:
    """Largest relative error of the settled output, over the frequencies."""
    t = np.arange(800) / FS
    worst = 0.0
    for f in FREQUENCIES:
        w = 2 * np.pi * f
        y = np.asarray(run(np.sin(w * t)))[400:]
        rows = np.stack([np.sin(w * t), np.cos(w * t), np.ones(t.size)], axis=1)[400:]
        fitted = np.linalg.lstsq(rows, y, rcond=None)[0]
        truth = frequency_response(model, np.array([f]))[0]
        worst = max(worst, abs((fitted[0] + 1j * fitted[1]) / truth - 1))
    return worst


def step_error(run: Callable[[np.ndarray], np.ndarray], model: Model) -> float:
    """Largest error of the answer to a step that is held, over the closed form."""
    t = np.arange(400) / FS
    y = np.asarray(run((t > 0).astype(float)))
    since = np.maximum(t - 1 / FS - model.delay, 0.0)
    w, zeta = 2 * np.pi * 10, 0.4
    d = w * np.sqrt(1 - zeta**2)
    exact = 1 - np.exp(-zeta * w * since) * (np.cos(d * since) + zeta * w / d * np.sin(d * since))
    return float(np.max(np.abs(y - exact)))


def rows() -> list[str]:
    """Rows of the table."""
    held = replace(MODEL, intersample="zoh")
    table = []

    def row(target: str, run: Callable, model: Model = MODEL, *, step: bool = True) -> None:
        with tempfile.TemporaryDirectory() as a, tempfile.TemporaryDirectory() as b:
            smooth = response_error(run(model, Path(a)), model)
            late = f"{step_error(run(held, Path(b)), held):.0e}" if step else "–"
        table.append(f"| {target} | {smooth:.0e} | {late} |")

    row("C", c_program)
    row("Python", python_program)
    row("C, delay 31.7 ms", c_program, replace(MODEL, delay=0.0317), step=False)
    row("C, delay 1 ms", c_program, replace(MODEL, delay=0.001), step=False)
    row("python-control", lambda m, f: script(m, f, "control"))
    row("scipy.signal", lambda m, f: script(m, f, "scipy"))
    if shutil.which("octave-cli"):
        row("MATLAB function in GNU Octave", octave)
    for order in (4, 8, 12):
        error = pade_error(order, 2 * np.pi * 20 * MODEL.delay)
        table.append(f"| python-control, Padé of order {order} (computed) | {error:.0e} | – |")
    for timestep in (0.0005, 0.001, 0.002, 0.005):
        source = source_of(result_of(MODEL), name="x")
        error = _error(source, _stepped(source, timestep))[0]
        table.append(f"| MuJoCo, step {1e3 * timestep:g} ms (computed) | {error:.0e} | – |")
    return table


if __name__ == "__main__":
    print("| target | response up to 20 Hz | held step |\n| --- | --- | --- |")
    print("\n".join(rows()))
