"""FMUs, run by FMPy from their libraries, and built from their sources."""

import re
import subprocess
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hmpim.errors import ArgumentError
from hmpim.formats.models import export, fmu
from hmpim.model import Model, NonlinearPart
from tests_support import c_compiler

from .conftest import FS, result_of

fmpy = pytest.importorskip("fmpy")
pytest.importorskip("ziglang")

T = np.arange(300) / FS
SECOND = Model(
    delay=0.0317,
    scale_factor=2.0,
    denominator=(2.5330295910584444e-4, 0.012732395447351628, 1.0),
    bias=0.6,
    noise_std=0.1,
    saturation_high=4.0,
    output_unit="deg",
    band=20.0,
)


def walk() -> np.ndarray:
    return np.random.default_rng(1).standard_normal(T.size).cumsum() / 5 + 1.0


@pytest.fixture(scope="module", params=[2, 3])
def written(request, tmp_path_factory):
    """An FMU for this machine alone: the first library for another takes a minute."""
    path = tmp_path_factory.mktemp("fmu") / "axis.fmu"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fmu, "PLATFORMS", fmu.PLATFORMS[:1])
        export(result_of(SECOND), to="fmu", path=path, fmi=request.param)
    return path


def test_fmpy_finds_nothing_wrong_with_it(written):
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(written)) == []


def test_fmpy_gets_the_numbers_of_the_model(written):
    u = walk()
    signal = np.array(list(zip(T, u, strict=True)), dtype=[("time", float), ("u", float)])
    found = fmpy.simulate_fmu(
        str(written), stop_time=T[-1], input=signal, output=["y"], output_interval=1 / FS
    )
    truth = SECOND.simulate(u, T)
    assert found["time"] == pytest.approx(T)
    # FMPy reads the output before it sets the next input; a delay of a sample makes that right.
    assert found["y"] == pytest.approx(truth, abs=1e-6)


@pytest.mark.parametrize(
    ("kind", "at", "lag"),
    [("backlash", "output", 0.0), ("friction", "force", 0.0), ("friction", "force", 0.004)],
)
def test_fmpy_gets_the_numbers_of_a_model_that_is_not_linear(kind, at, lag, tmp_path, monkeypatch):
    monkeypatch.setattr(fmu, "PLATFORMS", fmu.PLATFORMS[:1])
    part = NonlinearPart(kind=kind, at=at, size=0.2, std=0.01, reach=5.0, lag=lag)
    below = tuple(np.polymul(SECOND.denominator, (lag, 1.0) if lag else (1.0,)))
    linear, u = replace(SECOND, denominator=below), walk()
    model = replace(linear, nonlinear=part)
    (path,) = export(result_of(model), to="fmu", path=tmp_path / "axis.fmu")
    signal = np.array(list(zip(T, u, strict=True)), dtype=[("time", float), ("u", float)])
    found = fmpy.simulate_fmu(
        str(path), stop_time=T[-1], input=signal, output=["y"], output_interval=1 / FS
    )
    assert found["y"] == pytest.approx(model.simulate(u, T), abs=1e-6)
    assert np.std(found["y"] - linear.simulate(u, T)) > 0.05


BUILT_FOR = {
    "linux64": ("ELF", "X86_64"),
    "win64": ("PE", "X86_64"),
    "darwin64": ("MACHO", "X86_64"),
    "x86_64-linux": ("ELF", "X86_64"),
    "aarch64-linux": ("ELF", "ARM64"),
    "x86_64-windows": ("PE", "X86_64"),
    "x86_64-darwin": ("MACHO", "X86_64"),
    "aarch64-darwin": ("MACHO", "ARM64"),
}
"""File format and machine of a library by its folder."""

SYSTEM = {
    "ELF": {"libc.so.6", "libm.so.6", "ld"},
    "PE": {"KERNEL32.dll", "api"},
    "MACHO": {"/usr/lib/libSystem.B.dylib", "@rpath/axis.dylib"},
}
"""What every machine of that system has; on Windows 10 and later api-ms-win-crt-*.dll as well."""


def assert_importers_can_load(library: bytes, folder: str, version: int) -> None:
    """Read the symbols: those of the standard are exported, and every machine has what is used."""
    lief = pytest.importorskip("lief")
    binary = lief.parse(library)
    kind, machine = binary.format.name, binary.abstract.header.architecture.name
    assert (kind, machine) == BUILT_FOR[folder]
    exported = {f.name for f in binary.exported_functions}
    needed = {getattr(one, "name", one).partition("-")[0] for one in binary.libraries}
    if kind == "MACHO":
        exported -= {"__mh_dylib_header", "___dso_handle"}  # the linker's own
        exported = {name.removeprefix("_") for name in exported}  # as C names are written there
        assert machine != "ARM64" or binary.has_code_signature  # else macOS refuses it
    assert exported == functions_of_the_standard(version)
    assert needed <= SYSTEM[kind]


def functions_of_the_standard(version: int) -> set[str]:
    """Names in the standard's header; in FMI 2 without those of model exchange."""
    header = Path(fmpy.__file__).with_name("c-code") / f"fmi{version}Functions.h"
    text = header.read_text(encoding="utf-8")
    if version == 2:
        for_exchange, for_simulation = (
            f"Functions for FMI2 for {kind}" for kind in ("Model Exchange", "Co-Simulation")
        )
        text = re.sub(f"{for_exchange}.*?{for_simulation}", "", text, flags=re.DOTALL)
    names = set(re.findall(rf"\b(fmi{version}[A-Z]\w+)TYPE\b", text))
    assert len(names) == {2: 34, 3: 75}[version]
    return names


