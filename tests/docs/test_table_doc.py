"""docs/table.md: its code runs, and its tables are what the code makes now."""

import importlib.util
import re
from pathlib import Path

import pytest

pytest.importorskip("mujoco", reason="the table needs the extra 'table'")

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "table.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def study():
    path = ROOT / "benchmarks" / "table_study.py"
    spec = importlib.util.spec_from_file_location("table_study", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def part(name):
    return TEXT.partition(f"<!-- {name} -->\n")[2].partition(f"<!-- end of {name} -->\n")[0]


def test_specification_and_exact_bandwidths_are_those_of_the_code(study):
    assert part("specification") == study.specification()
    assert part("exact") == study.exact_table()


def test_fifteen_cases_stand_there_and_agree_within_two_percent():
    rows = [line for line in part("agreement").splitlines() if line.startswith("| P")]
    assert len({tuple(row.split("|")[1:3]) for row in rows}) == 15
    off = [float(x) for row in rows for x in re.findall(r"([+-]\d+\.\d+) %", row)]
    assert len(off) == 30
    assert max(map(abs, off)) < 2.0


def test_the_code_runs_and_says_what_stands_there():
    (code,) = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
    said = float(re.search(r"bandwidth_phase90  # ([\d.]+) Hz", code)[1])
    space = {}
    exec(compile(code, "docs/table.md", "exec"), space)
    pair = space["identify"](space["run"](space["table"], space["sweep"], rng=1)).pairs[0]
    assert pair.bandwidth_phase90.value == pytest.approx(said, abs=0.06)
    assert {c.name for c in space["record"].outputs} == {"roll.position", "pitch.position"}


def test_pictures_are_there():
    for name in re.findall(r"\((images/[\w.-]+)\)", TEXT):
        assert (ROOT / "docs" / name).read_bytes().startswith(b"\x89PNG")
