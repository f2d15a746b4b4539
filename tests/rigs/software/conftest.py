"""FMUs under test, of both versions of FMI."""

from pathlib import Path

import pytest

from fmu_support import build_fmu


@pytest.fixture(scope="session", params=[2, 3], ids=["fmi2", "fmi3"])
def fmu(request, tmp_path_factory) -> Path:
    """An FMU of both interfaces: `fmu_under_test.c`."""
    return build_fmu(tmp_path_factory.mktemp(f"fmu{request.param}") / "unit.fmu", request.param)