def test_its_library_has_the_functions_of_the_standard(written):
    version = int(fmpy.read_model_description(str(written)).fmiVersion[0])
    archive = zipfile.ZipFile(written)
    (name,) = (name for name in archive.namelist() if name.startswith("binaries/"))
    assert_importers_can_load(archive.read(name), name.split("/")[1], version)


@pytest.mark.study
@pytest.mark.parametrize("version", [2, 3])
def test_it_has_libraries_for_three_systems(version, tmp_path):
    export(result_of(SECOND), to="fmu", path=tmp_path / "axis.fmu", fmi=version)
    wanted = (
        ["linux64/axis.so", "win64/axis.dll", "darwin64/axis.dylib"]
        if version == 2
        else [
            "x86_64-linux/axis.so",
            "aarch64-linux/axis.so",
            "x86_64-windows/axis.dll",
            "x86_64-darwin/axis.dylib",
            "aarch64-darwin/axis.dylib",
        ]
    )
    archive = zipfile.ZipFile(tmp_path / "axis.fmu")
    names = [name for name in archive.namelist() if name.startswith("binaries/")]
    assert sorted(names) == sorted(f"binaries/{name}" for name in wanted)
    for name in names:
        assert_importers_can_load(archive.read(name), name.split("/")[1], version)


def test_it_has_its_sources_and_says_where_it_comes_from(written):
    archive = zipfile.ZipFile(written)
    assert {"sources/axis.c", "sources/axis.h"} <= set(archive.namelist())
    assert sum(name.startswith("binaries/") for name in archive.namelist()) == 1
    page = archive.read("documentation/index.html").decode()
    assert "delay: 0.0317 +- 3.2e-05" in page
    assert "0123abcd" * 8 in page


def test_its_variables_say_errors_and_units(written):
    description = fmpy.read_model_description(str(written))
    variables = {v.name: v for v in description.modelVariables}
    assert variables["parameters.delay"].start == "0.0317"
    assert "+- 3.2e-05 [" in variables["parameters.delay"].description
    assert variables["y"].description == "in deg"
    assert "sha256 0123abcd" in description.description
    found = fmpy.simulate_fmu(
        str(written), stop_time=0.05, output=["parameters.bias"], output_interval=1 / FS
    )
    assert found["parameters.bias"][-1] == 0.6


def test_a_step_that_is_no_whole_number_of_its_own_is_refused(written):
    with pytest.raises(fmpy.FMICallException if hasattr(fmpy, "FMICallException") else Exception,
                       match=r"fmi\dDoStep|failed"):  # fmt: skip
        fmpy.simulate_fmu(str(written), stop_time=0.1, output_interval=0.0033)


def test_a_longer_step_holds_its_input(written):
    found = fmpy.simulate_fmu(
        str(written), stop_time=1.0, start_values={"u": 1.0}, output=["y"], output_interval=0.05
    )
    assert found["y"] == pytest.approx(np.full(21, 2.6))


@pytest.mark.parametrize("version", [2, 3])
def test_without_the_extra_it_is_sources_only_and_says_so(version, tmp_path, monkeypatch):
    monkeypatch.setattr(fmu, "can_compile", lambda: False)
    model = replace(SECOND, intersample="zoh", hold_period=0.0123)
    with pytest.warns(fmu.SourcesOnly, match=r"sources only.*hmpim\[fmu\]"):
        export(result_of(model), to="fmu", path=tmp_path / "s.fmu", fmi=version)
    with zipfile.ZipFile(tmp_path / "s.fmu") as archive:
        assert not any(name.startswith("binaries") for name in archive.namelist())
        archive.extractall(tmp_path / "s")
    compiler = c_compiler()
    folder = tmp_path / "s" / "binaries" / ("linux64" if version == 2 else "x86_64-linux")
    folder.mkdir(parents=True)
    sources = [tmp_path / "s" / "sources" / name for name in ("s.c", f"fmi{version}.c")]
    done = subprocess.run(
        [compiler, "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", "-o",
         folder / "s.so", *sources, "-lm"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    u = walk()
    signal = np.array(list(zip(T, u, strict=True)), dtype=[("time", float), ("u", float)])
    found = fmpy.simulate_fmu(
        str(tmp_path / "s"), stop_time=T[-1], input=signal, output=["y"], output_interval=1 / FS
    )
    assert found["y"] == pytest.approx(model.simulate(u, T), abs=1e-6)


def test_state_is_taken_and_put_back(written, tmp_path):
    unzipped = fmpy.extract(str(written), str(tmp_path / "x"))
    description = fmpy.read_model_description(unzipped)
    from fmpy import instantiate_fmu

    unit = instantiate_fmu(unzipped, description, "CoSimulation")
    two = description.fmiVersion == "2.0"
    read = unit.getReal if two else unit.getFloat64
    put = unit.setReal if two else unit.setFloat64
    if two:
        unit.setupExperiment(startTime=0.0)
    unit.enterInitializationMode()
    unit.exitInitializationMode()
    take, give = (
        (unit.getFMUstate, unit.setFMUstate) if two else (unit.getFMUState, unit.setFMUState)
    )

    def play(values: list[float], start: int) -> list[float]:
        seen = []
        for k, value in enumerate(values):
            put([0], [value])
            seen.append(read([1])[0])
            unit.doStep((start + k) / FS, 1 / FS)
        return seen

    play([1.0, 2.0, 3.0] * 5, 0)
    kept = take()
    first = play([2.0, -1.0] * 10, 15)
    give(kept)
    assert play([2.0, -1.0] * 10, 15) == first
    unit.terminate()
    unit.freeInstance()


def test_other_versions_are_refused(tmp_path):
    with pytest.raises(ArgumentError, match="fmi = 1"):
        export(result_of(SECOND), to="fmu", path=tmp_path / "x.fmu", fmi=1)
