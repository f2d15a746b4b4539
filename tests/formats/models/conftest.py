"""Results made by hand, so that the model is known exactly, and ways to run the exports."""

import ctypes
import subprocess
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from hmpim.identify import (
    Estimate,
    FrequencyResponse,
    Identification,
    PairIdentification,
    PaperEstimates,
    Parameters,
    RecordSummary,
)
from hmpim.model import Model, coefficient_vector, frequency_response
from hmpim.record import Finding
from tests_support import c_compiler

FS = 200.0


def estimate(value: float, unit: str = "", *, share: float = 1e-3) -> Estimate:
    std = abs(value) * share or 1e-6
    return Estimate(value=value, std=std, ci95=(value - 1.96 * std, value + 1.96 * std), unit=unit)


def result_of(model: Model, *, fs: float = FS) -> Identification:
    """The result that says exactly this model."""
    known: dict[str, Estimate] = {}
    units = {"delay": "s", "hold_period": "s", "scale_factor": "deg/V"}
    for field in fields(Parameters):
        value = getattr(model, field.name, None)
        if value is not None:
            known[field.name] = estimate(value, units.get(field.name, "deg"))
    if len(model.denominator) == 3:
        c2, c1, _ = model.denominator
        known["natural_frequency"] = estimate(c2**-0.5 / (2 * np.pi), "Hz")
        known["damping_ratio"] = estimate(0.5 * c1 * c2**-0.5)
    if len(model.denominator) == 2 and model.denominator[-1]:
        known["time_constant"] = estimate(model.denominator[0], "s")
    f = np.linspace(0.25, model.band or 20.0, 80)
    truth = frequency_response(model, f)
    vector = coefficient_vector(model)
    pair = PairIdentification(
        input="u",
        output="y",
        structure="second_order",
        intersample=model.intersample,
        fit_percent=99.0,
        parameters=Parameters(**known),
        paper=PaperEstimates(),
        frequency_response=FrequencyResponse(frequency=f, response=truth, std=0.01 * np.abs(truth)),
        numerator=model.numerator,
        denominator=model.denominator,
        candidates=(),
        verdict="ok",
        warnings=(
            Finding(
                code="odd",
                message="A message → with ± signs, \\ and */ in it.",
                severity="info",
                parameters=(),
            ),
        ),
        covariance=np.diag((1e-3 * np.abs(vector)) ** 2),
        nonlinear_part=model.nonlinear,
    )
    record = RecordSummary(fs=fs, samples=2000, sha256="0123abcd" * 8, source="bench 3")
    return Identification(record=record, pairs=(pair,))


def compiled_c(folder: Path) -> Callable[[np.ndarray], np.ndarray]:
    """Compile an exported folder as strictly as can be; return what runs it."""
    (source,) = folder.glob("*.c")
    library = folder / "model.so"
    done = subprocess.run(
        [c_compiler(), "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-Wconversion",
         "-Wshadow", "-O2", "-shared", "-fPIC", "-o", library, source, "-lm"],
        capture_output=True,
        text=True,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return runner(library, source.stem)


def runner(library: Path, name: str) -> Callable[[np.ndarray], np.ndarray]:
    loaded = ctypes.CDLL(str(library))
    begin, step, peek = (getattr(loaded, f"{name}_{verb}") for verb in ("init", "step", "peek"))
    begin.argtypes, begin.restype = [ctypes.c_void_p, ctypes.c_double], None
    for call in (step, peek):
        call.argtypes, call.restype = [ctypes.c_void_p, ctypes.c_double], ctypes.c_double

    def run(u: np.ndarray) -> np.ndarray:
        memory = ctypes.create_string_buffer(1 << 20)
        begin(memory, float(u[0]))
        seen = [(peek(memory, float(x)), step(memory, float(x))) for x in u]
        assert all(a == b or np.isnan([a, b]).all() for a, b in seen)
        return np.array([y for _, y in seen])

    return run


@pytest.fixture
def needs_cc() -> None:
    c_compiler()
