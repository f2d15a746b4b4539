"""docs/models.md: its code runs, its tables are what the code makes, its names exist."""

import importlib.util
import re
from pathlib import Path

import pytest

from docs_following import snippet
from hmpim.cli.main import app
from hmpim.formats.models import TARGETS

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "models.md").read_text(encoding="utf-8")


def part(name: str) -> list[str]:
    inside = TEXT.partition(f"<!-- {name} -->\n")[2].partition(f"<!-- end of {name} -->\n")[0]
    return [line for line in inside.splitlines() if line.startswith("|")][2:]


def test_the_code_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    code = snippet("models.md", "import hmpim")
    space = {}
    exec(compile(code, "docs/models.md", "exec"), space)
    assert (tmp_path / "model" / "model.c").is_file()
    assert capsys.readouterr().out == "True\n"
    assert len(space["study"]) == 100
    assert space["y"].shape == space["stimulus"].position.shape


def test_every_target_stands_there():
    named = set(re.findall(r"`([a-z0-9]+)`", " ".join(
        line.split("|")[1] for line in TEXT.splitlines() if line.startswith("| `")
    )))  # fmt: skip
    assert set(TARGETS) <= named


def test_options_that_are_named_exist(capsys):
    for command in ("export", "validate"):
        app([command, "--help"], standalone_mode=False)
    shown = capsys.readouterr().out
    for option in set(re.findall(r"`[^`]*?(--[a-z][a-z-]+)", TEXT)):
        assert option in shown or option == "--json", option


def test_computed_rows_are_what_the_code_computes():
    path = ROOT / "benchmarks" / "models_accuracy.py"
    spec = importlib.util.spec_from_file_location("models_accuracy", path)
    study = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(study)
    model = study.MODEL
    computed = {line.split("|")[1].strip(): line.split("|")[2].strip() for line in part("accuracy")}
    for milliseconds in (0.5, 1, 2, 5):
        source = study.source_of(study.result_of(model), name="x")
        error = study._error(source, study._stepped(source, milliseconds / 1e3))[0]
        assert computed[f"MuJoCo, step {milliseconds:g} ms (computed)"] == f"{error:.0e}"
    assert float(computed["C"]) < 1e-6
    assert float(computed["Python"]) < 1e-6


def test_the_circle_closed_for_every_tool():
    rows = part("circle")
    if not rows:
        pytest.fail("the table of the circle is missing")
    tools = {line.split("|")[1].strip() for line in rows}
    assert tools == {"C", "Python", "FMU in FMPy", "python-control", "MuJoCo", "GNU Octave"}
    for line in rows:
        counts = [int(n) for n in re.findall(r"(\d+) \(", line)]
        assert len(counts) == 5
        assert min(counts) >= 88
