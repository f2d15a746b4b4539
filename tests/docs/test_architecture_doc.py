"""docs/architecture.md: the rooms and names that it tells of are those of the code."""

import json
import re
from dataclasses import fields
from pathlib import Path

import numpy as np

import hmpim
from docs_following import snippet
from hmpim.identify import Parameters
from hmpim.record import Finding

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src" / "hmpim"
TEXT = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
WALK = TEXT.partition("## A walk")[2].partition("## Who may import whom")[0]
STOPS = re.split(r"^\d+\. ", WALK.partition("At the bottom")[0], flags=re.MULTILINE)[1:]


def test_each_room_of_the_walk_has_the_files_told_of():
    seen = set()
    for stop in STOPS:
        rooms = re.findall(r"\*\*`(\w+)/`\*\*", stop)
        assert rooms, stop
        for name in set(re.findall(r"`([\w/]+(?:/|\.py))`", stop)) - {f"{r}/" for r in rooms}:
            assert any((SOURCE / place / name).exists() for place in (*rooms, "")), name
        seen |= set(rooms)
    assert seen == {place.parent.name for place in SOURCE.glob("*/__init__.py")}


def test_each_folder_within_a_room_is_told_of():
    for stop in STOPS:
        for room in set(re.findall(r"\*\*`(\w+)/`\*\*", stop)) - {"identify"}:
            folders = {place.parent.name for place in (SOURCE / room).glob("*/[!.]*")}
            told = {name.split("/")[-1] for name in re.findall(r"`([\w/]+)/`", stop)}
            assert folders - {"__pycache__"} <= told, (room, folders)


def test_each_module_of_identification_beside_its_rooms_is_told_of():
    modules = {place.name for place in (SOURCE / "identify").glob("[!_]*.py")}
    assert modules <= set(re.findall(r"`(\w+\.py)`", TEXT))


def test_each_room_of_identification_is_told_of():
    chapter = TEXT.partition("### The rooms of identification")[2].partition("```text")[0]
    told = re.findall(r"^\| `(\w+)` \|", chapter, re.MULTILINE)
    assert set(told) == {place.parent.name for place in (SOURCE / "identify").glob("*/__init__.py")}


def test_the_ground_is_there():
    told = re.findall(r"`(\w+\.py)`", WALK.partition("At the bottom")[2])
    assert {*told, "__init__.py"} == {place.name for place in SOURCE.glob("*.py")}


def test_what_a_rig_and_a_command_are_asked_for_is_what_the_code_has():
    protocol = (SOURCE / "rigs" / "protocol.py").read_text(encoding="utf-8")
    (asked,) = re.findall(r"whole contract: (.*?`stop\(\)`)", WALK, re.DOTALL)
    for name in re.findall(r"`(\w+)", asked):
        assert re.search(rf"\b{name}\b", protocol), name


def test_batch_alone_imports_dask():
    takes = re.compile(
        r"^\s*(?:import|from) (?:dask|distributed)\b|[\"'](?:dask|distributed)[\"']", re.M
    )
    found = {
        file.relative_to(SOURCE).parts[0]
        for file in SOURCE.rglob("*.py")
        if takes.search(file.read_text(encoding="utf-8"))
    }
    assert found == {"batch"}


def test_the_core_is_what_import_linter_takes_for_it():
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    contract = project.partition('name = "The core draws nothing')[2].partition("]")[0]
    core = re.search(r"- The core \((.*?)\)", TEXT)[1]
    named = set(re.findall(r"`(\w+)`", core))
    assert named == set(re.findall(r'"hmpim\.(\w+)"', contract)) - {
        "arguments",
        "equality",
        "tables",
    }


def test_the_result_has_the_fields_told_of():
    told = json.loads(snippet("architecture.md", '{"schema"'))
    u = np.sin(0.02 * np.arange(400.0) ** 1.5)
    y = 2.0 * u + 0.01 * np.random.default_rng(0).standard_normal(u.size)
    record = hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=100.0)
    made = json.loads(json.dumps(hmpim.identify(record, structures=["static"]).to_dict()))
    assert told["schema"] == made["schema"]
    (said,), (pair,) = told["pairs"], made["pairs"]
    assert set(told["record"]) <= set(made["record"])
    assert set(said) <= set(pair)
    for name in ("paper", "frequency_response", "dynamics"):
        assert set(said[name]) <= set(pair[name]), name
    assert set(said["parameters"]["delay"]) == set(pair["parameters"]["scale_factor"])
    (finding,) = said["warnings"]
    assert set(finding) == {field.name for field in fields(Finding)}


def test_the_parameters_are_those_of_a_result():
    row = next(line for line in TEXT.splitlines() if line.startswith("| `parameters` |"))
    told = [name for name in re.findall(r"`(\w+)`", row)[1:] if name != "null"]
    assert told == [field.name for field in fields(Parameters)]
