"""An FMU under test: C beside its tests, compiled here."""

import subprocess
import zipfile
from pathlib import Path

from tests_support import c_compiler

SOURCE = Path(__file__).parent / "rigs" / "software" / "fmu_under_test.c"

TWO = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="unit" guid="{1}" numberOfEventIndicators="1">
  <ModelExchange modelIdentifier="unit"/>
  <CoSimulation modelIdentifier="unit" canHandleVariableCommunicationStepSize="true"/>
  <UnitDefinitions><Unit name="deg"/></UnitDefinitions>
  <ModelVariables>
    <ScalarVariable name="u" valueReference="0" causality="input">
      <Real start="0" unit="deg"/></ScalarVariable>
    <ScalarVariable name="y" valueReference="1" causality="output">
      <Real unit="deg"/></ScalarVariable>
    <ScalarVariable name="x" valueReference="2" causality="local"><Real/></ScalarVariable>
    <ScalarVariable name="der(x)" valueReference="3" causality="local"><Real derivative="3"/>
    </ScalarVariable>
    <ScalarVariable name="T" valueReference="4" causality="parameter" variability="fixed">
      <Real start="0.05"/></ScalarVariable>
    <ScalarVariable name="level" valueReference="5" causality="parameter" variability="fixed">
      <Real start="1e9"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="2"/></Outputs>
    <Derivatives><Unknown index="4"/></Derivatives>
    <InitialUnknowns><Unknown index="2"/><Unknown index="4"/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"""
THREE = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="unit" instantiationToken="{1}">
  <ModelExchange modelIdentifier="unit"/>
  <CoSimulation modelIdentifier="unit" canHandleVariableCommunicationStepSize="true"/>
  <UnitDefinitions><Unit name="deg"/></UnitDefinitions>
  <ModelVariables>
    <Float64 name="time" valueReference="9" causality="independent" variability="continuous"/>
    <Float64 name="u" valueReference="0" causality="input" start="0" unit="deg"/>
    <Float64 name="y" valueReference="1" causality="output" unit="deg"/>
    <Float64 name="x" valueReference="2" causality="local"/>
    <Float64 name="der(x)" valueReference="3" causality="local" derivative="2"/>
    <Float64 name="T" valueReference="4" causality="parameter" variability="fixed" start="0.05"/>
    <Float64 name="level" valueReference="5" causality="parameter" variability="fixed" start="1e9"/>
  </ModelVariables>
  <ModelStructure>
    <Output valueReference="1"/>
    <ContinuousStateDerivative valueReference="3"/>
    <InitialUnknown valueReference="1"/>
    <InitialUnknown valueReference="3"/>
    <EventIndicator valueReference="2"/>
  </ModelStructure>
</fmiModelDescription>
"""


def build_fmu(path: Path, version: int) -> Path:
    """Write an FMU of both interfaces: `fmu_under_test.c`."""
    library = path.with_suffix(".so")
    done = subprocess.run(
        [c_compiler(), "-std=c99", "-Wall", "-Wextra", "-Werror", "-O2", "-shared", "-fPIC",
         f"-DFMI={version}", "-o", library, SOURCE],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", TWO if version == 2 else THREE)
        place = "linux64" if version == 2 else "x86_64-linux"
        archive.write(library, f"binaries/{place}/unit.so")
    return path
